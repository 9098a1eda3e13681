"""The work of a comparison, unit by unit, here or shared by processes; each is kept when done."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from steerlab.analysis.study_data.teach_shard import SHARD_SCHEMA
from steerlab.app.teach_config import TeachConfig
from steerlab.app.teach_people import Person, Prepared
from steerlab.app.teach_shards import missing, read_shard, shard_path
from steerlab.app.teach_worker import TaughtUnit, Unit, UnitRunner, open_runner, run_unit
from steerlab.sim.engine.gl import draw_without_threads
from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.machine import worker_count
from steerlab.sim.files.run_folder import write_json
from steerlab.sim.unusual_teachers import UnusualTeacher

Progress = Callable[[str, float], None]


class WorkerLost(SteerlabError):
    """A process that taught has died: out of memory, or killed."""


def missing_units(config: TeachConfig, teachers: Sequence[Person], out: Path) -> list[Unit]:
    """What the shards in ``out`` lack, teacher by teacher."""
    units: list[Unit] = []
    for teacher in teachers:
        path = shard_path(out, teacher.name)
        shard = read_shard(path) if path.is_file() else _fresh(teacher)
        units += [
            Unit(teacher=teacher, learner=learner, seed=seed)
            for learner, seed in missing(shard, config.learners, config.learner_seeds)
        ]
    return units


def run_units(
    config: TeachConfig,
    prepared: Prepared,
    units: Sequence[Unit],
    out: Path,
    progress: Progress,
    jobs: int,
) -> None:
    """Run all units; each is in its teacher's shard as soon as it is done.

    Raises:
        WorkerLost: a process died; what was done is kept.
        OutputError: a shard cannot be written.
    """
    if not units:
        return
    if jobs <= 1 or len(units) == 1:
        _run_here(config, prepared, units, out, progress)
        return
    progress("teaching", 0.0)
    draw_without_threads()  # the processes inherit it; here MuJoCo may have been imported
    pool = ProcessPoolExecutor(
        max_workers=worker_count(jobs, len(units)),
        mp_context=get_context("spawn"),  # a fork would share torch's and OpenGL's state
        initializer=open_runner,
        initargs=(config, prepared.mappers, out),
    )
    try:
        waiting = {pool.submit(run_unit, unit): unit for unit in units}
        for done, future in enumerate(as_completed(waiting), start=1):
            if not future.cancelled():
                taught = future.result()
                _keep(taught, out)
                if taught.left_out:
                    _cancel(waiting, taught.unit.teacher)
            progress("teaching", done / len(units))
    except BrokenProcessPool as error:
        raise WorkerLost(
            "A process that taught has died, for lack of memory or because it could not start. "
            "What was finished is kept: give the same command again, with fewer --jobs."
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _cancel(waiting: Mapping[Future[TaughtUnit], Unit], teacher: Person) -> None:
    """Whatever else a teacher who is left out would have taught."""
    for future, unit in waiting.items():
        if unit.teacher.name == teacher.name:
            future.cancel()


def _run_here(
    config: TeachConfig,
    prepared: Prepared,
    units: Sequence[Unit],
    out: Path,
    progress: Progress,
) -> None:
    runner, left_out = UnitRunner(config, prepared.mappers, out), set[str]()
    try:
        for done, unit in enumerate(units):
            if unit.teacher.name in left_out:
                continue
            taught = runner.run(
                unit, lambda share, done=done: progress("teaching", (done + share) / len(units))
            )
            if taught.left_out:
                left_out.add(unit.teacher.name)
            _keep(taught, out)
    finally:
        runner.close()
    progress("teaching", 1.0)


def _keep(taught: TaughtUnit, out: Path) -> None:
    """Add a unit to its teacher's shard; only this process writes them."""
    unit = taught.unit
    path = shard_path(out, unit.teacher.name)
    shard = read_shard(path) if path.is_file() else _fresh(unit.teacher)
    if taught.failed_demonstrations is not None:
        shard["failed_demonstrations"][str(unit.seed)] = taught.failed_demonstrations
    if taught.result is None:
        learner = None if taught.failed_demonstrations is None else unit.learner
        why = {"seed": unit.seed, "learner": learner, "why": taught.left_out}
        if why not in shard["left_out"]:  # another of the teacher's units may have been under way
            shard["left_out"].append(why)
    else:
        shard["conditions"].setdefault(unit.learner, {})[str(unit.seed)] = taught.result
    write_json(shard, path, indent=None)


def _fresh(teacher: Person) -> dict[str, Any]:
    return {
        "schema": SHARD_SCHEMA,
        "teacher": teacher.name,
        **_describe(teacher),
        "left_out": [],
        "failed_demonstrations": {},
        "conditions": {},
    }


def _describe(teacher: Person) -> dict[str, Any]:
    if isinstance(teacher, UnusualTeacher):
        return {"style": asdict(teacher.scripted.style), "quirk": repr(teacher.quirk)}
    return {"style": asdict(teacher.style), "quirk": None}
