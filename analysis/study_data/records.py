"""``StudyData``: what is analysed, whether of a human study, a scripted one or a population run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from steerlab.analysis.study_data.conduct import SCRIPTED, Conduct
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.study.attention import AttentionCheck
from steerlab.study.surveys.answer_format import Value
from steerlab.study.surveys.questionnaire import Questionnaire

Role = Literal["training", "test"]
"""Training participants teach the mapper, as do the seen people of a population run."""


class NotAStudy(SteerlabError):
    """A folder or a file holds nothing that can be analysed."""


@dataclass(frozen=True, kw_only=True)
class Person:
    """A participant whose data count.

    Attributes:
        answers: by questionnaire and item, of the questionnaires that are not about a condition.
        order: keys of the conditions in the participant's order.
        latency_s: of the device; None if it was not measured.
        steered_with: kinds of device.
        attention: the attention checks they were shown, of every page that was handed in.
        parts: rollouts of each correcting phase, in their order; empty where there is one alone.
    """

    id: str
    role: Role
    answers: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    order: tuple[str, ...] = ()
    latency_s: float | None = None
    steered_with: tuple[str, ...] = ()
    attention: tuple[AttentionCheck, ...] = ()
    parts: tuple[tuple[str, ...], ...] = ()

    @property
    def scripted(self) -> bool:
        """Whether a script steered."""
        return SCRIPTED in self.steered_with


@dataclass(frozen=True, kw_only=True, eq=False)
class Embeddings:
    """Everyone's w from one trained network.

    Attributes:
        source: which network, in words.
        w: (people, d), in the order of ``people``.
        held_out: rollouts that the network was not fitted on; empty if it was fitted on all.
    """

    seed: int
    source: str
    people: tuple[str, ...]
    w: FloatArray
    held_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.w.ndim != 2 or len(self.w) != len(self.people):
            raise InvalidConfig(
                f"Embeddings are {self.w.shape} for {len(self.people)} people; give (people, d)."
            )

    def of(self, people: tuple[str, ...]) -> FloatArray:
        """Rows of some people, (n, d)."""
        rows = {person: row for row, person in enumerate(self.people)}
        return self.w[[rows[person] for person in people]]


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Label errors on rollouts that the network was not trained on, summed by person.

    Attributes:
        role: of the people; test participants were new to the network.
        before, after: (people,) sums of |label - truth|, raw and mapped, in wheel units.
        labels: (people,) how many each sum holds.
        worsened: labels that moved away from the truth.
        ratios: sum of (|e| - |e'|) / |e| over ``with_error`` labels, the paper's per-label figure.
    """

    seed: int
    role: Role
    people: tuple[str, ...]
    before: FloatArray
    after: FloatArray
    labels: npt.NDArray[np.int64]
    worsened: int
    ratios: float
    with_error: int


@dataclass(frozen=True, kw_only=True)
class PlannedHypothesis:
    """A hypothesis of the analysis plan, as it is worded there."""

    id: str
    text: str
    outcome: str
    test: str
    primary: bool


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The frozen analysis plan.

    Attributes:
        version: of the protocol that first had it.
        sha256: of the plan's content; None if nothing is frozen yet.
        protocol_sha256: of that protocol's text.
        amendments: a sentence for each later version of the protocol.
    """

    alpha: float
    correction: str
    hypotheses: tuple[PlannedHypothesis, ...]
    exclusions: tuple[str, ...]
    version: int | None
    sha256: str | None
    frozen_utc: str | None
    protocol_sha256: str | None = None
    amendments: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """Who or what does not count, and why."""

    what: Literal["person", "attempt", "teacher"]
    who: str
    why: str


@dataclass(frozen=True, kw_only=True)
class ConditionValue:
    """One outcome of one person under one condition.

    Attributes:
        round: of teaching; None where there are no rounds, as for a questionnaire afterwards.
        position: the condition's place in the person's order, from 0; None if it is not known.
    """

    person: str
    condition: str
    metric: str
    value: float
    round: int | None = None
    position: int | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyData:
    """All that the tables are made from.

    Attributes:
        kind: where it comes from.
        simulated: nobody in it is a person; the report says so.
        people: who counts, in the order in which they came.
        series: their labels, one of each person and rollout.
        flagged: (person, rollout) of attempts that broke a limit of timing.
        embeddings: of one network each, the primary one first.
        held_out: of each network and role.
        conduct: how a study was run; None of a population run.
        notices: what the report should say, in sentences.
    """

    kind: Literal["study", "population run"]
    title: str
    simulated: bool
    people: tuple[Person, ...]
    series: tuple[LabelSeries, ...]
    questionnaires: Mapping[str, Questionnaire] = field(default_factory=dict)
    flagged: frozenset[tuple[str, str]] = frozenset()
    embeddings: tuple[Embeddings, ...] = ()
    held_out: tuple[HeldOut, ...] = ()
    conditions: tuple[ConditionValue, ...] = ()
    plan: Plan | None = None
    exclusions: tuple[Exclusion, ...] = ()
    enrolled: int = 0
    conduct: Conduct | None = None
    notices: tuple[str, ...] = ()

    def of_role(self, role: Role) -> tuple[Person, ...]:
        """People of a role."""
        return tuple(person for person in self.people if person.role == role)
