"""What a participant sees: the page of their current step."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from starlette.responses import RedirectResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.guard import csrf_token
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
        """The participant's current state."""
        return self.study.participant(self.participant)

    def home_again(self) -> RedirectResponse:
        """A redirect to the participant's own page, which shows what comes next."""
        return RedirectResponse(self.home, 303)


def page_key(view: ParticipantView) -> str:
    """A key that changes when the participant's page must change."""
    phase = view.next_phase
    if phase is None:
        return str(view.standing)
    return f"{phase.id} {state_of(view, phase.id)}"


def current_page(context: ParticipantContext) -> Response:
    """The page of the step that comes next."""
    view = context.view()
    phase = view.next_phase
    if phase is None:
        return _end_page(context, view)
    if phase.kind is PhaseKind.CONSENT:
        return consent_page(context, view, phase)
    if phase.kind is PhaseKind.QUESTIONNAIRES:
        number = _first_unfinished(context, phase)
        return RedirectResponse(questions_path(context, phase, number), 303)
    if phase.kind in (PhaseKind.INSTRUCTIONS, PhaseKind.DEBRIEF):
        return page("read.html.j2", **_frame(context, view, phase), paragraphs=phase.text)
    return page(
        "wait.html.j2",
        **_frame(context, view, phase),
        computer=phase.kind is PhaseKind.CALIBRATE_W,
        running=state_of(view, phase.id) is PhaseState.STARTED,
        key=page_key(view),
        progress=view.progress,
    )


def consent_page(
    context: ParticipantContext, view: ParticipantView, phase: Phase, *, changed: bool = False
) -> Response:
    """Information and the two buttons; ``changed`` if another version was shown before."""
    version, paragraphs = context.study.consent_text(context.participant)
    return page(
        "consent.html.j2",
        status=409 if changed else 200,
        **_frame(context, view, phase),
        version=version,
        paragraphs=paragraphs,
        changed=changed,
    )


def questions_path(context: ParticipantContext, phase: Phase, number: int) -> str:
    """Path of the ``number``-th questionnaire of a phase, from 1."""
    return f"{context.home}/{phase.id}/{number}"


def questions_page(
    context: ParticipantContext,
    phase: Phase,
    number: int,
    *,
    marks: Mapping[str, str] | None = None,
    typed: Mapping[str, str] | None = None,
) -> Response:
    """One questionnaire; with ``marks`` by item it says how many and which to look at again."""
    key = phase.questionnaires[number - 1]
    questionnaire = context.study.questionnaire(key)
    answers = context.study.answers(context.participant, phase.id, key)
    return page(
        "questions.html.j2",
        status=422 if marks else 200,
        **_frame(context, context.view(), phase),
        questionnaire=questionnaire,
        fields=form_fields(questionnaire, answers, marks=marks, typed=typed),
        path=questions_path(context, phase, number),
        number=number,
        parts=len(phase.questionnaires),
    )


def _first_unfinished(context: ParticipantContext, phase: Phase) -> int:
    """The first questionnaire that lacks an answer, else the last; from 1."""
    for number, key in enumerate(phase.questionnaires, 1):
        answers = context.study.answers(context.participant, phase.id, key)
        if context.study.questionnaire(key).missing(answers):
            return number
    return len(phase.questionnaires)


def _frame(context: ParticipantContext, view: ParticipantView, phase: Phase) -> dict[str, Any]:
    step, steps = step_of(view)
    return {
        "study": context.study.title,
        "home": context.home,
        "csrf": csrf_token(context.token),
        "title": phase.title,
        "phase": phase,
        "step": step,
        "steps": steps,
    }


def _end_page(context: ParticipantContext, view: ParticipantView) -> Response:
    title, text = {
        Standing.DECLINED: (texts.DECLINED_TITLE, texts.DECLINED_TEXT),
        Standing.WITHDRAWN_KEPT: (texts.LEFT_TITLE, texts.LEFT_KEPT),
        Standing.ERASING: (texts.LEFT_TITLE, texts.LEFT_ERASING),
        Standing.WITHDRAWN_ERASED: (texts.LEFT_TITLE, texts.LEFT_ERASED),
    }.get(view.standing, (texts.THANKS_TITLE, texts.THANKS_TEXT))
    paragraphs = (text, texts.LEFT_END) if view.standing.withdrawn else (text,)
    return message_page(title, *paragraphs, status=200, study=context.study.title)
