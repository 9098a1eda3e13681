"""Which blend of mappers to use, by labels of the training people that were held out.

No mapper is the best for everyone: a network taught by simulation may be wrong for people unlike
the simulated ones, a line is all that clean labels need. So drives of the training people are held
out, a third of these people are taken for new, every candidate is fitted on the rest, and the blend
is grown greedily: from the best single mapper, each time the mapper is added, again or anew, that
lowers the mean error most (ensemble selection: Caruana et al., ICML 2004).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from steerlab.learning.baselines.auto import Choice
from steerlab.learning.batch_mapping import map_in_chunks
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mapper import LabelMapper
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import (
    RolloutSplit,
    StudySplit,
    drive_names,
    split_rollouts,
    split_study,
)
from steerlab.sim.arrays import FloatArray

CANDIDATES = (
    "identity",
    "person_gain",
    "person_gain_lag",
    "shared_ridge",
    "person_ridge",
    "mind_meld",
    "eb_nonlinear",
    "sim_pretrained",
)
"""What may be blended; whatever reads the car's motion may not, since a robot can give the truth away."""

_ROUNDS = 20  # the finest weight is a twentieth
_LEAST_GAIN = 1e-3  # relative: less is luck
_LEAST_PEOPLE = 6  # with fewer none is taken for new


def choose(
    series: Sequence[LabelSeries],
    builders: Mapping[str, Callable[[], LabelMapper]],
    *,
    seed: int,
) -> Choice:
    """Which blend of mappers removes the most error from labels held out of ``series``.

    Args:
        series: of the training people.
        builders: make each candidate anew.
        seed: says who is taken for new.

    Raises:
        InvalidLabels: too few drives to hold some out, or a candidate cannot be fitted.
    """
    inner = _inner_split(series, seed)
    fitted: dict[str, LabelMapper] = {}
    left_out: dict[str, str] = {}
    for name, build in builders.items():
        mapper = build()
        try:
            mapper.fit(inner.train_seen)
            if inner.calibrate_new:
                mapper.calibrate(inner.calibrate_new)
        except InvalidLabels as error:
            left_out[name] = str(error)
            continue
        fitted[name] = mapper
    mapped: dict[str, list[FloatArray]] = {name: [] for name in fitted}
    label: list[FloatArray] = []
    truth: list[FloatArray] = []
    for chunk, by_name in map_in_chunks(fitted, (*inner.held_out_seen, *inner.held_out_new)):
        label += [one.label[one.valid] for one in chunk]
        truth += [one.truth[one.valid] for one in chunk]
        for name, all_mapped in by_name.items():
            mapped[name] += [
                values[one.valid] for one, values in zip(chunk, all_mapped, strict=True)
            ]
    together = {name: np.concatenate(values) for name, values in mapped.items()}
    return replace(
        _grown(together, np.concatenate(label), np.concatenate(truth)), left_out=left_out
    )


def _inner_split(series: Sequence[LabelSeries], seed: int) -> StudySplit:
    usable = [one for one in series if one.valid.any()]
    drive_of = drive_names(usable)
    drives = list(dict.fromkeys(drive_of.values()))
    held_out = set(split_rollouts(drives).held_out)
    rollouts = {one.rollout for one in usable}
    learned_from = {one.person for one in usable if drive_of[one.rollout] not in held_out}
    usable = [one for one in usable if one.person in learned_from]
    people = list(dict.fromkeys(one.person for one in usable))
    shuffled = np.random.default_rng([seed, 0xA070]).permutation(len(people))
    new = shuffled[::3] if len(people) >= _LEAST_PEOPLE else shuffled[:0]
    names = {name: drive_of[name] in held_out for name in sorted(rollouts)}
    return split_study(
        usable,
        RolloutSplit(
            train=tuple(name for name, held in names.items() if not held),
            held_out=tuple(name for name, held in names.items() if held),
        ),
        [people[index] for index in new],
    )


def _grown(mapped: Mapping[str, FloatArray], label: FloatArray, truth: FloatArray) -> Choice:
    raw = float(np.abs(label - truth).sum())
    if not raw:
        raise InvalidLabels("The labels held out for auto equal the truth; nothing can be chosen.")
    errors = {name: float(np.abs(values - truth).sum()) for name, values in mapped.items()}
    best = min(errors, key=lambda name: errors[name])
    counts, total, error = {best: 1}, mapped[best].copy(), errors[best]
    for taken in range(1, _ROUNDS):
        tried = {
            name: float(np.abs((total + values) / (taken + 1) - truth).sum())
            for name, values in mapped.items()
        }
        name = min(tried, key=lambda name: tried[name])
        if tried[name] > (1.0 - _LEAST_GAIN) * error and name not in counts:
            break
        if tried[name] > error:
            break
        counts[name] = counts.get(name, 0) + 1
        total, error = total + mapped[name], tried[name]
    taken = sum(counts.values())
    weights = {name: count / taken for name, count in counts.items()}
    return Choice(
        weights=dict(sorted(weights.items(), key=lambda item: -item[1])),
        improvement={name: 1.0 - one / raw for name, one in errors.items()},
        blended=1.0 - error / raw,
        labels=len(truth),
        left_out={},
    )
