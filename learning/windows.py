"""Windows of labels around every control step, as one tensor."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries
from steerlab.sim.errors import InvalidConfig

CHANNELS = 2  # label, and whether there is one
_MOST_SIDE = 1000  # samples; ours have 10, and windows of all steps are in memory at once


@dataclass(frozen=True, kw_only=True)
class WindowConfig:
    """The span ``[t, t + delta t]`` of the paper, centred on the label t' to improve.

    Attributes:
        half_width_s: how far the window reaches on either side.
        rate_hz: the mapper's own rate. Labels recorded at another rate are read between steps, so
            one trained mapper serves any control rate.
        look_ahead_s: labels later than this after t' are absent, as beyond the rollout's end; 0
            is causal. None: the whole window, as in the paper.
        half_width_steps: how far it reaches in steps of each drive, whatever their rate, in place
            of ``half_width_s`` and ``rate_hz``, which then say nothing; None for those.
    """

    half_width_s: float = 1.0
    rate_hz: float = 10.0
    look_ahead_s: float | None = None
    half_width_steps: int | None = None

    def __post_init__(self) -> None:
        if self.half_width_steps is not None:
            self._check_steps(self.half_width_steps)
        ahead_s = self.look_ahead_s
        if ahead_s is not None and not 0.0 <= ahead_s <= self.half_width_s:
            raise InvalidConfig(
                f"WindowConfig.look_ahead_s is {ahead_s}; it must be 0 to {self.half_width_s}, "
                "the window's half width, or None."
            )
        for name in ("half_width_s", "rate_hz"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InvalidConfig(f"WindowConfig.{name} is {value}; it must be positive.")
        if self.half_width_s * self.rate_hz > _MOST_SIDE:
            raise InvalidConfig(
                f"A half width of {self.half_width_s} s at {self.rate_hz} Hz holds more than "
                f"{_MOST_SIDE} samples; narrow the window or lower the rate."
            )
        if self.side < 1:
            raise InvalidConfig(
                f"A half width of {self.half_width_s} s at {self.rate_hz} Hz holds no neighbour; "
                "widen the window or raise the rate."
            )

    def _check_steps(self, steps: int) -> None:
        if steps % 1 or not 1 <= steps <= _MOST_SIDE:
            raise InvalidConfig(
                f"WindowConfig.half_width_steps is {steps}; it must be whole, 1 to "
                f"{_MOST_SIDE}, or None."
            )
        if self.look_ahead_s is not None:
            raise InvalidConfig(
                f"A window of {steps} steps on either side has no rate, so look_ahead_s "
                f"({self.look_ahead_s}) means nothing; give half_width_s, or no look_ahead_s."
            )

    @property
    def side(self) -> int:
        """Samples on either side of the centre."""
        if self.half_width_steps is not None:
            return self.half_width_steps
        return round(self.half_width_s * self.rate_hz)

    @property
    def ahead(self) -> int:
        """Samples after the centre that may be read; at most ``side``."""
        if self.look_ahead_s is None:
            return self.side
        return min(self.side, int(self.look_ahead_s * self.rate_hz + 1e-6))

    @property
    def length(self) -> int:
        """Samples in a window; the centre is at ``side``."""
        return 2 * self.side + 1

    def reach_steps(self, rate_hz: float) -> float:
        """How many steps of a drive of ``rate_hz`` it reaches on either side."""
        if self.half_width_steps is not None:
            return float(self.half_width_steps)
        return self.half_width_s * rate_hz

    @property
    def span(self) -> str:
        """In words, from one end to the other: ``2 s``, ``25 steps``."""
        if self.half_width_steps is not None:
            return f"{self.length} steps"
        return f"{2.0 * self.half_width_s:g} s"

    def __str__(self) -> str:
        """``±1 s at 10 Hz``, ``±12 steps``; and how far ahead, if that is less."""
        if self.half_width_steps is not None:
            return f"±{self.half_width_steps} steps"
        ahead = "" if self.look_ahead_s is None else f", {self.look_ahead_s:g} s ahead"
        return f"±{self.half_width_s:g} s at {self.rate_hz:g} Hz{ahead}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Windows:
    """Every control step of a list of series with its surroundings; rows keep the series' order.

    Attributes:
        inputs: (rows, length, 2) float32; label ``a`` and 1, or 0 and 0 where there is no label
            (before the start, after the end, device lost).
        label: (rows,) float32, the label at the centre; NaN where none was given.
        truth: (rows,) float32; NaN where none exists.
        valid: (rows,) bool, may train and score.
        person: (rows,) int64 into ``people``.
    """

    inputs: Tensor
    label: Tensor
    truth: Tensor
    valid: Tensor
    person: Tensor
    people: tuple[str, ...]

    @property
    def difference(self) -> Tensor:
        """``d = a - o`` of Eq. 2, (rows,); NaN where label or truth is missing."""
        return self.label - self.truth


def window_offsets(
    rate_hz: float, config: WindowConfig
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Where a window's samples lie: steps from t', and how far on to the next, (length,) each."""
    stride = 1.0 if config.half_width_steps is not None else rate_hz / config.rate_hz
    offset = stride * np.arange(-config.side, config.side + 1)
    offset = np.where(np.abs(offset - np.round(offset)) < 1e-6, np.round(offset), offset)
    below = np.floor(offset).astype(np.int64)
    return below, np.asarray(offset - below, dtype=np.float64)


def make_windows(
    series: Sequence[LabelSeries],
    config: WindowConfig,
    rows: npt.NDArray[np.int64] | None = None,
) -> Windows:
    """Cut the windows of all series in one gather.

    Samples that fall between two control steps are interpolated linearly, which is also the
    anti-aliasing; at an integer ratio of rates they are labels as given, and the centre always is.

    Args:
        series: of any people.
        config: the window.
        rows: only these of all series' steps, counted through; None is all.

    Raises:
        InvalidLabels: no series was given.
    """
    if not series:
        raise InvalidLabels("No label series given; windows need at least one.")
    steps = np.array([drive.steps for drive in series])
    ends = np.cumsum(steps)
    label = np.concatenate([drive.label for drive in series])
    centre = np.arange(len(label)) if rows is None else rows
    series_of = np.searchsorted(ends, centre, side="right")
    first = (ends - steps)[series_of][:, None]
    last = (ends - 1)[series_of][:, None]

    rates, rate_of = np.unique([drive.rate_hz for drive in series], return_inverse=True)
    offsets = [window_offsets(rate_hz, config) for rate_hz in rates]
    rate_of_row = rate_of[series_of]
    weight = np.stack([fraction for _, fraction in offsets])[rate_of_row]
    lower = centre[:, None] + np.stack([below for below, _ in offsets])[rate_of_row]
    upper = lower + (weight > 0.0)
    inside = (lower >= first) & (upper <= last)
    inside[:, config.side + config.ahead + 1 :] = False
    lower, upper = np.clip(lower, first, last), np.clip(upper, first, last)
    sample = label[lower] + weight * (label[upper] - label[lower])
    present = inside & np.isfinite(sample)

    people = tuple(dict.fromkeys(drive.person for drive in series))
    index = {person: row for row, person in enumerate(people)}
    truth = np.concatenate([drive.truth for drive in series])[centre]
    inputs = np.stack([np.where(present, sample, 0.0), present], axis=-1)
    return Windows(
        inputs=torch.from_numpy(inputs.astype(np.float32)),
        label=torch.from_numpy(label[centre].astype(np.float32)),
        truth=torch.from_numpy(truth.astype(np.float32)),
        valid=torch.from_numpy(np.concatenate([drive.valid for drive in series])[centre]),
        person=torch.from_numpy(np.array([index[drive.person] for drive in series])[series_of]),
        people=people,
    )
