"""What a participant sees: the page of the step they are at."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from starlette.responses import RedirectResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.forms import csrf_token
from steerlab.app.console.next_steps import state_of, step_of
from steerlab.app.console.questionnaire_form import form_fields
from steerlab.app.console.rendering import message_page, page
from steerlab.study.contract import (
    ParticipantView,
    Phase,
    PhaseKind,
    PhaseState,
    Standing,
    StudyAccess,
)


@dataclass(frozen=True, kw_only=True, slots=True)
class ParticipantContext:
    """A request that came by a participant's link."""

    study: StudyAccess
    token: str
    participant: str

    @property
    def home(self) -> str:
        """Path of the participant's own page."""
        return f"/p/{self.token}"

    def view(self) -> ParticipantView:
        """The participant as they stand now."""
        return self.study.participant(self.participant)

    def home_again(self) -> RedirectResponse:
        """To whatever comes next."""
        return RedirectResponse(self.home, 303)


def page_key(view: ParticipantView) -> str:
    """Differs when another page is due than the one that waits."""
    phase = view.next_phase
    if phase is None:
        return str(view.standing)
    return f"{phase.id} {state_of(view, phase.id)}"


def current_page(visit: ParticipantContext) -> Response:
    """The page of the step that comes next."""
    view = visit.view()
    phase = view.next_phase
    if phase is None:
        return _end_page(visit, view)
    if phase.kind is PhaseKind.CONSENT:
        return consent_page(visit, view, phase)
    if phase.kind is PhaseKind.QUESTIONNAIRES:
        number = _first_unfinished(visit, phase)
        return RedirectResponse(questions_path(visit, phase, number), 303)
    if phase.kind in (PhaseKind.INSTRUCTIONS, PhaseKind.DEBRIEF):
        return page("read.html.j2", **_frame(visit, view, phase), paragraphs=phase.text)
    return page(
        "wait.html.j2",
        **_frame(visit, view, phase),
        computer=phase.kind is PhaseKind.CALIBRATE_W,
        running=state_of(view, phase.id) is PhaseState.STARTED,
        key=page_key(view),
        progress=view.progress,
    )


def consent_page(
    visit: ParticipantContext, view: ParticipantView, phase: Phase, *, changed: bool = False
) -> Response:
    """Information and the two buttons; ``changed`` if another version was shown before."""
    version, paragraphs = visit.study.consent_text(visit.participant)
    return page(
        "consent.html.j2",
        status=409 if changed else 200,
        **_frame(visit, view, phase),
        version=version,
        paragraphs=paragraphs,
        changed=changed,
    )


def questions_path(visit: ParticipantContext, phase: Phase, number: int) -> str:
    """Path of the ``number``-th questionnaire of a phase, from 1."""
    return f"{visit.home}/{phase.id}/{number}"


def questions_page(
    visit: ParticipantContext,
    phase: Phase,
    number: int,
    *,
    marks: Mapping[str, str] | None = None,
    typed: Mapping[str, str] | None = None,
) -> Response:
    """One questionnaire; with ``marks`` by item it says how many and which to look at again."""
    key = phase.questionnaires[number - 1]
    questionnaire = visit.study.questionnaire(key)
    answers = visit.study.answers(visit.participant, phase.id, key)
    return page(
        "questions.html.j2",
        status=422 if marks else 200,
        **_frame(visit, visit.view(), phase),
        questionnaire=questionnaire,
        fields=form_fields(questionnaire, answers, marks=marks, typed=typed),
        path=questions_path(visit, phase, number),
        number=number,
        parts=len(phase.questionnaires),
    )


def _first_unfinished(visit: ParticipantContext, phase: Phase) -> int:
    """The first questionnaire that lacks an answer, else the last; from 1."""
    for number, key in enumerate(phase.questionnaires, 1):
        answers = visit.study.answers(visit.participant, phase.id, key)
        if visit.study.questionnaire(key).missing(answers):
            return number
    return len(phase.questionnaires)


def _frame(visit: ParticipantContext, view: ParticipantView, phase: Phase) -> dict[str, Any]:
    step, steps = step_of(view)
    return {
        "study": visit.study.title,
        "home": visit.home,
        "csrf": csrf_token(visit.token),
        "title": phase.title,
        "phase": phase,
        "step": step,
        "steps": steps,
    }


def _end_page(visit: ParticipantContext, view: ParticipantView) -> Response:
    title, text = {
        Standing.DECLINED: (texts.DECLINED_TITLE, texts.DECLINED_TEXT),
        Standing.WITHDRAWN_KEPT: (texts.LEFT_TITLE, texts.LEFT_KEPT),
        Standing.ERASING: (texts.LEFT_TITLE, texts.LEFT_ERASING),
        Standing.WITHDRAWN_ERASED: (texts.LEFT_TITLE, texts.LEFT_ERASED),
    }.get(view.standing, (texts.THANKS_TITLE, texts.THANKS_TEXT))
    paragraphs = (text, texts.LEFT_END) if view.standing.withdrawn else (text,)
    return message_page(title, *paragraphs, status=200, study=visit.study.title)
