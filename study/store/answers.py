"""Answers to questionnaires and remarks of the experimenter; each is a new row, none is changed.

An answer's audit entry holds a hash of the answer and of a random nonce kept beside it: an edited
answer no longer fits its hash, and once answer and nonce are erased the hash reveals nothing.
"""

import json
import secrets
from dataclasses import dataclass
from hashlib import sha256

from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.rows import Table
from steerlab.study.store.seals import ANSWER, ANSWERED, Row, sealing
from steerlab.study.surveys.answer_format import Value


@dataclass(frozen=True, kw_only=True, slots=True)
class Response:
    """One answer as it was given; ``value`` None takes back the earlier answer.

    Attributes:
        phase_run: how often the phase had been reopened by then; only the last run counts.
    """

    id: int
    participant: str
    phase: str
    phase_run: int
    questionnaire: str
    item: str
    value: Value | None
    at_utc: str
    nonce: str

    @property
    def row(self) -> Row:
        """Its name in the audit."""
        return ANSWER, self.id

    @property
    def digest(self) -> str:
        """What the audit keeps of it."""
        fields = [self.participant, self.phase, self.phase_run, self.questionnaire, self.item]
        text = json.dumps([*fields, self.value, self.nonce], ensure_ascii=False)
        return sha256(text.encode()).hexdigest()


RESPONSES = Table("responses", Response)


def insert_response(
    connection: StoreConnection,
    *,
    participant: str,
    phase: str,
    phase_run: int,
    questionnaire: str,
    item: str,
    value: Value | None,
) -> None:
    """Keep one answer; inside a transaction."""
    response = Response(
        id=connection.next_id("responses"),
        participant=participant,
        phase=phase,
        phase_run=phase_run,
        questionnaire=questionnaire,
        item=item,
        value=value,
        at_utc=connection.now(),
        nonce=secrets.token_hex(16),
    )
    RESPONSES.insert(connection, response)
    connection.log(ANSWERED, sealing(response.row, response.digest))


def read_responses(
    connection: StoreConnection, participant: str | None = None, phase: str | None = None
) -> list[Response]:
    """All answers ever given in order, or those of a participant or a phase."""
    named = {"participant": participant, "phase": phase}
    given = {column: name for column, name in named.items() if name is not None}
    where = " AND ".join(f"{column} = ?" for column in given) or "1"
    return RESPONSES.select(connection, f"WHERE {where} ORDER BY id", *given.values())


def insert_note(connection: StoreConnection, participant: str | None, text: str) -> None:
    """Keep a remark; the audit has only that there is one, since erasing deletes its text."""
    connection.insert("notes", participant=participant, at_utc=connection.now(), text=text)
    connection.log("note kept", participant or "about the study")


def read_notes(connection: StoreConnection, participant: str | None) -> list[tuple[str, str]]:
    """Time in UTC and text of each remark about a participant; None: about the study."""
    return connection.read(
        "SELECT at_utc, text FROM notes WHERE participant IS ? ORDER BY id", participant
    )
