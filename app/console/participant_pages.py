"""The pages behind a participant's link, and what the participant does on them.

Each request sees only the participant whose link it is; what is sent twice is kept once.
"""

from collections.abc import Callable, Mapping
from functools import partial

from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.guard import csrf_holds, read_form
from steerlab.app.console.next_steps import AtWheel, at_wheel
from steerlab.app.console.participant_views import (
    LONGEST_NAME,
    ParticipantContext,
    consent_copy,
    consent_page,
    current_page,
    page_key,
    questions_page,
    questions_path,
)
from steerlab.app.console.questionnaire_form import read_answer, read_posted, what_is_wrong
from steerlab.app.console.rendering import message_page, page, too_many_page
from steerlab.app.console.short_links import ShortLinks
from steerlab.app.console.sign_in import LoginThrottle, client_source
from steerlab.app.console.study_thread import StudyThread
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.sim.errors import SteerlabError
from steerlab.study.consent import MOST_TICKS, ConsentEntries, tick
from steerlab.study.contract import PAGES, Phase, PhaseKind, StudyAccess, StudyError
from steerlab.study.store.errors import StoreError
from steerlab.study.surveys.answer_format import InvalidAnswer, Value
from steerlab.study.surveys.questionnaire import Questionnaire

LONGEST_TOKEN = 128
LONGEST_CODE = 20
LEAVING_S = 5.0  # for which a press of the button waits until the phase before has left
SEEN = "seen"
"""The field of a form of questions that names those which the page showed."""

READING = (PhaseKind.INSTRUCTIONS, PhaseKind.DEBRIEF)

Form = Mapping[str, str]
"""The fields of a form that was sent; empty for a request that only reads."""
Work = Callable[[ParticipantContext, Form], Response]


class ParticipantPages:
    """Information, consent, questionnaires, instructions, waiting and thanks."""

    def __init__(
        self,
        study_thread: StudyThread,
        runs: WheelRuns,
        changes: ChangeFeed,
        throttle: LoginThrottle,
        short_links: ShortLinks,
        *,
        kiosk: bool,
    ) -> None:
        """``kiosk`` as of ``ParticipantContext``."""
        self._short_links = short_links
        self._study_thread = study_thread
        self._runs = runs
        self._kiosk = kiosk
        self._changes = changes
        self._throttle = throttle

    async def show(self, request: Request) -> Response:
        """Whatever comes next for the participant."""
        return await self._visit(request, lambda context, _: current_page(context))

    async def questions(self, request: Request) -> Response:
        """Show or hand in one questionnaire of the phase that is open."""
        number = request.path_params["number"]
        work = hand_in if request.method == "POST" else show_questions
        return await self._visit(request, partial(work, request.path_params["phase"], number))

    async def answer(self, request: Request) -> Response:
        """Keep one answer; 204 only once it is durable."""
        phase, number = request.path_params["phase"], request.path_params["number"]
        return await self._visit(request, partial(keep_answer, phase, number))

    async def consent(self, request: Request) -> Response:
        """Keep the decision."""
        return await self._visit(request, keep_decision)

    async def consent_copy(self, request: Request) -> Response:
        """Show what was agreed to, to be printed."""
        return await self._visit(request, lambda context, _: consent_copy(context))

    async def done(self, request: Request) -> Response:
        """Leave a page of instructions or the debriefing."""
        return await self._visit(request, partial(leave_page, request.path_params["phase"]))

    async def short(self, request: Request) -> Response:
        """Where a short link's code is typed, or pressed on: looking at it does not use it up."""
        return _short_page(request.path_params.get("code", ""))

    async def enter(self, request: Request) -> Response:
        """Follow a short link, once."""
        source = _source(request)
        if wait_s := self._throttle.wait_s(source):
            return too_many_page(wait_s)
        token = self._short_links.take((await read_form(request)).get("code", ""))
        if token is None:
            self._throttle.wrong(source)
            return _short_page("", wrong=True)
        return RedirectResponse(f"/p/{token}", 303)

    async def ready(self, request: Request) -> Response:
        """Begin the drive that is next, where page and wheel are one computer."""
        return await self._visit(request, begin_drive)

    async def events(self, request: Request) -> Response:
        """Tell a waiting page when it is out of date."""
        token, source = _token(request), _source(request)
        refusal = self._refusal(token, source)
        if refusal is not None:
            return refusal

        async def key() -> str:
            return await self._study_thread.do(partial(_key_of, token, self._runs))

        participant = await self._study_thread.do(lambda study: study.participant_of(token))
        if participant is None:
            return self._expired(source)
        stream = self._changes.response(key, owner=participant)
        return stream or PlainTextResponse(texts.TOO_MANY_PAGES, 503)

    async def _visit(self, request: Request, work: Work) -> Response:
        token, source = _token(request), _source(request)
        refusal = self._refusal(token, source)
        if refusal is not None:
            return refusal
        posted: Form = {}
        if request.method == "POST":
            posted = await read_form(request)
            if not csrf_holds(token, posted):
                return message_page(texts.STALE_TITLE, texts.STALE_TEXT, status=403)

        def with_study(study: StudyAccess) -> Response | None:
            participant = study.participant_of(token)
            if participant is None:
                return None
            try:
                context = ParticipantContext(
                    study=study,
                    runs=self._runs,
                    token=token,
                    participant=participant,
                    kiosk=self._kiosk,
                )
                return work(context, posted)
            except StoreError:  # the page of whatever sent it can be sent again
                raise
            except SteerlabError as error:
                return message_page(
                    texts.CANNOT_TITLE,
                    str(error),
                    status=409,
                    study=study.title,
                    link=f"/p/{token}",
                )

        response = await self._study_thread.do(with_study)
        if response is None:
            return self._expired(source)
        self._throttle.know(token)
        return response

    def _refusal(self, token: str, source: str) -> Response | None:
        wait_s = self._throttle.wait_s(source)
        if wait_s and not self._throttle.knows(token):
            return too_many_page(wait_s)
        return self._expired(source) if len(token) > LONGEST_TOKEN else None

    def _expired(self, source: str) -> Response:
        self._throttle.wrong(source)
        return message_page(texts.EXPIRED_TITLE, texts.EXPIRED_TEXT, status=404)


def _key_of(token: str, runs: WheelRuns, study: StudyAccess) -> str:
    participant = study.participant_of(token)
    return "" if participant is None else page_key(study.participant(participant), runs)


def _short_page(code: str, *, wrong: bool = False) -> Response:
    return page(
        "short.html.j2",
        status=401 if wrong else 200,
        study="",
        title=texts.SHORT_TITLE,
        code=code[:LONGEST_CODE],
        wrong=wrong,
    )


def _token(request: Request) -> str:
    return request.path_params["token"]


def _source(request: Request) -> str:
    """Whose wrong links are counted; wrong passwords are counted apart."""
    return f"link {client_source(request)}"


def keep_decision(context: ParticipantContext, posted: Form) -> Response:
    """Keep the decision, if it was made about the text that is valid now and lacks nothing.

    A typed name is on the page that answers, and is kept nowhere.
    """
    view = context.view()
    phase = view.next_phase
    decision = posted.get("decision")
    if phase is None or phase.kind is not PhaseKind.CONSENT or decision not in ("yes", "no"):
        return context.home_again()
    text = context.study.consent_text(context.participant)
    if posted.get("version") != str(text.version):
        return consent_page(context, view, phase, changed=True)
    name = posted.get("signature", "").strip()[:LONGEST_NAME]
    entries = ConsentEntries(
        ticked=frozenset(index for index in range(MOST_TICKS) if posted.get(tick(index)) == "yes"),
        of_age={"yes": True, "no": False}.get(posted.get("age", "")),
        signed=bool(name),
    )
    too_young = text.minimum_age is not None and entries.of_age is False
    given = decision == "yes" and not too_young
    if given and (marks := text.lacking(entries)):
        return consent_page(context, view, phase, marks=marks, entries=entries, name=name)
    context.study.consent(context.participant, given=given, shown=text.version, entries=entries)
    return consent_copy(context, name) if given and text.signature else context.home_again()


def begin_drive(context: ParticipantContext, posted: Form) -> Response:
    """Start the drive that the form names, if it is still next and the console is a kiosk's.

    Raises:
        StudyError: another one is running, or it cannot be started.
    """
    view = context.view()
    phase = view.next_phase
    if context.kiosk and phase is not None and phase.kind not in PAGES:
        asked = phase.id == posted.get("phase")
        if asked and at_wheel(view, phase, context.runs) is not AtWheel.RUNNING:
            run = context.runs.view()
            if run is not None and run.participant == view.id:
                context.runs.wait(LEAVING_S)  # the phase before is over; its window is closing
                run = context.runs.view()
            if run is not None and run.goes_on:
                raise StudyError(texts.KIOSK_BUSY)
            context.runs.start(view.id, phase)
    return context.home_again()


def leave_page(phase_id: str, context: ParticipantContext, posted: Form) -> Response:
    """Finish a page that was only to be read."""
    phase = _open_phase(context, phase_id)
    if phase is not None and phase.kind in READING:
        context.study.submit(context.participant, phase.id)
    return context.home_again()


def show_questions(
    phase_id: str, number: int, context: ParticipantContext, posted: Form
) -> Response:
    """One questionnaire of the open phase; a page that is past leads to the present one."""
    phase = _questions(context, phase_id, number)
    return context.home_again() if phase is None else questions_page(context, phase, number)


def hand_in(phase_id: str, number: int, context: ParticipantContext, posted: Form) -> Response:
    """Keep what the form says; go on if nothing is missing, back if that was asked for."""
    phase = _questions(context, phase_id, number)
    if phase is None:  # handed in before: a second press of the button, or the back button
        return context.home_again()
    study, key = context.study, phase.questionnaires[number - 1]
    questionnaire = study.questionnaire(key)
    read = read_posted(questionnaire, posted, study.answers(context.participant, phase.id, key))
    for item, value in read.answers.items():
        study.save_answer(context.participant, phase.id, key, item, value)
    if posted.get("go") == "back" and not read.wrong:
        return RedirectResponse(questions_path(context, phase, max(1, number - 1)), 303)
    answers = study.answers(context.participant, phase.id, key)
    follow = _not_seen(questionnaire, answers, posted)
    missing = [item for item in questionnaire.missing(answers) if item not in follow]
    marks = {item: texts.PLEASE_ANSWER for item in missing} | dict(read.wrong)
    if marks or follow:
        return questions_page(context, phase, number, marks=marks, typed=read.typed, follow=follow)
    if number < len(phase.questionnaires):
        return RedirectResponse(questions_path(context, phase, number + 1), 303)
    for other, lacking in study.submit(context.participant, phase.id).items():
        if lacking:
            marks = {item: texts.PLEASE_ANSWER for item in lacking}
            return questions_page(
                context, phase, phase.questionnaires.index(other) + 1, marks=marks
            )
    return context.home_again()


def _not_seen(
    questionnaire: Questionnaire, answers: Mapping[str, Value], posted: Form
) -> frozenset[str]:
    """Items that these answers show and the page did not: without scripts it comes once more."""
    if SEEN not in posted:
        return frozenset()
    seen = posted[SEEN].split()
    return frozenset(item.id for item in questionnaire.shown(answers) if item.id not in seen)


def keep_answer(phase_id: str, number: int, context: ParticipantContext, posted: Form) -> Response:
    """Keep one answer; says 204 only once it is durable."""
    phase = _questions(context, phase_id, number)
    if phase is None:
        return PlainTextResponse(texts.CANNOT_SAVE, 409)
    key, item, raw = phase.questionnaires[number - 1], posted.get("item", ""), posted.get("value")
    questionnaire = context.study.questionnaire(key)
    if raw is None or all(known.id != item for known in questionnaire.items):
        return PlainTextResponse(texts.CANNOT_SAVE, 409)
    try:
        value = read_answer(questionnaire, item, raw)
    except InvalidAnswer:
        return PlainTextResponse(what_is_wrong(questionnaire.item(item)), 422)
    try:
        context.study.save_answer(context.participant, phase.id, key, item, value)
    except StoreError:
        raise
    except SteerlabError as error:
        return PlainTextResponse(str(error), 409)
    return Response(status_code=204)


def _open_phase(context: ParticipantContext, phase_id: str) -> Phase | None:
    phase = context.view().next_phase
    return phase if phase is not None and phase.id == phase_id else None


def _questions(context: ParticipantContext, phase_id: str, number: int) -> Phase | None:
    phase = _open_phase(context, phase_id)
    if phase is None or phase.kind is not PhaseKind.QUESTIONNAIRES:
        return None
    return phase if 1 <= number <= len(phase.questionnaires) else None
