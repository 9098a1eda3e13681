"""Interactive learners on camera images: one loop, and a small file for each of them."""

from steerlab.learning.agents.catalogue import LEARNERS, baseline_of, make_agent
from steerlab.learning.agents.contract import Agent, Episode, Gate, LabelRule, Learner, Targets
from steerlab.learning.agents.evaluation import DriveResult, evaluate
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.play import Place, play
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching import (
    BallNeverReached,
    Judging,
    RoundResult,
    TeachingConfig,
    demonstrate,
    teach,
)

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
    "Place",
    "PolicyLearner",
    "RoundResult",
    "Targets",
    "TaskEnv",
    "TeachingConfig",
    "baseline_of",
    "demonstrate",
    "evaluate",
    "make_agent",
    "play",
    "teach",
]
