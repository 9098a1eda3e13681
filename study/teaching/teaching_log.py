"""What one participant taught in one phase: in the store, and its policies in the study's folder."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import pyarrow as pa
from safetensors import SafetensorError

from steerlab.learning.agents.contract import Episode
from steerlab.learning.agents.episode import decision_rows
from steerlab.learning.agents.evaluation import DriveResult
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching_contract import FinishedDrive, KeptRound, RoundResult
from steerlab.learning.policy import PolicyNetwork, load_policy, save_policy
from steerlab.learning.policy_training import TrainingRows
from steerlab.sim.files.whole_file import whole_file
from steerlab.sim.live_teacher import DriveContext
from steerlab.sim.rollout import Outcome
from steerlab.study.frozen_files import MODELS
from steerlab.study.store.records import Attempt, AttemptStatus
from steerlab.study.store.store import StudyStore
from steerlab.study.store.teaching import (
    StoredTargets,
    TaughtRound,
    Trial,
    insert_round,
    insert_trials,
    read_phase_run,
    read_targets,
    read_taught,
    read_tried,
)
from steerlab.study.teaching.episodes import episode_of, rerender_observations
from steerlab.study.teaching.request import TeachingError

POLICIES = f"{MODELS}/policies"
"""Folder of a study with every round's policy; erasing a participant finds them by their names."""
_OUTCOME = "outcome: "


def outcome_event(outcome: Outcome) -> str:
    """What is kept with an attempt, so that a crash right after it does not lose how it ended."""
    return f"{_OUTCOME}{outcome.value}"


class StudyTeachingLog:
    """A ``TeachingLog`` in a study; everything is on the disk when a method that writes returns.

    Args:
        env: draws again what the robot saw in a drive.
        mapper_sha256: of what maps the labels; None if nothing does.
    """

    def __init__(
        self,
        folder: Path,
        store: StudyStore,
        env: TaskEnv,
        *,
        participant: str,
        phase: str,
        condition: str,
        mapper_sha256: str | None,
    ) -> None:
        self._folder, self._store, self._env = folder, store, env
        self._participant, self._phase, self._condition = participant, phase, condition
        self._mapper_sha256 = mapper_sha256
        self._phase_run, self._first = read_phase_run(store.connection, participant, phase)

    def next_drive(self, number: int) -> DriveContext:
        """Named by phase, condition, task and round."""
        name, mine = self._name(number), self._mine()
        attempt = sum(one.rollout == name for one in mine)
        return self._env.context(name, number=number, order=len(mine), attempt=attempt)

    def left_over(self, number: int) -> FinishedDrive | None:
        """The last attempt at a round's drive, if it was finished.

        One that was finished before another was begun was to be done again, so it does not count.
        """
        name = self._name(number)
        mine = [a for a in self._mine() if a.rollout == name and a.order_index >= self._first]
        if mine and mine[-1].status is AttemptStatus.FINISHED:
            for event in self._store.events(mine[-1]):
                if event.what.startswith(_OUTCOME):
                    outcome = Outcome(event.what.removeprefix(_OUTCOME))
                    return FinishedDrive(
                        name=name,
                        number=number,
                        attempt=mine[-1].attempt,
                        outcome=outcome,
                        seen=None,
                    )
        return None

    def episode(self, drive: FinishedDrive) -> Episode:
        """From the rows of the attempt; what was seen before this run is drawn again."""
        steps = self._steps(drive.name, drive.attempt)
        seen = drive.seen or rerender_observations(self._env, steps)
        return episode_of(self._env, steps, seen, drive.outcome, drive.number)

    def rounds(self) -> list[KeptRound]:
        """Rounds that are done, in order."""
        tried = read_tried(self._store.connection, self._participant, self._phase)
        return [
            KeptRound(
                number=taught.round,
                evaluated=taught.round in tried,
                rows=lambda taught=taught: self._rows(taught),
                networks=lambda taught=taught: self._load(taught),
            )
            for taught in self._taught()
        ]

    def keep(self, result: RoundResult, networks: Sequence[PolicyNetwork]) -> None:
        """Policies first, then all that is known of the round at once: now it is done.

        Raises:
            TeachingError: the disk does not take the policies.
        """
        number, targets = result.round_number, result.targets
        taught = TaughtRound(
            participant=self._participant,
            phase=self._phase,
            phase_run=self._phase_run,
            condition=self._condition,
            round=number,
            rollout=result.drive.name,
            attempt=result.drive.attempt,
            outcome=result.outcome,
            labels_asked=result.labels_asked,
            label_mae=result.label_mae,
            given_mae=result.given_mae,
            teacher_s=result.teacher_seconds,
            switches=result.switches,
            loss=result.loss,
            training_s=result.training_s,
            policies=self._save(number, networks),
            mapper_sha256=self._mapper_sha256 if number else None,
        )
        rows = decision_rows(result.episode.rollout.steps)
        stored = StoredTargets(rows, targets.target, targets.weight, targets.asked)
        connection = self._store.connection
        with connection.transaction(f"keep round {number} of {self._phase!r}", durable=True):
            insert_round(connection, taught, stored)
            insert_trials(connection, taught, _trials(result.drives))

    def keep_drives(self, number: int, drives: Sequence[DriveResult]) -> None:
        """Keep how a round's policy drove."""
        (taught,) = (one for one in self._taught() if one.round == number)
        connection = self._store.connection
        with connection.transaction(f"keep trials of round {number}", durable=True):
            insert_trials(connection, taught, _trials(drives))

    def _save(self, number: int, networks: Sequence[PolicyNetwork]) -> dict[str, str]:
        """Write a round's policies.

        Returns:
            their hashes by file.

        Raises:
            TeachingError: the disk does not take them.
        """
        folder = self._folder / POLICIES
        stem = f"{self._participant}-{self._phase}-{self._phase_run}-r{number:02d}"
        kept: dict[str, str] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for member, network in enumerate(networks):
                path = folder / f"{stem}-{member}.safetensors"
                with whole_file(path) as part:
                    save_policy(network, part)
                    kept[f"{POLICIES}/{path.name}"] = sha256(part.read_bytes()).hexdigest()
        except (OSError, SafetensorError) as error:
            raise TeachingError(
                f"The policy of round {number} cannot be kept in {folder}: {error}. Free some room "
                f"and run the phase again: the drive is kept, and it is learnt from then."
            ) from error
        return kept

    def _load(self, taught: TaughtRound) -> list[PolicyNetwork]:
        """A round's policies.

        Raises:
            TeachingError: a file is missing or was changed.
        """
        found: list[PolicyNetwork] = []
        for name, digest in taught.policies.items():
            path = self._folder / name
            now = sha256(path.read_bytes()).hexdigest() if path.is_file() else "missing"
            if now != digest:
                raise TeachingError(
                    f"{path} is not the policy that round {taught.round} of {self._participant} "
                    f"left: its sha256 is {now}, it was {digest}. Restore it from the last copy of "
                    f"the study, or open the phase again with study redo."
                )
            found.append(load_policy(path))
        return found

    def _rows(self, taught: TaughtRound) -> TrainingRows | None:
        targets = read_targets(self._store.connection, taught)
        kept = targets.weight > 0.0
        if not kept.any():
            return None
        seen = rerender_observations(self._env, self._steps(taught.rollout, taught.attempt))
        return TrainingRows(seen.take(kept), targets.target[kept], targets.weight[kept])

    def _steps(self, rollout: str, attempt: int) -> pa.Table:
        found = [one for one in self._mine() if (one.rollout, one.attempt) == (rollout, attempt)]
        return self._store.steps(found[0])

    def _taught(self) -> list[TaughtRound]:
        return read_taught(self._store.connection, self._participant, self._phase)

    def _mine(self) -> list[Attempt]:
        return [one for one in self._store.attempts() if one.participant == self._participant]

    def _name(self, number: int) -> str:
        """Of a round's drive in the store."""
        return f"{self._phase}-{self._condition}-{self._env.task.name}-r{number:02d}"


def _trials(drives: Sequence[DriveResult]) -> list[Trial]:
    return [
        Trial(start=start, outcome=one.outcome, final_distance_m=one.final_distance_m)
        for start, one in enumerate(drives)
    ]
