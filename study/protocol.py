"""The protocol of a study as data: what participants go through, and what was planned for it."""

import re
from dataclasses import dataclass, field

from steerlab.sim.errors import InvalidValue, check_words
from steerlab.study.contract import PhaseKind, Role
from steerlab.study.plans import (
    AnalysisPlan,
    ConsentText,
    DisplayPlan,
    MapperPlan,
    PracticePlan,
    WheelPlan,
)
from steerlab.study.teaching.conditions import TAUGHT
from steerlab.study.teaching.plan import TeachPlan
from steerlab.teleop.timing_limits import GateConfig

_KEY = re.compile(r"[a-z][a-z0-9_-]{0,31}")
KEY_WORDS = "lower-case letters, digits, - and _, starting with a letter, 32 at most"
CONDITIONS = tuple(TAUGHT)
"""What test participants can teach with; the paper compares the first three."""
MOST_CONDITIONS = 4  # 24 orders; more would need blocks that no study fills
_PREFIX = re.compile(r"[A-Z]{1,4}")


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
    """

    id: str
    kind: PhaseKind
    title: str
    roles: tuple[Role, ...] = (Role.TRAINING, Role.TEST)
    questionnaires: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    text: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.id):
            raise InvalidValue("id", self.id, KEY_WORDS)
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
        for name in ("questionnaires", "after"):
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
        seed: of the condition orders, the practice worlds and the training.
        rollouts: names of the calibration rollouts, in the order in which they are corrected.
        demonstrations: rounds of each condition, after its first drive; N in the paper's Algorithm 1.
        block_size: condition orders are balanced within each block of so many test participants.
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
    training_prefix: str = "T"
    test_prefix: str = "P"
    practice: PracticePlan = field(default_factory=PracticePlan)
    display: DisplayPlan = field(default_factory=DisplayPlan)
    wheel: WheelPlan = field(default_factory=WheelPlan)
    mapper: MapperPlan = field(default_factory=MapperPlan)
    teaching: TeachPlan = field(default_factory=TeachPlan)
    gates: GateConfig = field(default_factory=GateConfig)
    plan: AnalysisPlan = field(default_factory=AnalysisPlan)

    def prefix(self, role: Role) -> str:
        """Of the pseudonyms of a role."""
        return self.training_prefix if role is Role.TRAINING else self.test_prefix

    @property
    def questionnaires(self) -> tuple[str, ...]:
        """Keys of all that are asked, each once."""
        named = [key for phase in self.phases for key in (*phase.questionnaires, *phase.after)]
        return tuple(dict.fromkeys(named))


def check_prefix(key: str, prefix: str) -> None:
    """A pseudonym's first letters.

    Raises:
        InvalidValue: they are none.
    """
    if not _PREFIX.fullmatch(prefix):
        raise InvalidValue(key, prefix, "one to four capital letters")
