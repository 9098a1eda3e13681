"""The paper's hypotheses and the planned comparison: verdict, effect size, interval, power."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from steerlab.analysis.statistics.corrections import benjamini_hochberg, holm
from steerlab.analysis.statistics.noncentral import (
    multiple_power,
    paired_power,
    smallest_multiple,
    smallest_paired,
)
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import wilcoxon
from steerlab.analysis.study_data.records import PlannedHypothesis, StudyData
from steerlab.analysis.study_tables.comparison_hypothesis import comparison
from steerlab.analysis.study_tables.label_quality import NO_ERROR, NOT_HELD_OUT, person_errors
from steerlab.analysis.study_tables.plain import empty, is_empty, plain

MEDIUM_R, LARGE_R, MEDIUM_D = 0.3, 0.5, 0.5  # Cohen's conventions, for the power a sample had

_TEXT: dict[str, tuple[str, bool]] = {
    "H1": ("MIND MELD improves the labels given in the calibration rollouts.", True),
    "H2a": ("The embeddings correlate with personality traits.", False),
    "H2b": ("The embeddings correlate with experience in playing video games.", False),
    "H2c": ("The embeddings correlate with driving experience.", False),
    "H3a": ("The embeddings correlate with the tendency to over- or under-correct.", True),
    "H3b": ("The embeddings correlate with the tendency to correct late or early.", True),
    "H4": ("Agents taught with MIND MELD drive better than those of the other learners.", True),
}
_TOPICS = {"H2a": "personality", "H2b": "games", "H2c": "driving"}
_CORRECTIONS: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "holm": holm,
    "bh": benjamini_hochberg,
    "none": lambda p: p,
}


def hypotheses(
    data: StudyData,
    table2: Mapping[str, Any],
    conditions: Mapping[str, Any],
    styles: Mapping[str, str],
) -> list[dict[str, Any]]:
    """Each hypothesis with its test.

    A hypothesis about several scales is judged by its smallest p-value after Holm's correction
    over them. Then the plan's correction goes over all primary hypotheses that can be tested, and
    apart from those over the secondary ones.
    """
    plan = data.plan
    alpha = plan.alpha if plan else 0.05
    correction = plan.correction if plan else "holm"
    planned = {one.id: one for one in plan.hypotheses} if plan else {}
    rows = [_about(name, planned.get(name), any_plan=plan is not None) for name in _TEXT]
    for row in rows:
        name = row["id"]
        if name == "H1":
            row |= _improvement(data, alpha)
        elif name == "H4":
            row |= comparison(conditions, alpha)
        elif name in styles:
            row |= _correlations(table2, alpha, keys=(styles[name],))
        else:
            row |= _correlations(table2, alpha, topic=_TOPICS[name])
    for primary in (True, False):
        _judge([row for row in rows if row["primary"] is primary], alpha, correction)
    return rows


def _about(name: str, planned: PlannedHypothesis | None, *, any_plan: bool) -> dict[str, Any]:
    """What was not planned is never primary: it would weaken the tests that were."""
    text, primary = _TEXT[name]
    return {
        "id": name,
        "text": planned.text if planned else text,
        "primary": planned.primary if planned else primary and not any_plan,
        "planned": planned is not None,
    }


def _judge(rows: Sequence[dict[str, Any]], alpha: float, correction: str) -> None:
    """Corrected p-values and verdicts."""
    testable = [row for row in rows if not is_empty(row["p"])]
    p = np.array([row["p"] for row in testable])
    adjusted = _CORRECTIONS[correction](p).tolist() if testable else []
    for row in rows:
        row |= {"alpha": alpha, "correction": correction}
        if is_empty(row["p"]):
            row |= {"p_corrected": row["p"], "verdict": "not testable"}
    for row, value in zip(testable, adjusted, strict=True):
        otherwise = row.pop("otherwise", None)
        found = value < alpha and otherwise is None
        if value < alpha and otherwise is not None:
            row["note"] = otherwise
        row |= {
            "p_corrected": plain(value),
            "verdict": "supported" if found else "not supported",
        }


def _improvement(data: StudyData, alpha: float) -> dict[str, Any]:
    held_out = [one for one in data.held_out if one.role == "training"]
    test = "Wilcoxon's signed ranks of each person's mean error, given against mapped"
    if not held_out:
        return _untestable(test, NOT_HELD_OUT)
    before, after = person_errors(held_out[0])
    found = wilcoxon(before, after)
    if isinstance(found, NotComputable):
        return _untestable(test, found.reason)
    given, mapped = float(held_out[0].before.sum()), float(held_out[0].after.sum())
    return {
        "test": test,
        "p": plain(found.p),
        "otherwise": None if found.shift > 0.0 else "the labels got worse",
        "effect": {
            "what": "median fall of the mean label error, wheel units",
            "value": plain(found.shift),
            "ci95": plain(found.interval),
            "rank_biserial": plain(found.rank_biserial),
            "share_removed": plain(1.0 - mapped / given) if given else empty(NO_ERROR),
        },
        "n": found.n,
        "power": {
            "smallest_effect_80": plain(smallest_paired(found.n, alpha=alpha)),
            "of_medium": plain(paired_power(MEDIUM_D, found.n, alpha=alpha)),
            "what": f"mean difference in its standard deviations; medium is {MEDIUM_D}",
        },
    }


def _correlations(
    table2: Mapping[str, Any], alpha: float, *, topic: str = "", keys: Sequence[str] = ()
) -> dict[str, Any]:
    test = "multiple R of w, p by permutation"
    rows = [
        row
        for row in table2["rows"]
        if row["key"] in keys or (row["topic"] == topic and row["family"])
    ]
    if not rows:
        asked = f"nobody was asked about {topic}" if topic else "nobody has style metrics"
        return _untestable(test, table2.get("why_empty", asked))
    tested = [row for row in rows if not is_empty(row["primary"])]
    if not tested:
        reasons = dict.fromkeys(row["primary"]["empty"] for row in rows)
        return _untestable(test, "; ".join(reasons))
    if len(tested) > 1:
        test += f", the smallest of {len(tested)} after Holm"
    adjusted = holm(np.array([row["primary"]["p"] for row in tested])).tolist()
    at = int(np.argmin(adjusted))
    best, n = tested[at]["primary"], tested[at]["primary"]["n"]
    return {
        "test": test,
        "p": plain(adjusted[at]),
        "effect": {
            "what": f"multiple R with {tested[at]['title']}",
            "value": best["r"],
            "ci95": best["interval"],
            "adjusted_r2": best["adjusted_r2"],
        },
        "parts": [
            {"key": row["key"], "r": row["primary"]["r"], "p": row["primary"]["p"], "holm": value}
            for row, value in zip(tested, map(plain, adjusted), strict=True)
        ],
        "not_tested": [
            {"key": row["key"], "why": row["primary"]["empty"]} for row in rows if row not in tested
        ],
        "n": n,
        "power": {
            "smallest_effect_80": plain(smallest_multiple(n, best["dimensions"], alpha=alpha)),
            "of_medium": plain(multiple_power(MEDIUM_R, n, best["dimensions"], alpha=alpha)),
            "of_large": plain(multiple_power(LARGE_R, n, best["dimensions"], alpha=alpha)),
            "what": f"multiple R of one test; medium is {MEDIUM_R}, large {LARGE_R}",
        },
    }


def _untestable(test: str, reason: str) -> dict[str, Any]:
    nothing = empty(reason)
    return {"test": test, "p": nothing, "effect": nothing, "n": 0, "power": nothing}
