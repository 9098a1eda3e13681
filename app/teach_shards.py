"""One file a teacher, written whole or not at all, so that an interrupted run goes on."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from steerlab.analysis.study_data.teach_shard import read_teach_shard
from steerlab.learning.agents import Episode, RoundResult, TaskEnv
from steerlab.learning.policy import PolicyNetwork, save_policy
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.run_folder import keeping
from steerlab.sim.rollout import Outcome
from steerlab.sim.world import REACH_M

SHOWN_FRAMES = 6
_PATH_EVERY = 10  # control steps between the points of a drawn path
_DIGITS = 4


def keep_policies(networks: Sequence[PolicyNetwork], folder: Path, learner: str) -> None:
    """One file a policy, ``<learner>-<member>.safetensors``.

    Raises:
        OutputError: they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"Cannot write to {folder}: {refusal(error, 'choose another --out')}."
        ) from error
    for member, network in enumerate(networks):
        file = folder / f"{learner.replace(':', '-')}-{member}.safetensors"
        with keeping(file) as fresh:
            save_policy(network, fresh)


def shard_path(folder: Path, teacher: str) -> Path:
    """Where a teacher's results are kept."""
    return folder / "teachers" / f"{teacher}.json"


def read_shard(path: Path) -> dict[str, Any]:
    """What ``write_json`` kept of one teacher.

    Raises:
        OutputError: it is damaged or of another version.
    """
    try:
        return read_teach_shard(path)[1]
    except InvalidConfig as error:
        raise OutputError(
            f"{path} is damaged or of another steerlab; remove it, and the same command makes it "
            f"again. {error}"
        ) from error


def round_values(result: RoundResult) -> dict[str, Any]:
    """A round in plain values; evaluation is null where there was none."""
    drives = result.drives
    reached = [drive.outcome is Outcome.BALL_REACHED for drive in drives]
    hit = [drive.outcome is Outcome.BLOCK_HIT for drive in drives]
    # Whoever reached the ball is as near as anyone can be; centimetres below are no merit.
    distance_m = [max(drive.final_distance_m, REACH_M) for drive in drives]
    return {
        "round": result.round_number,
        "outcome": str(result.outcome),
        "label_mae": _rounded(result.label_mae),
        "labels_asked": result.labels_asked,
        "teacher_seconds": _rounded(result.teacher_seconds),
        "switches": result.switches,
        "loss": _rounded(result.loss),
        "drives": len(drives),
        "success": _rounded(float(np.mean(reached)) if drives else None),
        "collisions": _rounded(float(np.mean(hit)) if drives else None),
        "final_distance_m": _rounded(float(np.mean(distance_m)) if drives else None),
        "path_m": path_values(result.episode),
    }


def path_values(episode: Episode) -> list[list[float]]:
    """Where the car went, thinned, with the last point."""
    points = episode.rollout.pose[:, :2]
    rows = [*range(0, len(points) - 1, _PATH_EVERY), len(points) - 1]
    return np.round(points[rows], 2).tolist()


def final_drives(results: Sequence[RoundResult]) -> list[dict[str, Any]]:
    """The evaluation drives after the last round, a point each half second."""
    return [
        {
            "outcome": str(drive.outcome),
            "final_distance_m": round(drive.final_distance_m, 2),
            "path_m": np.round(drive.path_m, 2).tolist(),
        }
        for drive in results[-1].drives
    ]


def shown_frames(env: TaskEnv, episode: Episode) -> list[str]:
    """What the camera saw, evenly spread over the drive: base64 of PNG, 64 x 64."""
    rollout = episode.rollout
    frames: list[str] = []
    for row in np.linspace(0, len(episode.rows) - 1, SHOWN_FRAMES).round().astype(int):
        env.driving.restore(rollout.physics_state[episode.rows[row]])
        file = BytesIO()
        Image.fromarray(env.frame()).save(file, "PNG")
        frames.append(b64encode(file.getvalue()).decode("ascii"))
    return frames


def missing(shard: Mapping[str, Any], learners: Sequence[str], seeds: int) -> list[tuple[str, int]]:
    """Learners and seeds that this teacher has still to teach; none if the teacher is left out."""
    if why_left_out(shard, learners, seeds):
        return []
    return [
        (name, seed)
        for name in learners
        for seed in range(seeds)
        if str(seed) not in shard["conditions"].get(name, {})
    ]


def why_left_out(shard: Mapping[str, Any], learners: Sequence[str], seeds: int) -> str | None:
    """Why a teacher cannot be judged by these; None if they can."""
    for found in shard["left_out"]:
        if found["seed"] < seeds and found["learner"] in (None, *learners):
            return found["why"]
    return None


def part_of(shard: Mapping[str, Any], learners: Sequence[str], seeds: int) -> dict[str, Any]:
    """What a shard holds of these learners and the first ``seeds``, as summaries read it.

    ``left_out`` is the reason or None, each condition a list by seed; those not taught are missing.
    """
    taught = shard["conditions"]
    whole = [
        name for name in learners if all(str(seed) in taught.get(name, {}) for seed in range(seeds))
    ]
    return {
        **{key: shard[key] for key in ("schema", "teacher", "style", "quirk")},
        "left_out": why_left_out(shard, learners, seeds),
        "conditions": {name: [taught[name][str(seed)] for seed in range(seeds)] for name in whole},
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, _DIGITS)
