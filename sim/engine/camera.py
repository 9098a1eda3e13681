"""An offscreen camera tuned for software OpenGL: 0.5 ms for 64 x 64 where defaults take 65 ms."""

import atexit
import ctypes
import os
import sys
from importlib import import_module
from threading import get_ident
from types import TracebackType
from typing import Protocol
from weakref import WeakSet

import mujoco
import numpy as np
from numpy.typing import NDArray
from OpenGL.error import Error as OpenGLError

from steerlab.sim.camera_config import CameraConfig
from steerlab.sim.engine.car import CAR_GROUP, HOOD_GROUP
from steerlab.sim.engine.gl import INSTALL_HINT, choose_gl, context_module, why_not
from steerlab.sim.errors import NoRenderer

_FORKED = (
    "This process was forked from one that had drawn, and OpenGL does not survive that. Start it "
    'afresh, with multiprocessing.get_context("spawn"), or fork before the first camera.'
)


class _GLContext(Protocol):
    def make_current(self) -> None: ...

    def free(self) -> None: ...


class Camera:
    """Draws the scene of one model and data pair; close it before the model goes.

    It belongs to the thread that made it. In a process that was forked from one that has drawn,
    there is no drawing: there, closing does nothing.

    Raises:
        NoRenderer: this machine has no OpenGL back end that can draw offscreen, or the process was
            forked.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, config: CameraConfig | None = None
    ) -> None:
        self.config = config or CameraConfig()
        width, height = self.config.width, self.config.height
        self.model, self._data = model, data
        self._gl: _GLContext | None = _open_context(width, height)
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.quality.offsamples = self.config.samples
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False  # 30 ms of 65
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()
        self._option.geomgroup[CAR_GROUP] = self.config.view == "chase"
        self._option.geomgroup[HOOD_GROUP] = self.config.view == "driver"
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(f"car/{self.config.view}").id
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._bottom_up = np.empty((height, width, 3), np.uint8)
        self._frame = np.empty_like(self._bottom_up)
        self._thread = get_ident()
        _process.opened(self)

    def frame(self, out: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
        """Draw what the camera sees now.

        Returns:
            (height, width, 3) RGB, top row first: ``out`` if given, else a buffer that the next
            call overwrites.

        Raises:
            NoRenderer: the camera is closed, or another thread or a forked process asks.
        """
        if self._gl is None:
            raise NoRenderer(
                _FORKED if _process.forked else "This camera is closed; make a new one."
            )
        self._check_thread("draws")
        frame = self._frame if out is None else out
        model, data = self.model, self._data
        # mj_step leaves positions one physics step behind; these two do not touch its warm start.
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        self._gl.make_current()
        mujoco.mjv_updateScene(
            model,
            data,
            self._option,
            None,
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        mujoco.mjr_render(self._viewport, self._scene, self._context)
        mujoco.mjr_readPixels(self._bottom_up, None, self._viewport, self._context)
        np.copyto(frame, self._bottom_up[::-1])
        return frame

    def close(self) -> None:
        """Free the OpenGL context; calling it again does nothing.

        Raises:
            NoRenderer: another thread than the one that made the camera asks.
        """
        if self._gl is not None:
            self._check_thread("is closed")
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None

    def __enter__(self) -> "Camera":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _check_thread(self, does: str) -> None:
        if get_ident() != self._thread:
            raise NoRenderer(
                f"A camera {does} only in the thread that made it; make one in each thread that "
                "draws, and close it there."
            )

    def _abandon(self) -> None:
        """Never free what belongs to the process from which this one was forked: that hangs."""
        for one in (self._context, self._gl):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(one))
        self._gl = None


class _Process:
    """What this process has drawn with, so that one forked from it touches none of it."""

    def __init__(self) -> None:
        self.forked = False
        self._cameras: WeakSet[Camera] = WeakSet()
        self._watched = False

    def opened(self, camera: Camera) -> None:
        self._cameras.add(camera)
        if not self._watched and hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._after_fork)
        self._watched = True

    def _after_fork(self) -> None:
        self.forked = True
        for camera in self._cameras:
            if camera._gl is not None:
                camera._abandon()
        egl = sys.modules.get("mujoco.egl")
        if egl is not None:  # it would shut the driver down at exit
            atexit.unregister(egl.EGL.eglTerminate)


_process = _Process()


def _open_context(width: int, height: int) -> _GLContext:
    if _process.forked:
        raise NoRenderer(_FORKED)
    backend = choose_gl()
    if backend is None and why_not():
        raise NoRenderer(why_not())
    try:
        if backend is None:
            raise RuntimeError("no back end works here")
        # Not mujoco.GLContext: that was bound to a back end when MuJoCo was first imported,
        # which may have been before steerlab could choose one.
        context = import_module(context_module(backend)).GLContext(width, height)
        context.make_current()
    except (RuntimeError, ImportError, AttributeError, OpenGLError) as error:
        raise NoRenderer(
            f"Cannot draw offscreen with MUJOCO_GL={os.environ['MUJOCO_GL']} ({error}). "
            f"Unset it if you have set it, or fix the driver: {INSTALL_HINT}"
        ) from error
    return context
