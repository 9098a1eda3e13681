from dataclasses import replace

import numpy as np
import pytest

from steerlab.sim.arrays import FloatArray
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import InvalidConfig, NoPath
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth import OracleLabels, Planner, PlannerConfig, sample_starts
from steerlab.sim.ground_truth.distance_grid import body_of, clearance_at, distance_grid
from steerlab.sim.rollout import Outcome
from steerlab.sim.world import REACH_M, WorldSpec


def _reason(planner: Planner, pose: Pose2D) -> str:
    reasons = set()
    for ask in (lambda: planner.label(pose, 5.0), lambda: planner.check_start(pose)):
        with pytest.raises(NoPath, match="World '") as caught:
            ask()
        reasons.add(caught.value.reason)
    assert len(reasons) == 1
    return reasons.pop()


def test_goal_blocked(walled_in_ball: Planner) -> None:
    assert _reason(walled_in_ball, Pose2D(-30.0, 0.0, 0.0)) == "goal_blocked"


def test_no_connection(locked_room: Planner) -> None:
    assert _reason(locked_room, Pose2D(-30.0, 0.0, 0.0)) == "no_connection"


def test_no_connection_when_a_hit_cannot_be_avoided(wall_planner: Planner) -> None:
    assert _reason(wall_planner, Pose2D(-2.0 - 2.1 - 1.0, 0.0, 0.0)) == "no_connection"


def test_pose_in_collision(wall_planner: Planner) -> None:
    assert _reason(wall_planner, Pose2D(0.0, 0.0, 0.0)) == "pose_in_collision"
    assert _reason(wall_planner, Pose2D(51.0, 0.0, 0.0)) == "pose_in_collision"


def test_a_start_needs_more_room_than_a_label(wall_planner: Planner) -> None:
    close = Pose2D(0.0, 6.0 + 0.9 + 0.2, 0.0)
    wall_planner.label(close, 5.0)
    with pytest.raises(NoPath, match="discs") as caught:
        wall_planner.check_start(close)
    assert caught.value.reason == "pose_in_collision"


def test_inside_the_locked_room_the_ball_is_reached(locked_room: Planner) -> None:
    with Driving(locked_room.world) as car:
        state = car.reset(start=Pose2D(-8.0, 0.0, 0.0))
        while car.outcome is Outcome.RUNNING:
            car.step(locked_room.label(state.pose, float(state.velocity[0])))
            state = car.state
        assert car.outcome is Outcome.BALL_REACHED


def _weave(steps: int) -> tuple[FloatArray, FloatArray]:
    """Poses (steps, 3) of a car that comes up the middle to the wall, now left, now right."""
    x_m = np.linspace(-35.0, -20.0, steps)
    y_m = 0.1 * np.where(np.arange(steps) % 2, 1.0, -1.0)
    return np.stack((x_m, y_m, np.zeros(steps)), axis=-1), np.full(steps, 5.0)


def test_hysteresis_keeps_the_route(wall_world: WorldSpec, wall_planner: Planner) -> None:
    pose, speed_mps = _weave(40)
    kept = wall_planner.label_rollout(pose, speed_mps)
    assert len(set(np.sign(kept.wheel))) == 1
    forgetful = Planner(wall_world, seed=0, config=PlannerConfig(hysteresis_m=0.0))
    flips = np.diff(np.sign(forgetful.label_rollout(pose, speed_mps).wheel))
    assert np.count_nonzero(flips) > 30
    assert (
        np.std(np.diff(kept.wheel))
        < 0.2
        < np.std(np.diff(np.abs(kept.wheel) * flips.mean() + 1)) + 0.2
    )


def test_hysteresis_gives_way_to_a_much_shorter_route(wall_planner: Planner) -> None:
    pose = np.array([(-25.0, 0.5, 0.0), (-25.0, -6.5, 0.0), (-24.0, -6.5, 0.0)])
    wheel = wall_planner.label_rollout(pose, np.full(3, 5.0)).wheel
    assert wheel[0] > 0.0 > wheel[1]
    assert wheel[2] < 0.0


def test_first_label_of_a_rollout_is_the_stateless_one(wall_planner: Planner) -> None:
    pose, speed_mps = _weave(3)
    first = wall_planner.label_rollout(pose, speed_mps).wheel[0]
    assert first == wall_planner.label(Pose2D(*pose[0].tolist()), 5.0)


def test_labels_do_not_depend_on_what_was_asked_before(wall_planner: Planner) -> None:
    pose, speed_mps = _weave(10)
    again = [wall_planner.label(Pose2D(*row), 5.0) for row in pose.tolist()]
    wall_planner.label_rollout(pose, speed_mps)
    assert again == [wall_planner.label(Pose2D(*row), 5.0) for row in pose.tolist()]


def test_steps_without_a_path_are_masked_never_zero(wall_planner: Planner) -> None:
    pose = np.array([(-30.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-5.1, 0.0, 0.0), (10.0, 0.0, 0.0)])
    found = wall_planner.label_rollout(pose, np.full(4, 5.0))
    assert found.valid.tolist() == [True, False, False, True]
    assert np.isnan(found.wheel[~found.valid]).all()
    assert np.isfinite(found.wheel[found.valid]).all()
    assert found.reason == (None, "pose_in_collision", "no_connection", None)


def test_goal_blocked_masks_a_whole_rollout(walled_in_ball: Planner) -> None:
    found = walled_in_ball.label_rollout(np.tile((-30.0, 0.0, 0.0), (2, 1)), np.full(2, 5.0))
    assert not found.valid.any()
    assert found.reason == ("goal_blocked", "goal_blocked")


@pytest.mark.parametrize(
    ("pose", "speed_mps"),
    [
        (np.zeros((3, 2)), np.zeros(3)),
        (np.zeros((3, 3)), np.zeros(2)),
        (np.full((3, 3), np.nan), np.zeros(3)),
        (np.zeros((3, 3)), np.full(3, np.inf)),
    ],
)
def test_a_damaged_rollout_is_refused(
    wall_planner: Planner, pose: FloatArray, speed_mps: FloatArray
) -> None:
    with pytest.raises(InvalidConfig):
        wall_planner.label_rollout(pose, speed_mps)


def test_labels_that_contradict_themselves_are_refused() -> None:
    with pytest.raises(InvalidConfig, match="valid exactly where"):
        OracleLabels(np.array([np.nan, 1.0]), np.array([True, True]), (None, None))
    with pytest.raises(InvalidConfig, match="one rollout"):
        OracleLabels(np.zeros(2), np.ones(2, dtype=bool), (None,))


def test_a_committed_path_is_drivable(random_planner: Planner) -> None:
    """Curvature within the planned radius and full margin, until the ball is within reach."""
    planner, config = random_planner, random_planner.config
    body, grid = body_of(planner.car), distance_grid(planner.world, config.grid_m)
    for start in sample_starts(planner, np.random.default_rng(2), 5):
        path = planner.check_start(start)
        np.testing.assert_allclose(path.points[-1], planner.world.ball_xy_m, atol=1e-9)
        curvature = np.abs(np.diff(path.heading)) / np.maximum(np.diff(path.arc_m), 1e-9)
        assert curvature[np.diff(path.arc_m) > 1e-3].max() < 1.02 / config.plan_radius_m
        to_ball_m = path.length_m - path.arc_m
        for along_m, left_m, (x_m, y_m), heading in zip(
            path.arc_m, to_ball_m, path.points, path.heading, strict=True
        ):
            if along_m > 4.0 and left_m > REACH_M + planner.car.wheelbase_m / 2:
                clear_m = clearance_at(grid, body, x_m, y_m, heading)
                assert clear_m > body.radius_m + config.margin_m - 0.1


def test_the_tree_of_poses_is_drivable_and_its_costs_add_up(random_planner: Planner) -> None:
    tree = random_planner.pose_tree
    assert tree.goals == 36
    assert (tree.parent[: tree.goals] == -1).all()
    assert (tree.parent[tree.goals :] >= 0).all()
    ball = np.array(random_planner.world.ball_xy_m)
    straight_m = np.hypot(*(tree.poses[:, :2] - ball).T)
    assert (tree.cost_m >= straight_m - 1e-9).all()
    assert (tree.cost_m[tree.goals :] > tree.cost_m[tree.parent[tree.goals :]]).all()


def test_starts_are_seeded_apart_and_far_enough(random_planner: Planner) -> None:
    starts = sample_starts(random_planner, np.random.default_rng(5), 6, min_to_ball_m=30.0)
    assert starts == sample_starts(random_planner, np.random.default_rng(5), 6, min_to_ball_m=30.0)
    assert starts != sample_starts(random_planner, np.random.default_rng(6), 6, min_to_ball_m=30.0)
    ball_x_m, ball_y_m = random_planner.world.ball_xy_m
    assert all(np.hypot(s.x_m - ball_x_m, s.y_m - ball_y_m) >= 30.0 for s in starts)


def test_starts_that_cannot_be_found_are_reported(walled_in_ball: Planner) -> None:
    with pytest.raises(NoPath, match="only 0 of 1 starts") as caught:
        sample_starts(walled_in_ball, np.random.default_rng(0), 1)
    assert caught.value.reason == "goal_blocked"


def test_a_ground_full_of_blocks_still_gives_an_answer(wall_world: WorldSpec) -> None:
    tiny = replace(
        wall_world, ball_xy_m=(2.0, 0.0), start=Pose2D(0.0, 0.0, 0.0), half_extent_m=3.0, blocks=()
    )
    with pytest.raises(NoPath, match="within reach of the ball"):
        Planner(tiny, seed=0).label(Pose2D(0.0, 0.0, 0.0), 5.0)
