"""Windows of labels around every control step, as one tensor."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries
from steerlab.sim.errors import InvalidConfig

CHANNELS = 2  # label, and whether there is one


@dataclass(frozen=True, kw_only=True)
class WindowConfig:
    """The span ``[t, t + delta t]`` of the paper, centred on the label t' to improve.

    Attributes:
        half_width_s: how far the window reaches on either side.
        rate_hz: the mapper's own rate. Labels recorded at another rate are read between steps, so
            one trained mapper serves any control rate.
    """

    half_width_s: float = 1.0
    rate_hz: float = 10.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise InvalidConfig(f"WindowConfig.{name} is {value}; it must be positive.")
        if self.side < 1:
            raise InvalidConfig(
                f"A half width of {self.half_width_s} s at {self.rate_hz} Hz holds no neighbour; "
                "widen the window or raise the rate."
            )

    @property
    def side(self) -> int:
        """Samples on either side of the centre."""
        return round(self.half_width_s * self.rate_hz)

    @property
    def length(self) -> int:
        """Samples in a window; the centre is at ``side``."""
        return 2 * self.side + 1


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


def make_windows(series: Sequence[LabelSeries], config: WindowConfig) -> Windows:
    """Cut the windows of all series in one gather.

    Samples that fall between two control steps are interpolated linearly, which is also the
    anti-aliasing; at an integer ratio of rates they are labels as given, and the centre always is.

    Raises:
        InvalidLabels: no series was given.
    """
    if not series:
        raise InvalidLabels("No label series given; windows need at least one.")
    steps = np.array([one.steps for one in series])
    ends = np.cumsum(steps)
    first = np.repeat(ends - steps, steps)[:, None]
    last = np.repeat(ends - 1, steps)[:, None]
    label = np.concatenate([one.label for one in series])

    rates, rate_of = np.unique([one.rate_hz for one in series], return_inverse=True)
    offset = rates[:, None] / config.rate_hz * np.arange(-config.side, config.side + 1)
    offset = np.where(np.abs(offset - np.round(offset)) < 1e-6, np.round(offset), offset)
    below = np.floor(offset).astype(np.int64)
    rate_of_row = np.repeat(rate_of, steps)
    weight = (offset - below)[rate_of_row]
    lower = np.arange(len(label))[:, None] + below[rate_of_row]
    upper = lower + (weight > 0.0)
    inside = (lower >= first) & (upper <= last)
    lower, upper = np.clip(lower, first, last), np.clip(upper, first, last)
    sample = label[lower] + weight * (label[upper] - label[lower])
    present = inside & np.isfinite(sample)

    people = tuple(dict.fromkeys(one.person for one in series))
    index = {person: row for row, person in enumerate(people)}
    inputs = np.stack([np.where(present, sample, 0.0), present], axis=-1)
    return Windows(
        inputs=torch.from_numpy(inputs.astype(np.float32)),
        label=torch.from_numpy(label.astype(np.float32)),
        truth=torch.from_numpy(np.concatenate([one.truth for one in series]).astype(np.float32)),
        valid=torch.from_numpy(np.concatenate([one.valid for one in series])),
        person=torch.from_numpy(np.repeat([index[one.person] for one in series], steps)),
        people=people,
    )
