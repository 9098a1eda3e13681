"""``Driving``: the fast way to drive, with nothing between the caller and ``mj_step``."""

from dataclasses import dataclass
from math import hypot, inf
from types import TracebackType

import mujoco
import numpy as np
from numpy.typing import NDArray

from steerlab.sim.engine.car import CarControls, acceleration, floats, velocity
from steerlab.sim.engine.scene import PHYSICS_TIMESTEP_S, compose
from steerlab.sim.errors import InvalidConfig, InvalidWorld, StateMismatch
from steerlab.sim.geometry import Pose2D
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import REACH_M, Block, WorldSpec

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION  # FULLPHYSICS omits the warm start and drifts


@dataclass(frozen=True, kw_only=True)
class DrivingConfig:
    """Control rate, time limit, and the spread of starts."""

    control_hz: float = 20.0
    time_limit_s: float = 30.0
    start_jitter_m: float = 1.5  # standard deviation of x and y around the world's start
    start_jitter_rad: float = 0.1

    def __post_init__(self) -> None:
        substeps = 1.0 / (self.control_hz * PHYSICS_TIMESTEP_S) if self.control_hz > 0 else 0.0
        if substeps < 1.0 or abs(substeps - round(substeps)) > 1e-9:
            raise InvalidConfig(
                f"control_hz is {self.control_hz}; one control step must be a whole number of "
                f"{PHYSICS_TIMESTEP_S} s physics steps: 10, 20, 25, 50 or 100 Hz."
            )
        if not 0 < self.time_limit_s < inf:
            raise InvalidConfig(
                f"time_limit_s is {self.time_limit_s}; it must be positive and finite."
            )
        for name in ("start_jitter_m", "start_jitter_rad"):
            if not 0 <= getattr(self, name) < inf:
                raise InvalidConfig(f"{name} is {getattr(self, name)}; it must be from 0.")

    @property
    def substeps(self) -> int:
        """Physics steps in a control step."""
        return round(1.0 / (self.control_hz * PHYSICS_TIMESTEP_S))

    @property
    def max_steps(self) -> int:
        """Control steps until the time limit."""
        return round(self.time_limit_s * self.control_hz)


@dataclass(frozen=True, slots=True)
class DrivingState:
    """What a policy may see, apart from the camera image; see ``engine.car`` for the frames.

    Attributes:
        velocity: (3,) forward and leftward speed in m/s, yaw rate in rad/s.
        acceleration: (2,) forward and leftward acceleration in m/s².
    """

    step: int
    t_s: float
    pose: Pose2D
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    outcome: Outcome


class Referee:
    """Decides whether a drive is over, for ``Driving`` and for the dm_control task alike.

    Only the chassis and blocks can touch each other. A grazing contact lasts a single physics step
    of 10 ms, so it must be looked for after each of them.
    """

    def __init__(self, data: mujoco.MjData, world: WorldSpec) -> None:
        self._data = data
        self._qpos = floats(data.qpos)
        self._ball_x_m, self._ball_y_m = world.ball_xy_m
        self._half_extent_m = world.half_extent_m

    def distance_to_ball_m(self) -> float:
        """From the car's centre to the ball's centre."""
        return hypot(self._qpos[0] - self._ball_x_m, self._qpos[1] - self._ball_y_m)

    def near_block(self) -> bool:
        """Whether a block is within ``NEAR_BLOCK_M``: only then can the next control step hit one."""
        return self._data.ncon > 0

    def touching(self) -> bool:
        """Whether the car touched a block in the last physics step."""
        return self._data.ncon > 0 and bool(self._data.contact.dist.min() < 0.0)

    def verdict(self, touched: bool) -> Outcome:
        """The outcome now, apart from the time limit.

        Args:
            touched: whether the car touched a block in any physics step of this control step.
        """
        if touched:
            return Outcome.BLOCK_HIT
        if self.distance_to_ball_m() < REACH_M:
            return Outcome.BALL_REACHED
        if max(abs(self._qpos[0]), abs(self._qpos[1])) > self._half_extent_m:
            return Outcome.OUT_OF_BOUNDS
        return Outcome.RUNNING


class Driving:
    """One car in one world: ``reset``, then ``step`` until the outcome is not ``RUNNING``.

    ``model`` and ``data`` are MuJoCo's own, for cameras and viewers; they live as long as this.

    Raises:
        InvalidWorld: the world's start lies inside a block.
    """

    def __init__(
        self,
        world: WorldSpec,
        *,
        car: CarConfig | None = None,
        config: DrivingConfig | None = None,
    ) -> None:
        self.world = world
        self.car = car or CarConfig()
        self.config = config or DrivingConfig()
        self.model: mujoco.MjModel = compose(world, self.car).compile()
        self.data = mujoco.MjData(self.model)
        self._controls = CarControls(self.data, self.car)
        self._referee = Referee(self.data, world)
        self._substeps = self.config.substeps
        self._max_steps = self.config.max_steps
        self._state_size = mujoco.mj_stateSize(self.model, _STATE)
        self._steps = 0
        self.outcome = Outcome.RUNNING
        self.reset(start=world.start)

    def reset(self, seed: int | None = None, *, start: Pose2D | None = None) -> DrivingState:
        """Stand at ``start``, or at a start drawn around the world's by ``seed``, at cruise speed.

        Raises:
            InvalidWorld: the start lies inside a block, or no free one was drawn in 1000 tries.
        """
        if start is None and seed is not None:
            start = draw_start(np.random.default_rng(seed), self.world, self.car, self.config)
        start = start or self.world.start
        block = _block_at(start, self.world, self.car)
        if block is not None:
            raise InvalidWorld(
                f"World {self.world.name!r}: a car at {start} stands in {block}; "
                "choose a start further from it."
            )
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:3] = start.x_m, start.y_m, start.heading_rad
        speed_mps = self.car.cruise_speed_mps
        self.data.qvel[:2] = (
            speed_mps * np.cos(start.heading_rad),
            speed_mps * np.sin(start.heading_rad),
        )
        mujoco.mj_fwdPosition(self.model, self.data)  # finds the blocks nearby
        self._steps = 0
        self.outcome = self._referee.verdict(self._referee.touching())
        return self.state

    def step(self, wheel: float, throttle: float | None = None, brake: float = 0.0) -> Outcome:
        """Hold the wheel for one control step; ``state`` is computed only when it is read.

        Args:
            wheel: position in [-2.5, 2.5], clipped; positive turns left.
            throttle: None cruises at the paper's constant speed; else [0, 1] of the top speed.
            brake: [0, 1].

        Raises:
            InvalidConfig: the wheel or a pedal is not a number.
        """
        if wheel != wheel or throttle != throttle or brake != brake:
            raise InvalidConfig(
                f"wheel {wheel}, throttle {throttle}, brake {brake}: not a number; "
                "a missing input must be handled before it reaches the car."
            )
        self._controls.apply(wheel, throttle, brake)
        model, data, touched = self.model, self.data, False
        if self._referee.near_block():
            for _ in range(self._substeps):
                mujoco.mj_step(model, data)
                touched = touched or self._referee.touching()
        else:
            mujoco.mj_step(model, data, self._substeps)
        self._steps += 1
        outcome = self._referee.verdict(touched)
        if outcome is Outcome.RUNNING and self._steps >= self._max_steps:
            outcome = Outcome.TIME_LIMIT
        self.outcome = outcome
        return outcome

    @property
    def state(self) -> DrivingState:
        """The current state."""
        x_m, y_m, heading_rad = self.data.qpos[:3].tolist()
        return DrivingState(
            step=self._steps,
            t_s=self._steps / self.config.control_hz,
            pose=Pose2D(x_m, y_m, heading_rad),
            velocity=velocity(self.data),
            acceleration=acceleration(self.data),
            outcome=self.outcome,
        )

    @property
    def distance_to_ball_m(self) -> float:
        """From the car's centre to the ball's centre."""
        return self._referee.distance_to_ball_m()

    def physics_state(self) -> NDArray[np.float64]:
        """(n,) mjSTATE_INTEGRATION vector; ``restore`` continues from it bit for bit."""
        state = np.empty(self._state_size)
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def restore(self, physics_state: NDArray[np.float64]) -> DrivingState:
        """Continue from a vector that ``physics_state`` gave in this world.

        Raises:
            StateMismatch: the vector has another size or is not finite.
        """
        if physics_state.shape != (self._state_size,):
            raise StateMismatch(
                f"A state of shape {physics_state.shape} does not fit world {self.world.name!r}, "
                f"which needs ({self._state_size},); restore it in the world (and with the MuJoCo "
                "version) it was recorded in."
            )
        if not np.isfinite(physics_state).all():
            raise StateMismatch("The state holds NaN or infinity; the recording is damaged.")
        state = np.ascontiguousarray(physics_state, dtype=np.float64)
        mujoco.mj_setState(self.model, self.data, state, _STATE)
        self._steps = round(self.data.time * self.config.control_hz)
        # Contacts are not part of the state: find them without touching the solver's warm start.
        mujoco.mj_fwdPosition(self.model, self.data)
        self.outcome = self._referee.verdict(self._referee.touching())
        return self.state

    def close(self) -> None:
        """Nothing is left to free: model and data go with the last reference to them."""

    def __enter__(self) -> "Driving":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def draw_start(
    rng: np.random.Generator, world: WorldSpec, car: CarConfig, config: DrivingConfig
) -> Pose2D:
    """A free pose around the world's start.

    Raises:
        InvalidWorld: none was found in 1000 tries.
    """
    around = world.start
    for _ in range(1000):
        dx_m, dy_m = rng.normal(0.0, config.start_jitter_m, size=2)
        turn_rad = rng.normal(0.0, config.start_jitter_rad)
        start = Pose2D(
            around.x_m + float(dx_m),
            around.y_m + float(dy_m),
            around.heading_rad + float(turn_rad),
        )
        inside = max(abs(start.x_m), abs(start.y_m)) < world.half_extent_m
        if inside and _block_at(start, world, car) is None:
            return start
    raise InvalidWorld(
        f"World {world.name!r}: no free start within {config.start_jitter_m} m of {around}; "
        "move the start or lower start_jitter_m."
    )


def _block_at(pose: Pose2D, world: WorldSpec, car: CarConfig) -> Block | None:
    """A block that the car's covering discs touch at ``pose``."""
    discs = [pose.ahead(offset_m) for offset_m in car.disc_offsets_m]
    for block in world.blocks:
        if any(block.distance_m(disc.x_m, disc.y_m) < car.disc_radius_m for disc in discs):
            return block
    return None
