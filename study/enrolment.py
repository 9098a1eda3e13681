"""Enrolling: the program chooses pseudonym and condition order, and the first one freezes the plan."""

from steerlab.study.contract import Role, StudyError
from steerlab.study.opened import OpenStudy
from steerlab.study.orders import allocation, order_at
from steerlab.study.plans import ConsentText
from steerlab.study.protocol import StudyProtocol
from steerlab.study.protocol_file import protocol_sha256, read_protocol_text
from steerlab.study.store.people import Enrolment, insert_enrolment, read_enrolments


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
        order, drawn_from = (), ""
        if role is Role.TEST:
            order, drawn_from = next_order(protocol, enrolled)
        participant = _next_pseudonym(study, protocol.prefix(role))
        insert_enrolment(
            connection,
            Enrolment(
                participant=participant,
                role=role.value,
                protocol_version=version,
                allocation=drawn_from,
                condition_order=order,
            ),
        )
    return participant


def next_order(protocol: StudyProtocol, enrolled: list[Enrolment]) -> tuple[tuple[str, ...], str]:
    """The next test participant's order, and what it is drawn from.

    Whoever leaves keeps their place: handing it on would make the order depend on who stays.
    """
    keys = tuple(condition.key for condition in protocol.conditions)
    drawn_from = allocation(keys, seed=protocol.seed, block_size=protocol.block_size)
    index = sum(one.role == Role.TEST and one.allocation == drawn_from for one in enrolled)
    order = order_at(keys, seed=protocol.seed, block_size=protocol.block_size, index=index)
    return order, drawn_from


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
        before = [study.protocol_of(one.version).consent for one in versions]
        _check_consent(study.draft().consent, before)
        return study.freeze(" ".join(why.split()))


def _check_consent(now: ConsentText, before: list[ConsentText]) -> None:
    """A version of the consent text says which words somebody agreed to, so it names one text."""
    same = [one for one in before if one.version == now.version]
    if same and same[0].text != now.text:
        raise StudyError(
            f"The consent text was changed and is still called version {now.version}; "
            f"set consent.version to {max(one.version for one in before) + 1}."
        )


def _next_pseudonym(study: OpenStudy, prefix: str) -> str:
    """One above the highest there is, enrolled or not: a number is never given twice."""
    numbers = [
        int(rest)
        for name in study.store.participants()
        if (rest := name.removeprefix(prefix)) != name and rest.isascii() and rest.isdecimal()
    ]
    return f"{prefix}{max(numbers, default=0) + 1:03d}"
