"""What a policy does with what it sees, by the compiled kernels.

A row's wheel is the same, bit for bit, whatever other rows are asked about with it, and on any
processor.
"""

import numpy as np
from numpy.typing import NDArray

from steerlab.learning.policy import Observations, PolicyNetwork
from steerlab.learning.policy_kernels.network import room_for, run_policy, sizes_of
from steerlab.sim.rollout import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


def decide(network: PolicyNetwork, seen: Observations) -> FloatArray:
    """Wheel positions (rows,) within ±``WHEEL_LIMIT``."""
    wheel, _ = _run(network, seen)
    return np.clip(wheel.astype(np.float64), -WHEEL_LIMIT, WHEEL_LIMIT)


def features_of(network: PolicyNetwork, seen: Observations) -> FloatArray:
    """The last hidden layer, (rows, hidden)."""
    _, hidden = _run(network, seen)
    return hidden.astype(np.float64)


def _run(
    network: PolicyNetwork, seen: Observations
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    sizes, rows = sizes_of(network.config), len(seen)
    wheel = np.empty(rows, np.float32)
    hidden = np.empty((rows, network.config.hidden), np.float32)
    vector = np.concatenate([part.detach().numpy().ravel() for part in network.used()])
    image = np.ascontiguousarray(seen.image).reshape(rows, -1)
    motion = np.ascontiguousarray(seen.motion, np.float32)
    run_policy(sizes, vector, image, motion, room_for(sizes, 1), wheel, hidden)
    return wheel, hidden
