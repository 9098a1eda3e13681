"""Enrolling: the program chooses pseudonym and condition order, and the first freezes the protocol.

Condition orders are all permutations, balanced within blocks, drawn by the protocol's seed. The
place of whoever declines or withdraws is given to the next, so that those who stay are balanced.
"""

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from itertools import count, permutations
from math import factorial

from steerlab.sim.errors import unreadable
from steerlab.sim.names import appearance
from steerlab.study.consent import ConsentText
from steerlab.study.contract import PhaseKind, Role, StudyError
from steerlab.study.design import has_left
from steerlab.study.models import frozen_model, training_people
from steerlab.study.progress import everybody
from steerlab.study.protocol import StudyProtocol
from steerlab.study.protocol_file import PROTOCOL_FILE, protocol_sha256, read_protocol_text
from steerlab.study.store.forms import result_of, take
from steerlab.study.store.people import Enrolment, insert_enrolment, read_enrolments
from steerlab.study.study_folder import OpenStudy


def enrol(study: OpenStudy, role: Role, form: str | None = None) -> str:
    """Enrol the next participant; programs that do so at once get different ones.

    Args:
        form: names the form that asks for it; asked for twice, it is done once.

    Returns:
        the pseudonym.

    Raises:
        StudyError: the protocol is wrong, or was changed after it was frozen.
    """
    connection = study.store.connection
    with connection.transaction(f"enrol a {role} participant", durable=True):
        if (already := result_of(connection, form)) is not None:
            return already
        study.check_unchanged()
        versions = study.versions()
        version = versions[-1].version if versions else study.freeze("the first enrolment")
        protocol = study.protocol_of(version)
        if not any(role in phase.roles for phase in protocol.phases):
            raise StudyError(
                f"{PROTOCOL_FILE} has no phase for {role} participants, so none is enrolled."
            )
        enrolment = Enrolment(
            participant=_next_pseudonym(study, protocol.prefix(role)),
            role=role.value,
            protocol_version=version,
        )
        if role is Role.TEST:
            check_network_first(study, protocol)
            enrolment = _with_order(enrolment, protocol, _staying(study))
        elif protocol.design.turn_parts:
            enrolment = _with_place(enrolment, "parts in turn", _staying(study))
        insert_enrolment(connection, enrolment)
        take(connection, form, enrolment.participant)
    return enrolment.participant


def check_network_first(study: OpenStudy, protocol: StudyProtocol) -> None:
    """Test participants need a network, or that one can be trained.

    Raises:
        StudyError: there is none, too few training participants have finished, and the protocol
            does not let test participants come first.
    """
    needs_w = any(phase.kind is PhaseKind.CALIBRATE_W for phase in protocol.phases)
    if not (needs_w and protocol.design.network_first) or frozen_model(study) is not None:
        return
    finished, fewest = len(training_people(study)), protocol.mapper.minimum_people
    if finished < fewest:
        raise StudyError(
            f"No test participant can be enrolled yet: they teach with the network, for which "
            f"{fewest} training participants must have finished (mapper.minimum_people), and "
            f"{finished} have. Run {fewest - finished} more first, or let test participants come "
            f"before with design.network_first = false in {PROTOCOL_FILE}."
        )


def _with_order(
    enrolment: Enrolment, protocol: StudyProtocol, staying: Sequence[Enrolment]
) -> Enrolment:
    """Draw the order of the first place in the blocks that nobody has who stays."""
    keys = tuple(condition.key for condition in protocol.conditions)
    seed, block_size = protocol.seed, protocol.block_size
    allocation = f"seed {seed}, blocks of {block_size}: {', '.join(keys)}"
    placed = _with_place(enrolment, allocation, staying)
    order = order_at(keys, seed=seed, block_size=block_size, index=placed.place or 0)
    return replace(placed, condition_order=order)


def _with_place(enrolment: Enrolment, allocation: str, staying: Sequence[Enrolment]) -> Enrolment:
    """The first place in that allocation that nobody has who stays."""
    taken = {one.place for one in staying if one.allocation == allocation}
    place = next(place for place in count() if place not in taken)
    return replace(enrolment, allocation=allocation, place=place)


def _staying(study: OpenStudy) -> list[Enrolment]:
    """Enrolments of all who have neither declined nor withdrawn."""
    stays = {one.view.id for one in everybody(study) if not has_left(one.view.standing)}
    return [one for one in read_enrolments(study.store.connection) if one.participant in stays]


def order_at(
    conditions: Sequence[str], *, seed: int, block_size: int, index: int
) -> tuple[str, ...]:
    """The order of the ``index``-th place, from 0.

    Each block holds every order equally often, shuffled. A cyclic Latin square would balance
    positions only: with all orders, each condition also follows each other equally often.

    A block is shuffled by the hashes of its entries and not by a random generator, so that an
    assignment can be checked by any version of any library, forever.
    """
    block, position = divmod(index, block_size)
    copies = block_size // factorial(len(conditions))
    entries = [(order, copy) for order in permutations(conditions) for copy in range(copies)]

    def rank(entry: tuple[tuple[str, ...], int]) -> str:
        order, copy = entry
        return sha256(f"{seed}/{block}/{copy}/{'>'.join(order)}".encode()).hexdigest()

    return sorted(entries, key=rank)[position][0]


def _next_pseudonym(study: OpenStudy, prefix: str) -> str:
    """Its number is above all there are, enrolled or not: no number is ever given twice.

    Nor beside a name that only looks otherwise, such as ``p001`` of ``steerlab correct``.
    """
    start = appearance(prefix)
    numbers = [
        int(rest)
        for name in map(appearance, study.store.participants())
        if (rest := name.removeprefix(start)) != name and rest.isascii() and rest.isdecimal()
    ]
    return f"{prefix}{max(numbers, default=0) + 1:03d}"


def amend(study: OpenStudy, why: str) -> int:
    """Record the file as it is now as a new version; who is enrolled keeps the old one.

    Returns:
        the new version's number.

    Raises:
        StudyError: nothing is frozen yet, nothing changed, no reason is given, the file is wrong,
            or the consent text was changed under its old version.
    """
    if not why.strip():
        raise StudyError('An amendment needs its reason; give it with --why "...".')
    if found := unreadable(" ".join(why.split())):
        raise StudyError(f"The reason has {found!r} in it, which nobody can read; leave it out.")
    connection = study.store.connection
    with connection.transaction("amend the protocol", durable=True):
        versions = study.versions()
        if not versions:
            raise StudyError(
                "The protocol is not frozen yet: nobody is enrolled. Simply change the file."
            )
        changed = protocol_sha256(read_protocol_text(study.folder)) != versions[-1].sha256
        if not changed:
            try:
                study.check_unchanged()
            except StudyError:  # a questionnaire was changed
                changed = True
        if not changed:
            raise StudyError(
                f"The protocol is as version {versions[-1].version} has it; change the file first."
            )
        before = [study.protocol_of(version.version).consent for version in versions]
        _check_consent(study.draft().consent, before)
        return study.freeze(" ".join(why.split()))


def _check_consent(now: ConsentText, before: list[ConsentText]) -> None:
    """A version of the consent text says what somebody agreed to, so it names one text."""
    same = [text for text in before if text.version == now.version]
    if same and same[0] != now:
        raise StudyError(
            f"The consent text was changed and is still called version {now.version}; "
            f"set consent.version to {max(text.version for text in before) + 1}."
        )
