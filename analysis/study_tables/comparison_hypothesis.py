"""H4: do agents taught with MIND MELD drive better than those taught otherwise?"""

from collections.abc import Mapping
from typing import Any

from steerlab.analysis.statistics.noncentral import paired_power, smallest_paired
from steerlab.analysis.study_tables.plain import empty, is_empty, plain

OURS = ("mind_meld", "mind-meld")
RIVALS = ("bc", "dagger")
_MEDIUM_D = 0.5


def comparison(conditions: Mapping[str, Any], alpha: float) -> dict[str, Any]:
    """Success after the last round: the mixed model's test of condition, and the two pairs.

    It holds if the conditions differ and MIND MELD is better than each rival after Holm.
    """
    test = "mixed model of success, joint test of condition; Holm-corrected Wilcoxon pairs"
    found = conditions["metrics"].get("success")
    if found is None:
        return _untestable(test, conditions.get("why_empty", "no success is on record"))
    if is_empty(found["mixed_model"]):
        return _untestable(test, found["mixed_model"]["empty"])
    ours = next((name for name in OURS if name in found["conditions"]), None)
    if ours is None:
        return _untestable(test, "MIND MELD is not among the conditions")
    pairs = [
        _toward(pair, ours) for pair in found["pairs"] if ours in (pair["first"], pair["second"])
    ]
    rivals = [pair for pair in pairs if pair["rival"] in RIVALS]
    if not rivals:
        return _untestable(test, "neither BC nor DAgger is among the conditions")
    weakest = min(
        (one for one in rivals if not is_empty(one["p_holm"])),
        key=lambda one: one["shift"],
        default=None,
    )
    if weakest is None:
        return _untestable(test, rivals[0]["p_holm"]["empty"])
    better = all(
        not is_empty(one["p_holm"]) and one["p_holm"] < alpha and one["shift"] > 0.0
        for one in rivals
    )
    n = found["people"]
    return {
        "test": test,
        "p": found["mixed_model"]["condition"]["p"],
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
            "of_medium": plain(paired_power(_MEDIUM_D, n, alpha=alpha)),
            "what": f"mean difference of two conditions in its SDs; medium is {_MEDIUM_D}",
        },
    }


def _toward(pair: Mapping[str, Any], ours: str) -> dict[str, Any]:
    """A pair as MIND MELD less the other."""
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
