"""What is correlated with w: scores of people's scales, and their style metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.study_data.records import Embeddings, Person, StudyData
from steerlab.analysis.style.person_style import PersonStyle
from steerlab.sim.arrays import FloatArray
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.scoring import score

Topic = Literal["personality", "games", "driving", "trust", "amplitude", "timing", "other"]

_TOPICS: dict[str, Topic] = {
    "mini_ipip_5": "personality",
    "mini_ipip_7": "personality",
    "experience_games": "games",
    "experience_sim_driving": "driving",
    "experience_driving": "driving",
    "trust": "trust",
}
_ORDER: tuple[Topic, ...] = ("games", "driving", "trust", "personality", "other")

STYLES: dict[str, tuple[str, Topic]] = {
    "amplitude_total": ("Over-/under-correcting (Eq. 3)", "amplitude"),
    "amplitude": ("Over-/under-correcting, a point of the path", "amplitude"),
    "lag_plain_s": ("Delay/anticipation (mean lag along the path)", "timing"),
    "lag_s": ("Delay/anticipation (median lag, scaled signals)", "timing"),
    "voted_lag_s": ("Delay/anticipation (the paper's majority vote)", "timing"),
}
"""Style metrics by key of ``PersonStyle``."""

PLANNED_STYLES = {
    "multiple R of w with the signed DTW distance (Eq. 3)": "amplitude_total",
    "multiple R of w with the signed DTW distance a point of the path": "amplitude",
    "multiple R of w with the mean lag along the DTW path": "lag_plain_s",
    "multiple R of w with the median lag between scaled signals": "lag_s",
}
"""Which metric a frozen plan's outcome means."""

DEFAULT_STYLES = {"H3a": "amplitude_total", "H3b": "lag_s"}
"""Where there is no plan: Eq. 3 as printed, and the lag that finds planted delays
(``docs/statistics.md``)."""


NO_HELD_OUT = "no network was trained without the rollouts that style would be measured on"


@dataclass(frozen=True, kw_only=True, eq=False)
class Construct:
    """One quantity of each person.

    Attributes:
        key: ``mini_ipip_5.extraversion``, or a style metric's.
        family: it counts among the tests that are corrected together, the paper's Table 2.
        rollouts: that it was measured on; only w of networks that were not fitted on them goes with
            it, or the noise of one drive would be in both. Empty if it was measured on none.
        people: who has a value; ``values`` (n,) are theirs.
        missing: why the others have none, by person.
        none: why nobody has a value, where that is no matter of single people; else empty.
    """

    key: str
    title: str
    topic: Topic
    family: bool
    people: tuple[str, ...]
    values: FloatArray
    missing: Mapping[str, str]
    rollouts: tuple[str, ...] = ()
    none: str = ""

    def networks(self, data: StudyData) -> tuple[Embeddings, ...]:
        """Those whose w may be compared with it, the primary one first."""
        return tuple(
            w for w in data.embeddings if not self.rollouts or set(self.rollouts) <= set(w.held_out)
        )


def main_scales(questionnaire: Questionnaire) -> tuple[str, ...]:
    """Scales that are tested: not those whose items all belong to scales named before.

    So trust is its total; its two sub-scales are reported, and not tested beside it.
    """
    scales: list[str] = []
    taken: set[str] = set()
    for scale in questionnaire.scales:
        if not set(scale.items) <= taken:
            scales.append(scale.key)
        taken.update(scale.items)
    return tuple(scales)


def asked_of(data: StudyData) -> list[Questionnaire]:
    """Questionnaires with scales that people answered about themselves, in the paper's order."""
    keys = dict.fromkeys(key for person in data.people for key in person.answers)
    known = [data.questionnaires[key] for key in keys if key in data.questionnaires]
    asked = [questionnaire for questionnaire in known if questionnaire.scales]
    rank = {key: row for row, key in enumerate(("experience_games", "experience_sim_driving"))}
    return sorted(
        asked,
        key=lambda questionnaire: (
            _ORDER.index(_TOPICS.get(questionnaire.key, "other")),
            rank.get(questionnaire.key, len(rank)),
        ),
    )


def survey_constructs(data: StudyData, people: Sequence[Person]) -> list[Construct]:
    """The scores of every scale of ``main_scales``."""
    constructs: list[Construct] = []
    for questionnaire in asked_of(data):
        scores = {
            person.id: score(questionnaire, person.answers[questionnaire.key])
            for person in people
            if questionnaire.key in person.answers
        }
        for scale in main_scales(questionnaire):
            values: dict[str, float] = {}
            missing: dict[str, str] = {}
            for person in people:
                scored = scores[person.id][scale] if person.id in scores else None
                if scored is not None and scored.score is not None:
                    values[person.id] = scored.score
                else:
                    missing[person.id] = "was not asked" if scored is None else scored.reason
            constructs.append(
                Construct(
                    key=f"{questionnaire.key}.{scale}",
                    title=questionnaire.scale(scale).title,
                    topic=_TOPICS.get(questionnaire.key, "other"),
                    family=True,
                    people=tuple(values),
                    values=np.array(list(values.values())),
                    missing=missing,
                )
            )
    return constructs


def style_constructs(
    styles: Sequence[PersonStyle],
    people: Sequence[Person],
    primary: Mapping[str, str],
    rollouts: tuple[str, ...],
) -> list[Construct]:
    """The style metrics; those of ``primary`` (by hypothesis) are the family's.

    Args:
        styles: measured on ``rollouts`` alone, which some network was not fitted on. If there are
            none, no metric has a value.
    """
    styles = styles if rollouts else ()
    wanted = {person.id for person in people}
    of_people = [style for style in styles if style.person in wanted]
    have = {style.person for style in of_people}
    constructs: list[Construct] = []
    keys = sorted(STYLES, key=lambda key: key not in primary.values())  # the family's first
    for key in keys:
        title, topic = STYLES[key]
        cells = {style.person: getattr(style, key) for style in of_people}
        values = {who: cell for who, cell in cells.items() if not isinstance(cell, NotComputable)}
        missing = {who: cell.reason for who, cell in cells.items() if who not in values}
        if rollouts:
            missing |= {person.id: "has no labels" for person in people if person.id not in have}
        constructs.append(
            Construct(
                key=key,
                title=title,
                topic=topic,
                family=key in primary.values(),
                people=tuple(values),
                values=np.array(list(values.values()), dtype=np.float64),
                missing=missing,
                rollouts=rollouts,
                none="" if rollouts else NO_HELD_OUT,
            )
        )
    return constructs


def style_rollouts(data: StudyData) -> tuple[str, ...]:
    """Those that networks were not fitted on: what style is measured on where w is compared with it."""
    return next((w.held_out for w in data.embeddings if w.held_out), ())


def planned_styles(data: StudyData) -> dict[str, str]:
    """The style metric that H3a and H3b are tested on: the frozen plan's, if it names one."""
    styles = dict(DEFAULT_STYLES)
    for hypothesis in data.plan.hypotheses if data.plan else ():
        if hypothesis.id in styles and hypothesis.outcome in PLANNED_STYLES:
            styles[hypothesis.id] = PLANNED_STYLES[hypothesis.outcome]
    return styles
