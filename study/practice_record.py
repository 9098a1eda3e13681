"""What is kept of practice drives: how many balls, blocks and seconds, and nothing of the steering."""

import json
from dataclasses import asdict, dataclass
from typing import Self

from steerlab.study.progress import ParticipantProgress
from steerlab.study.store.people import PhaseAct
from steerlab.teleop.practice import PracticeResult


@dataclass(frozen=True, kw_only=True, slots=True)
class Practised:
    """How much a participant practised.

    Attributes:
        driven_s: time at the wheel while the car drove.
    """

    balls: int
    blocks_hit: int
    driven_s: float

    @classmethod
    def of(cls, result: PracticeResult) -> Self:
        """What one sitting reached."""
        return cls(
            balls=result.balls, blocks_hit=result.crashes, driven_s=round(result.driven_s, 3)
        )

    @property
    def detail(self) -> str:
        """What the act that ends a sitting says, as JSON."""
        return json.dumps(asdict(self))

    def __str__(self) -> str:
        """In words."""
        return f"{self.balls} balls reached, {self.blocks_hit} blocks hit, {self.driven_s:.1f} s driven"


def practised(progress: ParticipantProgress, phase: str) -> Practised:
    """What a participant reached in all sittings of a practice phase, since it was last opened."""
    sittings: list[Practised] = []
    for act in progress.acts.get(phase, ()):
        if act.act is PhaseAct.REOPENED:
            sittings.clear()
        elif act.act is not PhaseAct.SKIPPED and act.detail:
            sittings.append(Practised(**json.loads(act.detail)))
    return Practised(
        balls=sum(one.balls for one in sittings),
        blocks_hit=sum(one.blocks_hit for one in sittings),
        driven_s=sum(one.driven_s for one in sittings),
    )
