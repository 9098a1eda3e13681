"""The schema of the study database: every table, and the triggers that keep what was recorded.

There is one version, and no conversion of files that another one made. Whoever changes a table
before a release simply changes it here; after one, ``STORE_VERSION`` counts.
"""

import pyarrow as pa

from steerlab.sim.records import LABELLED_STEP_SCHEMA, Driver
from steerlab.study.store.records import TIMING_SCHEMA

STORE_VERSION = 1
APPLICATION_ID = 0x53544C42  # "STLB" in the file's header: tells our files from other SQLite files

ERASED_IN_ORDER = (
    *("teaching_trials", "teaching_targets", "teaching_rounds"),
    *("timings", "steps", "events", "flags", "attempts", "sessions"),
    *("phase_events", "responses", "consents", "notes", "embeddings"),
)
"""Tables that are emptied of a person who withdraws and wants their data erased; children first.

Of ``links`` the newest hash stays, so that who opens their page later learns that all is erased.
"""


def _columns(schema: pa.Schema) -> str:
    """The columns of an Arrow schema in SQL, so that they are listed only once."""
    kinds = {
        pa.string(): "TEXT", pa.int32(): "INTEGER", pa.int64(): "INTEGER", pa.float64(): "REAL",
        pa.bool_(): "INTEGER",
    }  # fmt: skip
    columns = [
        f"{field.name} {kinds[field.type]}{'' if field.nullable else ' NOT NULL'}"
        + (f" CHECK ({field.name} IN (0, 1))" if field.type == pa.bool_() else "")
        for field in schema
    ]
    return ", ".join(columns)


_DRIVERS = ", ".join(f"'{driver}'" for driver in Driver)
_PERSON = "participant TEXT NOT NULL REFERENCES participants (pseudonym)"
_ATTEMPT = "participant, rollout, attempt"
_TO_ATTEMPT = f"FOREIGN KEY ({_ATTEMPT}) REFERENCES attempts ({_ATTEMPT})"
_TO_STEP = f"FOREIGN KEY ({_ATTEMPT}, step) REFERENCES steps ({_ATTEMPT}, step)"
_PHASE_RUN = "phase TEXT NOT NULL, phase_run INTEGER NOT NULL CHECK (phase_run >= 0)"

# STRICT: without it SQLite keeps a numpy int as a blob and a text as a number where it can.
_TABLES = f"""
PRAGMA application_id = {APPLICATION_ID};

CREATE TABLE meta (key TEXT NOT NULL PRIMARY KEY, value TEXT NOT NULL) STRICT;

CREATE TABLE participants (pseudonym TEXT NOT NULL PRIMARY KEY, role TEXT NOT NULL) STRICT;

-- A live drive has no seed, and its length is known only when it is over.
CREATE TABLE rollouts (
    name TEXT NOT NULL PRIMARY KEY, world TEXT NOT NULL, control_hz REAL NOT NULL,
    seed INTEGER, steps INTEGER CHECK (steps > 0)
) STRICT;

CREATE TABLE sessions (
    id TEXT NOT NULL PRIMARY KEY, {_PERSON}, started_utc TEXT NOT NULL,
    input_kind TEXT NOT NULL, device_name TEXT NOT NULL, device_guid TEXT NOT NULL,
    profile_sha256 TEXT NOT NULL, force_feedback TEXT NOT NULL, device_details TEXT NOT NULL,
    screen_px TEXT, display_hz REAL, control_hz REAL NOT NULL, input_latency_ms REAL,
    settings TEXT NOT NULL, steerlab_version TEXT NOT NULL, environment TEXT NOT NULL
) STRICT;

CREATE TABLE attempts (
    {_PERSON}, rollout TEXT NOT NULL REFERENCES rollouts (name),
    attempt INTEGER NOT NULL CHECK (attempt >= 0),
    status TEXT NOT NULL CHECK (status IN ('running', 'finished', 'abandoned')),
    order_index INTEGER NOT NULL CHECK (order_index >= 0),
    session TEXT REFERENCES sessions (id), end_reason TEXT,
    PRIMARY KEY ({_ATTEMPT}), UNIQUE (participant, order_index)
) STRICT;

CREATE TABLE steps (
    {_columns(LABELLED_STEP_SCHEMA)}, CHECK (gate IN ({_DRIVERS})),
    PRIMARY KEY ({_ATTEMPT}, step), {_TO_ATTEMPT}
) STRICT, WITHOUT ROWID;

CREATE TABLE timings (
    {_columns(TIMING_SCHEMA)}, PRIMARY KEY ({_ATTEMPT}, step), {_TO_STEP}
) STRICT, WITHOUT ROWID;

CREATE TABLE events (
    id INTEGER PRIMARY KEY, participant TEXT NOT NULL, rollout TEXT NOT NULL,
    attempt INTEGER NOT NULL, step INTEGER NOT NULL CHECK (step >= 0), at_ns INTEGER NOT NULL,
    what TEXT NOT NULL, {_TO_ATTEMPT}
) STRICT;

CREATE TABLE flags (
    participant TEXT NOT NULL, rollout TEXT NOT NULL, attempt INTEGER NOT NULL,
    name TEXT NOT NULL, value REAL NOT NULL, bound REAL NOT NULL,
    PRIMARY KEY ({_ATTEMPT}, name), {_TO_ATTEMPT}
) STRICT, WITHOUT ROWID;

CREATE TABLE audit (
    id INTEGER PRIMARY KEY, at_utc TEXT NOT NULL, act TEXT NOT NULL, detail TEXT NOT NULL,
    sha256 TEXT
) STRICT;

-- Audits of studies that were merged into this one; study: the hash of such an audit's first entry.
CREATE TABLE merged_audits (
    study TEXT NOT NULL, id INTEGER NOT NULL, at_utc TEXT NOT NULL, act TEXT NOT NULL,
    detail TEXT NOT NULL, sha256 TEXT, PRIMARY KEY (study, id)
) STRICT;

CREATE TABLE protocols (
    version INTEGER PRIMARY KEY CHECK (version > 0), frozen_utc TEXT NOT NULL,
    sha256 TEXT NOT NULL, text TEXT NOT NULL, why TEXT NOT NULL
) STRICT;

CREATE TABLE instruments (
    protocol_version INTEGER NOT NULL REFERENCES protocols (version), key TEXT NOT NULL,
    version INTEGER NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY (protocol_version, key)
) STRICT, WITHOUT ROWID;

CREATE TABLE enrolments (
    {_PERSON} PRIMARY KEY, at_utc TEXT NOT NULL,
    protocol_version INTEGER NOT NULL REFERENCES protocols (version),
    allocation TEXT NOT NULL, place INTEGER CHECK (place >= 0), condition_order TEXT NOT NULL
) STRICT;

CREATE TABLE departures (
    {_PERSON} PRIMARY KEY, at_utc TEXT NOT NULL,
    how TEXT NOT NULL CHECK (how IN ('kept', 'erasing', 'erased'))
) STRICT;

CREATE TABLE phase_events (
    id INTEGER PRIMARY KEY, {_PERSON}, phase TEXT NOT NULL, at_utc TEXT NOT NULL,
    act TEXT NOT NULL CHECK (act IN ('started', 'done', 'skipped', 'reopened')),
    detail TEXT NOT NULL, first_attempt INTEGER NOT NULL CHECK (first_attempt >= 0)
) STRICT;

CREATE TABLE responses (
    id INTEGER PRIMARY KEY, {_PERSON}, {_PHASE_RUN}, questionnaire TEXT NOT NULL,
    item TEXT NOT NULL, value TEXT, at_utc TEXT NOT NULL, nonce TEXT NOT NULL
) STRICT;
CREATE INDEX responses_of ON responses (participant, phase, phase_run);

CREATE TABLE consents (
    id INTEGER PRIMARY KEY, {_PERSON}, at_utc TEXT NOT NULL,
    given INTEGER NOT NULL CHECK (given IN (0, 1)), version INTEGER NOT NULL, sha256 TEXT NOT NULL
) STRICT;

CREATE TABLE links (
    id INTEGER PRIMARY KEY, {_PERSON}, at_utc TEXT NOT NULL, token_sha256 TEXT NOT NULL UNIQUE
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
    id INTEGER PRIMARY KEY, {_PERSON}, at_utc TEXT NOT NULL, model_sha256 TEXT NOT NULL,
    w TEXT NOT NULL, covariance TEXT NOT NULL, distance REAL,
    outside INTEGER NOT NULL CHECK (outside IN (0, 1)), inputs TEXT NOT NULL
) STRICT;

CREATE TABLE teaching_rounds (
    id INTEGER PRIMARY KEY, {_PERSON}, {_PHASE_RUN}, condition TEXT NOT NULL,
    round INTEGER NOT NULL CHECK (round >= 0), at_utc TEXT NOT NULL,
    rollout TEXT NOT NULL, attempt INTEGER NOT NULL, outcome TEXT NOT NULL,
    labels_asked INTEGER NOT NULL CHECK (labels_asked >= 0),
    label_mae REAL, given_mae REAL, teacher_s REAL NOT NULL, switches INTEGER NOT NULL,
    loss REAL, training_s REAL NOT NULL, policies TEXT NOT NULL, mapper_sha256 TEXT,
    UNIQUE (participant, phase, phase_run, round), {_TO_ATTEMPT}
) STRICT;

CREATE TABLE teaching_targets (
    participant TEXT NOT NULL, rollout TEXT NOT NULL, attempt INTEGER NOT NULL,
    step INTEGER NOT NULL, target REAL, weight REAL NOT NULL CHECK (weight >= 0),
    asked INTEGER NOT NULL CHECK (asked IN (0, 1)), CHECK (target IS NOT NULL OR weight = 0),
    PRIMARY KEY ({_ATTEMPT}, step), {_TO_STEP}
) STRICT, WITHOUT ROWID;

CREATE TABLE teaching_trials (
    participant TEXT NOT NULL, {_PHASE_RUN}, round INTEGER NOT NULL,
    start INTEGER NOT NULL CHECK (start >= 0),
    outcome TEXT NOT NULL, final_distance_m REAL NOT NULL,
    PRIMARY KEY (participant, phase, phase_run, round, start),
    FOREIGN KEY (participant, phase, phase_run, round)
        REFERENCES teaching_rounds (participant, phase, phase_run, round)
) STRICT, WITHOUT ROWID;

-- Has a row only inside the transaction that erases the participant: see the triggers.
CREATE TABLE erasing (participant TEXT NOT NULL PRIMARY KEY) STRICT;
"""


def _refuse(act: str, table: str, why: str, when: str = "1") -> str:
    """A trigger: ``act`` on rows of ``table`` fails for every program if ``when`` is true."""
    return (
        f"CREATE TRIGGER {act.lower()}_of_{table} BEFORE {act} ON {table} WHEN {when} "
        f"BEGIN SELECT RAISE(ABORT, '{why}'); END;\n"
    )


def _exists(table: str, key: str) -> str:
    """There is a row with that key: this stops INSERT OR REPLACE, whose deletes fire no trigger."""
    same = " AND ".join(f"{column} = NEW.{column}" for column in key.split(", "))
    return f"EXISTS (SELECT 1 FROM {table} WHERE {same})"


def _changed(*columns: str) -> str:
    return " OR ".join(f"NEW.{column} IS NOT OLD.{column}" for column in columns)


_NOT_RUNNING = (
    "NOT EXISTS (SELECT 1 FROM attempts WHERE participant = NEW.participant "
    "AND rollout = NEW.rollout AND attempt = NEW.attempt AND status = 'running')"
)
_JOINING = {"timings": f"{_ATTEMPT}, step", "events": "id", "flags": f"{_ATTEMPT}, name"}
_BY_ID = ("phase_events", "responses", "consents", "links", "notes", "embeddings")
_APPENDED = {
    "participants": "pseudonym",
    "rollouts": "name",
    "attempts": _ATTEMPT,
    "protocols": "version",
    "instruments": "protocol_version, key",
    "enrolments": "participant",
    "departures": "participant",
    **dict.fromkeys((*_BY_ID, "models", "teaching_rounds"), "id"),
    "merged_audits": "study, id",
    "teaching_targets": f"{_ATTEMPT}, step",
    "teaching_trials": "participant, phase, phase_run, round, start",
}
_CHANGING = ("attempts", "departures", "models")  # in one way only: see their triggers
_STAYING = (
    "steps",
    "sessions",
    *_JOINING,
    *(table for table in _APPENDED if table not in _CHANGING),
)
_KEPT = (
    *("participants", "rollouts", "enrolments", "departures"),
    *("protocols", "instruments", "models", "merged_audits"),
)
_NOT_ERASING = "OLD.participant IS NULL OR OLD.participant NOT IN (SELECT participant FROM erasing)"

_TRIGGERS = (
    _refuse("INSERT", "steps", "the attempt is not running", _NOT_RUNNING),
    *(
        _refuse(
            *("INSERT", table, f"{table}: the attempt is not running, or has this already"),
            f"{_NOT_RUNNING} OR {_exists(table, key)}",
        )
        for table, key in _JOINING.items()
    ),
    _refuse("INSERT", "sessions", "there is a session with this id", _exists("sessions", "id")),
    *(
        _refuse("INSERT", table, f"{table} are append only", _exists(table, key))
        for table, key in _APPENDED.items()
    ),
    *(_refuse("UPDATE", table, f"{table} are never changed") for table in _STAYING),
    _refuse(
        *("UPDATE", "attempts", "an attempt ends once and keeps its place"),
        f"OLD.status <> 'running' OR {_changed(*_ATTEMPT.split(', '), 'order_index', 'session')}",
    ),
    _refuse(
        *("UPDATE", "departures", "who has left has left"),
        f"{_changed('participant')} "
        "OR OLD.how || '>' || NEW.how NOT IN ('kept>erasing', 'erasing>erased')",
    ),
    _refuse(
        *("UPDATE", "models", "a model is frozen: it can only be removed"),
        "OLD.removed_utc IS NOT NULL OR "
        + _changed("id", "at_utc", "file", "sha256", "people", "inputs"),
    ),
    *(_refuse("DELETE", table, f"{table} are never deleted") for table in _KEPT),
    *(
        _refuse(
            *("DELETE", table, f"{table} are deleted only when a participant is erased"),
            _NOT_ERASING,
        )
        for table in (*ERASED_IN_ORDER, "links")
    ),
    _refuse("INSERT", "audit", "the audit is append only", _exists("audit", "id")),
    *(_refuse(act, "audit", "the audit is append only") for act in ("UPDATE", "DELETE")),
)

SCHEMA = _TABLES + "".join(_TRIGGERS)
"""All of it, in SQL."""
