"""Series by person, and what was learned of one."""

from collections.abc import Mapping, Sequence
from typing import TypeVar

from steerlab.learning.errors import UnknownPerson
from steerlab.learning.series import LabelSeries

Learned = TypeVar("Learned")


def by_person(series: Sequence[LabelSeries]) -> dict[str, list[LabelSeries]]:
    """Each person's series, people and series in the order given."""
    people: dict[str, list[LabelSeries]] = {}
    for one in series:
        people.setdefault(one.person, []).append(one)
    return people


def of_person(learned: Mapping[str, Learned], mapper: str, person: str) -> Learned:
    """What ``mapper`` learned of ``person``.

    Raises:
        UnknownPerson: the person was neither fitted nor calibrated.
    """
    if person not in learned:
        raise UnknownPerson(f"{mapper} does not know {person!r}; call calibrate with their series.")
    return learned[person]
