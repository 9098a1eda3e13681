import itertools

import numpy as np
import pytest

from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import InvalidConfig, InvalidWorld
from steerlab.sim.ground_truth import Planner, PlannerConfig
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import (
    NAMED_TASKS,
    draw_task_start,
    generated_world,
    make_task,
    oracle_outcome,
    redraw_noise,
    screen_starts,
)

SMALL = PlannerConfig(nodes=1500, dubins_nodes=600, margin_m=1.2)


@pytest.fixture(scope="module")
def easy():
    task = make_task("easy")
    planner = Planner(task.world, seed=0, car=task.car, config=SMALL)
    with Driving(task.world, car=task.car, config=task.driving) as driving:
        yield task, planner, driving


@pytest.mark.parametrize("name", ["slalom", "hard"])
def test_every_start_has_the_same_way_round_the_blocks(name):
    """Two right answers would leave a policy between them, and nothing to compare."""
    task = make_task(name)
    planner = Planner(task.world, seed=0, car=task.car, config=SMALL)
    sides = set()
    for index in range(20):
        points = planner.plan(draw_task_start(task, index).pose).points
        passed = [float(np.interp(one.x_m, *points.T)) for one in task.world.blocks]
        sides.add(
            tuple(np.sign([y - one.y_m for y, one in zip(passed, task.world.blocks, strict=False)]))
        )
    assert len(sides) == 1
    (side,) = sides
    assert all(left != right for left, right in itertools.pairwise(side))  # it is a slalom


@pytest.mark.parametrize("name", NAMED_TASKS)
def test_time_suffices_for_the_named_worlds(name):
    task = make_task(name)
    start, ball = task.world.start, task.world.ball_xy_m
    straight_m = np.hypot(start.x_m - ball[0], start.y_m - ball[1])
    assert task.decisions == 200
    assert straight_m < 0.9 * task.speed_mps * task.driving.time_limit_s


def test_an_unknown_task_lists_the_valid_ones():
    for name in ("sloalm", "generated-", "generated-x"):
        with pytest.raises(InvalidConfig, match="easy, slalom, hard"):
            make_task(name)


def test_noise_beyond_the_wheel_is_refused():
    with pytest.raises(InvalidConfig, match="noise is -1"):
        make_task("easy", noise=-1.0)


def test_generated_worlds_repeat_and_differ():
    assert generated_world(3) == generated_world(3)
    assert generated_world(3).blocks != generated_world(4).blocks


def test_equal_entropy_gives_equal_starts_and_noise():
    task = make_task("slalom")
    one, same = draw_task_start(task, "teach", 1, 2), draw_task_start(task, "teach", 1, 2)
    other = draw_task_start(task, "teach", 1, 3)
    assert one.pose == same.pose
    assert (one.noise == same.noise).all()
    assert one.pose != other.pose
    again = redraw_noise(task, one, 0, 1)
    assert again.pose == one.pose
    assert (again.noise != one.noise).any()


def test_noise_has_the_spread_it_says():
    task = make_task("easy", noise=0.7)
    noise = np.concatenate([draw_task_start(task, index).noise for index in range(20)])
    assert noise.std() == pytest.approx(0.7, rel=0.05)


def test_screened_starts_are_those_the_oracle_manages(easy):
    task, planner, driving = easy
    found = screen_starts(task, planner, driving, 3, 0)
    assert len(found.starts) == 3 <= found.drawn
    for start in found.starts:
        assert oracle_outcome(task, planner, driving, start) is Outcome.BALL_REACHED


def test_a_task_nobody_can_do_says_so(easy):
    _, planner, driving = easy
    wild = make_task("easy", noise=2.5)
    short = Driving(wild.world, config=type(wild.driving)(time_limit_s=0.2))  # too short for anyone
    with short, pytest.raises(InvalidWorld, match="0 of 40 starts"):
        screen_starts(wild, planner, short, 2, 0)
    assert driving is not short
