"""The learner behind every condition: one or more policies, and the doubt its gate asks for.

Doubt is the spread of the policies, how new a row is, or how likely the policy is to err on it.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray

from steerlab.learning.policy import (
    Observations,
    PolicyConfig,
    PolicyNetwork,
    decide,
    hidden_features,
    stack,
)
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows, train_policy
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.progress import ShareProgress, no_progress

APART = 1  # decisions: what changes from one to the next in a drive is not new yet
MOST_ROWS = 4000  # the newest; a tree of more slows a drive down
UNSAFE_WHEEL = 0.5  # an error larger than this is unsafe
PENALTY = 1.0
_NEWTON_STEPS = 15
Doubts = Literal["none", "spread", "novelty", "risk", "safety"]
LEARNT_WHEEL = 0.5  # an error up to which a row counts as learnt, for the doubt ``risk``
SPREAD_WHEEL = 0.35  # standard deviation among policies at which doubt is 1


class Novelty:
    """One class by nearest neighbours; after Chernova & Veloso (2009).

    Distance is measured in units of how much features change within ``APART`` decisions of the
    first drive, the median. How far drives are from each other would be no measure: it grows with
    every odd drive, until nothing is new.

    Args:
        drives: (rows, size) features of each drive learned from; of the first every decision, in
            order.
        known: (rows,) of each drive, which rows count as known; None: all.
    """

    def __init__(
        self, drives: Sequence[FloatArray], known: Sequence[BoolArray] | None = None
    ) -> None:
        from scipy.spatial import KDTree

        rows = np.concatenate(list(drives))
        counts = np.concatenate(list(known)) if known is not None else np.ones(len(rows), bool)
        self._scale = rows.std(axis=0) + 1e-3
        self._limit = _change(drives[0] / self._scale)
        kept = rows[counts][-MOST_ROWS:]
        self._tree = KDTree(kept / self._scale) if len(kept) else None

    def __call__(self, features: FloatArray) -> FloatArray:
        """(rows, size) -> (rows,): distance over its unit; infinite where nothing is known."""
        if self._tree is None or not self._limit > 0.0:
            return np.full(len(features), np.inf)
        distance, _ = self._tree.query(features / self._scale)
        return np.asarray(distance) / self._limit


def _change(drive: FloatArray) -> float:
    """Median distance between rows ``APART`` of each other; 0 if the drive is too short."""
    if len(drive) <= APART:
        return 0.0
    return float(np.median(np.linalg.norm(drive[APART:] - drive[:-APART], axis=1)))


class SafetyModel:
    """Logistic regression of "error above ``UNSAFE_WHEEL``" on the policy's features.

    Args:
        features: (rows, size) of rows the teacher labelled, as the present policy sees them.
        error: (rows,) of the policy that drove there, before it learned them.
    """

    def __init__(self, features: FloatArray, error: FloatArray) -> None:
        unsafe = np.abs(error) > UNSAFE_WHEEL
        self._always = bool(unsafe.all()) or not unsafe.any()
        self._unsafe_everywhere = bool(unsafe.all())
        self._centre, self._scale = features.mean(axis=0), features.std(axis=0) + 1e-3
        self._weight = np.zeros(features.shape[1] + 1)
        if not self._always:
            self._weight = _logistic(self._inputs(features), unsafe)

    def __call__(self, features: FloatArray) -> FloatArray:
        """Odds of being unsafe, (rows,); above 1 it is more likely than not."""
        if self._always:
            return np.full(len(features), np.inf if self._unsafe_everywhere else 0.0)
        return np.exp(np.clip(self._inputs(features) @ self._weight, -30.0, 30.0))

    def _inputs(self, features: FloatArray) -> FloatArray:
        scaled = (features - self._centre) / self._scale
        return np.column_stack([scaled, np.ones(len(features))])


def _logistic(inputs: FloatArray, unsafe: NDArray[np.bool_]) -> FloatArray:
    """Newton's method on the penalised likelihood."""
    weight = np.zeros(inputs.shape[1])
    for _ in range(_NEWTON_STEPS):
        odds = np.clip(inputs @ weight, -30.0, 30.0)
        chance = torch.sigmoid(torch.from_numpy(odds)).numpy()
        slope = inputs.T @ (chance - unsafe) + PENALTY * weight
        curve = (inputs * (chance * (1.0 - chance))[:, None]).T @ inputs
        weight = weight - np.linalg.solve(curve + PENALTY * np.eye(len(weight)), slope)
    return weight


class PolicyLearner:
    """A ``Learner`` with warm weights: each round trains on from where the last one stopped.

    Args:
        seed: of weights and batches; equal for every condition that is compared.
        members: policies; what it does is their mean.
        doubts: ``spread`` of the members over ``SPREAD_WHEEL``, ``novelty``, ``risk`` (of what
            is new or not learnt yet) or ``safety`` of the first member's features.
    """

    def __init__(
        self,
        seed: int,
        *,
        members: int = 1,
        doubts: str = "none",
        policy: PolicyConfig | None = None,
        training: PolicyTrainingConfig | None = None,
    ) -> None:
        if members < 1 or (doubts == "spread" and members < 2):
            raise InvalidConfig(f"{members} policies cannot have doubt {doubts!r}; give more.")
        if doubts not in get_args(Doubts):
            raise InvalidConfig(
                f"doubts is {doubts!r}; choose one of {', '.join(get_args(Doubts))}."
            )
        self._doubts = doubts
        self._training = training or PolicyTrainingConfig()
        config = policy or PolicyConfig()
        self.networks: list[PolicyNetwork] = [
            PolicyNetwork(config, torch.Generator().manual_seed(1000 * seed + member))
            for member in range(members)
        ]
        self._rngs = [np.random.default_rng([seed, member, 0x7EA]) for member in range(members)]
        self._novelty: Novelty | None = None
        self._safety: SafetyModel | None = None
        self._errors: list[FloatArray] = []  # of each episode, by the policy before it learned it

    def load(self, networks: Sequence[PolicyNetwork]) -> None:
        """Copy other networks' weights; the fitted doubt stays as it was."""
        for mine, other in zip(self.networks, networks, strict=True):
            mine.load_state_dict(other.state_dict())

    def act(self, seen: Observations) -> FloatArray:
        """The members' mean wheel, (rows,)."""
        return np.mean([decide(network, seen) for network in self.networks], axis=0)

    def doubt(self, seen: Observations) -> FloatArray:
        """Doubt of each row, (rows,); infinite before the first ``train``.

        Raises:
            InvalidConfig: this learner was made without doubt.
        """
        if self._doubts == "none":
            raise InvalidConfig("This learner has no doubt; give doubts='novelty' or another.")
        if self._doubts == "spread":
            wheels = [decide(network, seen) for network in self.networks]
            return np.std(wheels, axis=0) / SPREAD_WHEEL
        judge = self._safety if self._doubts == "safety" else self._novelty
        if judge is None:
            return np.full(len(seen), np.inf)
        return judge(hidden_features(self.networks[0], seen))

    def _learnt(self, episode: TrainingRows) -> BoolArray:
        """(rows,) True where the policy now does what it was taught."""
        return np.abs(self.act(episode.seen) - episode.target) <= LEARNT_WHEEL

    def train(
        self, episodes: Sequence[TrainingRows], progress: ShareProgress = no_progress
    ) -> float:
        """Learn from all episodes, then refit the doubt; the members' last mean loss.

        Raises:
            TrainingDiverged: the loss is not finite.
        """
        if self._doubts == "safety":
            for episode in episodes[len(self._errors) :]:
                self._errors.append(self.act(episode.seen) - episode.target)
        rows = TrainingRows(
            stack([episode.seen for episode in episodes]),
            np.concatenate([episode.target for episode in episodes]),
            np.concatenate([episode.weight for episode in episodes]),
        )
        members = len(self.networks)
        losses = [
            train_policy(
                network,
                rows,
                rng,
                self._training,
                lambda share, done=done: progress((done + share) / members),
            )
            for done, (network, rng) in enumerate(zip(self.networks, self._rngs, strict=True))
        ]
        if self._doubts in ("novelty", "risk"):
            drives = [hidden_features(self.networks[0], episode.seen) for episode in episodes]
            learnt = None if self._doubts == "novelty" else [*map(self._learnt, episodes)]
            self._novelty = Novelty(drives, learnt)
        elif self._doubts == "safety":
            self._safety = SafetyModel(
                hidden_features(self.networks[0], rows.seen), np.concatenate(self._errors)
            )
        return float(np.mean(losses))
