"""What one downstream comparison is: who teaches which learners, on which task."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from steerlab.learning.agents import baseline_of
from steerlab.learning.agents.teaching import TeachingConfig
from steerlab.learning.policy import Inputs, PolicyConfig
from steerlab.learning.policy_training import PolicyTrainingConfig
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.live_teacher import DrivingStyle
from steerlab.sim.tasks import Task, make_task

Population = Literal["wide", "paper", "low", "human", "high", "people", "sparse"]
Family = Literal[
    "scripted", "asymmetric", "bang-bang", "dither", "late-braking", "fatigue", "sparse"
]
DEFAULT_LEARNERS = ("bc", "dagger", "mind-meld", "mind-meld-mean", "oracle")


@dataclass(frozen=True, kw_only=True)
class TeachConfig:
    """Everything that decides the results; how many processes share the work does not.

    Attributes:
        population: of all teachers; see ``sim/wide_population.py`` and ``sim/populations.py``.
        family: of the test teachers; any but ``scripted`` is one the mapper never saw. ``sparse``
            ones are of the population of that name, whatever the others' is.
        driving: how teachers drive, ``softened`` or as clumsily as they correct (``raw``).
        training_teachers: whose calibration labels the mappers are trained on.
        starts: evaluation drives after the last round; ``starts_on_the_way`` of them before.
        training_steps: gradient steps of a policy in each round.
    """

    learners: tuple[str, ...] = DEFAULT_LEARNERS
    teachers: int = 20
    rounds: int = 12
    task: str = "slalom"
    noise: float = 0.5
    speed_mps: float = 5.0
    learner_seeds: int = 3
    seed: int = 0
    population: Population = "wide"
    family: Family = "scripted"
    driving: DrivingStyle = "softened"
    inputs: Inputs = "image+state"
    training_teachers: int = 34
    starts: int = 10
    starts_on_the_way: int = 4
    training_steps: int = PolicyTrainingConfig().steps

    def __post_init__(self) -> None:
        for name, least in (
            ("teachers", 1),
            ("rounds", 1),
            ("learner_seeds", 1),
            ("seed", 0),
            ("training_teachers", 3),
            ("starts", 1),
            ("starts_on_the_way", 1),
            ("training_steps", 1),
        ):
            if getattr(self, name) < least:
                raise InvalidConfig(
                    f"{name.replace('_', '-')} is {getattr(self, name)}; it must be at least "
                    f"{least}."
                )
        for name, kinds in (
            ("population", Population),
            ("family", Family),
            ("driving", DrivingStyle),
        ):
            if getattr(self, name) not in get_args(kinds):
                raise InvalidConfig(
                    f"{name} is {getattr(self, name)!r}; choose one of "
                    f"{', '.join(get_args(kinds))}."
                )
        if self.family != "scripted" and self.population == "wide":
            raise InvalidConfig(
                f"{self.family} teachers are of any population but wide; add --population human."
            )
        if not self.learners or len(set(self.learners)) != len(self.learners):
            raise InvalidConfig(f"learners is {', '.join(self.learners)!r}; name each once.")
        for learner in self.learners:
            baseline_of(learner)
        if self.starts_on_the_way > self.starts:
            raise InvalidConfig(
                f"starts-on-the-way {self.starts_on_the_way} are more than all {self.starts} starts."
            )
        PolicyConfig(inputs=self.inputs)
        make_task(self.task, noise=self.noise, speed_mps=self.speed_mps)

    @property
    def baselines(self) -> set[str]:
        """The mappers that the learners need."""
        return {baseline for baseline in map(baseline_of, self.learners) if baseline is not None}

    @property
    def teaching(self) -> TeachingConfig:
        """The settings of one learner's rounds."""
        return TeachingConfig(
            rounds=self.rounds,
            driving_style=self.driving,
            policy=PolicyConfig(inputs=self.inputs),
            training=PolicyTrainingConfig(steps=self.training_steps),
        )

    def make_task(self) -> Task:
        """The task with its noise and speed."""
        return make_task(self.task, noise=self.noise, speed_mps=self.speed_mps)

    def identity(self) -> dict[str, Any]:
        """What must be equal to continue a run; teachers, learners and their seeds may be added."""
        values = asdict(self)
        del values["teachers"], values["learners"], values["learner_seeds"]
        return values
