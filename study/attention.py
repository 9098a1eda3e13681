"""Attention checks: items whose right answer everybody who reads them gives."""

from dataclasses import dataclass

from steerlab.study.contract import PhaseKind, PhaseState
from steerlab.study.progress import ParticipantProgress, given_answers
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.answer_format import Value

EXCLUDED = "A participant who failed an attention check is left out."
"""The rule of a plan's ``exclusions`` by which an analysis leaves them out; without it none does."""


@dataclass(frozen=True, kw_only=True, slots=True)
class AttentionCheck:
    """One check of one participant, on a page that was handed in.

    Attributes:
        given: None where the item was optional and left out.
    """

    phase: str
    questionnaire: str
    item: str
    expected: Value
    given: Value | None

    @property
    def passed(self) -> bool:
        """They gave the right answer."""
        return self.given == self.expected


def attention_checks(study: OpenStudy, progress: ParticipantProgress) -> tuple[AttentionCheck, ...]:
    """The checks that a participant was shown, in the order of their phases."""
    checks: list[AttentionCheck] = []
    for phase, state in progress.view.phases:
        if phase.kind is not PhaseKind.QUESTIONNAIRES or state is not PhaseState.DONE:
            continue
        given = given_answers(study, progress, phase.id)
        for key in phase.questionnaires:
            answers = given.get(key, {})
            checks += [
                AttentionCheck(
                    phase=phase.id,
                    questionnaire=key,
                    item=item.id,
                    expected=item.attention,
                    given=answers.get(item.id),
                )
                for item in study.questionnaires[key].shown(answers)
                if item.attention is not None
            ]
    return tuple(checks)
