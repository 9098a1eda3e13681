"""What trains and what is held out: by a fixed split of rollouts and people, or fold by fold.

Folds leave out rollouts and people at once, without leaks: both are dealt into K folds each. Fold k
trains on the people of the other folds on the rollouts of the other folds. Its rollouts are then
held out for everyone: they score the seen people, and, after calibration on the other rollouts,
fold k's own people as new ones. So K fits give each label exactly one held-out prediction, 1/K of
them as a new person's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries, by_person
from steerlab.sim.errors import InvalidConfig

if TYPE_CHECKING:
    from steerlab.learning.label_table import LabelTable

HELD_OUT_EVERY = 4  # of 12 rollouts, 9 train and 3 are held out
_TELLING = 10  # steps: two drives do not begin with the same ten truths by chance


@dataclass(frozen=True, kw_only=True)
class RolloutSplit:
    """Names of the rollouts that train or calibrate, and of those held out for scoring."""

    train: tuple[str, ...]
    held_out: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class StudySplit:
    """Series in four parts; no (person, rollout) pair is in two of them.

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
    for drive in series:
        if drive.rollout not in rollouts.train and drive.rollout not in rollouts.held_out:
            raise InvalidLabels(f"Rollout {drive.rollout!r} is in no part of the split.")
        if (drive.person, drive.rollout) in pairs:
            raise InvalidLabels(f"{drive.person!r} has two series for {drive.rollout!r}; give one.")
        pairs.add((drive.person, drive.rollout))
        parts[drive.person in new_people, drive.rollout in rollouts.held_out].append(drive)
    absent = set(new_people) - {person for person, _ in pairs}
    if absent:
        raise InvalidLabels(f"No series of {', '.join(sorted(absent))}; check the pseudonyms.")
    return StudySplit(
        train_seen=tuple(parts[False, False]),
        held_out_seen=tuple(parts[False, True]),
        calibrate_new=tuple(parts[True, False]),
        held_out_new=tuple(parts[True, True]),
    )


@dataclass(frozen=True, kw_only=True)
class FoldPlan:
    """What trains and what scores, fold by fold.

    Attributes:
        folds: one or more; no (person, rollout) pair is held out in two.
        fit: what the final model is fitted on; None where that of the only fold is the final one.
        notices: who could not be scored, in sentences for the report.
    """

    folds: tuple[StudySplit, ...]
    fit: tuple[LabelSeries, ...] | None
    notices: tuple[str, ...]


def plan_folds(table: "LabelTable", count: int, seed: int) -> FoldPlan:
    """Folds as the table's split column says, or else ``count`` of them.

    Raises:
        InvalidConfig: ``count`` is below 2.
        InvalidLabels: people or rollouts are too few, or the split column leaks or lacks a part.
    """
    if count < 2:
        raise InvalidConfig(f"folds is {count}; cross-validation needs at least 2.")
    usable = [(given.series, given.split) for given in table.given if given.series.valid.any()]
    series = [drive for drive, _ in usable]
    notices: list[str] = []
    everyone = {given.series.person for given in table.given}
    if absent := sorted(everyone - {drive.person for drive in series}):
        notices.append(f"{some_names(absent)}: no row has both label and truth; left out.")
    if table.has_split:
        return _by_column(usable, notices)
    return _by_dealing(series, count, seed, notices)


def _by_column(usable: list[tuple[LabelSeries, str | None]], notices: list[str]) -> FoldPlan:
    parts: dict[str, list[LabelSeries]] = {
        name: [drive for drive, split in usable if split == name]
        for name in ("train", "heldout", "new_calibration", "new_test")
    }
    if lacking := [name for name, part in parts.items() if not part]:
        raise InvalidLabels(
            f"split has no usable row for {', '.join(lacking)}; mark some, or drop the column and "
            f"let --folds deal."
        )
    people = {name: {drive.person for drive in part} for name, part in parts.items()}
    for both, why in (
        (
            (people["train"] | people["heldout"])
            & (people["new_calibration"] | people["new_test"]),
            "both seen (train, heldout) and new; a person is one or the other",
        ),
        (people["heldout"] - people["train"], "heldout but not in train; mark a rollout as train"),
        (
            people["new_test"] - people["new_calibration"],
            "in new_test without new_calibration; mark a rollout to calibrate them on",
        ),
    ):
        if both:
            raise InvalidLabels(f"split: {some_names(sorted(both))} is {why}.")
    drive_of, mirrored = _joined([drive for drive, _ in usable])
    trained = {drive_of[one.rollout] for one in parts["train"]}
    held_out = [*parts["heldout"], *parts["new_test"]]
    if shared := sorted({one.rollout for one in held_out if drive_of[one.rollout] in trained}):
        notices.append(
            f"{some_names(shared)}: held out for some people, trained on by others, so its truth "
            f"is not new to the network; improvements may be flattered."
        )
    notices += _same_truth(drive_of, mirrored, "the split column says where each goes")
    only = StudySplit(
        train_seen=tuple(parts["train"]),
        held_out_seen=tuple(parts["heldout"]),
        calibrate_new=tuple(parts["new_calibration"]),
        held_out_new=tuple(parts["new_test"]),
    )
    _check([only])
    return FoldPlan(folds=(only,), fit=None, notices=tuple(notices))


def _by_dealing(series: list[LabelSeries], count: int, seed: int, notices: list[str]) -> FoldPlan:
    people = list(dict.fromkeys(drive.person for drive in series))
    drive_of, mirrored = _joined(series)
    rollouts = list(dict.fromkeys(drive_of.values()))
    notices += _same_truth(drive_of, mirrored, "they are held out together")
    for what, names in (("people", people), ("rollouts", rollouts)):
        if len(names) < count:
            counted_once = what == "rollouts" and len(names) < len(drive_of)
            remedy = (
                f"give --folds {len(names)} or fewer" if len(names) > 1 else "more must be recorded"
            )
            raise InvalidLabels(
                f"{len(names)} {what} with labels and truth cannot make {count} folds"
                f"{' (one truth is one rollout, whatever its names)' if counted_once else ''}; "
                f"{remedy}."
            )
    # Dealt in turn, in the order in which people have them: whether names are shared by all or
    # each person's own, everyone's rollouts are spread over as many folds as there can be.
    drive_fold = {name: index % count for index, name in enumerate(rollouts)}
    rollout_fold = {name: drive_fold[drive] for name, drive in drive_of.items()}
    shuffled = np.random.default_rng(seed).permutation(len(people))
    person_fold = {people[index]: rank % count for rank, index in enumerate(shuffled)}
    folds = tuple(_fold(series, number, person_fold, rollout_fold) for number in range(count))
    for number, fold in enumerate(folds):
        if not fold.train_seen:
            raise InvalidLabels(
                f"Fold {number + 1} of {count} leaves nothing to train on; give other --folds."
            )
    _check(folds)
    scored = {
        (drive.person, drive.rollout)
        for fold in folds
        for drive in (*fold.held_out_seen, *fold.held_out_new)
    }
    if left := [drive for drive in series if (drive.person, drive.rollout) not in scored]:
        notices.append(
            f"{some_names(sorted({drive.person for drive in left}))}: {len(left)} of "
            f"{len(series)} rollouts train but are not scored, since nothing else of theirs could "
            f"be learned from when they were held out."
        )
    return FoldPlan(folds=folds, fit=tuple(series), notices=tuple(notices))


def drive_names(series: Sequence[LabelSeries]) -> dict[str, str]:
    """For each rollout the first one that has the same truth: one drive under two names.

    Whoever trains on one of them has learned the truth of the other, so folds must not part them.
    Mirror images, of which one truth is the negative of the other, are one drive for that reason.
    A truth that ends, or has a gap, where the other goes on is the same from ``_TELLING`` steps on.
    A constant one is nobody's in particular.
    """
    return _joined(series)[0]


def _joined(series: Sequence[LabelSeries]) -> tuple[dict[str, str], bool]:
    """What ``drive_names`` gives, and whether some rollouts are one as mirror images."""
    drive_of = {drive.rollout: drive.rollout for drive in series}
    place = {rollout: number for number, rollout in enumerate(drive_of)}
    mirrored = False

    def first(rollout: str) -> str:
        while drive_of[rollout] != rollout:
            rollout = drive_of[rollout]
        return rollout

    # Those of which each is how the next one begins; with the side that the truth is on at first.
    begins: list[tuple[bytes, str, bool]] = []
    told = {(truth, one.rollout, right) for one in series for truth, right in [_telling(one)]}
    for truth, rollout, right in sorted(told):
        while begins and not truth.startswith(begins[-1][0]):
            begins.pop()
        if begins and truth and (truth == begins[-1][0] or len(begins[-1][0]) >= 8 * _TELLING):
            one, other = sorted((first(begins[-1][1]), first(rollout)), key=place.__getitem__)
            drive_of[other] = one
            mirrored |= right != begins[-1][2] and rollout != begins[-1][1]
        begins.append((truth, rollout, right))
    return {rollout: first(rollout) for rollout in drive_of}, mirrored


def _telling(drive: LabelSeries) -> tuple[bytes, bool]:
    """The truth up to its first gap, 8 bytes a step; empty if it tells no drive from another.

    Mirrored if need be, so that it first leaves 0 to the left; and whether it was.
    """
    known = np.isfinite(drive.truth)
    start = int(np.argmax(known))
    gaps = np.flatnonzero(~known[start:])
    stop = start + int(gaps[0]) if len(gaps) else len(known)
    truth = drive.truth[start:stop]
    if np.ptp(truth) == 0.0 or (known[stop:].any() and len(truth) < _TELLING):
        return b"", False
    right = bool(truth[np.argmax(truth != 0.0)] < 0.0)
    return ((-truth if right else truth) + 0.0).tobytes(), right  # -0.0 is 0.0


def _same_truth(drive_of: Mapping[str, str], mirrored: bool, then: str) -> list[str]:
    """What the report says of rollouts with one truth under several names."""
    groups: dict[str, list[str]] = {}
    for rollout, drive in drive_of.items():
        groups.setdefault(drive, []).append(rollout)
    same = [some_names(names) for names in groups.values() if len(names) > 1]
    if not same:
        return []
    more = f" and {len(same) - 3} more" if len(same) > 3 else ""
    images = ", or its mirror image (the negative at every step)," if mirrored else ""
    return [
        f"Rollouts that have one and the same truth{images} are one drive, whatever their names: "
        f"{'; '.join(same[:3])}{more}. So {then}."
    ]


def _fold(
    series: Sequence[LabelSeries],
    number: int,
    person_fold: dict[str, int],
    rollout_fold: dict[str, int],
) -> StudySplit:
    parts: dict[tuple[bool, bool], list[LabelSeries]] = {
        (new, held): [] for new in (False, True) for held in (False, True)
    }
    for drive in series:
        parts[person_fold[drive.person] == number, rollout_fold[drive.rollout] == number].append(
            drive
        )
    learned = {
        new: {drive.person for drive in parts[new, False]} for new in (False, True)
    }  # a person with nothing to learn from has no embedding, and is not scored in this fold
    return StudySplit(
        train_seen=tuple(parts[False, False]),
        held_out_seen=tuple(
            drive for drive in parts[False, True] if drive.person in learned[False]
        ),
        calibrate_new=tuple(parts[True, False]),
        held_out_new=tuple(drive for drive in parts[True, True] if drive.person in learned[True]),
    )


def _check(folds: Sequence[StudySplit]) -> None:
    """Raise errors that would stop a fold before any slow training starts."""
    for number, fold in enumerate(folds, start=1):
        for person, drives in by_person((*fold.train_seen, *fold.calibrate_new)).items():
            if not any(drive.label[drive.valid].any() for drive in drives):
                where = f" on what fold {number} learns from" if len(folds) > 1 else ""
                raise InvalidLabels(
                    f"{person!r} has no valid label other than 0{where}, so nothing tells how they "
                    f"label; leave them out."
                )
    for what, scored in (
        ("seen", [drive for fold in folds for drive in fold.held_out_seen]),
        ("new", [drive for fold in folds for drive in fold.held_out_new]),
    ):
        people = by_person(scored)
        if len(people) < 2:
            raise InvalidLabels(
                f"{len(people)} {what} people can be scored, which gives no interval; it takes two "
                f"with two or more rollouts each."
            )
        faultless = [
            person for person, drives in people.items() if not any(map(_has_error, drives))
        ]
        if len(faultless) == len(people):
            raise InvalidLabels("The labels equal the truth; no improvement is defined.")
        if 2 * len(faultless) >= len(people):
            raise InvalidLabels(
                f"{len(faultless)} of {len(people)} {what} people gave labels without any error, "
                f"which nothing can improve, so the median person has no improvement; leave out "
                f"people who need no correction, such as {some_names(faultless)}."
            )


def _has_error(series: LabelSeries) -> bool:
    return bool((series.label != series.truth)[series.valid].any())


def some_names(names: Sequence[str]) -> str:
    """Up to three names, quoted, and how many more there are."""
    shown = ", ".join(repr(name) for name in names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown
