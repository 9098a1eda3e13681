"""The JSON file that ``steerlab teach`` keeps for each teacher, as records.

``app/teach_shards.py`` writes it as plain values and reads it back by these records, and so does
everything else that reads a run.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from steerlab.sim.errors import InvalidValue
from steerlab.sim.files.structured import (
    json_values,
    structured,
    utf8_text,
    versioned,
    within_file,
)

SHARD_SCHEMA = 2  # 2: by learner seed, so that seeds can be added
Point = tuple[float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class TaughtRound:
    """One round of a learner; None where nobody was asked, or nothing was judged or trained.

    Attributes:
        round: from 0, the demonstration.
        success, collisions: shares of the evaluation drives, 0 to 1.
        path_m: where the car went, thinned.
    """

    round: int
    outcome: str
    label_mae: float | None
    labels_asked: int
    teacher_seconds: float
    switches: int
    loss: float | None
    drives: int
    success: float | None
    collisions: float | None
    final_distance_m: float | None
    path_m: tuple[Point, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class FinalDrive:
    """One evaluation drive after the last round."""

    outcome: str
    final_distance_m: float
    path_m: tuple[Point, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class TaughtSeed:
    """A learner from one seed, taught to the end; frames (base64 of PNG) of the first seed only."""

    by_round: tuple[TaughtRound, ...]
    final_drives: tuple[FinalDrive, ...]
    frames: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class LeftOut:
    """Why a teacher cannot be judged; ``learner`` is None if they could not demonstrate at all."""

    seed: int
    learner: str | None
    why: str


@dataclass(frozen=True, kw_only=True, slots=True)
class TeachShard:
    """One teacher; ``failed_demonstrations`` by seed, ``conditions`` by learner and seed."""

    teacher: str
    style: Mapping[str, Any]
    quirk: str | None
    left_out: tuple[LeftOut, ...] = ()
    failed_demonstrations: Mapping[int, int] = field(default_factory=dict)
    conditions: Mapping[str, Mapping[int, TaughtSeed]]

    def __post_init__(self) -> None:
        taught = [seed for seeds in self.conditions.values() for seed in seeds.values()]
        rounds = sorted({tuple(row.round for row in seed.by_round) for seed in taught})
        if len(rounds) > 1:
            raise InvalidValue("conditions", rounds, "of the same rounds throughout")


def read_teach_shard(path: Path) -> tuple[TeachShard, dict[str, Any]]:
    """A shard, and the plain values it is in the file.

    Raises:
        InvalidConfig: it cannot be read, is damaged or of another schema.
    """
    values = json_values(utf8_text(path), str(path))
    with within_file(str(path)):
        known = versioned(TeachShard, values, "schema", SHARD_SCHEMA)
        return structured(TeachShard, known), values
