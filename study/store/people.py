"""What the store keeps of participants in a study: enrolment, phases, consent, links, departure.

Functions that write are called inside ``StoreConnection.transaction``, so that several of them are
kept together or not at all; each logs its own act.
"""

import json
from dataclasses import dataclass
from enum import StrEnum

from steerlab.sim.records import check_name
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.schema import StoreError

NOW = "strftime('%Y-%m-%dT%H:%M:%fZ', 'now')"


class PhaseAct(StrEnum):
    """What happened to a phase."""

    STARTED = "started"
    DONE = "done"
    SKIPPED = "skipped"
    REOPENED = "reopened"


class Departure(StrEnum):
    """How a participant left; ``ERASING`` until all that is not in the database is gone too."""

    KEPT = "kept"
    ERASING = "erasing"
    ERASED = "erased"


@dataclass(frozen=True, kw_only=True, slots=True)
class Enrolment:
    """A participant's place in the study.

    Attributes:
        allocation: what the order was drawn from; participants of equal allocation share blocks.
        order: condition keys.
    """

    participant: str
    role: str
    at_utc: str
    protocol_version: int
    allocation: str
    order: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class PhaseEvent:
    """One act on one phase.

    Attributes:
        first_attempt: how many attempts the participant had made by then; attempts before the last
            reopening do not count.
    """

    participant: str
    phase: str
    at_utc: str
    act: PhaseAct
    detail: str
    first_attempt: int


def insert_enrolment(connection: StoreConnection, enrolment: Enrolment) -> None:
    """Enrol a new participant.

    Raises:
        StoreError: the pseudonym is taken.
    """
    name = check_name("pseudonym", enrolment.participant)
    if connection.read("SELECT 1 FROM participants WHERE pseudonym = ?", name):
        raise StoreError(f"{name!r} is taken already; enrol under another pseudonym.")
    connection.run("INSERT INTO participants VALUES (?, ?)", name, enrolment.role)
    connection.run(
        f"INSERT INTO enrolments VALUES (?, {NOW}, ?, ?, ?)",
        *(name, enrolment.protocol_version, enrolment.allocation, json.dumps(enrolment.order)),
    )
    order = f", order {' > '.join(enrolment.order)}" if enrolment.order else ""
    connection.log(
        "enrolled",
        f"{name} as {enrolment.role}, protocol version {enrolment.protocol_version}{order}",
    )


def read_enrolments(connection: StoreConnection) -> list[Enrolment]:
    """All, in the order in which they were enrolled."""
    rows = connection.read(
        "SELECT e.participant, p.role, e.at_utc, e.protocol_version, e.allocation, e.orders "
        "FROM enrolments AS e JOIN participants AS p ON p.pseudonym = e.participant "
        "ORDER BY e.rowid"
    )
    return [
        Enrolment(
            participant=participant,
            role=role,
            at_utc=at_utc,
            protocol_version=version,
            allocation=allocation,
            order=tuple(json.loads(order)),
        )
        for participant, role, at_utc, version, allocation, order in rows
    ]


def insert_phase_event(
    connection: StoreConnection, participant: str, phase: str, act: PhaseAct, detail: str = ""
) -> None:
    """Keep what happened to a phase."""
    count = "SELECT count(*) FROM attempts WHERE participant = ?"
    (attempts,) = connection.run(count, participant).fetchone()
    connection.run(
        "INSERT INTO phase_events (participant, phase, at_utc, what, detail, first_attempt) "
        f"VALUES (?, ?, {NOW}, ?, ?, ?)",
        *(participant, phase, act.value, detail, attempts),
    )
    connection.log(f"phase {act}", f"{participant} {phase}")  # details go when the person goes


def read_phase_events(
    connection: StoreConnection, participant: str | None = None
) -> list[PhaseEvent]:
    """A participant's, or everybody's, in order."""
    where, values = ("", ()) if participant is None else ("WHERE participant = ?", (participant,))
    rows = connection.read(
        "SELECT participant, phase, at_utc, what, detail, first_attempt FROM phase_events "
        f"{where} ORDER BY id",
        *values,
    )
    return [
        PhaseEvent(
            participant=who,
            phase=phase,
            at_utc=at_utc,
            act=PhaseAct(what),
            detail=detail,
            first_attempt=first,
        )
        for who, phase, at_utc, what, detail, first in rows
    ]


def insert_consent(
    connection: StoreConnection, participant: str, *, given: bool, version: int, sha256: str
) -> None:
    """Keep a decision about the text of this version and hash."""
    connection.run(
        "INSERT INTO consents (participant, at_utc, given, version, sha256) "
        f"VALUES (?, {NOW}, ?, ?, ?)",
        *(participant, int(given), version, sha256),
    )
    act = "consent given" if given else "consent refused"
    connection.log(act, f"{participant} to version {version}, sha256 {sha256}")


def read_consents(connection: StoreConnection) -> dict[str, bool]:
    """The last decision of everyone who made one."""
    rows = connection.read("SELECT participant, given FROM consents ORDER BY id")
    return {participant: bool(given) for participant, given in rows}


def read_consented_sha256(connection: StoreConnection, participant: str) -> str | None:
    """Hash of the text that a participant has decided on; None before they have."""
    rows = connection.read(
        "SELECT sha256 FROM consents WHERE participant = ? ORDER BY id DESC LIMIT 1", participant
    )
    return rows[0][0] if rows else None


def insert_link(connection: StoreConnection, participant: str, token_sha256: str) -> None:
    """Keep the hash of a fresh link; older ones of the participant no longer count."""
    connection.run(
        f"INSERT INTO links (participant, at_utc, token_sha256) VALUES (?, {NOW}, ?)",
        *(participant, token_sha256),
    )
    connection.log("link made", participant)


def read_link_owner(connection: StoreConnection, token_sha256: str) -> str | None:
    """Whose newest link it is; None if nobody's."""
    rows = connection.read(
        "SELECT participant FROM links AS mine WHERE token_sha256 = ? AND NOT EXISTS "
        "(SELECT 1 FROM links WHERE participant = mine.participant AND id > mine.id)",
        token_sha256,
    )
    return rows[0][0] if rows else None


def write_departure(connection: StoreConnection, participant: str, how: Departure) -> None:
    """Keep that, and how, a participant left."""
    connection.run(
        f"INSERT INTO departures VALUES (?, {NOW}, ?) "
        "ON CONFLICT (participant) DO UPDATE SET how = excluded.how",
        *(participant, how.value),
    )
    connection.log("withdrawn", f"{participant}: {how}")


def read_departures(connection: StoreConnection) -> dict[str, Departure]:
    """How each participant who left did so."""
    rows = connection.read("SELECT participant, how FROM departures")
    return {participant: Departure(how) for participant, how in rows}
