"""The calibration set: twelve fixed rollouts that every participant corrects.

It ships with the package; ``steerlab calibration-set --out FILE`` makes it again.
"""

from importlib.resources import as_file, files

from steerlab.sim.rollout import Rollout
from steerlab.sim.rollout_file import read_rollouts

CALIBRATION_FILE = "calibration_set.parquet"


def load_calibration_set() -> tuple[Rollout, ...]:
    """The shipped twelve rollouts."""
    with as_file(files("steerlab.assets") / CALIBRATION_FILE) as path:
        return read_rollouts(path)
