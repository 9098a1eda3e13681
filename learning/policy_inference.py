"""What a policy does with what it sees, by the compiled kernels.

A row's wheel is the same, bit for bit, whatever other rows are asked about with it, and on any
processor.
"""

import numpy as np
from numpy.typing import NDArray

from steerlab.learning.policy import Observations, PolicyNetwork
from steerlab.sim.rollout import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


class Decider:
    """A policy's weights as they are now, laid out once for many decisions.

    Not for use by several threads at once.
    """

    def __init__(self, network: PolicyNetwork) -> None:
        from steerlab.learning.policy_kernels.forward import run_policy
        from steerlab.learning.policy_kernels.layout import prepare, room_for, sizes_of

        self._run_policy = run_policy  # imported here, not in the first decision of a drive
        self._sizes = sizes_of(network.config)
        vector = np.concatenate([part.detach().numpy().ravel() for part in network.used()])
        self._weights = prepare(self._sizes, vector)
        self._room = room_for(self._sizes, 1)

    def wheel(self, seen: Observations) -> FloatArray:
        """Wheel positions (rows,) within ±``WHEEL_LIMIT``."""
        wheel, _ = self._run(seen)
        return np.clip(wheel.astype(np.float64), -WHEEL_LIMIT, WHEEL_LIMIT)

    def features(self, seen: Observations) -> FloatArray:
        """The last hidden layer, (rows, hidden)."""
        _, hidden = self._run(seen)
        return hidden.astype(np.float64)

    def _run(self, seen: Observations) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        rows = len(seen)
        wheel = np.empty(rows, np.float32)
        hidden = np.empty((rows, self._sizes.hidden.outs), np.float32)
        image = np.ascontiguousarray(seen.image).reshape(rows, -1)
        motion = np.ascontiguousarray(seen.motion, np.float32)
        self._run_policy(self._sizes, self._weights, image, motion, self._room, wheel, hidden)
        return wheel, hidden


def decide(network: PolicyNetwork, seen: Observations) -> FloatArray:
    """Wheel positions (rows,) within ±``WHEEL_LIMIT``, for once."""
    return Decider(network).wheel(seen)
