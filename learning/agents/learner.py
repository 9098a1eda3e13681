"""The learner behind every condition: one or more policies, and the doubt its gate asks for."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import torch

from steerlab.learning.agents.novelty import Novelty
from steerlab.learning.agents.safety import SafetyModel
from steerlab.learning.policy import (
    Observations,
    PolicyConfig,
    PolicyNetwork,
    decide,
    hidden_features,
    stack,
)
from steerlab.learning.policy_training import (
    PolicyTrainingConfig,
    Progress,
    TrainingRows,
    no_progress,
    train_policy,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import BoolArray

Doubts = Literal["none", "spread", "novelty", "risk", "safety"]
LEARNT_WHEEL = 0.5  # an error up to which a row counts as learnt, for the doubt ``risk``
SPREAD_WHEEL = 0.35  # standard deviation among policies at which doubt is 1


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
        """Take over other networks' weights; what it doubts by stays as it was."""
        for mine, other in zip(self.networks, networks, strict=True):
            mine.load_state_dict(other.state_dict())

    def act(self, seen: Observations) -> FloatArray:
        """The members' mean wheel, (rows,)."""
        return np.mean([decide(network, seen) for network in self.networks], axis=0)

    def doubt(self, seen: Observations) -> FloatArray:
        """(rows,); before the first ``train`` everything is doubtful.

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
        """(rows,) where the policy does by now what it was taught."""
        return np.abs(self.act(episode.seen) - episode.target) <= LEARNT_WHEEL

    def train(self, episodes: Sequence[TrainingRows], progress: Progress = no_progress) -> float:
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
