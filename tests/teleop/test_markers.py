"""What marks are made of a session, and that whoever keeps it sees no difference."""

from itertools import pairwise

from steerlab.sim.rollout import Outcome
from steerlab.teleop.attempt import SessionConfig
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.markers import MarkedRecorder, marked
from steerlab.teleop.screen.contract import Act
from steerlab.teleop.session import DriveSession
from tests.teleop.test_session import ROLLOUTS, Lab


class Listener:
    def __init__(self):
        self.marks, self.steps = [], []

    def mark(self, what, at_ns, /, **details):
        self.marks.append((what, details))

    def step(self, order, step, at_ns):
        self.steps.append((order, step, at_ns))


def run(lab, listener, rollouts=ROLLOUTS):
    DriveSession(
        screen=lab,
        device=lab,
        poll=lambda: None,
        recorder=marked(lab, listener, participant="p", device="G29"),
        participant="p",
        total=len(rollouts),
        config=SessionConfig(),
        now_ns=lab.now_ns,
        sleep_s=lab.sleep_s,
    ).run(map(Replay, rollouts))


def test_a_pause_and_the_attempt_after_it():
    lab, listener = Lab(), Listener()
    lab.on_step = lambda order, step: lab.press(Act.PAUSE) if (order, step) == (0, 9) else None
    run(lab, listener, ROLLOUTS[:1])
    name, outcome = ROLLOUTS[0].name, ROLLOUTS[0].outcome.value
    about = {"participant": "p", "rollout": name, "attempt": 0, "control_hz": 20.0, "device": "G29"}
    driver = ("driver", {"driver": "robot", "step": 0})
    assert listener.marks == [
        ("drive_begin", about | {"order": 0}),
        driver,
        ("event", {"what": "paused", "step": 10}),
        ("drive_end", {"how": "abandoned", "reason": "paused"}),
        ("drive_begin", about | {"order": 1}),
        driver,
        ("drive_end", {"how": "finished", "outcome": outcome}),
    ]
    assert [entry[:2] for entry in listener.steps] == [
        *((0, step) for step in range(10)),
        *((1, step) for step in range(25)),
    ]


def test_a_step_bears_the_time_at_which_the_wheel_was_sampled():
    """On the loop's own clock, 50 ms apart and within some of its deadline."""
    lab, listener = Lab(), Listener()
    run(lab, listener, ROLLOUTS[:1])
    times = [at_ns for *_, at_ns in listener.steps]
    gaps = [after - before for before, after in pairwise(times)]
    assert max(abs(gap - 50_000_000) for gap in gaps) < 6_000_000


def test_the_record_is_the_same_with_markers_and_without():
    with_markers, without = Lab(), Lab()
    run(with_markers, Listener())
    run(without, None)
    assert with_markers.log == without.log
    assert marked(without, None, participant="p", device="x") is without


def test_contact_and_changes_of_hands_are_marked():
    from dataclasses import replace

    from steerlab.sim.records import Driver, labelled_step

    class Record:
        attempt, order = 2, 5

        def step(self, step, timing):
            pass

        def event(self, step, what):
            pass

        def finish(self, failed):
            pass

        def abandon(self, reason):
            pass

    class Recorder:
        def begin(self, drive):
            return Record()

    class Drive(Replay):
        outcome = Outcome.BLOCK_HIT

    listener = Listener()
    recorder = MarkedRecorder(Recorder(), listener, participant="p", device="x")
    record = recorder.begin(Drive(ROLLOUTS[0]))
    for k, gate in enumerate((Driver.ROBOT, Driver.TEACHER, Driver.TEACHER, Driver.ROBOT)):
        step = labelled_step(ROLLOUTS[0], k, 0.0, participant="p", attempt=2)
        record.step(replace(step, gate=gate), None)
    record.finish()
    assert [details["step"] for what, details in listener.marks if what == "driver"] == [0, 1, 3]
    assert listener.marks[-1] == ("drive_end", {"how": "finished", "outcome": "block_hit"})
    assert [entry[:2] for entry in listener.steps] == [(5, k) for k in range(4)]
