"""Schema 3 in SQL: participants' ways through a study, answers, models, and a chained audit."""

COLUMNS_OF_3 = {
    "protocols": ("version", "frozen_utc", "sha256", "text", "why"),
    "instruments": ("protocol_version", "key", "version", "sha256"),
    "enrolments": ("participant", "at_utc", "protocol_version", "allocation", "orders"),
    "departures": ("participant", "at_utc", "how"),
    "phase_events": ("id", "participant", "phase", "at_utc", "what", "detail", "first_attempt"),
    "responses": (
        *("id", "participant", "phase", "round", "questionnaire"),
        *("item", "value", "at_utc", "nonce"),
    ),
    "consents": ("id", "participant", "at_utc", "given", "version", "sha256"),
    "links": ("id", "participant", "at_utc", "token_sha256"),
    "notes": ("id", "participant", "at_utc", "text"),
    "models": ("id", "at_utc", "file", "sha256", "people", "inputs", "removed_utc"),
    "embeddings": (
        *("id", "participant", "at_utc", "model_sha256", "w", "covariance"),
        *("distance", "outside", "inputs"),
    ),
}
"""Columns of the tables that schema 3 adds."""

# Rows of these belong to a person: they are deleted only while ``erasing`` names that person, which
# it does only inside the transaction that erases them.
_ERASED = (
    *("steps", "timings", "events", "flags", "attempts", "sessions"),
    *("phase_events", "responses", "consents", "links", "notes", "embeddings"),
)
ERASED_IN_ORDER = tuple(table for table in _ERASED if table != "links")
"""Tables that are emptied of a person who withdraws and wants their data erased; children first.

Of ``links`` the newest hash stays, so that who opens their page later learns that all is erased.
"""

_KEPT = ("participants", "enrolments", "departures", "protocols", "instruments", "models")
_FINAL = ("protocols", "instruments", "enrolments")
_GROWING = ("phase_events", "responses", "consents", "links", "notes", "embeddings")


def _is_erased_only_whole(table: str) -> str:
    return f"""
CREATE TRIGGER {table}_are_kept BEFORE DELETE ON {table}
WHEN OLD.participant IS NULL OR OLD.participant NOT IN (SELECT participant FROM erasing)
BEGIN SELECT RAISE(ABORT, '{table} are deleted only when a participant is erased'); END;
"""


def _is_kept(table: str) -> str:
    return f"""
CREATE TRIGGER {table}_are_kept BEFORE DELETE ON {table}
BEGIN SELECT RAISE(ABORT, '{table} are never deleted'); END;
"""


def _stays(table: str) -> str:
    return f"""
CREATE TRIGGER {table}_stay BEFORE UPDATE ON {table}
BEGIN SELECT RAISE(ABORT, '{table} are never changed'); END;
"""


def _grows(table: str) -> str:
    return f"""
CREATE TRIGGER {table}_ids_are_new BEFORE INSERT ON {table}
WHEN EXISTS (SELECT 1 FROM {table} WHERE id = NEW.id)
BEGIN SELECT RAISE(ABORT, '{table} are append only'); END;
"""


VERSION_3 = f"""
CREATE TABLE protocols (
    version INTEGER PRIMARY KEY CHECK (version > 0), frozen_utc TEXT NOT NULL,
    sha256 TEXT NOT NULL, text TEXT NOT NULL, why TEXT NOT NULL
) STRICT;

CREATE TABLE instruments (
    protocol_version INTEGER NOT NULL REFERENCES protocols (version),
    key TEXT NOT NULL, version INTEGER NOT NULL, sha256 TEXT NOT NULL,
    PRIMARY KEY (protocol_version, key)
) STRICT, WITHOUT ROWID;

CREATE TABLE enrolments (
    participant TEXT NOT NULL PRIMARY KEY REFERENCES participants (pseudonym),
    at_utc TEXT NOT NULL,
    protocol_version INTEGER NOT NULL REFERENCES protocols (version),
    allocation TEXT NOT NULL,
    orders TEXT NOT NULL
) STRICT;

CREATE TABLE departures (
    participant TEXT NOT NULL PRIMARY KEY REFERENCES participants (pseudonym),
    at_utc TEXT NOT NULL,
    how TEXT NOT NULL CHECK (how IN ('kept', 'erasing', 'erased'))
) STRICT;

CREATE TABLE phase_events (
    id INTEGER PRIMARY KEY,
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    phase TEXT NOT NULL, at_utc TEXT NOT NULL,
    what TEXT NOT NULL CHECK (what IN ('started', 'done', 'skipped', 'reopened')),
    detail TEXT NOT NULL, first_attempt INTEGER NOT NULL CHECK (first_attempt >= 0)
) STRICT;

CREATE TABLE responses (
    id INTEGER PRIMARY KEY,
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    phase TEXT NOT NULL, round INTEGER NOT NULL CHECK (round >= 0),
    questionnaire TEXT NOT NULL, item TEXT NOT NULL, value TEXT,
    at_utc TEXT NOT NULL, nonce TEXT NOT NULL
) STRICT;
CREATE INDEX responses_of ON responses (participant, phase, round);

CREATE TABLE consents (
    id INTEGER PRIMARY KEY,
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    at_utc TEXT NOT NULL, given INTEGER NOT NULL CHECK (given IN (0, 1)),
    version INTEGER NOT NULL, sha256 TEXT NOT NULL
) STRICT;

CREATE TABLE links (
    id INTEGER PRIMARY KEY,
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    at_utc TEXT NOT NULL, token_sha256 TEXT NOT NULL UNIQUE
) STRICT;

CREATE TABLE notes (
    id INTEGER PRIMARY KEY, participant TEXT REFERENCES participants (pseudonym),
    at_utc TEXT NOT NULL, text TEXT NOT NULL
) STRICT;

CREATE TABLE models (
    id INTEGER PRIMARY KEY, at_utc TEXT NOT NULL, file TEXT NOT NULL, sha256 TEXT NOT NULL,
    people TEXT NOT NULL, inputs TEXT NOT NULL, removed_utc TEXT
) STRICT;

CREATE TABLE embeddings (
    id INTEGER PRIMARY KEY,
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    at_utc TEXT NOT NULL, model_sha256 TEXT NOT NULL, w TEXT NOT NULL, covariance TEXT NOT NULL,
    distance REAL, outside INTEGER NOT NULL CHECK (outside IN (0, 1)), inputs TEXT NOT NULL
) STRICT;

CREATE TABLE erasing (participant TEXT NOT NULL PRIMARY KEY) STRICT;

ALTER TABLE audit ADD COLUMN sha256 TEXT;
DROP TRIGGER audit_stays;
CREATE TRIGGER audit_stays BEFORE UPDATE ON audit
WHEN OLD.sha256 IS NOT NULL OR NEW.id <> OLD.id OR NEW.at_utc <> OLD.at_utc
    OR NEW.act <> OLD.act OR NEW.detail <> OLD.detail
BEGIN SELECT RAISE(ABORT, 'the audit is append only'); END;

CREATE TRIGGER departures_are_final BEFORE UPDATE ON departures
WHEN NEW.participant <> OLD.participant OR OLD.how || '>' || NEW.how
    NOT IN ('kept>erasing', 'erasing>erased')
BEGIN SELECT RAISE(ABORT, 'who has left has left'); END;

CREATE TRIGGER models_are_removed_once BEFORE UPDATE ON models
WHEN OLD.removed_utc IS NOT NULL OR NEW.id <> OLD.id OR NEW.at_utc <> OLD.at_utc
    OR NEW.file <> OLD.file OR NEW.sha256 <> OLD.sha256 OR NEW.people <> OLD.people
    OR NEW.inputs <> OLD.inputs
BEGIN SELECT RAISE(ABORT, 'a model is frozen: it can only be removed'); END;

{"".join(map(_is_erased_only_whole, _ERASED))}
{"".join(map(_is_kept, _KEPT))}
{"".join(map(_stays, (*_FINAL, *_GROWING)))}
{"".join(map(_grows, (*_GROWING, "models")))}
"""


def _empty(name: str, columns: tuple[str, ...]) -> str:
    nothing = ", ".join(f"NULL AS {column}" for column in columns)
    return f"CREATE TEMP VIEW {name} AS SELECT {nothing} WHERE 0;"


VIEWS_OF_2 = "\n".join(
    [
        *(_empty(name, columns) for name, columns in COLUMNS_OF_3.items()),
        "CREATE TEMP VIEW audit AS SELECT *, NULL AS sha256 FROM main.audit;",
    ]
)
"""What makes a file of schema 2 that is only read look like one of schema 3."""
