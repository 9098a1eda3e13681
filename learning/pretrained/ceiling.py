"""An estimate of what any calibration could reach: the network told each teacher's parameters.

Only simulated teachers have such parameters, so this is a yardstick for studies, not a mapper for
people. It is an estimate: a larger network trained longer might do better.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from steerlab.learning.empirical_bayes.grid import RATE_HZ
from steerlab.learning.errors import UnknownPerson
from steerlab.learning.pretrained.mapper import EstimatedStyle, SimPretrainedMapper
from steerlab.learning.pretrained.model import PretrainedModel
from steerlab.learning.pretrained.teachers import TeacherRanges, known_style
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray
from steerlab.sim.populations import HUMAN
from steerlab.sim.scripted_teacher import TeacherStyle

# The populations' own ranges, and nothing beside them: the ceiling need not be robust.
CEILING_RANGES = TeacherRanges(
    wandering=0.0,
    log_gain_std=HUMAN.log_gain_std,
    delay_std_s=HUMAN.delay_std_s,
    lag_s=HUMAN.lag_s,
    noise_time_s=HUMAN.noise_time_s,
)

_MID_SESSION = 5.5  # rollouts: where a drifting gain is taken
_LEAST_NOISE = 1.0 / RATE_HZ**2  # a noise-free teacher still has a logarithm


class CeilingMapper(SimPretrainedMapper):
    """Maps with the true style instead of the calibrated one.

    Args:
        model: from ``pretrain`` with ``known_style``.
        teachers: true style by pseudonym.
        context: also read the car's own motion.
    """

    def __init__(
        self, model: PretrainedModel, teachers: Mapping[str, TeacherStyle], *, context: bool = False
    ) -> None:
        super().__init__(context=context, model=model, fine_tuning=None)
        self.name = "ceiling_context" if context else "ceiling"
        self._teachers = dict(teachers)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Coefficients of the closed form from the labels, w from the truth.

        Raises:
            UnknownPerson: someone's true style was not given.
            InvalidLabels: no series, or someone without a valid label.
        """
        super().calibrate(series)
        for person in dict.fromkeys(drive.person for drive in series):
            if person not in self._teachers:
                raise UnknownPerson(f"The true style of {person!r} was not given to the ceiling.")
            self._people[person] = EstimatedStyle(
                coefficients=self._people[person].coefficients,
                style=known_style(_parameters(self._teachers[person])),
            )


def _parameters(style: TeacherStyle) -> FloatArray:
    return np.array(
        [
            np.log(style.gain) + _MID_SESSION * style.drift,
            style.delay_s,
            style.lag_s,
            style.dead_zone,
            style.bias,
            np.log(max(style.signal_noise, _LEAST_NOISE)),
            style.noise_time_s,
        ]
    )
