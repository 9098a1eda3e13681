"""Answers to questionnaires and remarks of the experimenter's; each is a new row, none is changed.

An answer's audit entry holds a hash of it with a random nonce that lies beside the answer: an edited
answer shows, and once answer and nonce are erased the hash says nothing.
"""

import json
import secrets
from dataclasses import dataclass
from hashlib import sha256

from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.people import NOW

Value = str | int | float
ANSWERED = "answer kept"


@dataclass(frozen=True, kw_only=True, slots=True)
class Response:
    """One answer as it was given; ``value`` None takes back the one before.

    Attributes:
        round: how often the phase had been reopened by then; only the last round counts.
    """

    id: int
    participant: str
    phase: str
    round: int
    questionnaire: str
    item: str
    value: Value | None
    at_utc: str
    nonce: str

    @property
    def seal(self) -> str:
        """What the audit says of it."""
        fields = [self.participant, self.phase, self.round, self.questionnaire, self.item]
        text = json.dumps([*fields, self.value, self.nonce], ensure_ascii=False)
        return f"response {self.id} {sha256(text.encode()).hexdigest()}"


def insert_response(
    connection: StoreConnection,
    *,
    participant: str,
    phase: str,
    round_: int,
    questionnaire: str,
    item: str,
    value: Value | None,
) -> None:
    """Keep one answer; inside a transaction."""
    nonce = secrets.token_hex(16)
    kept = None if value is None else json.dumps(value, ensure_ascii=False)
    cursor = connection.run(
        "INSERT INTO responses (participant, phase, round, questionnaire, item, value, at_utc, "
        f"nonce) VALUES (?, ?, ?, ?, ?, ?, {NOW}, ?)",
        *(participant, phase, round_, questionnaire, item, kept, nonce),
    )
    (row,) = connection.run(
        f"SELECT {_COLUMNS} FROM responses WHERE id = ?", cursor.lastrowid
    ).fetchall()
    connection.log(ANSWERED, _response(row).seal)


_COLUMNS = "id, participant, phase, round, questionnaire, item, value, at_utc, nonce"


def read_responses(
    connection: StoreConnection, participant: str | None = None, phase: str | None = None
) -> list[Response]:
    """All answers ever given, by these if named, in order."""
    named = {"participant": participant, "phase": phase}
    given = {column: name for column, name in named.items() if name is not None}
    where = " AND ".join(f"{column} = ?" for column in given) or "1"
    query = f"SELECT {_COLUMNS} FROM responses WHERE {where} ORDER BY id"
    rows = connection.read(query, *given.values())
    return [_response(row) for row in rows]


def insert_note(connection: StoreConnection, participant: str | None, text: str) -> None:
    """Keep a remark; the audit says only that there is one, since it goes with the person."""
    connection.run(
        f"INSERT INTO notes (participant, at_utc, text) VALUES (?, {NOW}, ?)", participant, text
    )
    connection.log("note kept", participant or "about the study")


def read_notes(connection: StoreConnection, participant: str | None) -> list[tuple[str, str]]:
    """(time in UTC, text) of each remark about a participant; None: about the study."""
    return connection.read(
        "SELECT at_utc, text FROM notes WHERE participant IS ? ORDER BY id", participant
    )


def _response(row: tuple[int, str, str, int, str, str, str | None, str, str]) -> Response:
    id_, participant, phase, round_, questionnaire, item, value, at_utc, nonce = row
    return Response(
        id=id_,
        participant=participant,
        phase=phase,
        round=round_,
        questionnaire=questionnaire,
        item=item,
        value=None if value is None else json.loads(value),
        at_utc=at_utc,
        nonce=nonce,
    )
