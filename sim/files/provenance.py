"""What a run was made with: versions and processor, kept with every result."""

import platform
from importlib.metadata import version

from steerlab.sim.files.machine import cpu_model

PACKAGES = ("steerlab", "mujoco", "numba", "numpy", "pyarrow", "scipy", "torch")


def versions() -> dict[str, str]:
    """Versions by name; the processor too, since AVX-512 machines may round differently."""
    return {
        "python": platform.python_version(),
        **{package: version(package) for package in PACKAGES},
        "platform": platform.platform(),
        "cpu": cpu_model(),
    }
