"""``steerlab doctor``: what this machine can do, and what to change where it falls short."""

import os
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter

import numpy as np

from steerlab.sim.errors import NoRenderer
from steerlab.sim.files.machine import available_cores, cpu_model
from steerlab.sim.files.provenance import versions

MIN_FREE_GB = 2.0
MAX_FRAME_MS = 16.0  # one display frame at 60 Hz
MIN_PYTHON = (3, 11)
_DRAW_AND_TRAIN = """
from steerlab.sim.engine.camera import Camera
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import NoRenderer
from steerlab.sim.tasks import make_task

def draw():
    try:
        with Driving(make_task("easy").world) as driving, Camera(driving.model, driving.data):
            pass
    except NoRenderer:  # another check reports it
        pass

draw()
import torch
weight = torch.nn.Parameter(torch.ones(1))
weight.sum().backward()
torch.optim.Adam([weight]).step()
draw()
"""


@dataclass(frozen=True, kw_only=True)
class CheckResult:
    """One line of ``steerlab doctor``; ``mend`` says what to do, and is empty where ``ok``."""

    what: str
    found: str
    ok: bool
    mend: str = ""


def examine(folder: Path) -> list[CheckResult]:
    """Python, processor, disk (of ``folder``), versions, OpenGL, physics, and drawing beside PyTorch."""
    return [_python(), _processor(), _disk(folder), _versions(), *_camera(), _training()]


def _python() -> CheckResult:
    installed = ".".join(map(str, sys.version_info[:3]))
    ok = sys.version_info >= MIN_PYTHON
    return CheckResult(
        what="Python", found=installed, ok=ok, mend="" if ok else "Install Python 3.11."
    )


def _processor() -> CheckResult:
    cores = available_cores()
    ok = cores >= 2
    mend = "" if ok else "Give it two cores: the loop and the drawing each want one."
    return CheckResult(what="Processor", found=f"{cores} cores, {cpu_model()}", ok=ok, mend=mend)


def _disk(folder: Path) -> CheckResult:
    try:
        free_gb = shutil.disk_usage(folder).free / 1e9
    except OSError as error:
        return CheckResult(
            what="Disk",
            found=f"{folder}: {error.strerror}",
            ok=False,
            mend="Name an existing folder with --folder.",
        )
    ok = free_gb >= MIN_FREE_GB
    mend = "" if ok else f"Free {MIN_FREE_GB:g} GB: a full disk stops a session."
    return CheckResult(what="Disk", found=f"{free_gb:.1f} GB free", ok=ok, mend=mend)


def _versions() -> CheckResult:
    other_lines = ("python", "cpu", "platform")
    packages = [f"{name} {v}" for name, v in versions().items() if name not in other_lines]
    return CheckResult(what="Versions", found=", ".join(packages), ok=True)


def _camera() -> list[CheckResult]:
    from steerlab.sim.engine.camera import Camera, CameraConfig
    from steerlab.sim.engine.driving import Driving
    from steerlab.sim.engine.gl import INSTALL_HINT, why_not
    from steerlab.sim.world_generator import generate_world

    backend = os.environ.get("MUJOCO_GL", "none")
    with Driving(generate_world("doctor", np.random.default_rng(0))) as driving:
        checks: list[CheckResult] = []
        for config in (CameraConfig(), CameraConfig(width=960, height=540)):
            what = f"Camera {config.width} x {config.height}"
            try:
                with Camera(driving.model, driving.data, config) as camera:
                    frame_ms = _ms_per_call(camera.frame)
            except NoRenderer as error:
                mend = "Unset MUJOCO_GL, and run this again." if why_not() else INSTALL_HINT
                return [CheckResult(what="OpenGL", found=str(error), ok=False, mend=mend)]
            ok = frame_ms <= MAX_FRAME_MS
            mend = "" if ok else "Use a smaller picture, or a machine with a graphics driver."
            checks.append(CheckResult(what=what, found=f"{frame_ms:.1f} ms", ok=ok, mend=mend))
        step_us = 1e3 * _ms_per_call(lambda: driving.step(0.0))
    return [
        CheckResult(what="OpenGL", found=backend, ok=True),
        *checks,
        CheckResult(what="Physics", found=f"{step_us:.0f} µs per control step", ok=True),
    ]


def _training() -> CheckResult:
    """PyTorch's Triton and Mesa's drivers can kill the process they share (``sim.engine.gl``)."""
    what, brought = "Drawing, training", "without Triton"
    with suppress(PackageNotFoundError):
        brought = f"with Triton {version('triton')}"
    done = subprocess.run(
        [sys.executable, "-c", _DRAW_AND_TRAIN], capture_output=True, encoding="utf-8"
    )
    if done.returncode == 0:
        return CheckResult(what=what, found=f"in one process, {brought}", ok=True)
    said = done.stderr.strip().rpartition("\n")[2] or f"it ended with {done.returncode}"
    return CheckResult(
        what=what,
        found=f"not in one process, {brought}: {said}",
        ok=False,
        mend="Install PyTorch's CPU build (make TORCH=cpu), or uninstall triton.",
    )


def _ms_per_call(call, calls: int = 60) -> float:
    call()
    started = perf_counter()
    for _ in range(calls):
        call()
    return 1e3 * (perf_counter() - started) / calls
