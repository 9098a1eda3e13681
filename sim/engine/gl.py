"""What must be settled before MuJoCo is imported: the OpenGL back end, and Triton before OpenGL.

MuJoCo and dm_control read ``MUJOCO_GL`` at import and fail there, or late, when it does not fit. A
back end is tried in a process of its own (a broken driver may crash the process), the answer is
cached. What was settled is told to the processes that are started from here, by the environment.

PyTorch's CUDA build brings Triton, which carries an LLVM of its own; Mesa's software drivers load
LLVM as a shared library, whose symbols PyOpenGL makes visible to everyone. A Triton that is loaded
after it (``torch.optim`` does that) finds those instead of its own and ends in a segmentation
fault. Loaded first, both keep their own.
"""

import ctypes
import importlib.util
import json
import logging
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from steerlab.sim.errors import shown
from steerlab.sim.files.whole_file import whole_file

if sys.platform == "darwin":
    BACKENDS: tuple[str, ...] = ("cgl", "glfw")
    INSTALL_HINT = "run it in a session that may use the display; macOS brings its own driver"
elif sys.platform == "win32":
    BACKENDS = ("wgl", "glfw")
    INSTALL_HINT = "install the graphics card's driver from its maker"
else:
    BACKENDS = ("egl", "osmesa", "glfw")  # fastest and most headless first
    INSTALL_HINT = "sudo apt-get install libegl1 libgl1 libgl1-mesa-dri"
_DISABLED = "disabled"
_NO_BACKEND = (_DISABLED, "disable", "off", "false", "0")  # as MuJoCo takes it
_SETTLED = "STEERLAB_GL"  # the ``MUJOCO_GL`` that was found good here
_WHY_NOT = "STEERLAB_GL_WHY_NOT"  # what is wrong with the one that the user has set
_PROBE = """
import mujoco
context = mujoco.GLContext(32, 32)
context.make_current()
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><light pos="0 0 3"/><geom size="1"/></worldbody></mujoco>')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, renderer)
assert renderer.currentBuffer == mujoco.mjtFramebuffer.mjFB_OFFSCREEN
renderer.free()
context.free()
"""
_log = logging.getLogger(__name__)


def choose_gl() -> str | None:
    """Set ``MUJOCO_GL`` unless the user has; return the back end, None where none works.

    Without a back end everything but the camera works; ``Camera`` then raises ``NoRenderer``. So it
    is where the user's choice is no back end or cannot draw, which is said once: MuJoCo's import
    would fail on some of those.
    """
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()  # as MuJoCo reads it
    if not asked or asked != os.environ.get(_SETTLED):
        os.environ[_WHY_NOT] = why_not = _why_not(asked)
        if why_not:
            _log.warning("%s Until then, nothing is drawn.", why_not)
            asked = _DISABLED
        os.environ[_SETTLED] = asked or _cached(_cache_key()) or _probe_all() or _DISABLED
    chosen = os.environ["MUJOCO_GL"] = os.environ[_SETTLED]
    if chosen in ("egl", "osmesa"):  # PyOpenGL must be told too, before its first import
        os.environ["PYOPENGL_PLATFORM"] = chosen
    if chosen == "osmesa":
        os.environ.setdefault("DISABLE_RENDER_THREAD_OFFLOADING", "1")  # else noise at exit
    return chosen if chosen in BACKENDS else None


def why_not() -> str:
    """What is wrong with the ``MUJOCO_GL`` that the user has set, and the remedy; empty if nothing."""
    return os.environ.get(_WHY_NOT, "")


def _why_not(asked: str) -> str:
    if not asked or asked in _NO_BACKEND:
        return ""
    if asked not in BACKENDS:
        cause = "is no OpenGL back end"
    elif _draws(asked):
        return ""
    else:
        cause = "cannot draw on this machine"
    return (
        f"MUJOCO_GL is {shown(asked)}, which {cause}; unset it to let steerlab choose, or set it "
        f"to one of {', '.join(BACKENDS)} that draws here."
    )


def draw_without_threads() -> None:
    """Have Mesa's software driver draw in the thread that asks, unless the user has set otherwise.

    Waking its threads costs more than a frame of 64 pixels takes (0.67 ms a step with its picture
    against 0.40), the more when other processes want the cores; large pictures do gain from them.
    Changes no pixel. Call it before MuJoCo is imported, which opens the driver; processes started
    afterwards inherit it.
    """
    os.environ.setdefault("LP_NUM_THREADS", "0")


def context_module(backend: str) -> str:
    """The module whose ``GLContext`` draws with ``backend``; MuJoCo serves WGL by GLFW."""
    return f"mujoco.{'glfw' if backend == 'wgl' else backend}"


def works(backend: str) -> bool:
    """Whether ``backend`` draws into an offscreen buffer, tried in a fresh process."""
    environment = {**os.environ, "MUJOCO_GL": backend}
    environment.pop("PYOPENGL_PLATFORM", None)
    if backend == "osmesa":
        environment["PYOPENGL_PLATFORM"] = "osmesa"
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE], env=environment, capture_output=True, timeout=60
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        _log.debug("%s: %s", backend, error)
        return False
    return done.returncode == 0


def _probe_all() -> str | None:
    for backend in BACKENDS:
        if backend == "glfw" and sys.platform == "linux" and "DISPLAY" not in os.environ:
            continue
        if works(backend):
            _remember(_cache_key(), backend)
            return backend
    return None


def _draws(backend: str) -> bool:
    """Whether a back end of the user's own choice works, tried or remembered."""
    key = f"{_cache_key()}, MUJOCO_GL {backend}"
    if backend in (_cached(_cache_key()), _cached(key)):
        return True
    if not works(backend):
        return False
    _remember(key, backend)
    return True


def _cache_file() -> Path:
    """Where answers are kept.

    Raises:
        OSError: the user has no home folder.
    """
    root = os.environ.get("XDG_CACHE_HOME")
    try:
        folder = Path(root) if root else Path.home() / ".cache"
    except RuntimeError as error:  # neither HOME nor an entry in the system's list of users
        raise OSError(str(error)) from error
    return folder / "steerlab" / "gl.json"


def _cache_key() -> str:
    """What the answer depends on: another driver or display may need another back end."""
    return f"mujoco {version('mujoco')}, display {os.environ.get('DISPLAY', 'none')}"


def _cached(key: str) -> str | None:
    """A remembered success; failures are not kept, since the user may fix them."""
    answer = _answers().get(key)
    return next((backend for backend in BACKENDS if backend == answer), None)


def _answers() -> dict[str, object]:
    try:
        answers = json.loads(_cache_file().read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return answers if isinstance(answers, dict) else {}


def _remember(key: str, backend: str) -> None:
    try:
        path = _cache_file()
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as fresh:
            fresh.write_text(json.dumps(_answers() | {key: backend}), encoding="utf-8")
    except OSError as error:  # a read-only home costs a probe at each start, nothing else
        _log.debug("cannot cache the OpenGL choice: %s", error)


def settle_triton() -> None:
    """Make it safe to draw and to train in this process, in any order; without Triton do nothing.

    Where someone has already opened such a driver, Triton is kept out instead: importing it then
    raises ``ImportError``, with which PyTorch goes on. Call it before MuJoCo is imported.
    """
    if sys.platform != "linux" or "triton" in sys.modules:
        return
    spec = importlib.util.find_spec("triton")
    if spec is None or spec.origin is None:
        return
    if _llvm_is_loaded():
        _log.info("an OpenGL driver was opened before steerlab was imported: no Triton here")
        sys.modules["triton"] = None  # pyright: ignore[reportArgumentType] - Python's own way
        return
    library = Path(spec.origin).parent / "_C" / "libtriton.so"
    try:
        if library.exists():
            ctypes.CDLL(str(library))  # 20 ms; the whole package takes 100
        else:
            importlib.import_module("triton")
    except (OSError, ImportError) as error:  # what cannot be loaded now cannot be later either
        _log.info("Triton cannot be loaded: %s", error)


def _llvm_is_loaded() -> bool:
    """Whether this process has LLVM's shared library open."""
    try:
        return "/libLLVM" in Path("/proc/self/maps").read_text(encoding="utf-8")
    except OSError:  # no /proc, as in some sandboxes: then the usual order is taken for granted
        return False
