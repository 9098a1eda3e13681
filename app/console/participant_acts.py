"""What a participant does on their pages; whatever is done twice is done once."""

from collections.abc import Mapping

from starlette.responses import PlainTextResponse, RedirectResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.participant_views import (
    ParticipantContext,
    consent_page,
    questions_page,
    questions_path,
)
from steerlab.app.console.questionnaire_form import read_answer, read_posted, what_is_wrong
from steerlab.study.contract import Phase, PhaseKind, StudyError
from steerlab.study.surveys.answer_format import InvalidAnswer

Posted = Mapping[str, str]
READING = (PhaseKind.INSTRUCTIONS, PhaseKind.DEBRIEF)


def consent(visit: ParticipantContext, posted: Posted) -> Response:
    """Keep the decision, if it was made about the text that is valid now."""
    view = visit.view()
    phase = view.next_phase
    decision = posted.get("decision")
    if phase is None or phase.kind is not PhaseKind.CONSENT or decision not in ("yes", "no"):
        return visit.home_again()
    version, _ = visit.study.consent_text(visit.participant)
    if posted.get("version") != str(version):
        return consent_page(visit, view, phase, changed=True)
    visit.study.consent(visit.participant, given=decision == "yes", shown=version)
    return visit.home_again()


def leave_page(phase_id: str, visit: ParticipantContext, posted: Posted) -> Response:
    """Finish a page that was only to be read."""
    phase = _open_phase(visit, phase_id)
    if phase is not None and phase.kind in READING:
        visit.study.submit(visit.participant, phase.id)
    return visit.home_again()


def show_questions(
    phase_id: str, number: int, visit: ParticipantContext, posted: Posted
) -> Response:
    """One questionnaire of the open phase; a page that is past leads to the present one."""
    phase = _questions(visit, phase_id, number)
    return visit.home_again() if phase is None else questions_page(visit, phase, number)


def hand_in(phase_id: str, number: int, visit: ParticipantContext, posted: Posted) -> Response:
    """Keep what the form says; go on if nothing is missing, back if that was asked for."""
    phase = _questions(visit, phase_id, number)
    if phase is None:  # handed in before: a second press of the button, or the back button
        return visit.home_again()
    study, key = visit.study, phase.questionnaires[number - 1]
    questionnaire = study.questionnaire(key)
    read = read_posted(questionnaire, posted, study.answers(visit.participant, phase.id, key))
    for item, value in read.answers.items():
        study.save_answer(visit.participant, phase.id, key, item, value)
    if posted.get("go") == "back" and not read.wrong:
        return RedirectResponse(questions_path(visit, phase, max(1, number - 1)), 303)
    missing = questionnaire.missing(study.answers(visit.participant, phase.id, key))
    marks = {item: texts.PLEASE_ANSWER for item in missing} | dict(read.wrong)
    if marks:
        return questions_page(visit, phase, number, marks=marks, typed=read.typed)
    if number < len(phase.questionnaires):
        return RedirectResponse(questions_path(visit, phase, number + 1), 303)
    for other, lacking in study.submit(visit.participant, phase.id).items():
        if lacking:
            marks = {item: texts.PLEASE_ANSWER for item in lacking}
            return questions_page(visit, phase, phase.questionnaires.index(other) + 1, marks=marks)
    return visit.home_again()


def keep_one(phase_id: str, number: int, visit: ParticipantContext, posted: Posted) -> Response:
    """Keep one answer; says 204 only once it is durable."""
    phase = _questions(visit, phase_id, number)
    if phase is None:
        return PlainTextResponse(texts.CANNOT_SAVE, 409)
    key, item, raw = phase.questionnaires[number - 1], posted.get("item", ""), posted.get("value")
    questionnaire = visit.study.questionnaire(key)
    if raw is None or all(one.id != item for one in questionnaire.items):
        return PlainTextResponse(texts.CANNOT_SAVE, 409)
    try:
        value = read_answer(questionnaire, item, raw)
    except InvalidAnswer:
        return PlainTextResponse(what_is_wrong(questionnaire.item(item)), 422)
    try:
        visit.study.save_answer(visit.participant, phase.id, key, item, value)
    except StudyError as error:
        return PlainTextResponse(str(error), 409)
    return Response(status_code=204)


def _open_phase(visit: ParticipantContext, phase_id: str) -> Phase | None:
    phase = visit.view().next_phase
    return phase if phase is not None and phase.id == phase_id else None


def _questions(visit: ParticipantContext, phase_id: str, number: int) -> Phase | None:
    phase = _open_phase(visit, phase_id)
    if phase is None or phase.kind is not PhaseKind.QUESTIONNAIRES:
        return None
    return phase if 1 <= number <= len(phase.questionnaires) else None
