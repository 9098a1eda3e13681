"""``steerlab teach``: the downstream comparison, a shard a teacher, then summary and report."""

from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

from steerlab.analysis.teach_report import TeachReport, render_teach_report
from steerlab.analysis.teach_summary import summarise
from steerlab.app.teach_config import TeachConfig
from steerlab.app.teach_people import given_mapper, prepare
from steerlab.app.teach_recordings import FOLDER, write_recordings
from steerlab.app.teach_shards import part_of, read_shard, shard_path
from steerlab.app.teach_units import missing_units, run_units
from steerlab.sim.files.provenance import versions
from steerlab.sim.files.run_folder import open_run_folder, write_json, write_text

Progress = Callable[[str, float], None]
RUN_FILE = "teach.json"
PARTS = ("models", "teachers", "policies", FOLDER, "report")


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
    """Run what is missing of a comparison in ``out``, then write its summary and report.

    Layout: ``teach.json`` (the settings), ``models/``, ``teachers/<name>.json``,
    ``policies/<name>/`` and ``recordings/<name>.rrd`` (of the first learner seed), ``summary.json``,
    ``report/index.html``.
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
    open_run_folder(out, settings, file=RUN_FILE, parts=PARTS, force=force)
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
    write_json(summary, out / "summary.json")
    recordings = write_recordings(
        shards,
        config.learners,
        task.world,
        out,
        lambda share: progress("writing the report", 0.8 * share),
    )
    report = TeachReport(
        summary=summary, shards=shards, world=task.world, command=command, recordings=recordings
    )
    write_text(render_teach_report(report), out / "report" / "index.html")
    progress("writing the report", 1.0)
    return summary
