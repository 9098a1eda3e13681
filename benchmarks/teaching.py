"""Does teaching keep up? The live drive of a robot beside a window, and how long people rest.

``python -m benchmarks.teaching [--drives 4]``: needs Xvfb, and a machine that does nothing else; its
load is in the rows' names.
"""

import os
import sys
import tempfile
from argparse import ArgumentParser
from pathlib import Path
from time import perf_counter, perf_counter_ns

import numpy as np

from benchmarks.rows import Row, at_most, print_rows
from benchmarks.teleop import xvfb
from steerlab.learning.agents import PolicyLearner, TaskEnv, make_agent
from steerlab.learning.agents.drive import RoundDrive
from steerlab.learning.policy import IMAGE_SHAPE, MOTION_SIZE, Observations
from steerlab.learning.policy_training import TrainingRows
from steerlab.sim.records import LabelledStep
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle
from steerlab.sim.tasks import make_task
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.study.recording.writer import AttemptWriter
from steerlab.study.teaching.conditions import TAUGHT
from steerlab.study.teaching.live_round import LiveRound, make_live_round
from steerlab.study.teaching.run_teaching import warm_up
from steerlab.study.teaching.scripted_interface import LiveScriptedDevice
from steerlab.teleop.drives.live import LiveDrive
from steerlab.teleop.loop import run_drive
from steerlab.teleop.pacing import PacingConfig, WallClock, no_garbage_collection
from steerlab.teleop.screen.contract import DriveView
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import SdlEvents
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import LoopHealth

ROUNDS = 12
REST_LIMIT_S = 3.0
STEP_MS = 50.0


def run(drives: int = 4) -> list[Row]:
    """All rows; a drive takes 20 s at most."""
    return [*resting(), *driving(drives)]


def resting() -> list[Row]:
    """Learning after the last round, when there is most to learn from."""
    rng = np.random.default_rng(0)
    rows = [
        TrainingRows(
            Observations(
                rng.integers(0, 256, (200, *IMAGE_SHAPE), dtype=np.uint8),
                rng.normal(size=(200, MOTION_SIZE)).astype(np.float32),
            ),
            rng.normal(size=200),
            np.ones(200),
        )
        for _ in range(ROUNDS + 1)
    ]
    found: list[Row] = []
    for members, doubts in ((1, "none"), (1, "risk"), (3, "spread")):
        learner = PolicyLearner(0, members=members, doubts=doubts)
        learner.train(rows[:2])
        began = perf_counter()
        learner.train(rows)
        what = f"learning after round {ROUNDS}, {members} policies, doubt {doubts}"
        found.append(at_most(what, perf_counter() - began, REST_LIMIT_S, "s"))
    return found


def driving(drives: int) -> list[Row]:
    """A robot that looks, infers and is recorded, under a window at 60 Hz."""
    before, agent = os.getloadavg()[0], make_agent("dagger", {})
    teacher = ScriptedTeacher("bench", TeacherStyle(), 0)
    step_ms: list[float] = []
    decision_ms: list[float] = []
    timings: list[StepTiming] = []
    frame_ns: list[int] = []
    dropped = 0
    with (
        tempfile.TemporaryDirectory() as folder,
        xvfb(),
        SdlEvents(window=True) as events,
        DriveScreen(events) as screen,
        TaskEnv(make_task("slalom"), seed=0) as env,
    ):
        warm_up(env, agent)
        screen.enter(env.task.world)
        clock = WallClock(PacingConfig(), events.poll)
        info = SessionInfo(
            participant="P001",
            role="test",
            device=LiveScriptedDevice(teacher, _round(env, 1)).info,
            control_hz=20.0,
        )
        with SessionRecorder(Path(folder) / "study", info) as recorder:
            for number in range(1, drives + 1):
                live = _round(env, number)
                drive = _Timed(live.drive, step_ms)
                hand = LiveScriptedDevice(teacher, live)
                record = recorder.begin(drive)
                sink = _Sink(record, timings)
                with no_garbage_collection():
                    run_drive(
                        drive,
                        hand,
                        participant="P001",
                        order=number,
                        attempt=record.attempt,
                        clock=clock,
                        sink=sink,
                        show=lambda fraction, live=live: _show(screen, live, clock, fraction),
                    )
                record.finish()
                decision_ms += [ns / 1e6 for ns in live.robot.decision_ns]
                frame_ns += clock.frame_ns
                dropped += clock.dropped
        drawn = str(screen.resolution)
    health = LoopHealth.of(timings, frame_ns, dropped)
    at = f"load {before:.1f} before, {os.getloadavg()[0]:.1f} after"
    shown = health.frames + health.dropped
    return [
        at_most(f"picture and inference p99 ({at})", _p99(decision_ms), STEP_MS / 2.0, "ms"),
        at_most("control step with decision, truth and physics p99", _p99(step_ms), STEP_MS, "ms"),
        at_most("control step, worst", max(step_ms), STEP_MS, "ms"),
        at_most("wake-up lateness p99", health.lateness_p99_ms, 2.0, "ms"),
        at_most("wake-up lateness, worst", health.lateness_max_ms, 10.0, "ms"),
        at_most(f"display frames left out, {drawn}", 100.0 * health.dropped / shown, 0.5, "%"),
    ]


class _Timed(LiveDrive):
    """The round's drive, its steps timed."""

    def __init__(self, drive: LiveDrive, step_ms: list[float]) -> None:
        self.__dict__ |= drive.__dict__
        self._step_ms = step_ms

    def step(self, step: int, sample) -> LabelledStep:
        began_ns = perf_counter_ns()
        row = super().step(step, sample)
        self._step_ms.append((perf_counter_ns() - began_ns) / 1e6)
        return row


class _Sink:
    def __init__(self, record: AttemptWriter, timings: list[StepTiming]) -> None:
        self._record, self._timings = record, timings

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        self._record.step(step, timing)
        if timing is not None:
            self._timings.append(timing)


def _round(env: TaskEnv, number: int) -> LiveRound:
    context = env.context(f"bench-{number}", number=number, order=number, attempt=0)
    gate = make_agent("dagger", {}).gate
    learner = PolicyLearner(number)
    drive = RoundDrive(env=env, context=context, gate=gate, learner=learner, seed=0)
    return make_live_round(drive, TAUGHT["dagger"])


def _show(screen: DriveScreen, live: LiveRound, clock: WallClock, fraction: float) -> None:
    screen.show_drive(
        DriveView(
            pose=live.drive.between(fraction).pose,
            elapsed_s=clock.elapsed_s,
            number=live.round_drive.number,
            count=ROUNDS,
            needle=0.0,
            device="bench",
            instruction=live.during,
        )
    )


def _p99(values: list[float]) -> float:
    return float(np.percentile(values, 99))


if __name__ == "__main__":
    parser = ArgumentParser(description="Does teaching keep up?")
    parser.add_argument("--drives", type=int, default=4)
    sys.exit(print_rows(run(parser.parse_args().drives)))
