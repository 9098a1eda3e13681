"""``steerlab teach``: the downstream comparison, a shard a teacher, then summary and report."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from steerlab.analysis.teach_report import TeachReport, render_teach_report, summarise
from steerlab.analysis.wording import learner_name
from steerlab.app.teach_config import TeachConfig
from steerlab.app.teach_people import given_mapper, prepare
from steerlab.app.teach_shards import part_of, read_shard, shard_path
from steerlab.app.teach_units import missing_units, run_units
from steerlab.sim.files.provenance import versions
from steerlab.sim.files.run_folder import SUMMARY, results, run_folder, write_json
from steerlab.sim.progress import Progress, ShareProgress
from steerlab.sim.world import WorldSpec

RUN_FILE = "teach.json"
RECORDINGS = "recordings"
PARTS = ("models", "teachers", "policies")


def teach(
    config: TeachConfig,
    out: Path,
    *,
    command: str,
    progress: Progress,
    jobs: int = 1,
    mapper: Path | None = None,
    force: bool = False,
) -> dict[str, Any]:
    """Run what is missing of a comparison in ``out``, then write recordings, summary and report as one.

    Layout: ``teach.json`` (the settings), ``models/``, ``teachers/<name>.json``,
    ``policies/<name>/`` and ``recordings/<name>.rrd`` (of the first learner seed), ``summary.json``,
    ``report/index.html``. The last three belong together while there is a ``summary.json``.
    Stopped at any moment, the same command goes on with whatever each teacher has still to teach;
    more ``teachers`` and ``learner_seeds`` and other ``learners`` are added to what there is.

    Args:
        command: the command line, for the report.
        jobs: processes; results do not depend on it.
        mapper: a MIND MELD checkpoint in place of one trained here.
        force: begin anew where ``out`` holds another run.

    Raises:
        SteerlabError: bad input, no place to write, no OpenGL; finished teachers are kept.
    """
    started = perf_counter()
    given = None if mapper is None else given_mapper(mapper)
    settings = config.identity() | {"mapper": None if mapper is None else str(mapper)}
    with run_folder(out, settings, file=RUN_FILE, parts=PARTS, force=force):
        prepared = prepare(config, out / "models", progress, given=given)
        units = missing_units(config, prepared.teachers, out)
        run_units(config, prepared, units, out, progress, jobs)
        progress("writing the report", 0.0)
        shards = [
            part_of(read_shard(shard_path(out, one.name)), config.learners, config.learner_seeds)
            for one in prepared.teachers
        ]
        task = config.make_task()
        summary = summarise(
            shards,
            run=config.identity()
            | {
                "teachers": config.teachers,
                "learner_seeds": config.learner_seeds,
                "learners": list(config.learners),
            },
            versions=versions(),
            seconds={"this_call": perf_counter() - started},
        )
        with results(out) as fresh:
            for part in (RECORDINGS, "report"):
                (fresh / part).mkdir()
            write_json(summary, fresh / SUMMARY)
            recordings = write_recordings(
                shards,
                config.learners,
                task.world,
                fresh,
                lambda share: progress("writing the report", 0.8 * share),
            )
            report = TeachReport(
                summary=summary,
                shards=shards,
                world=task.world,
                command=command,
                recordings=recordings,
            )
            page = render_teach_report(report)
            (fresh / "report" / "index.html").write_text(page, encoding="utf-8", newline="\n")
        progress("writing the report", 1.0)
        return summary


def write_recordings(
    shards: Sequence[Mapping[str, Any]],
    learners: Sequence[str],
    world: WorldSpec,
    out: Path,
    progress: ShareProgress,
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
        file = f"{RECORDINGS}/{shard['teacher']}.rrd"
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
