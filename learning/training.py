"""Training MIND MELD: network and embeddings together (paper, section Variational Inference)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, isfinite, pi

import torch
from torch import Tensor
from torch.nn.functional import huber_loss

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
# The paper does not name the loss between d and its prediction; a square is the natural reading and
# what ``paper`` takes. Saturated labels leave errors that no w explains: 59.7 / 57.0 % with a linear
# tail against 58.8 / 56.2 % (tuning seeds, human noise), and the probes read w no worse.
HUBER = 0.3
# Mirrored people are not in the paper either. All people label the same few drives, which the
# network learns by heart; mirrored drives are new ones. Tuning seeds, human noise, seen / new
# people: 56.6 / 53.6 % without, 58.8 / 56.2 % with.
_MOST_THREADS = 1024


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How to train; the defaults are the ``lab`` preset.

    Attributes:
        rate: learning rate of the network, falling to 0 along a cosine.
        embedding_rate_factor: the embeddings' rate as a multiple of ``rate``.
        embedding_loss_weight: lambda before ``(w_hat - w)²`` of Eq. 2.
        share_per_epoch: windows drawn anew for each epoch.
        least_per_epoch: as many are drawn at least, if there are: a study of few people needs as
            many steps as one of many.
        mirror: half of the windows are seen left for right, as labels of a second person whom
            nobody is: their mirror image, with an embedding of their own.
        sampled: w_hat is a sample of what g says, as the paper has it; else its mean, and g's
            sigma is then never learned.
        uniform_start: everyone's w is first drawn from [0, 1), as in the authors' code; else from
            a standard normal distribution.
        least_factor: a small table gets so many times ``training_budget.LEAST_TRAINING_STEPS``.
        longer_if_clean: a table of clean labels is trained longer (``training_budget``).
        huber: error in wheel units from which the difference loss grows linearly; None squares.
        threads: torch's, for a batch. Other numbers round otherwise, so what is learnt repeats, bit
            for bit, with the same number on the same machine.
    """

    epochs: int = 60
    batch_size: int = 512
    rate: float = 1e-2
    embedding_rate_factor: float = EMBEDDING_RATE_FACTOR
    embedding_loss_weight: float = EMBEDDING_LOSS_WEIGHT
    share_per_epoch: float = SHARE_PER_EPOCH
    least_per_epoch: int = 10_000
    cosine: bool = True
    mirror: bool = True
    sampled: bool = True
    uniform_start: bool = False
    least_factor: int = 1
    longer_if_clean: bool = True
    huber: float | None = HUBER
    threads: int = 1

    def drawn_per_epoch(self, windows: int) -> int:
        """How many of the valid windows an epoch draws."""
        return min(windows, max(self.least_per_epoch, round(self.share_per_epoch * windows)))

    def steps(self, windows: int) -> int:
        """Gradient steps on a table of so many valid windows."""
        return self.epochs * -(-self.drawn_per_epoch(windows) // self.batch_size)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is None and name == "huber":
                continue
            may_be_zero = name == "embedding_loss_weight" or isinstance(value, bool)
            if value is None or not isfinite(value) or (value <= 0 and not may_be_zero):
                raise InvalidConfig(f"TrainingConfig.{name} is {value}; it must be positive.")
        if self.embedding_loss_weight < 0.0:
            raise InvalidConfig(
                f"embedding_loss_weight is {self.embedding_loss_weight}; it must not be negative."
            )
        if self.threads > _MOST_THREADS:
            raise InvalidConfig(f"threads is {self.threads}; give at most {_MOST_THREADS}.")
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
    huber: float | None = None,
    *,
    sampled: bool = True,
) -> LossParts:
    """Eq. 2 over a batch, with a reparameterised sample w_hat from g.

    Args:
        network: encoder, f and g.
        inputs: (batch, window, channels).
        difference: (batch,), the true ``a - o``.
        embedding: (batch, d), w of the person of each window; not detached in the second term.
        weight: lambda; with 0 nothing is inferred, and the second term is 0.
        generator: draws the sample.
        huber, sampled: see ``TrainingConfig``.
    """
    encoding = network.encoder(inputs)
    predicted = network.difference(encoding, embedding)
    if huber is None:
        difference_loss = (predicted - difference).square().mean()
    else:
        difference_loss = huber_loss(predicted, difference, delta=huber) / huber
    noise = torch.randn(embedding.shape, generator=generator)  # drawn whatever the weight
    embedding_loss = torch.zeros(())
    if weight > 0.0:
        mean, log_sigma = network.inference(encoding, predicted)
        w_hat = mean + log_sigma.exp() * noise if sampled else mean
        embedding_loss = (w_hat - embedding).square().mean()
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
    *,
    given: Tensor | None = None,
) -> TrainedMindMeld:
    """Learn the network and everyone's embedding from the valid windows.

    Args:
        windows: of the training people.
        network_config: sizes.
        config: rates, loss weight, length.
        seed: of weights, embeddings, batches and samples; same seed, same machine, same numbers.
        on_epoch: called with (epochs done, epochs).
        given: (people, d), embeddings that are held as they are; None learns them. With
            ``config.mirror`` their mirror images' follow, (2 people, d).

    Raises:
        InvalidLabels: someone has no valid window.
    """
    rows = torch.nonzero(windows.valid).squeeze(1)
    counts = torch.bincount(windows.person[rows], minlength=len(windows.people))
    for person, count in zip(windows.people, counts.tolist(), strict=True):
        if count == 0:
            raise InvalidLabels(f"{person!r} has no valid label to train on; leave them out.")
    difference = windows.difference

    generator = torch.Generator().manual_seed(seed)
    network = MindMeld(network_config, generator)
    people = len(windows.people)
    shape = (people * (2 if config.mirror else 1), network_config.embedding_size)
    draw = torch.rand if config.uniform_start else torch.randn
    embeddings = draw(shape, generator=generator)
    rates = [config.rate]
    groups: list[dict[str, list[Tensor]]] = [{"params": list(network.parameters())}]
    if given is None:
        rates.append(config.rate * config.embedding_rate_factor)
        groups.append({"params": [embeddings.requires_grad_()]})
    else:
        embeddings = given.reshape(shape)
    optimizer = torch.optim.Adam(groups, fused=True)
    per_epoch = config.drawn_per_epoch(len(rows))
    batches = -(-per_epoch // config.batch_size)
    history: list[tuple[float, float]] = []
    with torch_threads(config.threads):
        for epoch in range(config.epochs):
            drawn = rows[torch.randperm(len(rows), generator=generator)[:per_epoch]]
            sums = torch.zeros(2)
            for number, row in enumerate(drawn.split(config.batch_size), start=epoch * batches):
                inputs, target, whose = windows.inputs[row], difference[row], windows.person[row]
                if config.mirror:
                    mirrored = torch.rand(len(row), generator=generator) < 0.5
                    sign = 1.0 - 2.0 * mirrored
                    inputs[:, :, 0] *= sign[:, None]
                    target, whose = sign * target, whose + people * mirrored
                loss = mind_meld_loss(
                    network,
                    inputs,
                    target,
                    embeddings[whose],
                    config.embedding_loss_weight,
                    generator,
                    config.huber,
                    sampled=config.sampled,
                )
                factor = _rate_factor(number, config.epochs * batches, config)
                for group, rate in zip(optimizer.param_groups, rates, strict=True):
                    group["lr"] = rate * factor
                optimizer.zero_grad()
                loss.total.backward()
                optimizer.step()
                sums += torch.stack([loss.difference, loss.embedding]).detach()
            history.append((float(sums[0] / batches), float(sums[1] / batches)))
            if on_epoch is not None:
                on_epoch(epoch + 1, config.epochs)
    network.requires_grad_(False)
    return TrainedMindMeld(network, embeddings.detach()[:people].clone(), tuple(history))


def _rate_factor(step: int, steps: int, config: TrainingConfig) -> float:
    return 0.5 * (1.0 + cos(pi * step / steps)) if config.cosine else 1.0
