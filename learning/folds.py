"""Cross-validation without leaks: folds leave out rollouts and people at once.

Rollouts and people are dealt into K folds each. Fold k trains on the people of the other folds on
the rollouts of the other folds. Its rollouts are then held out for everyone: they score the seen
people, and, after calibration on the other rollouts, fold k's own people as new ones. So K fits
give each label exactly one held-out prediction, 1/K of them as a new person's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_table import LabelTable
from steerlab.learning.people import by_person
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import StudySplit
from steerlab.sim.errors import InvalidConfig


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


def plan_folds(table: LabelTable, count: int, seed: int) -> FoldPlan:
    """Folds as the table's split column says, or else ``count`` of them.

    Raises:
        InvalidConfig: ``count`` is below 2.
        InvalidLabels: people or rollouts are too few, or the split column leaks or lacks a part.
    """
    if count < 2:
        raise InvalidConfig(f"folds is {count}; cross-validation needs at least 2.")
    series = [one.series for one in table.given]
    splits = [one.split for one in table.given]
    usable = [bool(one.valid.any()) for one in series]
    notices: list[str] = []
    if absent := sorted({s.person for s in series} - _people(series, usable)):
        notices.append(f"{some_names(absent)}: no row has both label and truth; left out.")
    kept = [(one, split) for one, split, use in zip(series, splits, usable, strict=True) if use]
    if table.has_split:
        return _by_column(kept, notices)
    return _by_dealing([one for one, _ in kept], count, seed, notices)


def _by_column(kept: list[tuple[LabelSeries, str | None]], notices: list[str]) -> FoldPlan:
    parts: dict[str, list[LabelSeries]] = {
        name: [one for one, split in kept if split == name]
        for name in ("train", "heldout", "new_calibration", "new_test")
    }
    if lacking := [name for name, part in parts.items() if not part]:
        raise InvalidLabels(
            f"split has no usable row for {', '.join(lacking)}; mark some, or drop the column and "
            f"let --folds deal."
        )
    people = {name: {one.person for one in part} for name, part in parts.items()}
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
    trained = {one.rollout for one in parts["train"]}
    held_out = {one.rollout for one in [*parts["heldout"], *parts["new_test"]]}
    if shared := sorted(trained & held_out):
        notices.append(
            f"{some_names(shared)}: held out for some people, trained on by others, so its truth is "
            f"not new to the network; improvements may be flattered."
        )
    only = StudySplit(
        train_seen=tuple(parts["train"]),
        held_out_seen=tuple(parts["heldout"]),
        calibrate_new=tuple(parts["new_calibration"]),
        held_out_new=tuple(parts["new_test"]),
    )
    _check([only])
    return FoldPlan(folds=(only,), fit=None, notices=tuple(notices))


def _by_dealing(series: list[LabelSeries], count: int, seed: int, notices: list[str]) -> FoldPlan:
    people = list(dict.fromkeys(one.person for one in series))
    rollouts = list(dict.fromkeys(one.rollout for one in series))
    for what, found in (("people", people), ("rollouts", rollouts)):
        if len(found) < count:
            mend = (
                f"give --folds {len(found)} or fewer" if len(found) > 1 else "more must be recorded"
            )
            raise InvalidLabels(
                f"{len(found)} {what} with labels and truth cannot make {count} folds; {mend}."
            )
    # Dealt in turn, in the order in which people have them: whether names are shared by all or
    # each person's own, everyone's rollouts are spread over as many folds as there can be.
    rollout_fold = {name: index % count for index, name in enumerate(rollouts)}
    shuffled = np.random.default_rng(seed).permutation(len(people))
    person_fold = {people[index]: place % count for place, index in enumerate(shuffled)}
    folds = tuple(_fold(series, number, person_fold, rollout_fold) for number in range(count))
    for number, fold in enumerate(folds):
        if not fold.train_seen:
            raise InvalidLabels(
                f"Fold {number + 1} of {count} leaves nothing to train on; give other --folds."
            )
    _check(folds)
    scored = {
        (one.person, one.rollout)
        for fold in folds
        for one in (*fold.held_out_seen, *fold.held_out_new)
    }
    if left := [one for one in series if (one.person, one.rollout) not in scored]:
        notices.append(
            f"{some_names(sorted({one.person for one in left}))}: {len(left)} of "
            f"{len(series)} rollouts train but are not scored, since nothing else of theirs could "
            f"be learned from when they were held out."
        )
    return FoldPlan(folds=folds, fit=tuple(series), notices=tuple(notices))


def _fold(
    series: Sequence[LabelSeries],
    number: int,
    person_fold: dict[str, int],
    rollout_fold: dict[str, int],
) -> StudySplit:
    parts: dict[tuple[bool, bool], list[LabelSeries]] = {
        (new, held): [] for new in (False, True) for held in (False, True)
    }
    for one in series:
        parts[person_fold[one.person] == number, rollout_fold[one.rollout] == number].append(one)
    learned = {
        new: {one.person for one in parts[new, False]} for new in (False, True)
    }  # whoever has nothing to learn from has no embedding, and is not scored in this fold
    return StudySplit(
        train_seen=tuple(parts[False, False]),
        held_out_seen=tuple(one for one in parts[False, True] if one.person in learned[False]),
        calibrate_new=tuple(parts[True, False]),
        held_out_new=tuple(one for one in parts[True, True] if one.person in learned[True]),
    )


def _check(folds: Sequence[StudySplit]) -> None:
    """Say before anything long starts what no fold could get over."""
    for number, fold in enumerate(folds, start=1):
        for person, own in by_person((*fold.train_seen, *fold.calibrate_new)).items():
            if not any(one.label[one.valid].any() for one in own):
                where = f" on what fold {number} learns from" if len(folds) > 1 else ""
                raise InvalidLabels(
                    f"{person!r} has no valid label other than 0{where}, so nothing tells how they "
                    f"label; leave them out."
                )
    for what, scored in (
        ("seen", [one for fold in folds for one in fold.held_out_seen]),
        ("new", [one for fold in folds for one in fold.held_out_new]),
    ):
        people = by_person(scored)
        if len(people) < 2:
            raise InvalidLabels(
                f"{len(people)} {what} people can be scored, which gives no interval; it takes two "
                f"with two or more rollouts each."
            )
        faultless = [person for person, own in people.items() if not any(map(_has_error, own))]
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


def _people(series: Sequence[LabelSeries], usable: Sequence[bool]) -> set[str]:
    return {one.person for one, use in zip(series, usable, strict=True) if use}


def some_names(names: Sequence[str]) -> str:
    """Up to three names, quoted, and how many more there are."""
    shown = ", ".join(repr(name) for name in names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown
