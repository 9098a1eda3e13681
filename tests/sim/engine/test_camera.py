import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from steerlab.sim.engine import gl
from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import InvalidConfig, NoRenderer

pytestmark = pytest.mark.render


def _is_orange(frame):
    red, green, blue = (frame[..., channel].astype(int) for channel in range(3))
    return (red > 150) & (green > 50) & (green < 160) & (blue < 60)


@pytest.mark.parametrize("size", [(64, 64), (33, 17), (640, 360)])
def test_any_size_shows_the_ball_ahead(open_world, size):
    width, height = size
    config = CameraConfig(width=width, height=height)
    with Driving(open_world) as driving, Camera(driving.model, driving.data, config) as camera:
        frame = camera.frame()
        assert frame.shape == (height, width, 3)
        columns = np.nonzero(_is_orange(frame))[1]
        assert columns.size
        assert abs(columns.mean() - (width - 1) / 2) < 0.1 * width  # straight ahead
        sky, ground = frame[0].mean(axis=0), frame[-1].mean(axis=0)
        assert sky[2] > sky[0] + 20  # the top row is blue sky, so the picture is not upside down
        assert abs(ground[2] - ground[0]) < 20


def test_the_ball_moves_to_the_right_when_the_car_turns_left(open_world):
    with Driving(open_world) as driving, Camera(driving.model, driving.data) as camera:
        for _ in range(10):
            driving.step(1.0)
        columns = np.nonzero(_is_orange(camera.frame()))[1]
        assert columns.mean() > 36


def test_drawing_does_not_change_the_physics(blocky_world):
    with Driving(blocky_world) as plain, Driving(blocky_world) as seen:
        plain.reset(1)
        seen.reset(1)
        with Camera(seen.model, seen.data, CameraConfig(view="chase")) as camera:
            for step in range(50):
                plain.step(np.sin(step))
                seen.step(np.sin(step))
                camera.frame()
        np.testing.assert_array_equal(plain.physics_state(), seen.physics_state())


def test_a_frame_is_of_the_state_now_and_buffers_are_reused(open_world):
    with Driving(open_world) as driving, Camera(driving.model, driving.data) as camera:
        first = camera.frame()
        kept = first.copy()
        driving.step(2.5)
        assert camera.frame() is first
        out = np.empty_like(first)
        assert camera.frame(out) is out
        assert (out != kept).any()
        driving.reset()
        np.testing.assert_array_equal(camera.frame(), kept)


def test_two_cameras_do_not_disturb_each_other(open_world, wall_world):
    with Driving(open_world) as one, Driving(wall_world) as two:
        with Camera(one.model, one.data) as alone:
            expected = alone.frame().copy()
        first, second = Camera(one.model, one.data), Camera(two.model, two.data)
        second.frame()
        np.testing.assert_array_equal(first.frame(), expected)
        assert (second.frame() != expected).any()
        first.close()
        first.close()
        second.frame()
        second.close()
        with pytest.raises(NoRenderer, match="closed"):
            second.frame()


@pytest.mark.parametrize("bad", [{"width": 0}, {"height": 5000}, {"view": "side"}])
def test_bad_sizes_and_views(bad):
    with pytest.raises(InvalidConfig):
        CameraConfig(**bad)


_MUJOCO_FIRST = """
import mujoco
from steerlab.sim.engine.camera import Camera
from steerlab.sim.engine.driving import Driving
from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import WorldSpec
world = WorldSpec(name="w", ball_xy_m=(30.0, 0.0), start=Pose2D(0, 0, 0))
with Driving(world) as driving, Camera(driving.model, driving.data) as camera:
    print(int(camera.frame().mean()))
"""


def _run(code, **environment):
    merged = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    return subprocess.run(
        [sys.executable, "-c", code], env=merged | environment, capture_output=True, text=True
    )


def test_works_when_mujoco_was_imported_first_and_exits_cleanly():
    done = _run(_MUJOCO_FIRST)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 50
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


def test_without_opengl_driving_works_and_the_camera_says_how_to_mend_it():
    done = _run(_MUJOCO_FIRST, MUJOCO_GL="disabled")
    assert "NoRenderer" in done.stderr
    assert "apt-get install" in done.stderr
    assert _run("import steerlab.sim.engine.driving", MUJOCO_GL="disabled").returncode == 0


def test_an_unknown_back_end_is_refused_with_the_known_ones():
    done = _run("import steerlab.sim.engine.driving", MUJOCO_GL="metal")
    assert "MUJOCO_GL is 'metal'" in done.stderr
    assert "egl, osmesa, glfw" in done.stderr
    assert done.returncode == 0  # everything but the camera works


_DRAW = """
from steerlab.sim.engine.camera import Camera
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import NoRenderer
from steerlab.sim.tasks import make_task
driving = Driving(make_task("easy").world)
try:
    camera = Camera(driving.model, driving.data)
    print(camera.frame().mean() > 50)
except NoRenderer as error:
    print(error)
"""


@pytest.mark.parametrize("chosen", ["", "  ", "EGL"])
def test_an_empty_choice_is_none_and_case_does_not_matter(chosen):
    done = _run(_DRAW, MUJOCO_GL=chosen)
    assert done.stdout == "True\n", done.stderr


def test_a_back_end_that_cannot_draw_is_said_once_and_by_the_camera(tmp_path):
    """With the driver's own library missing, MuJoCo's import would end in a traceback."""
    done = _run(
        _DRAW + "import subprocess, sys; subprocess.run([sys.executable, '-c', 'import steerlab.sim.engine'])",
        MUJOCO_GL="osmesa", XDG_CACHE_HOME=str(tmp_path), LD_LIBRARY_PATH="/none",
    )  # fmt: skip
    if done.stdout == "True\n":
        pytest.skip("osmesa draws here")
    assert "MUJOCO_GL is 'osmesa', which cannot draw on this machine; unset it" in done.stdout
    assert done.stderr.count("MUJOCO_GL is 'osmesa'") == 1
    assert "Traceback" not in done.stderr


def test_a_camera_belongs_to_the_thread_that_made_it(open_world):
    with Driving(open_world) as driving, Camera(driving.model, driving.data) as camera:
        for use in (camera.frame, camera.close):
            with (
                ThreadPoolExecutor() as other,
                pytest.raises(NoRenderer, match="only in the thread"),
            ):
                other.submit(use).result()
        assert camera.frame().any()


_FORK = (
    _DRAW
    + """
import os, sys
if sys.argv[1] == "closed":
    camera.close()
sys.stdout.flush()
child = os.fork()
if child == 0:
    for use in (camera.frame, lambda: Camera(driving.model, driving.data)):
        try:
            use()
        except NoRenderer as error:
            print("forked" in str(error) or "closed" in str(error))
    camera.close()
    sys.exit(0)
os.waitpid(child, 0)
if sys.argv[1] == "open":
    print(camera.frame().mean() > 50)
"""
)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing is forked here")
@pytest.mark.parametrize("before", ["open", "closed"])
def test_a_forked_process_refuses_to_draw_and_ends(before):
    """It would wait for the driver's threads, which it has not, for ever: at exit too."""
    done = subprocess.run(
        [sys.executable, "-c", _FORK, before], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["True"] * (4 if before == "open" else 3), done.stderr


def test_without_a_home_the_choice_is_not_remembered(monkeypatch):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", nowhere)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("MUJOCO_GL")
    monkeypatch.setattr(gl, "works", lambda backend: backend == "egl")
    assert gl.choose_gl() == "egl"


def test_the_choice_is_cached_and_a_users_choice_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("MUJOCO_GL")
    tried = []
    monkeypatch.setattr(gl, "works", lambda backend: bool(tried.append(backend)) or True)
    assert gl.choose_gl() == tried[0] == "egl"
    assert list(json.loads((tmp_path / "steerlab/gl.json").read_text()).values()) == ["egl"]
    monkeypatch.delenv("MUJOCO_GL")
    gl.choose_gl()
    assert len(tried) == 1
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert gl.choose_gl() == "osmesa"


def test_no_back_end_is_not_cached(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("MUJOCO_GL")
    monkeypatch.setattr(gl, "works", lambda backend: False)
    assert gl.choose_gl() is None
    assert os.environ["MUJOCO_GL"] == "disabled"
    assert not (tmp_path / "steerlab/gl.json").exists()


_THREADS = """
import sys
from hashlib import sha256
from pathlib import Path
from steerlab.sim.engine.gl import choose_gl, draw_without_threads
if sys.argv[1] == "without":
    draw_without_threads()
    choose_gl()
from steerlab.sim.engine.camera import Camera
from steerlab.sim.engine.driving import Driving
from steerlab.sim.tasks import make_task
with Driving(make_task("slalom").world) as driving, Camera(driving.model, driving.data) as camera:
    frames = b"".join(camera.frame().tobytes() for step in range(30) if driving.step(step / 10))
names = [path.read_text() for path in Path("/proc/self/task").glob("*/comm")]
print(sha256(frames).hexdigest(), sum("llvmpipe" in name for name in names))
"""


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted in /proc")
def test_drawing_without_threads_changes_no_pixel():
    environment = {key: value for key, value in os.environ.items() if key != "LP_NUM_THREADS"}
    found: list[list[str]] = [
        subprocess.run(
            [sys.executable, "-c", _THREADS, how],
            env=environment, capture_output=True, text=True, check=True,
        ).stdout.split()
        for how in ("with", "without")
    ]  # fmt: skip
    (with_threads, _), (without, left) = found
    assert with_threads == without
    assert left == "0"


def test_whoever_sets_the_driver_s_threads_keeps_them(monkeypatch):
    monkeypatch.setenv("LP_NUM_THREADS", "3")
    gl.draw_without_threads()
    assert os.environ["LP_NUM_THREADS"] == "3"
