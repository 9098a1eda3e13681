import dataclasses

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from steerlab.sim import calibration_generator
from steerlab.sim.calibration_generator import (
    CALIBRATION_SEED,
    STYLES_BY_WORLD,
    CalibrationRules,
    drove_past_ball,
    generate_calibration_set,
    hard_share,
)
from steerlab.sim.calibration_set import load_calibration_set, read_rollouts, write_rollouts
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.ground_truth import Planner
from steerlab.sim.rollout import Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT

ROLLOUTS = load_calibration_set()
LABELS = np.concatenate([rollout.oracle_label for rollout in ROLLOUTS])


def _same(one: Rollout, other: Rollout) -> bool:
    return all(
        np.array_equal(getattr(one, field.name), getattr(other, field.name), equal_nan=True)
        if isinstance(getattr(one, field.name), np.ndarray)
        else getattr(one, field.name) == getattr(other, field.name)
        for field in dataclasses.fields(Rollout)
    )


def test_twelve_rollouts_over_six_worlds():
    assert len(ROLLOUTS) == 12
    assert len({rollout.world.name for rollout in ROLLOUTS}) == 6
    assert len({rollout.name for rollout in ROLLOUTS}) == 12
    assert all(150 <= rollout.steps <= 300 and rollout.control_hz == 20.0 for rollout in ROLLOUTS)


def test_every_step_has_a_label_and_few_are_saturated():
    assert all(rollout.oracle_valid.all() for rollout in ROLLOUTS)
    assert (np.abs(LABELS) > WHEEL_LIMIT - 0.01).mean() <= 0.05
    # Planned turns hold the wheel at a plateau below full lock, which hides as much.
    assert hard_share(LABELS) <= 0.20


def test_routes_seldom_flip():
    """A person can only be judged against a truth that does not change its mind."""
    for rollout in ROLLOUTS:
        flips = (np.abs(np.diff(rollout.oracle_label)) > 0.7).sum()
        assert flips <= (4 if drove_past_ball(rollout) else 2)


def test_turns_go_to_both_sides():
    assert (LABELS > 0.15).mean() > 0.3
    assert (LABELS < -0.15).mean() > 0.3


def test_they_err_as_half_trained_policies_do():
    near_block = [
        min(
            block.distance_m(x_m, y_m)
            for block in rollout.world.blocks
            for x_m, y_m, _ in rollout.pose
        )
        for rollout in ROLLOUTS
    ]
    assert sum(distance_m < 3.5 for distance_m in near_block) >= 4  # they approach blocks
    assert sum(drove_past_ball(rollout) for rollout in ROLLOUTS) >= 1  # they miss the ball
    assert all(np.abs(r.robot_wheel - r.oracle_label).mean() >= 0.35 for r in ROLLOUTS)
    assert (
        len({style.error_time_s for styles in STYLES_BY_WORLD for style in styles}) >= 3
    )  # at several speeds


@pytest.mark.parametrize("rollout", ROLLOUTS, ids=lambda rollout: rollout.name)
def test_each_replays_from_its_stored_states(rollout):
    """Restoring a state and applying the wheel gives the next state: bit for bit on one machine."""
    with Driving(rollout.world) as driving:
        for step in range(0, rollout.steps - 1, 17):
            state = driving.restore(rollout.physics_state[step])
            assert (state.pose.x_m, state.pose.y_m) == tuple(rollout.pose[step, :2])
            np.testing.assert_array_equal(state.velocity, rollout.velocity[step])
            np.testing.assert_array_equal(state.acceleration, rollout.acceleration[step])
            driving.step(rollout.robot_wheel[step])
            np.testing.assert_allclose(
                driving.physics_state(), rollout.physics_state[step + 1], rtol=0, atol=1e-9
            )


def test_labels_are_what_the_planner_says():
    rollout = ROLLOUTS[4]
    planner = Planner(rollout.world, seed=2)
    labels = planner.label_rollout(rollout.pose, rollout.velocity[:, 0])
    np.testing.assert_allclose(labels.wheel, rollout.oracle_label, atol=1e-9)


@pytest.mark.slow
def test_the_shipped_set_is_what_the_command_makes():
    for made, shipped in zip(generate_calibration_set(CALIBRATION_SEED), ROLLOUTS, strict=True):
        assert (made.name, made.seed, made.outcome) == (shipped.name, shipped.seed, shipped.outcome)
        np.testing.assert_allclose(made.pose, shipped.pose, atol=1e-6)
        np.testing.assert_allclose(made.oracle_label, shipped.oracle_label, atol=1e-6)


def test_rules_that_nothing_keeps_are_said(monkeypatch):
    monkeypatch.setattr(calibration_generator, "MAX_WORLDS", 1)
    monkeypatch.setattr(calibration_generator, "MAX_TRIES", 20)
    with pytest.raises(InvalidConfig, match="loosen"):
        generate_calibration_set(0, CalibrationRules(steps=(2, 3)))


def test_a_rollout_file_gives_back_every_bit(tmp_path):
    masked = ROLLOUTS[0].oracle_label.copy()
    masked[5:9] = np.nan
    rollouts = (
        dataclasses.replace(ROLLOUTS[0], oracle_label=masked, oracle_valid=~np.isnan(masked)),
        ROLLOUTS[7],
    )
    write_rollouts(rollouts, tmp_path / "r.parquet", made_by="test")
    back = read_rollouts(tmp_path / "r.parquet")
    assert all(_same(one, other) for one, other in zip(rollouts, back, strict=True))


def test_foreign_and_damaged_files_are_refused(tmp_path):
    path = tmp_path / "r.parquet"
    with pytest.raises(
        InvalidConfig, match="cannot be read as a rollout file: there is no such file"
    ):
        read_rollouts(path)
    path.write_bytes(b"PAR1 not really")
    with pytest.raises(InvalidConfig, match="cannot be read as a rollout file"):
        read_rollouts(path)
    pq.write_table(pa.table({"a": [1]}), path)
    with pytest.raises(InvalidConfig, match="not a rollout file"):
        read_rollouts(path)


@pytest.mark.parametrize(
    "change",
    [
        {"pose": np.zeros((3, 3))},
        {"robot_wheel": np.zeros(3)},
        {"physics_state": np.zeros(3)},
        {"oracle_label": np.full(ROLLOUTS[0].steps, np.nan)},
    ],
)
def test_a_rollout_checks_itself(change):
    with pytest.raises(InvalidConfig, match="Rollout 'calibration-00'"):
        dataclasses.replace(ROLLOUTS[0], **change)
