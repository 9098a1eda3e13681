"""The protocol of a study: what participants go through, with what settings, and the analysis plan.

``protocol_file`` reads it from ``study.toml``; the sections come first here, the whole last.
"""

import re
from dataclasses import dataclass, field
from typing import Literal

from steerlab.sim.camera_config import View
from steerlab.sim.errors import InvalidValue, check_words
from steerlab.study.consent import ConsentText
from steerlab.study.contract import Phase, PhaseKind, Role
from steerlab.study.design import DesignPlan
from steerlab.study.surveys.questionnaire import Language
from steerlab.study.teaching.conditions import TAUGHT
from steerlab.teleop.devices.force_feedback import DEFAULT_AUTOCENTRE
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.timing_limits import GateConfig

CONDITIONS = tuple(TAUGHT)
"""What test participants can teach with; the paper compares the first three."""
MOST_CONDITIONS = 4  # 24 orders; more would need blocks that no study fills
LONGEST_PRACTICE_MIN = 240.0
CORRECTIONS = ("holm", "bh", "none")
TASKS = ("easy", "slalom", "hard")  # of ``sim.tasks``, whose import takes a second
_GENERATED_TASK = re.compile(r"generated-\d{1,6}")
_PHASE_ID = re.compile(r"[a-z][a-z0-9_-]{0,31}")
_PHASE_ID_RULE = "lower-case letters, digits, - and _, starting with a letter, 32 at most"


@dataclass(frozen=True, kw_only=True, slots=True)
class PracticePlan:
    """The practice drive: how much of it, with pedals or at cruise speed, in what time.

    Attributes:
        balls: it is over when so many were reached,
        minutes: or after so much driving, whichever comes first; None: only the balls count.
        time_limit_s: for each ball.
    """

    balls: int = 5
    minutes: float | None = None
    pedals: bool = True
    time_limit_s: float = 120.0

    def __post_init__(self) -> None:
        if self.balls < 1:
            raise InvalidValue("balls", self.balls, "at least 1")
        if self.minutes is not None and not 0.0 < self.minutes <= LONGEST_PRACTICE_MIN:
            allowed = f"above 0, and at most {LONGEST_PRACTICE_MIN:g}"
            raise InvalidValue("minutes", self.minutes, allowed)
        if not self.time_limit_s > 0.0:
            raise InvalidValue("time_limit_s", self.time_limit_s, "positive")


@dataclass(frozen=True, kw_only=True, slots=True)
class DisplayPlan:
    """What is shown and heard; the same for all, since labels may depend on it.

    ``width`` and ``height`` are those of a window, where it is not the full screen.
    """

    show_agent_wheel: bool = False
    view: View = "driver"
    width: int = 960
    height: int = 540
    full_screen: bool = True
    sound: bool = True
    text_scale: float = 1.0
    countdown_s: float = 3.0

    def __post_init__(self) -> None:
        if not self.countdown_s >= 0.0:
            raise InvalidValue("countdown_s", self.countdown_s, "0 or more")
        self.screen()

    def screen(self) -> ScreenConfig:
        """The window.

        Raises:
            InvalidConfig: it is too small or too large.
        """
        return ScreenConfig(
            width=self.width,
            height=self.height,
            full_screen=self.full_screen,
            sound=self.sound,
            view=self.view,
            text_scale=self.text_scale,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class WheelPlan:
    """Force feedback: whether a wheel's motor pulls to the centre, and how hard, 0 to 1."""

    force_feedback: bool = True
    autocentre: float = DEFAULT_AUTOCENTRE

    def __post_init__(self) -> None:
        if not 0.0 <= self.autocentre <= 1.0:
            raise InvalidValue("autocentre", self.autocentre, "from 0 to 1")

    @property
    def strength(self) -> float | None:
        """The centring force to ask of the device; None leaves the device alone."""
        return self.autocentre if self.force_feedback else None


@dataclass(frozen=True, kw_only=True, slots=True)
class MapperPlan:
    """How the network is trained on the training participants.

    Attributes:
        epochs: None takes the preset's.
        minimum_people: with fewer finished training participants nothing is trained.
    """

    preset: Literal["lab", "paper", "paper-text"] = "lab"
    epochs: int | None = None
    minimum_people: int = 8

    def __post_init__(self) -> None:
        if self.epochs is not None and self.epochs < 1:
            raise InvalidValue("epochs", self.epochs, "at least 1")
        if self.minimum_people < 2:
            raise InvalidValue("minimum_people", self.minimum_people, "at least 2")


@dataclass(frozen=True, kw_only=True, slots=True)
class TeachPlan:
    """Where robots are taught and how they learn, the same for all participants and conditions.

    The number of rounds is the protocol's ``demonstrations``.

    Attributes:
        task: one of ``TASKS``, or ``generated-<number>``.
        noise: standard deviation of the noise added to whatever wheel is executed, in wheel units.
        learner_seed: of starts, noise, initial weights and batches; each participant's are drawn
            from it and their pseudonym, and are the same in all their conditions.
        gradient_steps: between two rounds.
        rate: of Adam.
        starts: number of evaluation drives of each round's policy; they start where the noisy
            oracle reaches the ball.
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
        if self.task not in TASKS and not _GENERATED_TASK.fullmatch(self.task):
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


@dataclass(frozen=True, kw_only=True, slots=True)
class Hypothesis:
    """What was expected before anything was seen, and how it will be tested."""

    id: str
    text: str
    outcome: str
    test: str
    primary: bool = False

    def __post_init__(self) -> None:
        for name in ("id", "text", "outcome", "test"):
            check_words(name, getattr(self, name))


@dataclass(frozen=True, kw_only=True, slots=True)
class AnalysisPlan:
    """How the study will be analysed; frozen with the protocol, before the first participant.

    Attributes:
        correction: for several tests of one family.
        exclusions: rules, in words.
    """

    alpha: float = 0.05
    correction: str = "holm"
    hypotheses: tuple[Hypothesis, ...] = ()
    exclusions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 0.0 < self.alpha < 1.0:
            raise InvalidValue("alpha", self.alpha, "between 0 and 1")
        if self.correction not in CORRECTIONS:
            raise InvalidValue("correction", self.correction, f"one of {', '.join(CORRECTIONS)}")
        for index, rule in enumerate(self.exclusions):
            check_words(f"exclusions[{index}]", rule)
        ids = [hypothesis.id for hypothesis in self.hypotheses]
        for index, id_ in enumerate(ids):
            if id_ in ids[:index]:
                raise InvalidValue(f"hypotheses[{index}].id", id_, "another one: it is taken")


@dataclass(frozen=True, kw_only=True, slots=True)
class Condition:
    """What a test participant teaches with; ``title`` is for reports, participants never see it."""

    key: str
    title: str

    def __post_init__(self) -> None:
        if self.key not in CONDITIONS:
            raise InvalidValue("key", self.key, f"one of {', '.join(CONDITIONS)}")
        check_words("title", self.title)


@dataclass(frozen=True, kw_only=True, slots=True)
class PhasePlan:
    """One phase as planned; a teaching phase becomes one phase for each condition.

    Attributes:
        id: unique; teaching phases get ``-1``, ``-2``, ... in the participant's order.
        after: questionnaires that follow each condition of a teaching phase.
        rollouts: what a calibration phase has of the protocol's; none stands for all.
    """

    id: str
    kind: PhaseKind
    title: str
    roles: tuple[Role, ...] = (Role.TRAINING, Role.TEST)
    questionnaires: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    text: tuple[str, ...] = ()
    rollouts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _PHASE_ID.fullmatch(self.id):
            raise InvalidValue("id", self.id, _PHASE_ID_RULE)
        check_words("title", self.title)
        if not self.roles or len(set(self.roles)) != len(self.roles):
            raise InvalidValue("roles", list(self.roles), "training, test or both, each once")
        asks = self.kind is PhaseKind.QUESTIONNAIRES
        if asks != bool(self.questionnaires):
            allowed = "one or more keys" if asks else f"left out: a {self.kind} phase has none"
            raise InvalidValue("questionnaires", list(self.questionnaires), allowed)
        if self.after and self.kind is not PhaseKind.TEACH:
            raise InvalidValue("after", list(self.after), "left out: only teach phases have it")
        reads = self.kind in (PhaseKind.INSTRUCTIONS, PhaseKind.DEBRIEF)
        if reads != bool(self.text):
            allowed = "one or more paragraphs" if reads else f"left out: {self.kind} has no text"
            raise InvalidValue("text", list(self.text), allowed)
        if self.rollouts and self.kind is not PhaseKind.CALIBRATION:
            allowed = f"left out: a {self.kind} phase has none"
            raise InvalidValue("rollouts", list(self.rollouts), allowed)
        for name in ("questionnaires", "after", "rollouts"):
            keys = getattr(self, name)
            if len(set(keys)) != len(keys):
                raise InvalidValue(name, list(keys), "keys that differ")
        if self.kind in (PhaseKind.CALIBRATE_W, PhaseKind.TEACH) and self.roles != (Role.TEST,):
            allowed = f"['test']: training participants have no {self.kind} phase"
            raise InvalidValue("roles", [*map(str, self.roles)], allowed)


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyProtocol:
    """All that is decided about a study before its first participant.

    Attributes:
        seed: of the condition orders, the orders of items, the practice worlds and the training.
        rollouts: names of the calibration rollouts, in the order in which they are corrected.
        demonstrations: rounds of each condition, after its first drive; N in the paper's Algorithm 1.
        block_size: condition orders are balanced within each block of so many test participants.
        language: of the participants' pages, and of every questionnaire that is asked.
        training_prefix, test_prefix: of the pseudonyms.
    """

    title: str
    seed: int
    rollouts: tuple[str, ...]
    consent: ConsentText
    phases: tuple[PhasePlan, ...]
    conditions: tuple[Condition, ...]
    block_size: int
    demonstrations: int = 12
    language: Language = "en"
    training_prefix: str = "T"
    test_prefix: str = "P"
    design: DesignPlan = field(default_factory=DesignPlan)
    practice: PracticePlan = field(default_factory=PracticePlan)
    display: DisplayPlan = field(default_factory=DisplayPlan)
    wheel: WheelPlan = field(default_factory=WheelPlan)
    mapper: MapperPlan = field(default_factory=MapperPlan)
    teaching: TeachPlan = field(default_factory=TeachPlan)
    gates: GateConfig = field(default_factory=GateConfig)
    plan: AnalysisPlan = field(default_factory=AnalysisPlan)

    def prefix(self, role: Role) -> str:
        """The first letters of a role's pseudonyms."""
        return self.training_prefix if role is Role.TRAINING else self.test_prefix

    @property
    def questionnaires(self) -> tuple[str, ...]:
        """Keys of all that are asked, each once."""
        named = [key for phase in self.phases for key in (*phase.questionnaires, *phase.after)]
        return tuple(dict.fromkeys(named))

    def parts_for(self, role: Role) -> tuple[PhasePlan, ...]:
        """The calibration phases of a role that have a part of the rollouts each."""
        return tuple(phase for phase in self.phases if role in phase.roles and phase.rollouts)

    def phases_for(self, role: Role, order: tuple[str, ...], place: int = 0) -> tuple[Phase, ...]:
        """All phases of a participant, with one teaching phase for each condition.

        Args:
            order: condition keys; the titles that participants see do not give them away.
            place: among the participants of that role, from 0; says who begins with which part.
        """
        parts = [phase.rollouts for phase in self.parts_for(role)]
        turned = place % len(parts) if self.design.turn_parts and parts else 0
        in_turn = iter(parts[turned:] + parts[:turned])
        phases: list[Phase] = []
        for plan in self.phases:
            if role not in plan.roles:
                continue
            if plan.kind is PhaseKind.TEACH:
                phases += _teaching_phases(plan, order)
                continue
            phases.append(
                Phase(
                    id=plan.id,
                    kind=plan.kind,
                    title=plan.title,
                    questionnaires=plan.questionnaires,
                    text=plan.text,
                    rollouts=(next(in_turn) if plan.rollouts else self.rollouts)
                    if plan.kind is PhaseKind.CALIBRATION
                    else (),
                )
            )
        return tuple(phases)


def teach_ids(phase: str, index: int) -> tuple[str, str]:
    """Ids of the ``index``-th condition's teaching and of the questionnaires after it."""
    return f"{phase}-{index + 1}", f"after-{phase}-{index + 1}"


def _teaching_phases(plan: PhasePlan, order: tuple[str, ...]) -> list[Phase]:
    phases: list[Phase] = []
    for index, condition in enumerate(order):
        teach, after = teach_ids(plan.id, index)
        title = f"{plan.title} {index + 1} of {len(order)}"
        phases.append(Phase(id=teach, kind=PhaseKind.TEACH, title=title, condition=condition))
        if plan.after:
            phases.append(
                Phase(
                    id=after,
                    kind=PhaseKind.QUESTIONNAIRES,
                    title=f"After {title[0].lower()}{title[1:]}",
                    condition=condition,
                    questionnaires=plan.after,
                )
            )
    return phases
