"""One teacher's whole comparison, in one process and on one thread."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from steerlab.learning.agents import (
    BallNeverReached,
    Episode,
    Judging,
    Stage,
    demonstrate,
    make_agent,
    teach,
)
from steerlab.learning.mapper import LabelMapper
from steerlab.learning.policy_training import TrainingDiverged
from steerlab.sim.unusual_teachers import UnusualTeacher
from steerlab.teleop.teach_config import TeachConfig
from steerlab.teleop.teach_people import Person
from steerlab.teleop.teach_shards import (
    SHARD_SCHEMA,
    final_drives,
    keep_policies,
    missing_learners,
    read_shard,
    round_values,
    shown_frames,
    write_json,
)


class Workshop:
    """A stage and the mappers, kept from teacher to teacher.

    Args:
        folder: of the run; shards go to ``teachers``, the first seed's policies to ``policies``.
    """

    def __init__(
        self, config: TeachConfig, mappers: Mapping[str, LabelMapper], folder: Path
    ) -> None:
        self._config, self._mappers, self._folder = config, mappers, folder
        self._stage = Stage(config.make_task(), seed=config.seed)
        self._judging: dict[int, Judging] = {}

    def run(self, teacher: Person, progress: Callable[[float], None]) -> None:
        """Teach whatever learners the teacher's shard lacks, and keep it after each.

        A teacher who cannot demonstrate, or whose labels make training diverge, is left out with
        the reason on record: the others' results do not depend on them.
        """
        path = shard_path(self._folder, teacher.name)
        shard = read_shard(path) if path.is_file() else self._fresh(teacher)
        try:
            self._teach(teacher, shard, progress)
        except (BallNeverReached, TrainingDiverged) as error:
            shard["left_out"] = str(error)
            write_json(shard, path, indent=None)

    def close(self) -> None:
        """Free the stage."""
        self._stage.close()

    def _fresh(self, teacher: Person) -> dict[str, Any]:
        return {
            "schema": SHARD_SCHEMA,
            "teacher": teacher.name,
            **_describe(teacher),
            "left_out": None,
            "failed_demonstrations": [],
            "conditions": {},
        }

    def _teach(
        self, teacher: Person, shard: dict[str, Any], progress: Callable[[float], None]
    ) -> None:
        config, stage = self._config, self._stage
        seeds = range(config.learner_seeds)
        shown = [demonstrate(stage, teacher, config.teaching, seed=seed) for seed in seeds]
        shard["failed_demonstrations"] = [failed for _, failed in shown]
        names = missing_learners(shard, config.learners)
        whole = len(names) * len(seeds)
        for row, name in enumerate(names):
            taught: list[dict[str, Any]] = []
            for seed, (demonstration, _) in zip(seeds, shown, strict=True):
                done = row * len(seeds) + seed
                taught.append(
                    self._teach_one(
                        teacher,
                        name,
                        demonstration,
                        seed,
                        lambda share, done=done: progress((done + share) / whole),
                    )
                )
            shard["conditions"][name] = taught
            write_json(shard, shard_path(self._folder, teacher.name), indent=None)

    def _teach_one(
        self,
        teacher: Person,
        name: str,
        demonstration: Episode,
        seed: int,
        progress: Callable[[float], None],
    ) -> dict[str, Any]:
        try:
            learner, results = teach(
                self._stage,
                make_agent(name, self._mappers),
                teacher,
                demonstration,
                self._judge(seed),
                self._config.teaching,
                seed=seed,
                progress=progress,
            )
        except TrainingDiverged as error:
            raise TrainingDiverged(f"{name}, learner seed {seed}: {error}") from error
        if seed == 0:
            folder = self._folder / "policies" / teacher.name
            keep_policies(learner.networks, folder, name)
        return {
            "by_round": [round_values(result) for result in results],
            "final_drives": final_drives(results),
            "frames": shown_frames(self._stage, results[-1].episode) if seed == 0 else [],
        }

    def _judge(self, seed: int) -> Judging:
        """The starts of a learner seed: the same for every teacher and condition."""
        if seed not in self._judging:
            starts = self._stage.screened(self._config.starts, "judge", seed).starts
            self._judging[seed] = Judging(
                on_the_way=starts[: self._config.starts_on_the_way], at_the_end=starts
            )
        return self._judging[seed]


def shard_path(folder: Path, teacher: str) -> Path:
    """Where a teacher's results are kept."""
    return folder / "teachers" / f"{teacher}.json"


_OPEN: list[Workshop] = []  # of this worker process; made once, used for each of its teachers


def open_workshop(config: TeachConfig, mappers: Mapping[str, LabelMapper], folder: Path) -> None:
    """Initialise a worker process."""
    torch.set_num_threads(1)
    _OPEN.append(Workshop(config, mappers, folder))


def run_teacher(teacher: Person) -> str:
    """One teacher in a worker process; the name of whoever is done."""
    _OPEN[-1].run(teacher, lambda share: None)
    return teacher.name


def _describe(teacher: Person) -> dict[str, Any]:
    if isinstance(teacher, UnusualTeacher):
        return {"style": asdict(teacher.scripted.style), "quirk": repr(teacher.quirk)}
    return {"style": asdict(teacher.style), "quirk": None}
