"""``Planner``: the ground truth of one world, computed once and queried thousands of times."""

from math import hypot, pi

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig, NoPath
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth.bicycle import ARRIVED, TOUCHED, drive
from steerlab.sim.ground_truth.boxes import FreeSpace, free_space
from steerlab.sim.ground_truth.config import PlannerConfig
from steerlab.sim.ground_truth.distance_grid import (
    Keep,
    body_of,
    clearance_at,
    collision,
    distance_grid,
    square_distance_grid,
)
from steerlab.sim.ground_truth.dubins_tree import PoseTree, goal_poses, grow_pose_tree, join_tree
from steerlab.sim.ground_truth.label_path import TOUCH_M, Labeller
from steerlab.sim.ground_truth.oracle import OracleLabels, Path
from steerlab.sim.ground_truth.path_writer import chain_to_ball, curve, shorten
from steerlab.sim.ground_truth.planner_inputs import RAMP_M, PlannerInputs, Route, route_map
from steerlab.sim.ground_truth.rrt_star import PointTree, cost_to_go, grow_point_tree
from steerlab.sim.ground_truth.stanley import stanley_rad, steering_of
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec

TIGHT_RADIUS_SHARE = 1.15  # of the least turning radius: what a label may use if it must
TIGHT_EXTRA_M = 8.0  # a detour up to this long is preferred to a tight turn
JOIN_M = 40.0  # how far a committed path may go before it meets the tree
QUERY_M = 4.0  # within which nodes are asked for the cost-to-go
DRIVE_MARGIN_M = 0.1  # a start is accepted only if its simulated drive keeps this to spare
DRIVE_SPARE_TIME = 1.5  # times the path's length at cruise speed
TRIES_PER_START = 200


class Planner:
    """Answers for any pose of one world, from two trees grown once. Not thread-safe.

    Args:
        seed: of the trees; the same seed gives the same bits.

    Raises:
        InvalidConfig: the planned radius is too small for the car.
    """

    def __init__(
        self,
        world: WorldSpec,
        *,
        seed: int,
        car: CarConfig | None = None,
        config: PlannerConfig | None = None,
    ) -> None:
        self.world = world
        self.car = car or CarConfig()
        self.config = config = config or PlannerConfig()
        config.check_car(self.car)
        point_rng, pose_rng = np.random.default_rng(seed).spawn(2)
        body = body_of(self.car)
        self._needed_m = body.radius_m + config.margin_m
        grid = distance_grid(world, config.grid_m)
        self.free_space: FreeSpace = free_space(world, self._needed_m)
        self.point_tree: PointTree = grow_point_tree(
            self.free_space, world.ball_xy_m, nodes=config.nodes, rng=point_rng
        )
        goals = goal_poses(world.ball_xy_m, config.goal_headings, body, grid, self._needed_m)
        self.pose_tree: PoseTree = grow_pose_tree(
            goals,
            grid,
            body,
            self.point_tree,
            self.free_space,
            nodes=config.dubins_nodes,
            radius_m=config.plan_radius_m,
            needed_m=self._needed_m,
            rng=pose_rng,
        )
        self._inputs = PlannerInputs(
            tree=self.point_tree,
            routes=route_map(self.point_tree),
            grid=grid,
            square_grid=square_distance_grid(world, config.grid_m),
            body=body,
            steering=steering_of(self.car, config),
            ball=world.ball_xy_m,
            radii_m=(config.plan_radius_m, TIGHT_RADIUS_SHARE * self.car.min_turn_radius_m),
            extra_m=(0.0, TIGHT_EXTRA_M),
            clearance_m=(
                body.radius_m + config.label_margin_share * config.margin_m,
                body.radius_m,
            ),
            grown_m=self._needed_m,
            path_step_m=config.path_step_m,
            hysteresis_m=config.hysteresis_m,
            verify_s=config.verify_s,
        )
        self._labeller = Labeller(self._inputs, self.pose_tree)

    def cost_to_go_m(self, x_m: float, y_m: float) -> float:
        """Length of a point's shortest path to the ball past grown blocks; infinite if none."""
        cost_m, _ = cost_to_go(self.point_tree, self.free_space, x_m, y_m, QUERY_M)
        return float(cost_m)

    def label(self, pose: Pose2D, speed_mps: float) -> float:
        """Ground-truth wheel position in [-2.5, 2.5] for one pose of the car's centre.

        Raises:
            NoPath: the ball cannot be reached from here by driving forward.
        """
        return self._label(pose, speed_mps, None)[0]

    def label_path(self, pose: Pose2D, speed_mps: float | None = None) -> Path:
        """The path that ``label`` reads the wheel off; at cruise speed unless told otherwise.

        Raises:
            NoPath: as ``label``.
        """
        self._label(pose, self.car.cruise_speed_mps if speed_mps is None else speed_mps, None)
        return Path(self._labeller.points.copy(), self._labeller.heading.copy())

    def label_rollout(self, pose: FloatArray, speed_mps: FloatArray) -> OracleLabels:
        """Labels of one rollout, in order: each keeps the route of the one before if it can.

        Args:
            pose: (steps, 3) x_m, y_m, heading_rad of the car's centre.
            speed_mps: (steps,) forward speed.

        Raises:
            InvalidConfig: the shapes do not match, or a value is not finite.
        """
        steps = len(pose)
        if pose.shape != (steps, 3) or speed_mps.shape != (steps,):
            raise InvalidConfig(
                f"pose is {pose.shape} and speed_mps {speed_mps.shape}; "
                "give (steps, 3) and (steps,) of the same rollout."
            )
        if not np.isfinite(speed_mps).all():
            raise InvalidConfig("speed_mps holds NaN or infinity; the recording is damaged.")
        wheel = np.full(steps, np.nan)
        reasons: list[str | None] = [None] * steps
        before: Route | None = None
        for step, (x_m, y_m, heading_rad) in enumerate(pose.tolist()):
            try:
                wheel[step], before = self._label(
                    Pose2D(x_m, y_m, heading_rad), float(speed_mps[step]), before
                )
            except NoPath as error:
                reasons[step] = error.reason
        return OracleLabels(wheel, ~np.isnan(wheel), tuple(reasons))

    def plan(self, pose: Pose2D) -> Path:
        """A committed path to the ball, drivable at the planned radius with the full margin.

        Raises:
            NoPath: the ball cannot be reached from here by driving forward.
        """
        self._check_pose(pose)
        start, inputs, radius_m = self._rear(pose), self._inputs, self.config.plan_radius_m
        clear_m = float(clearance_at(inputs.grid, inputs.body, *start)) - TOUCH_M
        keep = Keep(min(clear_m, self._needed_m), self._needed_m, RAMP_M)
        _, node = join_tree(
            self.pose_tree, np.array(start), radius_m, JOIN_M, inputs.grid, inputs.body, keep
        )
        if node < 0:
            raise self._no_connection(pose, f"at a turning radius of {radius_m:g} m")
        chain = chain_to_ball(self.pose_tree, np.array(start), node)
        chain = shorten(chain, radius_m, inputs.grid, inputs.body, keep)
        return Path(*curve(chain, radius_m, radius_m, inputs.ball, inputs.path_step_m))

    def check_start(self, pose: Pose2D) -> Path:
        """The committed path from a start, once it has been driven in simulation to the ball.

        Raises:
            NoPath: there is no path, or following it touches something or does not arrive.
        """
        path, inputs = self.plan(pose), self._inputs
        start, full_m = self._rear(pose), inputs.body.radius_m + DRIVE_MARGIN_M
        clear_m = float(clearance_at(inputs.grid, inputs.body, *start))
        if clear_m < full_m:
            raise NoPath(
                "pose_in_collision",
                f"World {self.world.name!r}: the car's discs of {inputs.body.radius_m:.2f} m at "
                f"{pose} have only {clear_m:.2f} m to the next block or edge; "
                f"start where they have {full_m:.2f} m.",
            )
        speed_mps = self.car.cruise_speed_mps
        outcome, seconds, _ = drive(
            path.points,
            path.heading,
            start,
            0.0,
            speed_mps,
            DRIVE_SPARE_TIME * path.length_m / speed_mps,
            inputs.ball,
            inputs.grid,
            inputs.body,
            inputs.steering,
            Keep(full_m, full_m, RAMP_M),
        )
        if outcome != ARRIVED:
            what = "touches a block or the edge" if outcome == TOUCHED else "has not arrived"
            raise self._no_connection(
                pose, f"that can be followed: the car {what} at {seconds:g} s"
            )
        return path

    def _label(self, pose: Pose2D, speed_mps: float, before: Route | None) -> tuple[float, Route]:
        self._check_pose(pose)
        rear = self._rear(pose)
        route = self._labeller.find(rear, speed_mps, before)
        if route is None:
            raise self._no_connection(pose, "even at full lock")
        delta_rad, _ = stanley_rad(
            self._labeller.points,
            self._labeller.heading,
            0,
            *rear,
            speed_mps,
            self._inputs.steering,
        )
        return self.car.wheel(delta_rad), route

    def _rear(self, pose: Pose2D) -> tuple[float, float, float]:
        rear = pose.ahead(-self.car.wheelbase_m / 2.0)
        return rear.x_m, rear.y_m, rear.heading_rad

    def _check_pose(self, pose: Pose2D) -> None:
        where = f"World {self.world.name!r}"
        if not self.pose_tree.goals:
            raise NoPath(
                "goal_blocked",
                f"{where}: blocks leave no room for the car within reach of the ball at "
                f"{self.world.ball_xy_m}; move them or the ball.",
            )
        obstacle = collision(pose, self.world, self.car)
        if obstacle is not None:
            raise NoPath("pose_in_collision", f"{where}: the car at {pose} is {obstacle}.")

    def _no_connection(self, pose: Pose2D, how: str) -> NoPath:
        return NoPath(
            "no_connection",
            f"World {self.world.name!r}: no forward path leads from {pose} to the ball {how}.",
        )


def sample_starts(
    planner: Planner, rng: np.random.Generator, count: int, *, min_to_ball_m: float = 20.0
) -> list[Pose2D]:
    """Draw poses anywhere on the ground, and keep those that ``Planner.check_start`` accepts.

    Args:
        planner: of the world to start in.
        rng: where the poses come from.
        count: how many starts are wanted.
        min_to_ball_m: from the car's centre to the ball's.

    Raises:
        NoPath: too few were found; the world leaves hardly any room.
    """
    limit_m = planner.world.half_extent_m
    ball_x_m, ball_y_m = planner.world.ball_xy_m
    starts: list[Pose2D] = []
    reason = "pose_in_collision"
    for _ in range(TRIES_PER_START * count):
        if len(starts) == count:
            return starts
        x_m, y_m = (float(value) for value in rng.uniform(-limit_m, limit_m, size=2))
        pose = Pose2D(x_m, y_m, float(rng.uniform(-pi, pi)))
        if hypot(x_m - ball_x_m, y_m - ball_y_m) < min_to_ball_m:
            continue
        try:
            planner.check_start(pose)
        except NoPath as error:
            reason = error.reason
            continue
        starts.append(pose)
    if len(starts) == count:
        return starts
    raise NoPath(
        reason,
        f"World {planner.world.name!r}: only {len(starts)} of {count} starts found at least "
        f"{min_to_ball_m:g} m from the ball; ask for fewer, nearer ones, or remove blocks.",
    )
