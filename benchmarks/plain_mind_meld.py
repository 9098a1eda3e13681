"""MIND MELD as one would write it first in PyTorch: what ours is measured against.

A ``Dataset`` that cuts one window at a time, a ``DataLoader``, a full bidirectional LSTM, Adam for
training, and Adam for each new person's embedding. Same sizes, same loss.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, Dataset

from steerlab.learning.series import LabelSeries

SIDE = 10  # samples on either side, 1 s at 10 Hz
STRIDE = 2  # of 20 Hz labels
Sample = tuple[Tensor, Tensor, int]


class PlainWindows(Dataset[Sample]):
    """One window, its difference and its person's index at a time."""

    def __init__(self, series: Sequence[LabelSeries]) -> None:
        people = list(dict.fromkeys(one.person for one in series))
        pad = SIDE * STRIDE
        self.labels = [np.pad(one.label, pad).astype(np.float32) for one in series]
        self.present = [np.pad(np.ones(one.steps, np.float32), pad) for one in series]
        self.difference = [(one.label - one.truth).astype(np.float32) for one in series]
        self.person = [people.index(one.person) for one in series]
        self.index = [
            (number, int(step))
            for number, one in enumerate(series)
            for step in np.flatnonzero(one.valid)
        ]

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, item: int) -> Sample:
        number, step = self.index[item]
        span = slice(step, step + 2 * SIDE * STRIDE + 1, STRIDE)
        window = np.stack([self.labels[number][span], self.present[number][span]], axis=1)
        difference = torch.tensor(self.difference[number][step])
        return torch.from_numpy(window), difference, self.person[number]


class PlainMindMeld(nn.Module):
    """Encoder, f and g."""

    def __init__(self, people: int, size: int = 4) -> None:
        super().__init__()
        self.w = nn.Embedding(people, size)
        self.lstm = nn.LSTM(2, 32, batch_first=True, bidirectional=True)
        self.encode = nn.Linear(64, 16)
        self.f = nn.Sequential(nn.Linear(16 + size, 200), nn.ReLU(), nn.Linear(200, 1))
        self.g = nn.Sequential(
            nn.Linear(17, 64), nn.ReLU(), nn.Linear(64, 32), nn.ReLU(), nn.Linear(32, 2 * size)
        )

    def loss(self, window: Tensor, difference: Tensor, w: Tensor, weight: float) -> Tensor:
        """Eq. 2; window (batch, 21, 2), difference (batch,), w (batch, d)."""
        states, _ = self.lstm(window)
        z = self.encode(states[:, SIDE])
        predicted = self.f(torch.cat([z, w], dim=1)).squeeze(1)
        mean, log_sigma = self.g(torch.cat([z, predicted[:, None]], dim=1)).chunk(2, dim=1)
        sampled = mean + log_sigma.exp() * torch.randn_like(mean)
        embedding_loss = (sampled - w).square().mean()
        return (predicted - difference).square().mean() + weight * embedding_loss


def train_plain(data: PlainWindows, people: int, batches: int, batch_size: int) -> int:
    """Train for some batches; returns how many windows that were."""
    network = PlainMindMeld(people)
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    windows = 0
    for number, (window, difference, person) in enumerate(
        DataLoader(data, batch_size=batch_size, shuffle=True)
    ):
        if number == batches:
            break
        loss = network.loss(window, difference, network.w(person), 1.0)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        windows += len(person)
    return windows


def calibrate_plain(network: PlainMindMeld, data: PlainWindows, epochs: int, rate: float) -> Tensor:
    """Fit one new person's w, (d,), by Adam over their windows; the network is frozen."""
    network.requires_grad_(False)
    w = network.w.weight.mean(dim=0).clone().requires_grad_()
    optimizer = torch.optim.Adam([w], lr=rate)
    for _ in range(epochs):
        for window, difference, person in DataLoader(data, batch_size=512, shuffle=True):
            loss = network.loss(window, difference, w.expand(len(person), -1), 0.1)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    return w.detach()
