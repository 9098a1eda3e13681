"""The lowest baseline: labels as given."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


class IdentityMapper:
    """Labels as given."""

    name = "identity"

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn."""

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn."""

    def map(self, series: LabelSeries) -> FloatArray:
        """The labels themselves, (steps,)."""
        return np.clip(series.label, -WHEEL_LIMIT, WHEEL_LIMIT)
