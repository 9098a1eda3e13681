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
OURS = ("mind_meld", "mind-meld")  # as a study and as ``steerlab teach`` spell it
RIVALS = ("bc", "dagger")  # H4 compares with these


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
    planned = {hypothesis.id: hypothesis for hypothesis in plan.hypotheses} if plan else {}
    rows = [_about(name, planned.get(name), any_plan=plan is not None) for name in _TEXT]
    for row in rows:
        name = row["id"]
        if name == "H1":
            row |= _improvement(data, alpha)
        elif name == "H4":
            row |= _comparison(conditions, alpha)
        elif name in styles:
            row |= _correlations(table2, alpha, keys=(styles[name],))
        else:
            row |= _correlations(table2, alpha, topic=_TOPICS[name])
    for primary in (True, False):
        _judge([row for row in rows if row["primary"] is primary], alpha, correction)
    return rows


def _about(name: str, planned: PlannedHypothesis | None, *, any_plan: bool) -> dict[str, Any]:
    """A row's first cells. What was not planned is never primary, or it would weaken planned tests."""
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
        supported = value < alpha and otherwise is None
        if value < alpha and otherwise is not None:
            row["note"] = otherwise
        row |= {
            "p_corrected": plain(value),
            "verdict": "supported" if supported else "not supported",
        }


def _improvement(data: StudyData, alpha: float) -> dict[str, Any]:
    held_out = [errors for errors in data.held_out if errors.role == "training"]
    test = "Wilcoxon's signed ranks of each person's mean error, given against mapped"
    if not held_out:
        return _untestable(test, NOT_HELD_OUT)
    before, after = person_errors(held_out[0])
    result = wilcoxon(before, after)
    if isinstance(result, NotComputable):
        return _untestable(test, result.reason)
    given, mapped = float(held_out[0].before.sum()), float(held_out[0].after.sum())
    return {
        "test": test,
        "p": plain(result.p),
        "otherwise": None if result.shift > 0.0 else "the labels got worse",
        "effect": {
            "what": "median fall of the mean label error, wheel units",
            "value": plain(result.shift),
            "ci95": plain(result.interval),
            "rank_biserial": plain(result.rank_biserial),
            "share_removed": plain(1.0 - mapped / given) if given else empty(NO_ERROR),
        },
        "n": result.n,
        "power": {
            "smallest_effect_80": plain(smallest_paired(result.n, alpha=alpha)),
            "of_medium": plain(paired_power(MEDIUM_D, result.n, alpha=alpha)),
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


def _comparison(conditions: Mapping[str, Any], alpha: float) -> dict[str, Any]:
    """H4, on success after the last round: the mixed model's test of condition, and two pairs.

    H4 holds if the conditions differ and MIND MELD is better than each rival after Holm.
    """
    test = "mixed model of success, joint test of condition; Holm-corrected Wilcoxon pairs"
    success = conditions["metrics"].get("success")
    if success is None:
        return _untestable(test, conditions.get("why_empty", "no success is on record"))
    if is_empty(success["mixed_model"]):
        return _untestable(test, success["mixed_model"]["empty"])
    ours = next((name for name in OURS if name in success["conditions"]), None)
    if ours is None:
        return _untestable(test, "MIND MELD is not among the conditions")
    pairs = [
        _toward(pair, ours) for pair in success["pairs"] if ours in (pair["first"], pair["second"])
    ]
    rivals = [pair for pair in pairs if pair["rival"] in RIVALS]
    if not rivals:
        return _untestable(test, "neither BC nor DAgger is among the conditions")
    weakest = min(
        (pair for pair in rivals if not is_empty(pair["p_holm"])),
        key=lambda pair: pair["shift"],
        default=None,
    )
    if weakest is None:
        return _untestable(test, rivals[0]["p_holm"]["empty"])
    better = all(
        not is_empty(pair["p_holm"]) and pair["p_holm"] < alpha and pair["shift"] > 0.0
        for pair in rivals
    )
    n = success["people"]
    return {
        "test": test,
        "p": success["mixed_model"]["condition"]["p"],
        "otherwise": None
        if better
        else "conditions differ, but MIND MELD is not better than every rival after Holm",
        "effect": {
            "what": f"success, {ours} less {weakest['rival']}, the closer rival",
            "value": weakest["shift"],
            "ci95": weakest["ci95"],
            "rank_biserial": weakest["rank_biserial"],
        },
        "parts": rivals,
        "n": n,
        "power": {
            "smallest_effect_80": plain(smallest_paired(n, alpha=alpha)),
            "of_medium": plain(paired_power(MEDIUM_D, n, alpha=alpha)),
            "what": f"mean difference of two conditions in its SDs; medium is {MEDIUM_D}",
        },
    }


def _toward(pair: Mapping[str, Any], ours: str) -> dict[str, Any]:
    """A pair of conditions as MIND MELD minus its rival."""
    first = pair["first"] == ours
    rival = pair["second"] if first else pair["first"]
    test = pair["test"]
    if is_empty(test):
        return {"rival": rival, "p": test, "p_holm": test, "shift": 0.0}
    sign = 1.0 if first else -1.0
    low, high = sorted(sign * limit for limit in test["interval"])
    return {
        "rival": rival,
        "p": test["p"],
        "p_holm": pair["p_holm"],
        "shift": plain(sign * test["shift"]),
        "ci95": [plain(low), plain(high)],
        "rank_biserial": plain(sign * test["rank_biserial"]),
    }


def _untestable(test: str, reason: str) -> dict[str, Any]:
    nothing = empty(reason)
    return {"test": test, "p": nothing, "effect": nothing, "n": 0, "power": nothing}
