"""What a participant sees: the page of their current step."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from starlette.responses import RedirectResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.guard import csrf_token
from steerlab.app.console.next_steps import at_wheel, state_of, step_of
from steerlab.app.console.questionnaire_form import form_fields
from steerlab.app.console.rendering import local_time, message_page, page
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.study.consent import NO_ENTRIES, ConsentEntries
from steerlab.study.contract import (
    ParticipantView,
    Phase,
    PhaseKind,
    PhaseState,
    Standing,
    StudyAccess,
)

LONGEST_NAME = 200  # characters of a typed signature


@dataclass(frozen=True, kw_only=True, slots=True)
class ParticipantContext:
    """A request that came by a participant's link.

    Attributes:
        kiosk: page and wheel are one computer, and the participant begins a drive themselves.
    """

    study: StudyAccess
    runs: WheelRuns
    token: str
    participant: str
    kiosk: bool

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


def page_key(view: ParticipantView, runs: WheelRuns) -> str:
    """A key that changes when the participant's page must change."""
    phase = view.next_phase
    if phase is None:
        return str(view.standing)
    return f"{phase.id} {state_of(view, phase.id)} {at_wheel(view, phase, runs).name}"


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
        how=at_wheel(view, phase, context.runs).name,
        key=page_key(view, context.runs),
        kiosk=context.kiosk,
    )


def consent_page(
    context: ParticipantContext,
    view: ParticipantView,
    phase: Phase,
    *,
    changed: bool = False,
    marks: tuple[str, ...] = (),
    entries: ConsentEntries = NO_ENTRIES,
    name: str = "",
) -> Response:
    """Information, what is to be ticked and signed, and the two buttons.

    Args:
        changed: another version was shown before.
        marks: names of what a yes lacks.
        entries, name: what was entered so far.
    """
    status = 409 if changed else 422 if marks else 200
    return page(
        "consent.html.j2",
        status=status,
        **_frame(context, view, phase),
        consent=context.study.consent_text(context.participant),
        changed=changed,
        marks=marks,
        entries=entries,
        name=name,
        longest_name=LONGEST_NAME,
    )


def consent_copy(context: ParticipantContext, name: str = "") -> Response:
    """The participant's copy, to print: text, what was ticked, decision and local time.

    It does not say under which code their data are: who finds it learns nothing of those.

    Args:
        name: as typed just now; it is on this page and nowhere else.
    """
    record = context.study.consent_record(context.participant)
    if record is None:
        return context.home_again()
    return page(
        "consent_copy.html.j2",
        study=context.study.title,
        title=texts.COPY_TITLE,
        home=context.home,
        record=record,
        name=name,
        when=local_time(record.at_utc),
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
    follow: Collection[str] = (),
) -> Response:
    """One questionnaire; with ``marks`` by item it says how many and which to look at again.

    Args:
        follow: items that the page did not show before, and that answers have led to.
    """
    key = phase.questionnaires[number - 1]
    questionnaire = context.study.questionnaire(key)
    answers = context.study.answers(context.participant, phase.id, key)
    return page(
        "questions.html.j2",
        status=422 if marks or follow else 200,
        **_frame(context, context.view(), phase),
        questionnaire=questionnaire,
        fields=form_fields(
            questionnaire,
            answers,
            order=context.study.item_order(context.participant, phase.id, key),
            marks=marks,
            typed=typed,
            follow=follow,
        ),
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
        "copy": _copy_path(context, view),
        "csrf": csrf_token(context.token),
        "title": phase.title,
        "phase": phase,
        "step": step,
        "steps": steps,
    }


def _copy_path(context: ParticipantContext, view: ParticipantView) -> str:
    """Path of their copy of the consent; empty before there is one, and when it is erased."""
    decided = any(
        phase.kind is PhaseKind.CONSENT and state is not PhaseState.WAITING
        for phase, state in view.phases
    )
    return f"{context.home}/consent/copy" if decided and not view.standing.erased else ""


def _end_page(context: ParticipantContext, view: ParticipantView) -> Response:
    if view.standing is Standing.DECLINED:
        record = context.study.consent_record(context.participant)
        if record is not None and record.too_young:
            said = texts.TOO_YOUNG_TEXT.format(age=record.text.minimum_age)
            return message_page(texts.TOO_YOUNG_TITLE, said, status=200, study=context.study.title)
    title, text = {
        Standing.DECLINED: (texts.DECLINED_TITLE, texts.DECLINED_TEXT),
        Standing.WITHDRAWN_KEPT: (texts.LEFT_TITLE, texts.LEFT_KEPT),
        Standing.ERASING: (texts.LEFT_TITLE, texts.LEFT_ERASING),
        Standing.WITHDRAWN_ERASED: (texts.LEFT_TITLE, texts.LEFT_ERASED),
    }.get(view.standing, (texts.THANKS_TITLE, texts.THANKS_TEXT))
    paragraphs = (text, texts.LEFT_END) if view.standing.withdrawn else (text,)
    copy = _copy_path(context, view)
    return message_page(title, *paragraphs, status=200, study=context.study.title, copy=copy)
