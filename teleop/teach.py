"""``steerlab teach``: the downstream comparison, a shard a teacher, then summary and report."""

import json
import shutil
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

from steerlab.analysis.teach_report import TeachReport, render_teach_report
from steerlab.analysis.teach_summary import summarise
from steerlab.sim.errors import SteerlabError
from steerlab.teleop.output_folder import OutputError
from steerlab.teleop.provenance import versions
from steerlab.teleop.teach_config import TeachConfig
from steerlab.teleop.teach_people import Person, Prepared, given_mapper, prepare
from steerlab.teleop.teach_recordings import FOLDER, write_recordings
from steerlab.teleop.teach_shards import missing_learners, read_shard, write_json, write_text
from steerlab.teleop.teach_worker import Workshop, open_workshop, run_teacher, shard_path

Progress = Callable[[str, float], None]
RUN_FILE = "teach.json"


class WorkerLost(SteerlabError):
    """A process that taught has died: out of memory, or killed."""


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
    more ``teachers`` and other ``learners`` are added to what there is.

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
    missing = [one for one in prepared.teachers if _unfinished(out, one, config)]
    _run(config, prepared, missing, out, progress, jobs)
    progress("writing the report", 0.0)
    shards = [read_shard(shard_path(out, one.name)) for one in prepared.teachers]
    task = config.make_task()
    summary = summarise(
        shards,
        run=config.identity() | {"teachers": config.teachers, "learners": list(config.learners)},
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


def _unfinished(out: Path, teacher: Person, config: TeachConfig) -> bool:
    path = shard_path(out, teacher.name)
    return not path.is_file() or bool(missing_learners(read_shard(path), config.learners))


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
    other = [name for name in wanted if kept.get(name) != wanted[name]]
    return "; ".join(f"{name} was {kept.get(name)} and is now {wanted[name]}" for name in other)


def _run(
    config: TeachConfig,
    prepared: Prepared,
    missing: list[Person],
    out: Path,
    progress: Progress,
    jobs: int,
) -> None:
    if not missing:
        return
    if jobs <= 1 or len(missing) == 1:
        workshop = Workshop(config, prepared.mappers, out)
        try:
            for done, teacher in enumerate(missing):
                workshop.run(
                    teacher,
                    lambda share, done=done: progress("teaching", (done + share) / len(missing)),
                )
        finally:
            workshop.close()
        return
    pool = ProcessPoolExecutor(
        max_workers=min(jobs, len(missing)),
        mp_context=get_context("spawn"),  # a fork would share torch's and OpenGL's state
        initializer=open_workshop,
        initargs=(config, prepared.mappers, out),
    )
    try:
        waiting = [pool.submit(run_teacher, teacher) for teacher in missing]
        progress("teaching", 0.0)
        for done, future in enumerate(as_completed(waiting), start=1):
            future.result()
            progress("teaching", done / len(missing))
    except BrokenProcessPool as error:
        raise WorkerLost(
            "A process that taught has died, for lack of memory or because it could not start. "
            "Finished teachers are kept: give the same command again, with fewer --jobs."
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
