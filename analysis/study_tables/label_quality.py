"""How much better labels became on rollouts that the network was not trained on."""

from typing import Any

import numpy as np

from steerlab.analysis.statistics.bootstrap import (
    RESAMPLES,
    percentile_interval,
    resample_counts,
)
from steerlab.analysis.statistics.outcome import ConfidenceInterval, NotComputable, too_few
from steerlab.analysis.study_data.records import HeldOut, Role, StudyData
from steerlab.analysis.study_tables.plain import empty, plain
from steerlab.analysis.study_tables.sizes import BANDS, mark
from steerlab.sim.arrays import FloatArray

_SPLITS: tuple[tuple[Role, str], ...] = (("training", "seen"), ("test", "new"))
NOT_HELD_OUT = "no network was trained without the rollouts it would be judged on"
NO_ERROR = "the labels as given had no error, so no improvement is defined"


def label_quality(data: StudyData, *, seed: int) -> dict[str, Any]:
    """By role and network: error before and after, the share removed, and the paper's figure."""
    splits: dict[str, Any] = {}
    for role, title in _SPLITS:
        held_out = [errors for errors in data.held_out if errors.role == role]
        if not held_out:
            who = "test participants" if role == "test" else "training participants"
            nobody = not data.of_role(role)
            splits[title] = empty(f"there are no {who}" if nobody else NOT_HELD_OUT)
            continue
        networks = [_quality(errors, seed) for errors in held_out]
        shares = [
            network["improvement"]
            for network in networks
            if isinstance(network["improvement"], float)
        ]
        splits[title] = {
            **networks[0],
            "networks": [
                {"seed": network["seed"], "improvement": network["improvement"]}
                for network in networks
            ],
            "improvement_over_networks": [plain(min(shares)), plain(max(shares))]
            if shares
            else empty(NO_ERROR),
            "by_person": [
                {
                    "person": person,
                    "labels": int(labels),
                    "mae_before": plain(before / labels) if labels else empty("no valid label"),
                    "mae_after": plain(after / labels) if labels else empty("no valid label"),
                }
                for person, before, after, labels in zip(
                    held_out[0].people,
                    held_out[0].before,
                    held_out[0].after,
                    held_out[0].labels,
                    strict=True,
                )
            ],
        }
    return splits


def person_errors(errors: HeldOut) -> tuple[np.ndarray, np.ndarray]:
    """Mean errors before and after of everyone who has a valid held-out label, (people,) each."""
    keep = errors.labels > 0
    return errors.before[keep] / errors.labels[keep], errors.after[keep] / errors.labels[keep]


def _quality(errors: HeldOut, seed: int) -> dict[str, Any]:
    before, after, labels = (
        float(errors.before.sum()),
        float(errors.after.sum()),
        int(errors.labels.sum()),
    )
    with_error = errors.before > 0.0
    if labels == 0:
        nothing = empty("no held-out label is valid")
        return {
            "seed": errors.seed,
            "people": len(errors.people),
            "too_few": mark(len(errors.people), BANDS),
            "labels": 0,
        } | dict.fromkeys(
            ("mae_before", "mae_after", "improvement", "ci95", "person_median"), nothing
        )
    medians = 1.0 - errors.after[with_error] / errors.before[with_error]
    return {
        "seed": errors.seed,
        "people": len(errors.people),
        "too_few": mark(len(errors.people), BANDS),
        "labels": labels,
        "mae_before": plain(before / labels),
        "mae_after": plain(after / labels),
        "improvement": plain(1.0 - after / before) if before else empty(NO_ERROR),
        "ci95": plain(_interval(errors.before, errors.after, seed)),
        "person_median": plain(np.median(medians)) if len(medians) else empty(NO_ERROR),
        "people_improved": plain(np.mean(errors.after < errors.before)),
        "labels_worsened": plain(errors.worsened / labels),
        "per_sample_percent": plain(100.0 * errors.ratios / errors.with_error)
        if errors.with_error
        else empty(NO_ERROR),
    }


def _interval(
    before: FloatArray, after: FloatArray, seed: int
) -> ConfidenceInterval | NotComputable:
    """Percentiles of the improvement over resampled people."""
    if missing := too_few(len(before), 2):
        return missing
    counts = resample_counts(len(before), RESAMPLES, np.random.default_rng([seed, 0xB007]))
    below = counts @ before
    if not below.all():
        return NotComputable(reason="some resamples have labels without any error")
    return percentile_interval(1.0 - (counts @ after) / below, 0.95)
