"""Artificial, suboptimal demonstrators and the wheel units their labels are learned in.

Styles come from ``steerlab.sim.populations``' ``paper`` population: delayed, anticipatory or
neither, and over- or under-correcting by a random magnitude, without noise (Fig. 2 c, d).
"""

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from steerlab.learning.series import LabelSeries
from steerlab.learning.synthetic.drives import DriveConfig, SyntheticDrive
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PAPER
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.vehicle import WHEEL_LIMIT

# Mappers take labels within ±WHEEL_LIMIT. A drive's truth is within a quarter turn and the
# strongest over-corrector multiplies it by 2.5, so with this factor no label is ever clipped:
# one wheel unit is a quarter turn. Ratios, and so improvements, do not depend on it.
WHEEL_PER_RAD = WHEEL_LIMIT / (PAPER.magnitude[1] * DriveConfig().largest_truth_rad)


class Timing(StrEnum):
    """When a demonstrator acts, compared with the ground truth."""

    DELAYED = "delayed"
    ANTICIPATORY = "anticipatory"
    NEITHER = "neither"

    @classmethod
    def of(cls, teacher: ScriptedTeacher) -> "Timing":
        """The timing of a teacher's style."""
        if teacher.style.delay_s == 0.0:
            return cls.NEITHER
        return cls.DELAYED if teacher.style.delay_s > 0.0 else cls.ANTICIPATORY


def respond_rad(teacher: ScriptedTeacher, drive: SyntheticDrive, rate_hz: float) -> FloatArray:
    """The teacher's labels on the drive's labelled steps: the truth shifted, times the gain.

    Raises:
        InvalidConfig: the style is more than a gain and a shift, the shift is not a whole number
            of steps, or it reaches past the drive's margin.
    """
    style = teacher.style
    extras = {n: v for n, v in vars(style).items() if n not in ("gain", "delay_s") and v != 0.0}
    if extras:
        raise InvalidConfig(f"{teacher.name} has {extras}; demonstrators here have gain and delay.")
    shift = round(style.delay_s * rate_hz)
    if abs(shift - style.delay_s * rate_hz) > 1e-9:
        raise InvalidConfig(
            f"{teacher.name} is {style.delay_s} s late: no whole number of steps at {rate_hz} Hz."
        )
    if abs(shift) > drive.margin_steps:
        raise InvalidConfig(
            f"{teacher.name} is {shift} steps late; the drive has {drive.margin_steps} beyond "
            f"its labelled ones. Give DriveConfig a larger margin_steps."
        )
    rows = np.arange(len(drive.truth_rad))[drive.labelled]
    return style.gain * drive.truth_rad[rows - shift]


def label_drives(
    teachers: Sequence[ScriptedTeacher], drives: Sequence[SyntheticDrive], rate_hz: float
) -> list[LabelSeries]:
    """Every teacher's labels on every drive, in wheel units."""
    return [
        LabelSeries(
            person=teacher.name,
            rollout=drive.name,
            rate_hz=rate_hz,
            label=WHEEL_PER_RAD * respond_rad(teacher, drive, rate_hz),
            truth=WHEEL_PER_RAD * drive.truth_rad[drive.labelled],
            valid=np.ones(len(drive.truth_rad[drive.labelled]), dtype=bool),
        )
        for teacher in teachers
        for drive in drives
    ]
