"""The work of a comparison, unit by unit, here or shared by processes; each is kept when done."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch

from steerlab.analysis.study_data.teach_shard import SHARD_SCHEMA
from steerlab.app.teach_config import TeachConfig
from steerlab.app.teach_people import Person, Prepared
from steerlab.app.teach_shards import (
    final_drives,
    keep_policies,
    missing,
    read_shard,
    round_values,
    shard_path,
    shown_frames,
)
from steerlab.app.worker_pool import worker_pool
from steerlab.learning.agents import (
    BallNeverReached,
    Episode,
    Judging,
    TaskEnv,
    demonstrate_offline,
    make_agent,
    teach_offline,
)
from steerlab.learning.mapper import LabelMapper
from steerlab.learning.policy_training import TrainingDiverged
from steerlab.sim.engine.gl import draw_without_threads
from steerlab.sim.files.run_folder import write_json
from steerlab.sim.progress import Progress, ShareProgress
from steerlab.sim.unusual_teachers import UnusualTeacher


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A teacher with one learner and learner seed: the least that is kept."""

    teacher: Person
    learner: str
    seed: int


@dataclass(frozen=True, kw_only=True)
class TaughtUnit:
    """What came of a unit, in plain values.

    Attributes:
        failed_demonstrations: before the one that reached the ball; None if none did.
        result: None where the teacher cannot be judged.
        left_out: why not.
    """

    unit: Unit
    failed_demonstrations: int | None
    result: dict[str, Any] | None
    left_out: str | None


class UnitRunner:
    """A task's environment and the mappers, kept from unit to unit.

    Args:
        folder: of the run; the first learner seed's policies go to its ``policies``.
    """

    def __init__(
        self, config: TeachConfig, mappers: Mapping[str, LabelMapper], folder: Path
    ) -> None:
        self._config, self._mappers, self._folder = config, mappers, folder
        self._env = TaskEnv(config.make_task(), seed=config.seed)
        self._judging: dict[int, Judging] = {}
        self._teacher = ""  # whose demonstrations are kept, by seed
        self._shown: dict[int, tuple[Episode, int]] = {}

    def run(self, unit: Unit, progress: ShareProgress) -> TaughtUnit:
        """Teach one learner.

        A teacher who cannot demonstrate, or whose labels make training diverge, is left out with
        the reason on record: the others' results do not depend on them.
        """
        failed = None
        try:
            demonstration, failed = self._demonstration(unit)
            result = self._teach(unit, demonstration, progress)
        except (BallNeverReached, TrainingDiverged) as error:
            return TaughtUnit(
                unit=unit, failed_demonstrations=failed, result=None, left_out=str(error)
            )
        return TaughtUnit(unit=unit, failed_demonstrations=failed, result=result, left_out=None)

    def close(self) -> None:
        """Free the environment."""
        self._env.close()

    def _demonstration(self, unit: Unit) -> tuple[Episode, int]:
        """All learners of a teacher and seed begin with the same."""
        if self._teacher != unit.teacher.name:
            self._teacher, self._shown = unit.teacher.name, {}
        if unit.seed not in self._shown:
            self._shown[unit.seed] = demonstrate_offline(
                self._env, unit.teacher, self._config.teaching, seed=unit.seed
            )
        return self._shown[unit.seed]

    def _teach(self, unit: Unit, demonstration: Episode, progress: ShareProgress) -> dict[str, Any]:
        first = unit.seed == 0
        try:
            learner, results = teach_offline(
                self._env,
                make_agent(unit.learner, self._mappers),
                unit.teacher,
                demonstration,
                self._judge(unit.seed),
                self._config.teaching,
                seed=unit.seed,
                progress=progress,
            )
        except TrainingDiverged as error:
            raise TrainingDiverged(f"{unit.learner}, learner seed {unit.seed}: {error}") from error
        if first:
            folder = self._folder / "policies" / unit.teacher.name
            keep_policies(learner.networks, folder, unit.learner)
        return {
            "by_round": [round_values(result) for result in results],
            "final_drives": final_drives(results),
            "frames": shown_frames(self._env, results[-1].episode) if first else [],
        }

    def _judge(self, seed: int) -> Judging:
        """The starts of a learner seed: the same for every teacher and condition."""
        if seed not in self._judging:
            starts = self._env.screened(self._config.starts, "judge", seed).starts
            self._judging[seed] = Judging(
                on_the_way=starts[: self._config.starts_on_the_way], at_the_end=starts
            )
        return self._judging[seed]


_OPEN: list[UnitRunner] = []  # of this worker process; made once, used for each of its teachers


def open_runner(config: TeachConfig, mappers: Mapping[str, LabelMapper], folder: Path) -> None:
    """Initialise a worker process."""
    torch.set_num_threads(1)
    _OPEN.append(UnitRunner(config, mappers, folder))


def run_unit(unit: Unit) -> TaughtUnit:
    """One unit, in a worker process."""
    return _OPEN[-1].run(unit, lambda share: None)


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
        WorkerLost: a process died; what was finished is kept.
        OutputError: a shard cannot be written.
    """
    if not units:
        return
    if jobs <= 1 or len(units) == 1:
        _run_here(config, prepared, units, out, progress)
        return
    progress("teaching", 0.0)
    draw_without_threads()  # the processes inherit it; here MuJoCo may have been imported
    runner = (config, prepared.mappers, out)
    with worker_pool(jobs, len(units), initializer=open_runner, initargs=runner) as pool:
        waiting = {pool.submit(run_unit, unit): unit for unit in units}
        for done, future in enumerate(as_completed(waiting), start=1):
            if not future.cancelled():
                taught = future.result()
                _keep(taught, out)
                if taught.left_out:
                    _cancel(waiting, taught.unit.teacher)
            progress("teaching", done / len(units))


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
