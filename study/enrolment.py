"""Enrolling: the program chooses pseudonym and condition order, and the first freezes the protocol.

Condition orders are all permutations, balanced within blocks, drawn by the protocol's seed.
"""

from collections.abc import Sequence
from hashlib import sha256
from itertools import permutations
from math import factorial

from steerlab.sim.errors import unreadable
from steerlab.sim.names import appearance
from steerlab.study.contract import Role, StudyError
from steerlab.study.protocol import ConsentText, StudyProtocol
from steerlab.study.protocol_file import protocol_sha256, read_protocol_text
from steerlab.study.store.people import Enrolment, insert_enrolment, read_enrolments
from steerlab.study.study_folder import OpenStudy


def enrol(study: OpenStudy, role: Role) -> str:
    """Enrol the next participant; programs that do so at once get different ones.

    Returns:
        the pseudonym.

    Raises:
        StudyError: the protocol is wrong, or was changed after it was frozen.
    """
    connection = study.store.connection
    with connection.transaction(f"enrol a {role} participant", durable=True):
        study.check_unchanged()
        versions = study.versions()
        version = versions[-1].version if versions else study.freeze("the first enrolment")
        protocol = study.protocol_of(version)
        enrolled = read_enrolments(connection)
        order, allocation = (), ""
        if role is Role.TEST:
            order, allocation = _next_order(protocol, enrolled)
        participant = _next_pseudonym(study, protocol.prefix(role))
        insert_enrolment(
            connection,
            Enrolment(
                participant=participant,
                role=role.value,
                protocol_version=version,
                allocation=allocation,
                condition_order=order,
            ),
        )
    return participant


def _next_order(protocol: StudyProtocol, enrolled: list[Enrolment]) -> tuple[tuple[str, ...], str]:
    """The next test participant's order, and its allocation: what it is drawn from.

    Participants of equal allocation share blocks. The order of a participant who leaves is given
    to nobody else: handing it on would make the order depend on who stays.
    """
    keys = tuple(condition.key for condition in protocol.conditions)
    seed, block_size = protocol.seed, protocol.block_size
    allocation = f"seed {seed}, blocks of {block_size}: {', '.join(keys)}"
    index = sum(person.role == Role.TEST and person.allocation == allocation for person in enrolled)
    return order_at(keys, seed=seed, block_size=block_size, index=index), allocation


def order_at(
    conditions: Sequence[str], *, seed: int, block_size: int, index: int
) -> tuple[str, ...]:
    """The order of the ``index``-th test participant, from 0.

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
    """A version of the consent text says which words somebody agreed to, so it names one text."""
    same = [text for text in before if text.version == now.version]
    if same and same[0].text != now.text:
        raise StudyError(
            f"The consent text was changed and is still called version {now.version}; "
            f"set consent.version to {max(text.version for text in before) + 1}."
        )
