"""The synthetic world is what the paper's text says, and its demonstrators do what they are said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.presets import MapperConfig
from steerlab.learning.synthetic.drives import (
    WHEEL_PER_RAD,
    DriveConfig,
    Timing,
    heading_difference_rad,
    label_drives,
    respond_rad,
    sample_drives,
)
from steerlab.learning.synthetic.experiment import SyntheticConfig, run_synthetic
from steerlab.learning.training import TrainingConfig
from steerlab.learning.windows import WindowConfig
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D, bearing_rad
from steerlab.sim.populations import PAPER, sample_population
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle
from steerlab.sim.vehicle import WHEEL_LIMIT

RATE_HZ = DriveConfig().rate_hz
COORDINATE = st.floats(-200.0, 200.0)


def _silent(what: str, share: float) -> None:
    pass


def _teacher(**style: float) -> ScriptedTeacher:
    return ScriptedTeacher("p", TeacherStyle(**style), 0)


@given(
    x=COORDINATE,
    y=COORDINATE,
    heading=st.floats(-10.0, 10.0),
    goal=st.tuples(COORDINATE, COORDINATE),
)
def test_the_truth_is_the_heading_difference_to_the_goal(x, y, heading, goal):
    found = heading_difference_rad(np.array([x, y]), np.float64(heading), np.array(goal))
    expected = bearing_rad(Pose2D(x, y, heading), goal)
    assert abs(np.exp(1j * found) - np.exp(1j * expected)) < 1e-9
    assert -np.pi <= found <= np.pi


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_drive_obeys_its_own_world(seed):
    config = DriveConfig()
    (drive,) = sample_drives(1, seed, prefix="t")
    assert len(drive.truth_rad[drive.labelled]) == config.steps
    assert np.abs(drive.truth_rad).max() <= config.largest_truth_rad
    # Turning the wheel by an angle turns the car by the same angle.
    np.testing.assert_allclose(np.diff(drive.heading_rad), drive.wheel_rad[:-1], atol=1e-12)
    moved = np.linalg.norm(np.diff(drive.position_m, axis=0), axis=1)
    np.testing.assert_allclose(moved, config.speed_mps / config.rate_hz)
    step = np.diff(drive.position_m, axis=0)
    ahead = np.arctan2(step[:, 1], step[:, 0])
    assert np.abs(np.exp(1j * ahead) - np.exp(1j * drive.heading_rad[1:])).max() < 1e-9
    np.testing.assert_allclose(
        drive.truth_rad,
        heading_difference_rad(drive.position_m, drive.heading_rad, drive.goal_m),
    )
    # Turned by the truth, the car faces the goal.
    row = config.steps // 2
    faced = drive.heading_rad[row] + drive.truth_rad[row]
    assert heading_difference_rad(
        drive.position_m[row], np.float64(faced), drive.goal_m
    ) == pytest.approx(0.0, abs=1e-9)


def test_drives_depend_on_seed_and_prefix_alone():
    one = sample_drives(3, 7, prefix="a")
    np.testing.assert_array_equal(one[1].truth_rad, sample_drives(2, 7, prefix="a")[1].truth_rad)
    for other in (sample_drives(3, 8, prefix="a"), sample_drives(3, 7, prefix="b")):
        assert not np.array_equal(one[0].truth_rad, other[0].truth_rad)
    for count, seed in ((0, 0), (1, -1)):
        with pytest.raises(InvalidConfig, match="give at least 1"):
            sample_drives(count, seed, prefix="a")
    with pytest.raises(InvalidConfig, match="speed_mps is 0"):
        DriveConfig(speed_mps=0.0)


@pytest.mark.parametrize("shift", [-3, 0, 3])
@pytest.mark.parametrize("gain", [0.5, 1.0, 2.0])
def test_styles_do_what_they_say(shift, gain):
    (drive,) = sample_drives(1, 3, prefix="t")
    teacher = _teacher(gain=gain, delay_s=shift / RATE_HZ)
    label = respond_rad(teacher, drive, RATE_HZ)
    truth = drive.truth_rad[drive.labelled]
    if shift > 0:  # what was true 3 steps ago
        np.testing.assert_allclose(label[shift:], gain * truth[:-shift])
    elif shift < 0:
        np.testing.assert_allclose(label[:shift], gain * truth[-shift:])
    else:
        np.testing.assert_allclose(label, gain * truth)
    assert Timing.of(teacher) == {-3: "anticipatory", 0: "neither", 3: "delayed"}[shift]


@pytest.mark.parametrize(
    ("style", "said"),
    [
        ({"delay_s": 0.25}, "no whole number of steps"),
        ({"delay_s": 0.6}, "larger margin_steps"),
        ({"lag_s": 0.1}, "demonstrators here have gain and delay"),
    ],
)
def test_other_styles_are_refused(style, said):
    with pytest.raises(InvalidConfig, match=said):
        respond_rad(_teacher(**style), sample_drives(1, 3, prefix="t")[0], RATE_HZ)


def test_no_label_is_clipped_by_the_scale():
    assert pytest.approx(2.0 / np.pi) == WHEEL_PER_RAD
    drives = sample_drives(12, 5, prefix="t")
    strongest = _teacher(gain=PAPER.magnitude[1])
    for series in label_drives([strongest], drives, RATE_HZ):
        np.testing.assert_allclose(series.label, PAPER.magnitude[1] * series.truth)
        assert np.abs(series.label).max() < WHEEL_LIMIT


def test_the_paper_population_has_all_six_styles():
    people = sample_population("paper", 60, 0, prefix="seen")
    styles = {(Timing.of(one), one.style.gain > 1.0) for one in people}
    assert len(styles) == 6


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"people": 5}, "people is 5"),
        ({"new_people": 1}, "new-people is 1"),
        ({"seed": -1}, "seed"),
    ],
)
def test_bad_settings_are_said(settings, said):
    with pytest.raises(InvalidConfig, match=said):
        SyntheticConfig(**settings)


def test_the_experiment_repeats_and_keeps_tasks_apart():
    config = SyntheticConfig(people=6, new_people=2, calibration_tasks=2, unseen_tasks=2, seed=9)
    quick = MapperConfig(
        window=WindowConfig(half_width_s=0.4), training=TrainingConfig(epochs=3, batch_size=128)
    )
    one = run_synthetic(config, _silent, quick)
    assert one.quality == run_synthetic(config, _silent, quick).quality
    names = {drive.name for drive in one.calibration} & {drive.name for drive in one.unseen}
    assert names == set()
    assert {split: ladder["mind_meld"].labels for split, ladder in one.quality.items()} == {
        "calibration": 6 * 2 * 150,
        "unseen": 6 * 2 * 150,
        "new": 2 * 2 * 150,
    }


@pytest.mark.slow
def test_mind_meld_undoes_paper_teachers():
    """A small experiment on a tuning seed."""
    config = SyntheticConfig(people=16, new_people=8, calibration_tasks=6, unseen_tasks=3, seed=100)
    quality = run_synthetic(config, _silent).quality
    found = {split: round(ladder["mind_meld"].improvement, 2) for split, ladder in quality.items()}
    assert found["calibration"] > 0.85
    assert found["unseen"] > 0.8
    assert found["new"] > 0.7
    for ladder in quality.values():
        assert ladder["mind_meld"].improvement > ladder["person_gain"].improvement + 0.1
