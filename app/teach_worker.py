"""One teacher with one learner and learner seed, in one process and on one thread."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from steerlab.app.teach_config import TeachConfig
from steerlab.app.teach_people import Person
from steerlab.app.teach_shards import final_drives, keep_policies, round_values, shown_frames
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

    def run(self, unit: Unit, progress: Callable[[float], None]) -> TaughtUnit:
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

    def _teach(
        self, unit: Unit, demonstration: Episode, progress: Callable[[float], None]
    ) -> dict[str, Any]:
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
