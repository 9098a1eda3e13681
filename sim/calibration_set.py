"""The calibration set: twelve fixed rollouts that every participant corrects, and their file.

The set ships with the package; ``steerlab calibration-set --out FILE`` makes it again. A file holds
a row a step; what belongs to a whole rollout is in its metadata.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from steerlab.sim.errors import InvalidConfig, shown
from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.reading import reading
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.structured import json_values, structured, within_file
from steerlab.sim.files.whole_file import whole_file
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.world import WorldSpec

_FORMAT = "steerlab.rollouts"
_FORMAT_VERSION = 1
_COLUMNS = {
    "pose": ("x_m", "y_m", "heading_rad"),
    "velocity": ("speed_mps", "lateral_speed_mps", "yaw_rate_radps"),
    "acceleration": ("acceleration_x_mps2", "acceleration_y_mps2"),
}
_ROLLOUT_SCHEMA = pa.schema(
    [
        pa.field("rollout", pa.string(), nullable=False),
        pa.field("step", pa.int32(), nullable=False),
        pa.field("t_s", pa.float64(), nullable=False),
        *(
            pa.field(name, pa.float64(), nullable=False)
            for names in _COLUMNS.values()
            for name in names
        ),
        pa.field("robot_wheel", pa.float64(), nullable=False),
        pa.field("oracle_label", pa.float64()),  # null where no path exists
        pa.field("physics_state", pa.list_(pa.float64()), nullable=False),
    ]
)
CALIBRATION_FILE = "calibration_set.parquet"


@dataclass(frozen=True, kw_only=True)
class _RolloutMetadata:
    """What is stored once for a whole rollout."""

    world: WorldSpec
    control_hz: float
    seed: int
    outcome: Outcome


@dataclass(frozen=True, kw_only=True)
class _Metadata:
    format: str
    version: int
    made_by: str
    mujoco: str
    rollouts: Mapping[str, _RolloutMetadata]


def write_rollouts(rollouts: Sequence[Rollout], path: Path, *, made_by: str) -> None:
    """Write a file that ``read_rollouts`` reads back bit for bit.

    Args:
        made_by: the command and seed that made the rollouts, for the reader of the file.

    Raises:
        OutputError: it cannot be written; a file that was there is as it was.
    """
    metadata = {
        "format": _FORMAT,
        "version": _FORMAT_VERSION,
        "made_by": made_by,
        "mujoco": version("mujoco"),
        "rollouts": {
            rollout.name: {
                "world": rollout.world.to_dict(),
                "control_hz": rollout.control_hz,
                "seed": rollout.seed,
                "outcome": str(rollout.outcome),
            }
            for rollout in rollouts
        },
    }
    tables = [_table(rollout) for rollout in rollouts]
    table = pa.concat_tables(tables).replace_schema_metadata({_FORMAT: json.dumps(metadata)})
    try:
        with whole_file(path) as part:
            pq.write_table(table, part, compression="zstd", compression_level=19)
    except OSError as error:
        raise OutputError(
            f"Cannot write {path}: {refusal(error, 'choose another file')}. What was there is as it was."
        ) from error


def read_rollouts(path: Path) -> tuple[Rollout, ...]:
    """The rollouts of a file, in the order they were written.

    Raises:
        InvalidConfig: the file is missing, damaged, or not one of ours.
    """
    with reading(path, "a rollout file", InvalidConfig, "Write it again with this steerlab."):
        table = pq.read_table(path)
        metadata = _metadata(table, path)
        names = np.asarray(table["rollout"])
        if unknown := set(names) ^ set(metadata.rollouts):
            raise InvalidConfig(
                f"{path} has rows or metadata of {shown(sorted(map(str, unknown)))}, not both."
            )
        return tuple(
            _rollout(name, table.filter(pa.array(names == name)), stored)
            for name, stored in metadata.rollouts.items()
        )


def _metadata(table: pa.Table, path: Path) -> _Metadata:
    raw = (table.schema.metadata or {}).get(_FORMAT.encode(), b"{}")
    values = json_values(raw.decode(errors="replace"), f"The metadata of {path}")
    file_version = (
        values.get("version", "no version") if isinstance(values, dict) else "no metadata"
    )
    if file_version != _FORMAT_VERSION:
        raise InvalidConfig(
            f"{path} is not a rollout file of version {_FORMAT_VERSION} (found {file_version}); "
            "write it again with this steerlab."
        )
    with within_file(str(path)):
        metadata = structured(_Metadata, values)
    if not table.schema.equals(_ROLLOUT_SCHEMA, check_metadata=False):
        raise InvalidConfig(f"{path} has other columns than a rollout file: {table.schema.names}.")
    return metadata


def _table(rollout: Rollout) -> pa.Table:
    columns: dict[str, Any] = {
        "rollout": [rollout.name] * rollout.steps,
        "step": np.arange(rollout.steps, dtype=np.int32),
        "t_s": rollout.t_s,
        "robot_wheel": rollout.robot_wheel,
        "oracle_label": pa.array(rollout.oracle_label, mask=~rollout.oracle_valid),
        "physics_state": list(rollout.physics_state),
    }
    for field, names in _COLUMNS.items():
        columns |= dict(zip(names, getattr(rollout, field).T, strict=True))
    return pa.table(columns, schema=_ROLLOUT_SCHEMA)


def _rollout(name: str, table: pa.Table, metadata: _RolloutMetadata) -> Rollout:
    def stacked(names: tuple[str, ...]) -> np.ndarray:
        return np.column_stack([table[column].to_numpy() for column in names])

    labels = table["oracle_label"]
    state = table["physics_state"].combine_chunks()
    return Rollout(
        name=name,
        world=metadata.world,
        control_hz=metadata.control_hz,
        seed=metadata.seed,
        outcome=metadata.outcome,
        t_s=table["t_s"].to_numpy(),
        pose=stacked(_COLUMNS["pose"]),
        velocity=stacked(_COLUMNS["velocity"]),
        acceleration=stacked(_COLUMNS["acceleration"]),
        robot_wheel=table["robot_wheel"].to_numpy(),
        oracle_label=labels.to_numpy(),  # null becomes NaN
        oracle_valid=labels.is_valid().to_numpy(),
        physics_state=state.flatten().to_numpy().reshape(table.num_rows, -1),
    )


def load_calibration_set() -> tuple[Rollout, ...]:
    """The shipped twelve rollouts."""
    with as_file(files("steerlab.assets") / CALIBRATION_FILE) as path:
        return read_rollouts(path)
