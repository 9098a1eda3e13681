"""A safety model: is the policy's wheel here likely to be far from the teacher's?"""

import numpy as np
import torch
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray

UNSAFE_WHEEL = 0.5  # an error larger than this is unsafe
PENALTY = 1.0
_NEWTON_STEPS = 15


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
