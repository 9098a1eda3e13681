"""What was planted in scripted teachers is found again; ``benchmarks/style.py`` has 200 of them."""

from dataclasses import replace

import pytest
from scipy.stats import spearmanr

from steerlab.analysis.style.person_style import people_styles
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population
from steerlab.sim.records import labelled_table
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle

TEACHERS = 40


def _series(teacher: ScriptedTeacher) -> list[LabelSeries]:
    return [
        series
        for order, rollout in enumerate(load_calibration_set())
        for series in series_from_table(
            labelled_table(
                rollout,
                teacher.respond(rollout, order=order, attempt=0),
                participant=teacher.name,
            )
        )
    ]


@pytest.mark.parametrize(("noise", "least"), [("none", 0.95), ("human", 0.85)])
def test_planted_gain_and_delay_are_found(noise, least):
    teachers = sample_population("human", TEACHERS, 23, prefix="style")
    if noise == "none":
        teachers = [
            replace(one, style=TeacherStyle(gain=one.style.gain, delay_s=one.style.delay_s))
            for one in teachers
        ]
    found = people_styles([series for teacher in teachers for series in _series(teacher)])
    gain, delay_s = ([getattr(one.style, name) for one in teachers] for name in ("gain", "delay_s"))
    assert spearmanr(gain, [one.amplitude for one in found]).statistic >= least
    assert spearmanr(delay_s, [one.lag_s for one in found]).statistic >= least
