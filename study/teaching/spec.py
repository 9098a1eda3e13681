"""What is taught in a course, and how."""

from collections.abc import Sequence
from dataclasses import dataclass

from steerlab.learning.agents.contract import Agent
from steerlab.sim.tasks import Start
from steerlab.study.teaching.conditions import TeachingMode
from steerlab.study.teaching.plan import TeachPlan


@dataclass(frozen=True, kw_only=True, eq=False)
class TeachingSpec:
    """One condition of one participant.

    Attributes:
        rounds: after the first demonstration.
        seed: of this participant's starts, noise, weights and batches.
        starts: of the evaluation drives.
        mapper_sha256: of what maps the labels; None if nothing does.
    """

    condition: str
    taught_by: TeachingMode
    agent: Agent
    plan: TeachPlan
    rounds: int
    seed: int
    starts: Sequence[Start]
    mapper_sha256: str | None
