"""The section ``[teaching]`` of a study's protocol: where robots are taught, and how they learn."""

import re
from dataclasses import dataclass

from steerlab.sim.errors import InvalidValue

TASKS = ("easy", "slalom", "hard")  # of ``sim.tasks``, whose import takes a second
_GENERATED = re.compile(r"generated-\d{1,6}")


@dataclass(frozen=True, kw_only=True, slots=True)
class TeachPlan:
    """The same for all participants and conditions; how many rounds is ``demonstrations``.

    Attributes:
        task: one of ``TASKS``, or ``generated-<number>``.
        noise: standard deviation of the noise added to whatever wheel is executed, in wheel units.
        learner_seed: of starts, noise, initial weights and batches; each participant's are drawn
            from it and their pseudonym, and are the same in all their conditions.
        gradient_steps: between two rounds.
        rate: of Adam.
        starts: evaluation drives of each round's policy, from starts the noisy oracle masters.
        tries: at the first drive, until it reaches the ball.
    """

    task: str = "slalom"
    noise: float = 0.5
    learner_seed: int = 0
    gradient_steps: int = 150
    rate: float = 2e-3
    starts: int = 10
    tries: int = 10

    def __post_init__(self) -> None:
        if self.task not in TASKS and not _GENERATED.fullmatch(self.task):
            allowed = f"one of {', '.join(TASKS)}, or generated-<number> such as generated-3"
            raise InvalidValue("task", self.task, allowed)
        if not 0.0 <= self.noise <= 2.5:
            raise InvalidValue("noise", self.noise, "from 0 to 2.5, in wheel units")
        if not 0.0 < self.rate < 1.0:
            raise InvalidValue("rate", self.rate, "between 0 and 1")
        for name, least in (
            ("learner_seed", 0),
            ("gradient_steps", 1),
            ("starts", 1),
            ("tries", 1),
        ):
            if getattr(self, name) < least:
                allowed = f"a whole number, at least {least}"
                raise InvalidValue(name, getattr(self, name), allowed)
