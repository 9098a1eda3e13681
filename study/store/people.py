"""What the store keeps of participants in a study: enrolment, phases, consent, links, departure.

Functions that write are called inside ``StoreConnection.transaction``, so that several of them are
kept together or not at all; each logs its act. Erasing a participant's rows is here as well.
"""

import sqlite3
from dataclasses import dataclass, replace
from enum import StrEnum
from time import sleep

from steerlab.sim.records import check_name
from steerlab.study.store.connection import BUSY_TIMEOUT_S, StoreConnection, fail
from steerlab.study.store.errors import StoreError
from steerlab.study.store.rows import Table
from steerlab.study.store.schema import ERASED_IN_ORDER
from steerlab.study.store.seals import log_erasure


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
    """That a participant was enrolled, and with which order of conditions.

    Attributes:
        at_utc: when; ``insert_enrolment`` sets it.
        allocation: what the order was drawn from; participants of equal allocation share blocks.
        place: in these blocks, from 0; None for whom no order was drawn.
        condition_order: condition keys.
    """

    participant: str
    role: str
    at_utc: str = ""
    protocol_version: int
    allocation: str = ""
    place: int | None = None
    condition_order: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class PhaseEvent:
    """One act on one phase.

    Attributes:
        detail: what there is to say of it: why a phase was skipped, the orders of items that a page
            had, what was entered with a consent, what a practice drive reached, which rollouts alone
            are reopened; empty for most.
        first_attempt: how many attempts the participant had made by then; attempts before the last
            reopening do not count.
    """

    participant: str
    phase: str
    at_utc: str
    act: PhaseAct
    detail: str
    first_attempt: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Decision:
    """Consent, given or refused, to the text of that version and hash."""

    at_utc: str
    given: bool
    version: int
    sha256: str


DECISIONS = Table("consents", Decision)
_LOOKS, _LOOK_MS = 30, 500  # for programs that read, before an erasure gives up

ENROLMENTS = Table("enrolments", Enrolment, joined=("role",))
PHASE_EVENTS = Table("phase_events", PhaseEvent)


def insert_enrolment(connection: StoreConnection, enrolment: Enrolment) -> None:
    """Enrol a new participant.

    Raises:
        StoreError: the pseudonym is taken.
    """
    name, role = check_name("pseudonym", enrolment.participant), enrolment.role
    if connection.read("SELECT 1 FROM participants WHERE pseudonym = ?", name):
        raise StoreError(f"{name!r} is taken already; enrol under another pseudonym.")
    connection.insert("participants", pseudonym=name, role=role)
    ENROLMENTS.insert(connection, replace(enrolment, at_utc=connection.now()))
    order = " > ".join(enrolment.condition_order)
    said = f"{name} as {role}, protocol version {enrolment.protocol_version}"
    connection.log("enrolled", said + (f", order {order}" if order else ""))


def read_enrolments(connection: StoreConnection) -> list[Enrolment]:
    """All enrolments, in their order."""
    join = "JOIN participants ON pseudonym = participant ORDER BY enrolments.rowid"
    return ENROLMENTS.select(connection, join)


def insert_phase_event(
    connection: StoreConnection, participant: str, phase: str, act: PhaseAct, detail: str = ""
) -> None:
    """Keep what happened to a phase."""
    count = "SELECT count(*) FROM attempts WHERE participant = ?"
    (attempts,) = connection.run(count, participant).fetchone()
    event = PhaseEvent(
        participant=participant,
        phase=phase,
        at_utc=connection.now(),
        act=act,
        detail=detail,
        first_attempt=attempts,
    )
    PHASE_EVENTS.insert(connection, event)
    connection.log(f"phase {act}", f"{participant} {phase}")  # details go when the person goes


def read_phase_events(
    connection: StoreConnection, participant: str | None = None
) -> list[PhaseEvent]:
    """The phase events of a participant, or of everybody, in order."""
    if participant is None:
        return PHASE_EVENTS.select(connection, "ORDER BY id")
    return PHASE_EVENTS.select(connection, "WHERE participant = ? ORDER BY id", participant)


def insert_consent(
    connection: StoreConnection, participant: str, *, given: bool, version: int, sha256: str
) -> None:
    """Keep a decision about the text of this version and hash."""
    values = {"given": int(given), "version": version, "sha256": sha256}
    connection.insert("consents", participant=participant, at_utc=connection.now(), **values)
    act = "consent given" if given else "consent refused"
    connection.log(act, f"{participant} to version {version}, sha256 {sha256}")


def read_consents(connection: StoreConnection) -> dict[str, bool]:
    """The last decision of everyone who made one."""
    rows = connection.read("SELECT participant, given FROM consents ORDER BY id")
    return {participant: bool(given) for participant, given in rows}


def read_decision(connection: StoreConnection, participant: str) -> Decision | None:
    """A participant's last decision; None before there is one."""
    tail = "WHERE participant = ? ORDER BY id DESC LIMIT 1"
    return next(iter(DECISIONS.select(connection, tail, participant)), None)


def insert_link(connection: StoreConnection, participant: str, token_sha256: str) -> None:
    """Keep the hash of a fresh link; older ones of the participant no longer count."""
    at_utc = connection.now()
    connection.insert("links", participant=participant, at_utc=at_utc, token_sha256=token_sha256)
    connection.log("link made", participant)


def read_link_owner(connection: StoreConnection, token_sha256: str) -> str | None:
    """The participant whose newest link this is; None if it is nobody's."""
    rows = connection.read(
        "SELECT participant FROM links AS mine WHERE token_sha256 = ? AND NOT EXISTS "
        "(SELECT 1 FROM links WHERE participant = mine.participant AND id > mine.id)",
        token_sha256,
    )
    return rows[0][0] if rows else None


def write_departure(connection: StoreConnection, participant: str, how: Departure) -> None:
    """Keep how a participant left."""
    update = "UPDATE departures SET how = ? WHERE participant = ?"
    if connection.run(update, how.value, participant).rowcount == 0:
        at_utc = connection.now()
        connection.insert("departures", participant=participant, at_utc=at_utc, how=how.value)
    connection.log("withdrawn", f"{participant}: {how}")


def read_departures(connection: StoreConnection) -> dict[str, Departure]:
    """How each participant who left did so."""
    rows = connection.read("SELECT participant, how FROM departures")
    return {participant: Departure(how) for participant, how in rows}


def erase_rows(connection: StoreConnection, participant: str) -> None:
    """Delete all rows of a participant but the tombstone and their link's hash; all or none.

    The one sanctioned way to delete what was recorded. The database pages that held the rows are
    overwritten with zeros; ``scrub`` must follow, since copies are still in the write-ahead log.

    Raises:
        StoreError: the database is busy or cannot be written.
    """
    connection.run("PRAGMA secure_delete = ON")
    with connection.transaction(f"erase {participant!r}", durable=True):
        log_erasure(connection, participant)
        connection.run("INSERT INTO erasing VALUES (?)", participant)
        for table in ERASED_IN_ORDER:
            connection.run(f"DELETE FROM {table} WHERE participant = ?", participant)
        newest = "SELECT max(id) FROM links WHERE participant = ?"
        connection.run(
            f"DELETE FROM links WHERE participant = ? AND id < ({newest})", participant, participant
        )
        connection.run("DELETE FROM erasing")
        write_departure(connection, participant, Departure.ERASING)


def scrub(connection: StoreConnection) -> None:
    """Rewrite the file without what was deleted, and empty the write-ahead log.

    Raises:
        StoreError: another program reads the database for half a minute, so that traces remain.
    """
    try:
        connection.run("VACUUM")
        connection.run(f"PRAGMA busy_timeout = {_LOOK_MS}")  # nobody can write in that time
        for _ in range(_LOOKS):
            busy, _, _ = connection.run("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            if not busy:
                return
            sleep(_LOOK_MS / 1000)
    except sqlite3.Error as error:
        fail(connection.path, "remove what was erased", error)
    finally:
        connection.run(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_S * 1000:.0f}")
    raise StoreError(
        f"Another program reads {connection.path}, so traces of what was erased remain in its "
        f"write-ahead log; close it and withdraw the participant again."
    )
