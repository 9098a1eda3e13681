"""Interactive learners on camera images: one loop, and a gate and a label rule for each learner."""

from steerlab.learning.agents.catalogue import LEARNERS, baseline_of, make_agent
from steerlab.learning.agents.contract import Agent, Episode, Gate, LabelRule, Learner, Targets
from steerlab.learning.agents.evaluation import DriveResult, evaluate
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.offline import demonstrate_offline, play, teach_offline
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching import (
    BallNeverReached,
    Judging,
    TeachingConfig,
    TeachingLoop,
    TeachingSpec,
)
from steerlab.learning.agents.teaching_contract import RoundResult

__all__ = [
    "LEARNERS",
    "Agent",
    "BallNeverReached",
    "DriveResult",
    "Episode",
    "Gate",
    "Judging",
    "LabelRule",
    "Learner",
    "PolicyLearner",
    "RoundResult",
    "Targets",
    "TaskEnv",
    "TeachingConfig",
    "TeachingLoop",
    "TeachingSpec",
    "baseline_of",
    "demonstrate_offline",
    "evaluate",
    "make_agent",
    "play",
    "teach_offline",
]
