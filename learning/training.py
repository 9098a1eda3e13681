"""Training MIND MELD: network and embeddings together (paper, section Variational Inference)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, isfinite, pi

import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.windows import Windows
from steerlab.sim.errors import InvalidConfig

# Departures from the paper, which sums the two losses of Eq. 2 (weight 1), trains everything at one
# rate of 1e-3 and gives neither batch, length nor schedule. Weight 0.01 maps no better than 0.1 and
# lays styles out less linearly (gain probe R² .86-.95 against .95-.97, tuning seeds); 1 shrinks w.
EMBEDDING_LOSS_WEIGHT = 0.1
EMBEDDING_RATE_FACTOR = 20.0  # a person's w sees 1/34 of the windows that a weight sees
SHARE_PER_EPOCH = 0.15  # windows at 20 Hz overlap their neighbours by all but a step


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How to train; the defaults are the ``lab`` preset.

    Attributes:
        rate: learning rate of the network, falling to 0 along a cosine.
        embedding_rate_factor: the embeddings' rate as a multiple of ``rate``.
        embedding_loss_weight: lambda before ``(w_hat - w)²`` of Eq. 2.
        share_per_epoch: windows drawn anew for each epoch.
        threads: torch threads while training and calibrating; another number gives other last
            bits. A second thread gains a third on an idle machine and loses tenfold on a busy one.
    """

    epochs: int = 60
    batch_size: int = 512
    rate: float = 1e-2
    embedding_rate_factor: float = EMBEDDING_RATE_FACTOR
    embedding_loss_weight: float = EMBEDDING_LOSS_WEIGHT
    share_per_epoch: float = SHARE_PER_EPOCH
    cosine: bool = True
    threads: int = 1

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not isfinite(value) or (
                value <= 0 and name not in ("embedding_loss_weight", "cosine")
            ):
                raise InvalidConfig(f"TrainingConfig.{name} is {value}; it must be positive.")
        if self.embedding_loss_weight < 0.0:
            raise InvalidConfig(
                f"embedding_loss_weight is {self.embedding_loss_weight}; it must not be negative."
            )
        if self.share_per_epoch > 1.0:
            raise InvalidConfig(f"share_per_epoch is {self.share_per_epoch}; a share is at most 1.")


@dataclass(frozen=True, slots=True)
class LossParts:
    """Eq. 2 by its parts; ``total = difference + lambda * embedding``."""

    total: Tensor
    difference: Tensor
    embedding: Tensor


@dataclass(frozen=True, slots=True, eq=False)
class TrainedMindMeld:
    """What training leaves.

    Attributes:
        embeddings: (people, d), w of each person, in the order of ``Windows.people``.
        history: mean (difference, embedding) loss of each epoch.
    """

    network: MindMeld
    embeddings: Tensor
    history: tuple[tuple[float, float], ...]


def mind_meld_loss(
    network: MindMeld,
    inputs: Tensor,
    difference: Tensor,
    embedding: Tensor,
    weight: float,
    generator: torch.Generator,
) -> LossParts:
    """Eq. 2 over a batch, with a reparameterised sample w_hat from g.

    Args:
        network: encoder, f and g.
        inputs: (batch, window, channels).
        difference: (batch,), the true ``a - o``.
        embedding: (batch, d), w of the person of each window; not detached in the second term.
        weight: lambda.
        generator: draws the sample.
    """
    encoding = network.encoder(inputs)
    predicted = network.difference(encoding, embedding)
    mean, log_sigma = network.inference(encoding, predicted)
    noise = torch.randn(mean.shape, generator=generator)
    sampled = mean + log_sigma.exp() * noise  # w_hat
    difference_loss = (predicted - difference).square().mean()
    embedding_loss = (sampled - embedding).square().mean()
    return LossParts(
        total=difference_loss + weight * embedding_loss,
        difference=difference_loss,
        embedding=embedding_loss,
    )


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Run with a fixed number of torch threads, then restore the caller's."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def train(
    windows: Windows,
    network_config: NetworkConfig,
    config: TrainingConfig,
    seed: int,
    on_epoch: Callable[[int, int], None] | None = None,
) -> TrainedMindMeld:
    """Learn the network and everyone's embedding from the valid windows.

    Args:
        windows: of the training people.
        network_config: sizes.
        config: rates, loss weight, length.
        seed: of weights, embeddings, batches and samples; same seed, same machine, same numbers.
        on_epoch: called with (epochs done, epochs).

    Raises:
        InvalidLabels: someone has no valid window.
    """
    rows = torch.nonzero(windows.valid).squeeze(1)
    counts = torch.bincount(windows.person[rows], minlength=len(windows.people))
    for person, count in zip(windows.people, counts.tolist(), strict=True):
        if count == 0:
            raise InvalidLabels(f"{person!r} has no valid label to train on; leave them out.")
    inputs, person = windows.inputs[rows], windows.person[rows]
    difference = windows.difference[rows]

    generator = torch.Generator().manual_seed(seed)
    network = MindMeld(network_config, generator)
    shape = (len(windows.people), network_config.embedding_size)
    embeddings = torch.randn(shape, generator=generator).requires_grad_()
    optimizer = torch.optim.Adam(
        [
            {"params": list(network.parameters()), "lr": config.rate},
            {"params": [embeddings], "lr": config.rate * config.embedding_rate_factor},
        ],
        fused=True,
    )
    per_epoch = max(1, round(config.share_per_epoch * len(rows)))
    batches = -(-per_epoch // config.batch_size)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda step: _rate_factor(step, config.epochs * batches, config)
    )
    history: list[tuple[float, float]] = []
    with torch_threads(config.threads):
        for epoch in range(config.epochs):
            drawn = torch.randperm(len(rows), generator=generator)[:per_epoch]
            sums = torch.zeros(2)
            for batch in drawn.split(config.batch_size):
                loss = mind_meld_loss(
                    network,
                    inputs[batch],
                    difference[batch],
                    embeddings[person[batch]],
                    config.embedding_loss_weight,
                    generator,
                )
                optimizer.zero_grad()
                loss.total.backward()
                optimizer.step()
                schedule.step()
                sums += torch.stack([loss.difference, loss.embedding]).detach()
            history.append((float(sums[0] / batches), float(sums[1] / batches)))
            if on_epoch is not None:
                on_epoch(epoch + 1, config.epochs)
    network.requires_grad_(False)
    return TrainedMindMeld(network, embeddings.detach(), tuple(history))


def _rate_factor(step: int, steps: int, config: TrainingConfig) -> float:
    return 0.5 * (1.0 + cos(pi * step / steps)) if config.cosine else 1.0
