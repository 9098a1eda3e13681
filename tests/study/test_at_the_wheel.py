"""A study's phases before a real window, by a virtual wheel: stopped, killed, and gone on with."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from time import sleep

import pytest

from steerlab.study.contract import PhaseState, Role
from steerlab.study.progress import progress_of
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.store.records import AttemptStatus
from steerlab.study.study import Study

PERSON = Path(__file__).parents[1] / "teleop" / "virtual_person.py"


@pytest.fixture
def at_calibration(folder, change):
    """The folder of a study in which T001 is to correct the robot now."""
    change(
        folder,
        ("countdown_s = 3.0", "countdown_s = 0.5"),
        ("width = 960\nheight = 540", "width = 640\nheight = 360"),
        ("full_screen = true ", "full_screen = false "),
        ("show_agent_wheel = false", "show_agent_wheel = true"),
    )
    script = ScriptedParticipant(kind="human", seed=1)
    with Study.open(folder) as study:
        who = study.enrol(Role.TRAINING).id
        while (at := study.participant(who).next_phase).id != "practice":
            script.fill(study._opened, progress_of(study._opened, who), at)
        from steerlab.study.runner import RunConfig

        study.run(who, RunConfig(device=script.device, phase="practice"))
        at = study.participant(who).next_phase
        script.fill(study._opened, progress_of(study._opened, who), at)
    return folder


@pytest.mark.display
@pytest.mark.slow
def test_calibration_is_stopped_killed_and_finished_without_doing_anything_twice(
    at_calibration, tmp_path, x_display
):
    folder = at_calibration
    environment = os.environ | {"DISPLAY": x_display}
    environment.pop("SDL_VIDEODRIVER", None)

    def sit_down(plan, act, *arguments):
        command = [sys.executable, str(PERSON), str(tmp_path), json.dumps(plan), "--", "study"]
        return subprocess.Popen(
            [*command, act, str(folder), *arguments],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def kept():
        with Study.open(folder, read_only=True) as study:
            mine = [
                (one.rollout, one.attempt, one.status, one.end_reason)
                for one in study._opened.store.attempts()
            ]
            view = study.participant("T001")
            return mine, {phase.id: state for phase, state in view.phases}, view.progress

    first = sit_down({"stop": 60}, "run", "--participant", "T001", "--phase", "calibration")
    said, wrong = first.communicate(timeout=120)
    assert first.returncode == 0, wrong
    assert "T001  Correcting the robot: stopped; 0 of 2 rollouts corrected" in said
    attempts, states, progress = kept()
    assert progress == "0 of 2 rollouts"
    assert attempts == [("calibration-05", 0, AttemptStatus.ABANDONED, "stopped")]
    assert states["calibration"] is PhaseState.STARTED

    second = sit_down({}, "run", "--participant", "T001")
    while "is done" not in (line := second.stdout.readline()):
        assert line, second.stderr.read()
    sleep(3.0)  # into the second rollout
    os.kill(second.pid, signal.SIGKILL)
    second.communicate()
    attempts, states, progress = kept()
    assert progress == "1 of 2 rollouts"
    assert [one[:3] for one in attempts[1:]] == [
        ("calibration-05", 1, AttemptStatus.FINISHED),
        ("calibration-07", 0, AttemptStatus.RUNNING),
    ]
    assert states["calibration"] is PhaseState.STARTED

    third = sit_down({}, "resume", "T001")
    said, wrong = third.communicate(timeout=120)
    assert third.returncode == 0, wrong
    assert "T001  Correcting the robot: 2 of 2 rollouts corrected" in said
    assert "T001 is at debrief" in said
    attempts, states, progress = kept()
    assert progress == ""
    assert [one[:3] for one in attempts[1:]] == [
        ("calibration-05", 1, AttemptStatus.FINISHED),
        ("calibration-07", 0, AttemptStatus.ABANDONED),
        ("calibration-07", 1, AttemptStatus.FINISHED),
    ]
    assert states["calibration"] is PhaseState.DONE
    with Study.open(folder, read_only=True) as study:
        store = study._opened.store
        for session in store.sessions().values():
            assert (session.input_kind, session.device_name) == ("wheel", "Logitech G920")
            assert session.screen_px == (640, 360)
            assert session.settings["show_agent_wheel"] == "true"
            assert session.settings["protocol_sha256"] == study._opened.versions()[0].sha256
        assert store.timings().num_rows > 0
        findings = study.findings("T001")
        assert any("Logitech G920 (wheel)" in one.found for one in findings)
        assert any("640 x 360" in one.found for one in findings)
