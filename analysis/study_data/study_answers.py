"""A participant's answers for an analysis: of pages that are finished, as the questionnaires allow."""

from collections.abc import Iterator, Mapping

from steerlab.analysis.study_data.records import ConditionValue
from steerlab.study.contract import Phase, PhaseKind, PhaseState
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import ParticipantProgress, answers_of
from steerlab.study.store.answers import Value
from steerlab.study.surveys.answer_format import InvalidAnswer
from steerlab.study.surveys.scoring import score


def answers_about_themselves(
    study: OpenStudy, place: ParticipantProgress, notices: list[str]
) -> dict[str, dict[str, Value]]:
    """By questionnaire and item, of all that are not about a condition.

    A page that is not finished, or open again, has no answers yet: they may still be changed.

    Args:
        notices: grows by what the report should say.
    """
    found: dict[str, dict[str, Value]] = {}
    for phase, done in _pages(place):
        if phase.condition is None:
            given = answers_of(study, place, phase.id) if done else {}
            for key in phase.questionnaires:
                found[key] = _allowed(study, place, key, given.get(key, {}), notices)
    return found


def scores_after_conditions(
    study: OpenStudy, place: ParticipantProgress, notices: list[str]
) -> list[ConditionValue]:
    """Scores of the questionnaires that followed each condition."""
    found: list[ConditionValue] = []
    for phase, done in _pages(place):
        if phase.condition is None or not done:
            continue
        given = answers_of(study, place, phase.id)
        for key in phase.questionnaires:
            answers = _allowed(study, place, key, given.get(key, {}), notices)
            found += [
                ConditionValue(
                    person=place.view.id,
                    condition=phase.condition,
                    metric=f"{key}.{scale}",
                    value=one.score,
                    position=place.view.order.index(phase.condition),
                )
                for scale, one in score(study.questionnaires[key], answers).items()
                if one.score is not None
            ]
    return found


def _pages(place: ParticipantProgress) -> Iterator[tuple[Phase, bool]]:
    """Pages of questionnaires, and whether each is finished."""
    for phase, state in place.view.phases:
        if phase.kind is PhaseKind.QUESTIONNAIRES:
            yield phase, state is PhaseState.DONE


def _allowed(
    study: OpenStudy,
    place: ParticipantProgress,
    key: str,
    given: Mapping[str, Value],
    notices: list[str],
) -> dict[str, Value]:
    """Answers that the questionnaire, as it is now, still allows."""
    kept: dict[str, Value] = {}
    for item, value in given.items():
        try:
            kept[item] = study.questionnaires[key].check(item, value)
        except InvalidAnswer as error:
            notices.append(f"An answer of {place.view.id} to {key} was left out: {error}")
    return kept
