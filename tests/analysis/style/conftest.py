"""Signals whose style is known."""

from collections.abc import Callable

import numpy as np
import pytest

from steerlab.learning.series import LabelSeries

RATE_HZ = 20.0


@pytest.fixture(scope="session")
def truth() -> np.ndarray:
    """Ten seconds of steering without plateaus, (200,)."""
    t_s = np.arange(200) / RATE_HZ
    return np.sin(1.3 * t_s) + 0.6 * np.sin(0.47 * t_s + 0.3)


@pytest.fixture(scope="session")
def make_series() -> Callable[..., LabelSeries]:
    """``make_series(label, truth, person=, rollout=)``; NaN masks a step."""

    def make(label, truth, *, person="p-01", rollout="one") -> LabelSeries:
        return LabelSeries(
            person=person,
            rollout=rollout,
            rate_hz=RATE_HZ,
            label=np.asarray(label, dtype=float),
            truth=np.asarray(truth, dtype=float),
            valid=np.isfinite(label) & np.isfinite(truth),
        )

    return make
