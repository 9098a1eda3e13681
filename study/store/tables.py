"""The study database's tables: what each schema version adds to the one before, in SQL.

A new file runs through all versions as an old one does, so there is one description of each
table. What was published never changes: a change is a new version at the end.
"""

import pyarrow as pa

from steerlab.sim.records import LABELLED_STEP_SCHEMA, Driver
from steerlab.study.store.study_tables import VERSION_3, VIEWS_OF_2
from steerlab.study.store.teaching_tables import VERSION_4, VIEWS_OF_3

APPLICATION_ID = 0x53544C42  # "STLB" in the file's header: tells our files from other SQLite files

SESSION_COLUMNS = (
    "id",
    "participant",
    "started_utc",
    "input_kind",
    "device_name",
    "device_guid",
    "profile_sha256",
    "force_feedback",
    "device_details",
    "screen_width_px",
    "screen_height_px",
    "display_hz",
    "control_hz",
    "input_latency_ms",
    "settings",
    "steerlab_version",
    "environment",
)
TIMING_COLUMNS = (
    "participant",
    "rollout",
    "attempt",
    "step",
    "deadline_ns",
    "actual_ns",
    "sample_ns",
    "event_age_ns",
    "overrun",
    "focus",
    "device_ok",
)
EVENT_COLUMNS = ("participant", "rollout", "attempt", "step", "at_ns", "what")
FLAG_COLUMNS = ("participant", "rollout", "attempt", "name", "value", "bound")


def _step_columns() -> str:
    """The columns of ``LABELLED_STEP_SCHEMA`` in SQL: there is one list of them, in records."""
    kinds = {
        pa.string(): "TEXT",
        pa.int32(): "INTEGER",
        pa.float64(): "REAL",
        pa.bool_(): "INTEGER",
    }
    return ", ".join(
        f"{field.name} {kinds[field.type]}{'' if field.nullable else ' NOT NULL'}"
        for field in LABELLED_STEP_SCHEMA
    )


# STRICT: without it SQLite keeps a numpy int as a blob and a text as a number where it can.
_VERSION_1 = f"""
PRAGMA application_id = {APPLICATION_ID};

CREATE TABLE meta (key TEXT NOT NULL PRIMARY KEY, value TEXT NOT NULL) STRICT;

CREATE TABLE participants (pseudonym TEXT NOT NULL PRIMARY KEY, role TEXT NOT NULL) STRICT;

CREATE TABLE rollouts (
    name TEXT NOT NULL PRIMARY KEY, world TEXT NOT NULL, control_hz REAL NOT NULL,
    seed INTEGER NOT NULL, steps INTEGER NOT NULL CHECK (steps > 0)
) STRICT;

CREATE TABLE attempts (
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    rollout TEXT NOT NULL REFERENCES rollouts (name),
    attempt INTEGER NOT NULL CHECK (attempt >= 0),
    status TEXT NOT NULL CHECK (status IN ('running', 'finished', 'abandoned')),
    order_index INTEGER NOT NULL CHECK (order_index >= 0),
    PRIMARY KEY (participant, rollout, attempt),
    UNIQUE (participant, order_index)
) STRICT;

CREATE TABLE steps (
    {_step_columns()},
    CHECK (gate IN ({", ".join(f"'{gate}'" for gate in Driver)})),
    CHECK (label_valid IN (0, 1)),
    PRIMARY KEY (participant, rollout, attempt, step),
    FOREIGN KEY (participant, rollout, attempt) REFERENCES attempts (participant, rollout, attempt)
) STRICT, WITHOUT ROWID;

CREATE TABLE audit (
    id INTEGER PRIMARY KEY, at_utc TEXT NOT NULL, act TEXT NOT NULL, detail TEXT NOT NULL
) STRICT;

-- What was recorded stays as it was, whichever program writes. The insert triggers also stop
-- INSERT OR REPLACE, whose deletions fire no delete trigger.
CREATE TRIGGER attempts_end_once BEFORE UPDATE ON attempts
WHEN OLD.status <> 'running' OR NEW.participant <> OLD.participant OR NEW.rollout <> OLD.rollout
    OR NEW.attempt <> OLD.attempt OR NEW.order_index <> OLD.order_index
BEGIN SELECT RAISE(ABORT, 'an attempt ends once and keeps its place'); END;

CREATE TRIGGER steps_join_a_running_attempt BEFORE INSERT ON steps
WHEN NOT EXISTS (
    SELECT 1 FROM attempts WHERE participant = NEW.participant AND rollout = NEW.rollout
    AND attempt = NEW.attempt AND status = 'running'
)
BEGIN SELECT RAISE(ABORT, 'the attempt is not running'); END;

CREATE TRIGGER steps_stay BEFORE UPDATE ON steps
BEGIN SELECT RAISE(ABORT, 'a recorded step is never changed'); END;

CREATE TRIGGER audit_ids_are_new BEFORE INSERT ON audit
WHEN EXISTS (SELECT 1 FROM audit WHERE id = NEW.id)
BEGIN SELECT RAISE(ABORT, 'the audit is append only'); END;

CREATE TRIGGER audit_stays BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit is append only'); END;

CREATE TRIGGER audit_is_kept BEFORE DELETE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit is append only'); END;
"""

_ATTEMPT_KEY = "participant, rollout, attempt"


def _joins_a_running_attempt(table: str, key: str) -> str:
    """Rows of ``table`` are new rows of a running attempt, and stay as they are."""
    same = " AND ".join(f"{column} = NEW.{column}" for column in key.split(", "))
    return f"""
CREATE TRIGGER {table}_join_a_running_attempt BEFORE INSERT ON {table}
WHEN NOT EXISTS (
    SELECT 1 FROM attempts WHERE participant = NEW.participant AND rollout = NEW.rollout
    AND attempt = NEW.attempt AND status = 'running'
) OR EXISTS (SELECT 1 FROM {table} WHERE {same})
BEGIN SELECT RAISE(ABORT, '{table}: the attempt is not running, or has this already'); END;

CREATE TRIGGER {table}_stay BEFORE UPDATE ON {table}
BEGIN SELECT RAISE(ABORT, '{table} are never changed'); END;
"""


# A drive that comes into being live has no seed, and its length is known only when it is over.
# SQLite relaxes a NOT NULL only by making the table anew (sqlite.org/lang_altertable.html, 7).
_VERSION_2 = f"""
CREATE TABLE rollouts_2 (
    name TEXT NOT NULL PRIMARY KEY, world TEXT NOT NULL, control_hz REAL NOT NULL,
    seed INTEGER, steps INTEGER CHECK (steps > 0)
) STRICT;
INSERT INTO rollouts_2 SELECT name, world, control_hz, seed, steps FROM rollouts;
DROP TABLE rollouts;
ALTER TABLE rollouts_2 RENAME TO rollouts;

CREATE TABLE sessions (
    id TEXT NOT NULL PRIMARY KEY,
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    started_utc TEXT NOT NULL,
    input_kind TEXT NOT NULL,
    device_name TEXT NOT NULL,
    device_guid TEXT NOT NULL,
    profile_sha256 TEXT NOT NULL,
    force_feedback TEXT NOT NULL,
    device_details TEXT NOT NULL,
    screen_width_px INTEGER,
    screen_height_px INTEGER,
    display_hz REAL,
    control_hz REAL NOT NULL,
    input_latency_ms REAL,
    settings TEXT NOT NULL,
    steerlab_version TEXT NOT NULL,
    environment TEXT NOT NULL
) STRICT;

CREATE TRIGGER session_ids_are_new BEFORE INSERT ON sessions
WHEN EXISTS (SELECT 1 FROM sessions WHERE id = NEW.id)
BEGIN SELECT RAISE(ABORT, 'there is a session with this id'); END;

CREATE TRIGGER sessions_stay BEFORE UPDATE ON sessions
BEGIN SELECT RAISE(ABORT, 'a recorded session is never changed'); END;

ALTER TABLE attempts ADD COLUMN session TEXT REFERENCES sessions (id);
ALTER TABLE attempts ADD COLUMN end_reason TEXT;

DROP TRIGGER attempts_end_once;
CREATE TRIGGER attempts_end_once BEFORE UPDATE ON attempts
WHEN OLD.status <> 'running' OR NEW.participant <> OLD.participant OR NEW.rollout <> OLD.rollout
    OR NEW.attempt <> OLD.attempt OR NEW.order_index <> OLD.order_index
    OR NEW.session IS NOT OLD.session
BEGIN SELECT RAISE(ABORT, 'an attempt ends once and keeps its place'); END;

CREATE TABLE timings (
    participant TEXT NOT NULL, rollout TEXT NOT NULL, attempt INTEGER NOT NULL,
    step INTEGER NOT NULL, deadline_ns INTEGER NOT NULL, actual_ns INTEGER NOT NULL,
    sample_ns INTEGER NOT NULL, event_age_ns INTEGER,
    overrun INTEGER NOT NULL CHECK (overrun IN (0, 1)),
    focus INTEGER NOT NULL CHECK (focus IN (0, 1)),
    device_ok INTEGER NOT NULL CHECK (device_ok IN (0, 1)),
    PRIMARY KEY ({_ATTEMPT_KEY}, step),
    FOREIGN KEY ({_ATTEMPT_KEY}, step) REFERENCES steps ({_ATTEMPT_KEY}, step)
) STRICT, WITHOUT ROWID;

CREATE TABLE events (
    id INTEGER PRIMARY KEY,
    participant TEXT NOT NULL, rollout TEXT NOT NULL, attempt INTEGER NOT NULL,
    step INTEGER NOT NULL CHECK (step >= 0), at_ns INTEGER NOT NULL, what TEXT NOT NULL,
    FOREIGN KEY ({_ATTEMPT_KEY}) REFERENCES attempts ({_ATTEMPT_KEY})
) STRICT;

CREATE TABLE flags (
    participant TEXT NOT NULL, rollout TEXT NOT NULL, attempt INTEGER NOT NULL,
    name TEXT NOT NULL, value REAL NOT NULL, bound REAL NOT NULL,
    PRIMARY KEY ({_ATTEMPT_KEY}, name),
    FOREIGN KEY ({_ATTEMPT_KEY}) REFERENCES attempts ({_ATTEMPT_KEY})
) STRICT, WITHOUT ROWID;

{_joins_a_running_attempt("timings", f"{_ATTEMPT_KEY}, step")}
{_joins_a_running_attempt("events", "id")}
{_joins_a_running_attempt("flags", f"{_ATTEMPT_KEY}, name")}
"""

VERSIONS = (_VERSION_1, _VERSION_2, VERSION_3, VERSION_4)
"""What to run to get from each schema version to the next, from none at all."""


def _empty(name: str, columns: tuple[str, ...]) -> str:
    nothing = ", ".join(f"NULL AS {column}" for column in columns)
    return f"CREATE TEMP VIEW {name} AS SELECT {nothing} WHERE 0;"


_VIEWS_OF_1 = f"""
CREATE TEMP VIEW attempts AS SELECT *, NULL AS session, NULL AS end_reason FROM main.attempts;
{_empty("sessions", SESSION_COLUMNS)}
{_empty("timings", TIMING_COLUMNS)}
{_empty("events", ("id", *EVENT_COLUMNS))}
{_empty("flags", FLAG_COLUMNS)}
"""

VIEWS = {
    1: _VIEWS_OF_1 + VIEWS_OF_2 + VIEWS_OF_3,
    2: VIEWS_OF_2 + VIEWS_OF_3,
    3: VIEWS_OF_3,
}
"""What makes an old file that is only read look like a file of the newest version."""
