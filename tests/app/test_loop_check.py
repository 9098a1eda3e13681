import subprocess
import sys
from dataclasses import replace

import pygame
import pytest

from steerlab.app.loop_check import LoopCheck, loop_checks, measure_loop
from steerlab.teleop.sdl import SdlEvents
from steerlab.teleop.timing_limits import LoopHealth, TimingViolation


def check(*failed, steps=1200, **changes):
    health = {
        "steps": steps,
        "lateness_p50_ms": 0.01,
        "lateness_p99_ms": 0.1,
        "lateness_max_ms": 0.4,
        "overruns": 0,
        "frames": 3600,
        "dropped": 0,
        "frame_p50_ms": 6.0,
        "frame_p99_ms": 9.0,
        "input_age_p50_ms": 2.0,
        "input_age_p99_ms": 4.0,
    }
    gates = tuple(TimingViolation(name=name, value=99.0, limit=1.0) for name in failed)
    return LoopCheck(
        health=LoopHealth(**(health | changes)),
        expected_steps=1200,
        input_p50_ms=2.0,
        input_p99_ms=4.0,
        keep_p50_us=10.0,
        keep_p99_us=20.0,
        load=0.2,
        failed=gates,
    )


def test_a_machine_that_keeps_time_has_nothing_to_mend():
    checks = loop_checks(check(), "960x540")
    assert all(one.ok and not one.mend for one in checks)
    assert "1200 taken, 0 lost" in checks[0].found


@pytest.mark.parametrize(
    ("gate", "what"),
    [
        ("lateness_p99_ms", "Wake-up lateness"),
        ("lateness_max_ms", "Wake-up lateness"),
        ("overrun_share", "Control steps"),
        ("dropped_share", "Display"),
        ("input_age_p99_ms", "Input"),
    ],
)
def test_each_gate_has_a_line_and_a_mend(gate, what):
    bad = [one for one in loop_checks(check(gate), "960x540") if not one.ok]
    assert [one.what for one in bad] == [what]
    assert bad[0].mend


def test_a_lost_step_and_no_display_are_said():
    lost = loop_checks(check(steps=1199), "960x540")[0]
    assert not lost.ok
    assert "1 lost" in lost.found
    blind = loop_checks(check(frames=0), "none")
    assert "nothing was drawn" in next(one.found for one in blind if one.what == "Display")


def test_a_load_that_the_system_does_not_tell_is_no_number():
    untold = replace(check(), load=None)
    for found, said in ((check(), "0.20 over the last minute"), (untold, "not told here")):
        load = next(one for one in loop_checks(found, "none") if one.what == "Load")
        assert load.ok
        assert load.found == said


def test_the_whole_loop_runs_and_every_motion_is_found_again(tmp_path):
    with SdlEvents(window=False) as events:
        found = measure_loop(tmp_path, events, None, seconds=0.5)
    assert found.health.steps == found.expected_steps > 100
    assert found.health.frames == 0
    assert 0.0 <= found.input_p50_ms <= found.input_p99_ms
    assert found.keep_p50_us > 0.0
    assert (tmp_path / "study.db").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signal")
def test_a_request_to_end_is_heard(tmp_path):
    """SDL takes SIGTERM, and makes an event of it."""
    code = (
        "import os, signal, sys, threading\n"
        "from pathlib import Path\n"
        "from steerlab.app.loop_check import measure_loop\n"
        "from steerlab.teleop.sdl import SdlEvents\n"
        "with SdlEvents(window=False) as events:\n"
        "    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGTERM)).start()\n"
        "    try:\n"
        "        measure_loop(Path(sys.argv[1]), events, None, 600.0)\n"
        "    except KeyboardInterrupt:\n"
        "        print('stopped')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == "stopped\n", done.stderr


def test_the_close_button_of_the_window_is_heard_too(tmp_path):
    with SdlEvents(window=False) as events:
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        with pytest.raises(KeyboardInterrupt):
            measure_loop(tmp_path, events, None, seconds=60.0)
