"""In which order a participant sees the items of a questionnaire: drawn once, and on record."""

import json
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256

from steerlab.study.progress import ParticipantProgress
from steerlab.study.store.people import PhaseAct
from steerlab.study.surveys.questionnaire import Item, Questionnaire

Orders = Mapping[str, tuple[str, ...]]
"""Ids of items in their order, by questionnaire."""


def drawn_order(questionnaire: Questionnaire, *, seed: int, participant: str) -> tuple[str, ...]:
    """The order in which a participant sees all items; the file's, unless it is random.

    Whatever depends on an item follows it at once, as in the file. Items are sorted by hashes and
    not shuffled by a random generator, so that an order can be checked by any version of any
    library, forever, and an item that is added later moves no other.

    Args:
        seed: the protocol's.
    """
    if questionnaire.order == "fixed":
        return tuple(item.id for item in questionnaire.items)

    def rank(item: Item) -> str:
        return sha256(f"{seed}/{participant}/{questionnaire.key}/{item.id}".encode()).hexdigest()

    below: dict[str | None, list[Item]] = {}
    for item in questionnaire.items:
        parent = None if item.shown_if is None else item.shown_if.item
        below.setdefault(parent, []).append(item)

    def with_dependants(items: Iterable[Item]) -> list[str]:
        return [
            id_ for item in items for id_ in (item.id, *with_dependants(below.get(item.id, ())))
        ]

    return tuple(with_dependants(sorted(below[None], key=rank)))


def item_order(
    progress: ParticipantProgress, phase: str, questionnaire: Questionnaire
) -> tuple[str, ...]:
    """The order on record, or that which will be: what the participant sees of a phase.

    A questionnaire that has other items by now has its order drawn anew.
    """
    drawn = drawn_order(questionnaire, seed=progress.protocol.seed, participant=progress.view.id)
    kept = orders_on_record(progress, phase).get(questionnaire.key, drawn)
    return kept if set(kept) == set(drawn) else drawn


def orders_on_record(progress: ParticipantProgress, phase: str) -> Orders:
    """The random orders that a phase's pages had, since it was last opened; empty before that."""
    for act in reversed(progress.acts.get(phase, ())):
        if act.act is PhaseAct.REOPENED:
            break
        if act.act is not PhaseAct.SKIPPED and act.detail:
            return {key: tuple(items) for key, items in json.loads(act.detail).items()}
    return {}


def orders_to_record(
    progress: ParticipantProgress, phase: str, questionnaires: Sequence[Questionnaire]
) -> str:
    """What the act that begins a phase of questionnaires says: its random orders, as JSON."""
    orders = {
        each.key: item_order(progress, phase, each)
        for each in questionnaires
        if each.order == "random"
    }
    return json.dumps(orders) if orders else ""
