"""What a run was made with: versions and processor, kept with every result."""

import platform
from importlib.metadata import version
from pathlib import Path

PACKAGES = ("steerlab", "mujoco", "dm-control", "numba", "numpy", "pyarrow", "scipy", "torch")


def versions() -> dict[str, str]:
    """Versions by name; the processor too, since AVX-512 machines may round differently."""
    return {
        "python": platform.python_version(),
        **{package: version(package) for package in PACKAGES},
        "platform": platform.platform(),
        "cpu": cpu_model(),
    }


def cpu_model() -> str:
    """The processor's name as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:  # not Linux
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
