"""Who and what trains, calibrates and scores: split by rollout and by person, never by window."""

from collections.abc import Sequence
from dataclasses import dataclass

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries

HELD_OUT_EVERY = 4  # of 12 rollouts, 9 train and 3 are held out


@dataclass(frozen=True, kw_only=True)
class RolloutSplit:
    """Names of the rollouts that train or calibrate, and of those held out for scoring."""

    train: tuple[str, ...]
    held_out: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class StudySplit:
    """No (person, rollout) pair is in two parts.

    Attributes:
        train_seen: training people on training rollouts: what a mapper is fitted on.
        held_out_seen: the same people on held-out rollouts.
        calibrate_new: new people on the training rollouts: what they are calibrated on.
        held_out_new: new people on held-out rollouts.
    """

    train_seen: tuple[LabelSeries, ...]
    held_out_seen: tuple[LabelSeries, ...]
    calibrate_new: tuple[LabelSeries, ...]
    held_out_new: tuple[LabelSeries, ...]


def split_rollouts(names: Sequence[str]) -> RolloutSplit:
    """Hold out every fourth rollout, starting with the third, in the order given.

    Fixed and interleaved: held-out rollouts are spread over the session, and every run of a study
    holds out the same ones.

    Raises:
        InvalidLabels: fewer than three rollouts, or a name twice.
    """
    if len(set(names)) != len(names):
        raise InvalidLabels("A rollout name is given twice; give each once.")
    if len(names) < HELD_OUT_EVERY - 1:
        raise InvalidLabels(
            f"{len(names)} rollouts leave none to hold out; a split needs {HELD_OUT_EVERY - 1}."
        )
    held_out = tuple(names[HELD_OUT_EVERY // 2 :: HELD_OUT_EVERY])
    return RolloutSplit(
        train=tuple(name for name in names if name not in held_out), held_out=held_out
    )


def split_study(
    series: Sequence[LabelSeries], rollouts: RolloutSplit, new_people: Sequence[str]
) -> StudySplit:
    """Sort series into the four parts; people not in ``new_people`` are seen.

    Raises:
        InvalidLabels: a series' rollout is in no part, a (person, rollout) pair comes twice, or a
            new person has no series.
    """
    parts: dict[tuple[bool, bool], list[LabelSeries]] = {
        (new, held): [] for new in (False, True) for held in (False, True)
    }
    pairs: set[tuple[str, str]] = set()
    for one in series:
        if one.rollout not in rollouts.train and one.rollout not in rollouts.held_out:
            raise InvalidLabels(f"Rollout {one.rollout!r} is in no part of the split.")
        if (one.person, one.rollout) in pairs:
            raise InvalidLabels(f"{one.person!r} has two series for {one.rollout!r}; give one.")
        pairs.add((one.person, one.rollout))
        parts[one.person in new_people, one.rollout in rollouts.held_out].append(one)
    absent = set(new_people) - {person for person, _ in pairs}
    if absent:
        raise InvalidLabels(f"No series of {', '.join(sorted(absent))}; check the pseudonyms.")
    return StudySplit(
        train_seen=tuple(parts[False, False]),
        held_out_seen=tuple(parts[False, True]),
        calibrate_new=tuple(parts[True, False]),
        held_out_new=tuple(parts[True, True]),
    )
