"""``OracleLabels``: the ground truth of one rollout, with the steps that have none marked."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig


@dataclass(frozen=True, slots=True, eq=False)
class OracleLabels:
    """Ground truth of one rollout.

    Attributes:
        wheel: (steps,) label ``o`` in [-2.5, 2.5]; NaN where not valid.
        valid: (steps,) False where no path exists.
        reason: why not, one entry a step; None where valid.
    """

    wheel: FloatArray
    valid: NDArray[np.bool_]
    reason: tuple[str | None, ...]

    def __post_init__(self) -> None:
        if not self.wheel.shape == self.valid.shape == (len(self.reason),):
            raise InvalidConfig(
                f"wheel {self.wheel.shape}, valid {self.valid.shape} and {len(self.reason)} "
                "reasons are not of one rollout."
            )
        if (np.isnan(self.wheel) == self.valid).any():
            raise InvalidConfig("A step is valid exactly where its label is a number.")
