"""A rollout that tests of scripted and of unusual teachers share."""

from collections.abc import Callable

import numpy as np
import pytest

from steerlab.sim.rollout import Rollout


@pytest.fixture(scope="session")
def waves(make_rollout: Callable[..., Rollout]) -> Callable[..., Rollout]:
    """``waves(seconds, control_hz, name=)``: the same two sines at any rate."""

    def build(seconds: float = 8.0, control_hz: float = 20.0, *, name: str = "one") -> Rollout:
        t_s = np.arange(round(seconds * control_hz)) / control_hz
        label = np.sin(1.3 * t_s) + 0.5 * np.sin(2.9 * t_s + 1.0)
        return make_rollout(label, name=name, control_hz=control_hz)

    return build
