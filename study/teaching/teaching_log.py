"""What one participant taught in one phase: in the store, and its policies in the study's folder."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import pyarrow as pa
from safetensors import SafetensorError

from steerlab.learning.policy import PolicyNetwork, load_policy, save_policy
from steerlab.sim.files.whole_file import whole_file
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
    read_occasion,
    read_targets,
    read_taught,
    read_tried,
)
from steerlab.study.teaching.errors import TeachingError

POLICIES = f"{MODELS}/policies"
"""Folder of a study with every round's policy; erasing a participant finds them by their names."""
_OUTCOME = "outcome: "


def outcome_event(outcome: Outcome) -> str:
    """What is kept with an attempt, so that a crash right after it does not lose how it ended."""
    return f"{_OUTCOME}{outcome.value}"


class TeachingLog:
    """Reads and writes them; everything is on the disk when a method that writes returns.

    Attributes:
        occasion: how often the phase was reopened.
    """

    def __init__(self, folder: Path, store: StudyStore, participant: str, phase: str) -> None:
        self._folder, self._store = folder, store
        self.participant, self.phase = participant, phase
        self.occasion, self._first = read_occasion(store.connection, participant, phase)

    def taught(self) -> list[TaughtRound]:
        """Rounds that are done, in order."""
        return read_taught(self._store.connection, self.participant, self.phase)

    def tried(self) -> set[int]:
        """Rounds whose policies were tried."""
        return read_tried(self._store.connection, self.participant, self.phase)

    def targets(self, taught: TaughtRound) -> StoredTargets:
        """What was imitated in a round."""
        return read_targets(self._store.connection, taught)

    def attempts(self, rollout: str) -> int:
        """How many attempts the participant made at a drive, whatever became of them."""
        return sum(one.rollout == rollout for one in self._mine())

    def left_over(self, rollout: str) -> tuple[Attempt, Outcome] | None:
        """The last attempt at a drive, if it was finished, and how it ended.

        One that was finished before another was begun was to be done again, so it does not count.
        """
        mine = [a for a in self._mine() if a.rollout == rollout and a.order_index >= self._first]
        if mine and mine[-1].status is AttemptStatus.FINISHED:
            for event in self._store.events(mine[-1]):
                if event.what.startswith(_OUTCOME):
                    return mine[-1], Outcome(event.what.removeprefix(_OUTCOME))
        return None

    def steps(self, rollout: str, attempt: int) -> pa.Table:
        """The rows of an attempt."""
        found = [one for one in self._mine() if (one.rollout, one.attempt) == (rollout, attempt)]
        return self._store.steps(found[0])

    def save(self, number: int, networks: Sequence[PolicyNetwork]) -> dict[str, str]:
        """Write a round's policies.

        Returns:
            their hashes by file.

        Raises:
            TeachingError: the disk does not take them.
        """
        folder = self._folder / POLICIES
        stem = f"{self.participant}-{self.phase}-{self.occasion}-r{number:02d}"
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

    def load(self, taught: TaughtRound) -> list[PolicyNetwork]:
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
                    f"{path} is not the policy that round {taught.round} of {self.participant} "
                    f"left: its sha256 is {now}, it was {digest}. Restore it from the last copy of "
                    f"the study, or open the phase again with study redo."
                )
            found.append(load_policy(path))
        return found

    def keep(self, taught: TaughtRound, targets: StoredTargets, trials: Sequence[Trial]) -> None:
        """Keep a round: it is done when this returns."""
        connection = self._store.connection
        act = f"keep round {taught.round} of {taught.phase!r}"
        with connection.transaction(act, durable=True):
            insert_round(connection, taught, targets)
            insert_trials(connection, taught, trials)

    def keep_trials(self, taught: TaughtRound, trials: Sequence[Trial]) -> None:
        """Keep how a round's policy drove."""
        connection = self._store.connection
        with connection.transaction(f"keep trials of round {taught.round}", durable=True):
            insert_trials(connection, taught, trials)

    def _mine(self) -> list[Attempt]:
        return [one for one in self._store.attempts() if one.participant == self.participant]
