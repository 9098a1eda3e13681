"""A Rerun recording for each teacher of a downstream comparison, made from their shards alone."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from steerlab.analysis.figures.learners import learner_name
from steerlab.sim.world import WorldSpec

FOLDER = "recordings"


def write_recordings(
    shards: Sequence[Mapping[str, Any]],
    learners: Sequence[str],
    world: WorldSpec,
    out: Path,
    progress: Callable[[float], None],
) -> list[str]:
    """Write ``recordings/<teacher>.rrd`` under ``out`` for every teacher who was judged.

    Returns:
        the files, relative to ``out``.

    Raises:
        RecordingUnavailable: one cannot be written.
    """
    from steerlab.analysis.taught_drives import TaughtDrives, write_taught_drives

    judged = [shard for shard in shards if not shard["left_out"]]
    files: list[str] = []
    for number, shard in enumerate(judged):
        first = {name: shard["conditions"][name][0] for name in learners}
        file = f"{FOLDER}/{shard['teacher']}.rrd"
        drives = TaughtDrives(
            teacher=shard["teacher"], world=world, conditions=first, about=about(shard, first)
        )
        write_taught_drives(drives, out / file)
        files.append(file)
        progress((number + 1) / len(judged))
    return files


def about(shard: Mapping[str, Any], first: Mapping[str, Mapping[str, Any]]) -> str:
    """Who the teacher is and what came of each learner, in Markdown."""
    style = shard["style"]
    lines = [
        f"**{shard['teacher']}**, first learner seed",
        "",
        f"gain {style['gain']:.2f}, delay {style['delay_s']:.2f} s, lag {style['lag_s']:.2f} s, "
        f"dead zone {style['dead_zone']:.2f}",
        *([f"quirk {shard['quirk']}"] if shard["quirk"] else []),
        "",
        "| learner | success | distance (m) |",
        "|---|---|---|",
    ]
    for name, taught in first.items():
        last = taught["by_round"][-1]
        lines.append(
            f"| {learner_name(name)} | {last['success']:.2f} | {last['final_distance_m']:.1f} |"
        )
    return "\n".join(lines)
