"""Schema 4 in SQL: what test participants taught, round by round, and how well the policies drive."""

COLUMNS_OF_4 = {
    "teaching_rounds": (
        *("id", "participant", "phase", "occasion", "condition", "round", "at_utc"),
        *("rollout", "attempt", "outcome", "labels_asked", "label_mae", "given_mae"),
        *("teacher_s", "switches", "loss", "training_s", "policies", "mapper_sha256"),
    ),
    "teaching_targets": (
        *("participant", "rollout", "attempt", "step"),
        *("target", "weight", "asked"),
    ),
    "teaching_trials": (
        *("participant", "phase", "occasion", "round", "start", "outcome", "final_distance_m"),
    ),
}
"""Columns of the tables that schema 4 adds."""

ERASED_FIRST = ("teaching_trials", "teaching_targets", "teaching_rounds")
"""Those of a person who withdraws and wants their data erased; children first, before all others."""

_KEYS = {
    "teaching_rounds": ("id",),
    "teaching_targets": ("participant", "rollout", "attempt", "step"),
    "teaching_trials": ("participant", "phase", "occasion", "round", "start"),
}


def _stays(table: str) -> str:
    """Rows are never changed nor written over, and go only when their person is erased."""
    same = " AND ".join(f"{column} = NEW.{column}" for column in _KEYS[table])
    return f"""
CREATE TRIGGER {table}_are_kept BEFORE DELETE ON {table}
WHEN OLD.participant NOT IN (SELECT participant FROM erasing)
BEGIN SELECT RAISE(ABORT, '{table} are deleted only when a participant is erased'); END;

CREATE TRIGGER {table}_stay BEFORE UPDATE ON {table}
BEGIN SELECT RAISE(ABORT, '{table} are never changed'); END;

CREATE TRIGGER {table}_are_new BEFORE INSERT ON {table}
WHEN EXISTS (SELECT 1 FROM {table} WHERE {same})
BEGIN SELECT RAISE(ABORT, '{table} are append only'); END;
"""


VERSION_4 = f"""
CREATE TABLE teaching_rounds (
    id INTEGER PRIMARY KEY,
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    phase TEXT NOT NULL, occasion INTEGER NOT NULL CHECK (occasion >= 0),
    condition TEXT NOT NULL, round INTEGER NOT NULL CHECK (round >= 0), at_utc TEXT NOT NULL,
    rollout TEXT NOT NULL, attempt INTEGER NOT NULL, outcome TEXT NOT NULL,
    labels_asked INTEGER NOT NULL CHECK (labels_asked >= 0),
    label_mae REAL, given_mae REAL, teacher_s REAL NOT NULL, switches INTEGER NOT NULL,
    loss REAL, training_s REAL NOT NULL, policies TEXT NOT NULL, mapper_sha256 TEXT,
    UNIQUE (participant, phase, occasion, round),
    FOREIGN KEY (participant, rollout, attempt) REFERENCES attempts (participant, rollout, attempt)
) STRICT;

CREATE TABLE teaching_targets (
    participant TEXT NOT NULL, rollout TEXT NOT NULL, attempt INTEGER NOT NULL,
    step INTEGER NOT NULL, target REAL, weight REAL NOT NULL CHECK (weight >= 0),
    asked INTEGER NOT NULL CHECK (asked IN (0, 1)),
    CHECK (target IS NOT NULL OR weight = 0),
    PRIMARY KEY (participant, rollout, attempt, step),
    FOREIGN KEY (participant, rollout, attempt, step)
        REFERENCES steps (participant, rollout, attempt, step)
) STRICT, WITHOUT ROWID;

CREATE TABLE teaching_trials (
    participant TEXT NOT NULL, phase TEXT NOT NULL, occasion INTEGER NOT NULL,
    round INTEGER NOT NULL, start INTEGER NOT NULL CHECK (start >= 0),
    outcome TEXT NOT NULL, final_distance_m REAL NOT NULL,
    PRIMARY KEY (participant, phase, occasion, round, start),
    FOREIGN KEY (participant, phase, occasion, round)
        REFERENCES teaching_rounds (participant, phase, occasion, round)
) STRICT, WITHOUT ROWID;

{"".join(map(_stays, COLUMNS_OF_4))}
"""


def _empty(name: str, columns: tuple[str, ...]) -> str:
    nothing = ", ".join(f"NULL AS {column}" for column in columns)
    return f"CREATE TEMP VIEW {name} AS SELECT {nothing} WHERE 0;\n"


VIEWS_OF_3 = "".join(_empty(name, columns) for name, columns in COLUMNS_OF_4.items())
"""What makes a file of schema 3 that is only read look like one of schema 4."""
