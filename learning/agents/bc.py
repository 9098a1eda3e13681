"""Behavioural cloning: the teacher demonstrates, again in each round, and the learner imitates.

Pomerleau, "ALVINN", NeurIPS 1988; the paper's human-centric condition.
"""

from steerlab.learning.agents.common import TeacherDrives, WhereTeacherDrives
from steerlab.learning.agents.contract import Agent


def bc() -> Agent:
    """Teacher drives; the learner never does while it learns."""
    return Agent(name="bc", gate=TeacherDrives(), rule=WhereTeacherDrives())
