"""Ground truth: RRT* and Stanley (paper, section 3.3) as one planner per world.

``Planner`` answers for any pose with an oracle label, the path the label was read from, or a
committed path to the ball; ``OracleDriver`` drives the latter; ``sample_starts`` draws poses from
which that works.
"""

from steerlab.sim.ground_truth.config import PlannerConfig
from steerlab.sim.ground_truth.oracle import OracleDriver, OracleLabels, Path
from steerlab.sim.ground_truth.planner import Planner, sample_starts

__all__ = ["OracleDriver", "OracleLabels", "Path", "Planner", "PlannerConfig", "sample_starts"]
