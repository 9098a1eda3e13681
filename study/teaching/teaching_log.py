"""What one participant taught in one phase, kept in the store; policies are files beside it."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
import pyarrow as pa

from steerlab.learning.agents.contract import Episode
from steerlab.learning.agents.episode import decision_rows, make_episode, make_rollout
from steerlab.learning.agents.evaluation import DriveResult
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching_contract import FinishedDrive, KeptRound, RoundResult
from steerlab.learning.policy import (
    Observations,
    PolicyNetwork,
    load_policy,
    pool_frame,
    save_policy,
)
from steerlab.learning.policy_training import TrainingRows
from steerlab.sim.arrays import FloatArray
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.whole_file import whole_file
from steerlab.sim.live_teacher import DriveContext
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome
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
from steerlab.study.study_folder import MODELS
from steerlab.study.teaching.contract import TeachingError

POLICIES = f"{MODELS}/policies"
"""Subfolder of every round's policies; a participant's are found by their names and erased."""
_OUTCOME = "outcome: "
_POSE = ("x_m", "y_m", "heading_rad")
_VELOCITY = ("speed_mps", "lateral_speed_mps", "yaw_rate_radps")
_ACCELERATION = ("acceleration_x_mps2", "acceleration_y_mps2")


def outcome_event(outcome: Outcome) -> str:
    """The event kept with an attempt, so that a crash right after it does not lose its outcome."""
    return f"{_OUTCOME}{outcome.value}"


class StudyTeachingLog:
    """A ``TeachingLog`` in a study; everything is on the disk when a method that writes returns.

    Args:
        env: to draw again what the robot saw in a drive.
        mapper_sha256: of the mapper's file; None if labels are not mapped.
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
        """The context of a round's next attempt."""
        name, attempts = self._name(number), self._attempts()
        attempt = sum(earlier.rollout == name for earlier in attempts)
        return self._env.context(name, number=number, order=len(attempts), attempt=attempt)

    def left_over(self, number: int) -> FinishedDrive | None:
        """The last attempt at a round's drive, if it was finished.

        An earlier finished attempt was to be done again, so it does not count.
        """
        name = self._name(number)
        attempts = [a for a in self._attempts() if a.rollout == name]
        attempts = [a for a in attempts if a.order_index >= self._first]
        if not attempts or attempts[-1].status is not AttemptStatus.FINISHED:
            return None
        for event in self._store.events(attempts[-1]):
            if event.what.startswith(_OUTCOME):
                return FinishedDrive(
                    name=name,
                    number=number,
                    attempt=attempts[-1].attempt,
                    outcome=Outcome(event.what.removeprefix(_OUTCOME)),
                    seen=None,
                )
        return None

    def episode(self, drive: FinishedDrive) -> Episode:
        """The drive as an episode; what the robot saw is drawn again if it is not at hand."""
        steps = self._steps(drive.name, drive.attempt)
        seen = drive.seen or rerender_observations(self._env, steps)
        return episode_of(self._env, steps, seen, drive.outcome, drive.number)

    def rounds(self) -> list[KeptRound]:
        """The rounds that are done, in order."""
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
        """Keep a round: its policies first, then all the rest at once, which makes it done.

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
        (taught,) = (taught for taught in self._taught() if taught.round == number)
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
        except OSError as error:
            raise TeachingError(
                f"The policy of round {number} cannot be kept in {folder}: "
                f"{refusal(error, 'make the folder writable')}. Then run the phase again: the drive "
                f"is kept, and it is learnt from then."
            ) from error
        return kept

    def _load(self, taught: TaughtRound) -> list[PolicyNetwork]:
        """A round's policies.

        Raises:
            TeachingError: a file is missing or was changed.
        """
        networks: list[PolicyNetwork] = []
        for name, digest in taught.policies.items():
            path = self._folder / name
            now = sha256(path.read_bytes()).hexdigest() if path.is_file() else "missing"
            if now != digest:
                raise TeachingError(
                    f"{path} is not the policy that round {taught.round} of {self._participant} "
                    f"left: its sha256 is {now}, it was {digest}. Restore it from the last copy of "
                    f"the study, or open the phase again with study redo."
                )
            networks.append(load_policy(path))
        return networks

    def _rows(self, taught: TaughtRound) -> TrainingRows | None:
        """What a round taught, as rows to train on; None if nothing has weight."""
        targets = read_targets(self._store.connection, taught)
        kept = targets.weight > 0.0
        if not kept.any():
            return None
        seen = rerender_observations(self._env, self._steps(taught.rollout, taught.attempt))
        return TrainingRows(seen.take(kept), targets.target[kept], targets.weight[kept])

    def _steps(self, rollout: str, attempt: int) -> pa.Table:
        key = (self._participant, rollout, attempt)
        return self._store.steps(next(a for a in self._attempts() if a.key == key))

    def _taught(self) -> list[TaughtRound]:
        return read_taught(self._store.connection, self._participant, self._phase)

    def _attempts(self) -> list[Attempt]:
        """All attempts of the participant, in order."""
        return [a for a in self._store.attempts() if a.participant == self._participant]

    def _name(self, number: int) -> str:
        """The name of a round's drive in the store."""
        return f"{self._phase}-{self._condition}-{self._env.task.name}-r{number:02d}"


def _trials(drives: Sequence[DriveResult]) -> list[Trial]:
    return [
        Trial(start=start, outcome=drive.outcome, final_distance_m=drive.final_distance_m)
        for start, drive in enumerate(drives)
    ]


def rerender_observations(env: TaskEnv, steps: pa.Table) -> Observations:
    """What the robot saw at each decision of a drive, drawn again from the stored poses."""
    rows = decision_rows(steps.num_rows)
    images = []
    for pose in _columns(steps, _POSE)[rows]:
        env.driving.data.qpos[:3] = pose
        images.append(pool_frame(env.frame()))
    motion = _columns(steps, (*_VELOCITY, *_ACCELERATION))[rows]
    return Observations(np.stack(images), motion.astype(np.float32))


def episode_of(
    env: TaskEnv, steps: pa.Table, seen: Observations, outcome: Outcome, number: int
) -> Episode:
    """The episode of a finished attempt; its truth is the stored oracle label of each step.

    Args:
        steps: the attempt's rows in the store.
        number: of the round; 0 is the first demonstration.
    """
    given = np.where(steps["label_valid"].to_numpy(), _values(steps, "teacher_label"), np.nan)
    rollout = make_rollout(
        env,
        steps["rollout"][0].as_py(),
        outcome,
        pose=_columns(steps, _POSE),
        velocity=_columns(steps, _VELOCITY),
        acceleration=_columns(steps, _ACCELERATION),
        robot_wheel=_values(steps, "robot_wheel"),
        truth=_values(steps, "oracle_label"),
        physics_state=np.zeros((steps.num_rows, 0)),
    )
    return make_episode(
        rollout,
        teacher_wheel=given,
        teacher_drives=np.array(steps["gate"].to_pylist()) == Driver.TEACHER.value,
        feedback=given,
        seen=seen,
        number=number,
        person=steps["participant"][0].as_py(),
    )


def _values(steps: pa.Table, name: str) -> FloatArray:
    """A column as floats, (steps,); null becomes NaN."""
    return steps[name].to_numpy().astype(np.float64)


def _columns(steps: pa.Table, names: tuple[str, ...]) -> FloatArray:
    """Several columns, (steps, names)."""
    return np.column_stack([_values(steps, name) for name in names])
