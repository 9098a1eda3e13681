"""The paper's hypotheses and the planned comparison: verdict, effect size, interval, power.

A hypothesis whose test cannot come out below alpha, whatever people do, was not tested: its verdict
is ``not testable``, with the smallest p there could have been.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from steerlab.analysis.statistics.corrections import benjamini_hochberg, holm
from steerlab.analysis.statistics.noncentral import multiple_power, smallest_multiple
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import wilcoxon
from steerlab.analysis.statistics.signed_rank_power import signed_rank_power, smallest_signed_rank
from steerlab.analysis.study_data.records import Person, PlannedHypothesis, StudyData
from steerlab.analysis.study_tables.label_quality import NO_ERROR, NOT_HELD_OUT, person_errors
from steerlab.analysis.study_tables.plain import EMPTY, empty, is_empty, plain
from steerlab.analysis.wording import learner_name, p_value
from steerlab.sim.arrays import FloatArray

MEDIUM_R, LARGE_R, MEDIUM_D = 0.3, 0.5, 0.5  # Cohen's conventions, for the power a sample had

_TEXT: dict[str, tuple[str, bool]] = {
    "H1": ("MIND MELD improves the labels given in the calibration rollouts.", True),
    "H2a": ("The embeddings correlate with personality traits.", False),
    "H2b": ("The embeddings correlate with experience in playing video games.", False),
    "H2c": ("The embeddings correlate with driving experience.", False),
    "H3a": ("The embeddings correlate with the tendency to over- or under-correct.", True),
    "H3b": ("The embeddings correlate with the tendency to correct late or early.", True),
    "H4": ("Agents taught with MIND MELD drive better than those of the other learners.", True),
    "PrePost": ("People correct better in the last correcting phase than in the first.", True),
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
    in_parts = any(person.parts for person in data.people)
    rows = [
        _about(name, planned.get(name), any_plan=plan is not None)
        for name in _TEXT
        if name != "PrePost" or in_parts or name in planned
    ]
    for row in rows:
        name = row["id"]
        if name == "H1":
            row |= _improvement(data)
        elif name == "PrePost":
            row |= _change(data)
        elif name == "H4":
            row |= _comparison(conditions, alpha)
        elif name in styles:
            row |= _correlations(table2, keys=(styles[name],))
        else:
            row |= _correlations(table2, topic=_TOPICS[name])
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
    """Corrected p-values, verdicts, and power at the strictest level the corrections may ask for.

    Tests that cannot be significant by themselves are no tests: they are left out of the family,
    which the data had no say in (``statistics/attainable.py``).
    """
    for row in rows:
        row |= {"alpha": alpha, "correction": correction}
        if not is_empty(row["p"]) and "why" not in row and row["smallest_p"] >= alpha:
            row["why"] = row["smallest_is"]
    tested = [row for row in rows if not is_empty(row["p"]) and "why" not in row]
    correct = _CORRECTIONS[correction]
    adjusted = correct(np.array([row["p"] for row in tested])).tolist()
    smallest = correct(np.array([row["smallest_p"] for row in tested])).tolist()
    for row, value, least in zip(tested, adjusted, smallest, strict=True):
        row["p_corrected"] = plain(value)
        otherwise = row.pop("otherwise", None)
        if value < alpha and otherwise is not None:
            row["note"] = "; ".join(filter(None, (otherwise, row.get("note"))))
        row["verdict"] = "supported" if value < alpha and otherwise is None else "not supported"
        if least >= alpha:
            row["why"] = (
                f"{row['smallest_is']}, and {p_value(least)} after correction for {len(tested)} "
                f"hypotheses"
            )
    for row in rows:
        power_at, parts = row.pop("power_at", None), row.pop("tests", 1)
        if power_at is not None:
            family = 1 if correction == "none" else max(1, len(tested))
            row["power"] = plain(power_at(alpha / (parts * family)))
        if is_empty(row["p"]):
            row["why"] = row["p"][EMPTY]
        if "why" in row:
            row |= {"p_corrected": empty(row["why"]), "verdict": "not testable"}
            row.pop("otherwise", None)
        row.pop("smallest_is", None)


def _power_of_pairs(n: int) -> Callable[[float], dict[str, Any]]:
    """What Wilcoxon's test of ``n`` people can find, by level."""
    return lambda level: {
        "smallest_effect_80": smallest_signed_rank(n, alpha=level),
        "of_medium": signed_rank_power(MEDIUM_D, n, alpha=level),
        "what": f"mean difference in its standard deviations; medium is {MEDIUM_D}",
        "medium": MEDIUM_D,
        "unit": "SD",
        "test": "Wilcoxon’s signed ranks",
        "level": level,
    }


def _power_of_r(n: int, dimensions: int) -> Callable[[float], dict[str, Any]]:
    """What the test of multiple R can find, by level; for normal values by F, as by permutation."""
    return lambda level: {
        "smallest_effect_80": smallest_multiple(n, dimensions, alpha=level),
        "of_medium": multiple_power(MEDIUM_R, n, dimensions, alpha=level),
        "of_large": multiple_power(LARGE_R, n, dimensions, alpha=level),
        "what": f"multiple R of one test; medium is {MEDIUM_R}, large {LARGE_R}",
        "medium": MEDIUM_R,
        "unit": "R",
        "test": "F test of multiple R, which a permutation test equals for normal values",
        "level": level,
    }


def _smallest_is(people: str, p: float, after: str = "") -> str:
    return f"with {people} the smallest p there can be is {p_value(p)}{after}"


def _improvement(data: StudyData) -> dict[str, Any]:
    held_out = [errors for errors in data.held_out if errors.role == "training"]
    test = "Wilcoxon's signed ranks of each person's mean error, given against mapped"
    if not held_out:
        return _untestable(test, NOT_HELD_OUT)
    row = _paired(test, *person_errors(held_out[0]), worse="the labels got worse")
    if is_empty(row["p"]):
        return row
    given, mapped = float(held_out[0].before.sum()), float(held_out[0].after.sum())
    removed = plain(1.0 - mapped / given) if given else empty(NO_ERROR)
    return row | {"effect": row["effect"] | {"share_removed": removed}}


def _change(data: StudyData) -> dict[str, Any]:
    """Each person's mean error in their first correcting phase against that in their last."""
    test = (
        "Wilcoxon's signed ranks of each person's mean error, first correcting phase against last"
    )
    in_parts = [person for person in data.people if person.parts]
    if not in_parts:
        return _untestable(test, "everybody corrected all drives in one phase")
    errors = {(s.person, s.rollout): np.abs(s.label - s.truth)[s.valid] for s in data.series}

    def errors_in(person: Person, part: int) -> FloatArray:
        return np.concatenate([errors[person.id, name] for name in person.parts[part]])

    pairs = [(errors_in(one, 0), errors_in(one, -1)) for one in in_parts]
    means = [(one.mean(), other.mean()) for one, other in pairs if len(one) and len(other)]
    before, after = np.array(means).reshape(-1, 2).T
    row = _paired(test, before, after, worse="the corrections got worse")
    firsts = Counter(person.parts[0] for person in in_parts)
    if len(firsts) == 1:
        return row | {
            "note": "everybody had the same drives first, so that a change of the people cannot be "
            "told from one of the drives"
        }
    if max(firsts.values()) - min(firsts.values()) > 1:
        return row | {"note": f"the parts came first unequally often: {sorted(firsts.values())}"}
    return row


def _paired(test: str, before: FloatArray, after: FloatArray, *, worse: str) -> dict[str, Any]:
    """Wilcoxon's test of people's mean label errors."""
    result = wilcoxon(before, after)
    if isinstance(result, NotComputable):
        return _untestable(test, result.reason)
    differing = f"{result.n} people"
    if result.equal:
        differing = f"{result.n - result.equal} of {result.n} people whose error changed"
    return {
        "test": test,
        "p": plain(result.p),
        "smallest_p": plain(result.smallest_p),
        "smallest_is": _smallest_is(differing, result.smallest_p),
        "otherwise": None if result.shift > 0.0 else worse,
        "effect": {
            "what": "median fall of the mean label error, wheel units",
            "value": plain(result.shift),
            "ci95": plain(result.interval),
            "rank_biserial": plain(result.rank_biserial),
        },
        "n": result.n,
        "power_at": _power_of_pairs(result.n),
    }


def _correlations(
    table2: Mapping[str, Any], *, topic: str = "", keys: Sequence[str] = ()
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
    smallest = float(holm(np.array([row["primary"]["smallest_p"] for row in tested])).min())
    at = int(np.argmin(adjusted))
    best, n = tested[at]["primary"], tested[at]["primary"]["n"]
    several = f" after Holm’s correction over {len(tested)} scales" if len(tested) > 1 else ""
    return {
        "test": test,
        "p": plain(adjusted[at]),
        "smallest_p": plain(smallest),
        "smallest_is": _smallest_is(
            f"{n} people and {best['permutations']} permutations", smallest, several
        ),
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
        "tests": len(tested),
        "power_at": _power_of_r(n, best["dimensions"]),
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
    compared = sum(not is_empty(pair["p_holm"]) for pair in success["pairs"])
    least = max(pair["smallest_p_holm"] for pair in rivals if not is_empty(pair["p_holm"]))
    cannot = {
        "why": f"with {n} people the smallest p that a pair of conditions can have is "
        f"{p_value(least)} after Holm’s correction over {compared} pairs"
    }
    return {
        "test": test,
        "p": success["mixed_model"]["condition"]["p"],
        "smallest_p": 0.0,
        "smallest_is": "",
        **(cannot if least >= alpha else {}),
        "otherwise": None
        if better
        else "conditions differ, but MIND MELD is not better than every rival after Holm",
        "effect": {
            "what": f"success, {learner_name(ours)} less {learner_name(weakest['rival'])}, the closer rival",
            "value": weakest["shift"],
            "ci95": weakest["ci95"],
            "rank_biserial": weakest["rank_biserial"],
        },
        "parts": rivals,
        "n": n,
        "tests": compared,
        "power_at": _power_of_pairs(n),
    }


def _toward(pair: Mapping[str, Any], ours: str) -> dict[str, Any]:
    """A pair of conditions as MIND MELD minus its rival."""
    first = pair["first"] == ours
    rival = pair["second"] if first else pair["first"]
    test = pair["test"]
    if is_empty(test):
        return {"rival": rival, "p": test, "p_holm": test, "shift": 0.0}
    sign, interval = 1.0 if first else -1.0, test["interval"]
    if not is_empty(interval):
        interval = [plain(limit) for limit in sorted(sign * limit for limit in interval)]
    return {
        "rival": rival,
        "p": test["p"],
        "p_holm": pair["p_holm"],
        "shift": plain(sign * test["shift"]),
        "smallest_p_holm": pair["smallest_p_holm"],
        "ci95": interval,
        "rank_biserial": plain(sign * test["rank_biserial"]),
    }


def _untestable(test: str, reason: str) -> dict[str, Any]:
    nothing = empty(reason)
    return {"test": test, "p": nothing, "effect": nothing, "n": 0, "power": nothing}
