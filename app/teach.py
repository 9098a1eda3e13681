"""``steerlab teach``: the downstream comparison, a shard a teacher, then summary and report."""

import json
import shutil
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
from steerlab.sim.files.kept_files import write_json, write_text
from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.provenance import versions

Progress = Callable[[str, float], None]
RUN_FILE = "teach.json"


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
    _open_folder(config, out, mapper, force)
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


def _open_folder(config: TeachConfig, out: Path, mapper: Path | None, force: bool) -> None:
    """Begin a run, or make sure that the one in ``out`` is this one."""
    wanted = config.identity() | {"mapper": None if mapper is None else str(mapper)}
    try:
        if out.exists() and not out.is_dir():
            raise OutputError(f"{out} is a file; choose a folder for --out.")
        if out.is_dir() and any(out.iterdir()) and not _same_run(out, wanted):
            if not force:
                raise OutputError(
                    f"{out} holds something else: {_difference(out, wanted)}. Choose another "
                    "folder, give the same settings to go on, or add --force to begin anew."
                )
            shutil.rmtree(out)
        for part in ("models", "teachers", "policies", FOLDER, "report"):
            (out / part).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"Cannot write to {out}: {error.strerror or error}; choose another --out."
        ) from error
    write_json(wanted, out / RUN_FILE)


def _kept(out: Path) -> dict[str, Any] | None:
    try:
        return json.loads((out / RUN_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _same_run(out: Path, wanted: dict[str, Any]) -> bool:
    return _kept(out) == wanted


def _difference(out: Path, wanted: dict[str, Any]) -> str:
    kept = _kept(out)
    if kept is None:
        return f"it has no readable {RUN_FILE}"
    other = [name for name in {**wanted, **kept} if kept.get(name) != wanted.get(name)]
    return "; ".join(f"{name} was {kept.get(name)} and is now {wanted.get(name)}" for name in other)
