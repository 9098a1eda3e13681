"""The experimenter's pages (all participants, one participant, the checks), and what is done on them."""

from collections.abc import Callable, Mapping
from functools import partial

from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.data_export import DataExport
from steerlab.app.console.experimenter_views import (
    ExperimenterContext,
    checks_page,
    keep_link,
    people_page,
    person_page,
)
from steerlab.app.console.guard import csrf_holds, form_key, read_form
from steerlab.app.console.rendering import message_page, page, too_many_page
from steerlab.app.console.short_links import ShortLinks
from steerlab.app.console.sign_in import BrowserSession, LoginThrottle, SignIn, client_source
from steerlab.app.console.study_thread import StudyCheckJob, StudyThread
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.sim.errors import SteerlabError
from steerlab.study.contract import PAGES, Role, StudyAccess, StudyError
from steerlab.study.store.errors import StoreError

LONGEST_NOTE = 5000  # characters

Form = Mapping[str, str]
"""The fields of a form that was sent; empty for a request that only reads."""
Work = Callable[[ExperimenterContext, Form], Response]


class ExperimenterPages:
    """Everything but the participants' own pages; only for who signed in."""

    def __init__(
        self,
        study_thread: StudyThread,
        runs: WheelRuns,
        check_job: StudyCheckJob,
        changes: ChangeFeed,
        sign_in: SignIn,
        throttle: LoginThrottle,
        exports: DataExport,
        short_links: ShortLinks,
        *,
        origin: str,
        kiosk: bool,
    ) -> None:
        """``origin`` is what participants' links begin with; ``kiosk`` as of ``make_app``."""
        self._short_links = short_links
        self._kiosk = kiosk
        self._exports = exports
        self._study_thread = study_thread
        self._runs = runs
        self._check_job = check_job
        self._changes = changes
        self._sign_in = sign_in
        self._throttle = throttle
        self._origin = origin

    async def front(self, request: Request) -> Response:
        """Where the experimenter signs in; says nothing of the study."""
        return self._sign_in_page(status=401)

    async def people(self, request: Request) -> Response:
        """Everyone, and what to do next."""
        return await self._work(request, lambda context, _: people_page(context))

    async def person(self, request: Request) -> Response:
        """One participant."""
        participant = request.path_params["participant"]
        shown = request.query_params.get("link", "")
        return await self._work(
            request, lambda context, _: person_page(context, participant, link_key=shown)
        )

    async def checks(self, request: Request) -> Response:
        """The whole study's integrity; a POST checks again."""
        if request.method == "POST":
            response = await self._work(
                request, lambda context, _: RedirectResponse(f"{context.home}/checks", 303)
            )
            if response.status_code == 303:  # signed in, and the form is ours
                self._check_job.start()
                await self._changes.try_look()
            return response
        if self._session(request) is not None and not self._check_job.view().at:
            self._check_job.start()
            await self._changes.try_look()
        return await self._work(
            request, lambda context, _: checks_page(context, self._check_job.view())
        )

    async def export(self, request: Request) -> Response:
        """The study's data in a format, as a .zip to download."""
        allowed = await self._work(request, lambda context, _: Response(context.study.title))
        if allowed.status_code != 200:  # not signed in, or the form is not ours
            return allowed
        try:
            made = await self._exports.packed(request.state.posted.get("format", ""))
        except SteerlabError as error:
            return message_page(texts.CANNOT_TITLE, str(error), status=409, link=self._sign_in.home)
        headers = {
            "content-disposition": f'attachment; filename="{made.name}"',
            "cache-control": "no-store",
        }
        return Response(made.content, media_type="application/zip", headers=headers)

    async def enrol(self, request: Request) -> Response:
        """The next participant."""
        return await self._work(request, enrol_participant)

    async def act(self, request: Request) -> Response:
        """One of ``ACTS`` on a participant."""
        act = ACTS.get(request.path_params["act"])
        if act is None:
            return message_page(texts.NOT_FOUND_TITLE, texts.NOT_FOUND_TEXT, status=404)
        return await self._work(request, partial(act, request.path_params["participant"]))

    async def events(self, request: Request) -> Response:
        """Tell the open pages whenever something changed."""
        session = self._session(request)
        if session is None:
            return PlainTextResponse(texts.SIGN_IN_TITLE, 401)

        async def key() -> str:
            return self._changes.version

        stream = self._changes.response(key, owner=session.secret)
        return stream or PlainTextResponse(texts.TOO_MANY_PAGES, 503)

    async def enter(self, request: Request) -> Response:
        """Sign in by the terminal's one-time link."""
        return self._by_code(request, request.path_params["code"])

    async def sign_in(self, request: Request) -> Response:
        """Sign in by the terminal's one-time code, or by password."""
        posted = await read_form(request)
        if "password" in posted:
            return self._by_password(request, posted["password"])
        return self._by_code(request, posted.get("code", ""))

    def _by_code(self, request: Request, code: str) -> Response:
        """Never waits for a right code, however many wrong ones came: nobody can guess it."""
        session = self._sign_in.by_code(code)
        if session is not None:
            return self._let_in(session)
        source = _source(request)
        wait_s = self._throttle.wait_s(source)
        if wait_s:
            return too_many_page(wait_s, sign_in=True)
        self._throttle.wrong(source)
        return self._sign_in_page(status=401, wrong=texts.SIGN_IN_USED)

    def _by_password(self, request: Request, password: str) -> Response:
        source = _source(request)
        wait_s = self._throttle.password_wait_s(source)
        if wait_s:
            return too_many_page(wait_s, sign_in=True)
        session = self._sign_in.by_password(password)
        if session is not None:
            return self._let_in(session)
        self._throttle.wrong_password(source)
        return self._sign_in_page(status=401, wrong=texts.WRONG_PASSWORD)

    async def sign_out(self, request: Request) -> Response:
        """End the session."""
        session = self._session(request)
        posted = await read_form(request)
        if session is not None and csrf_holds(session.secret, posted):
            self._sign_in.sign_out(session)
        response = RedirectResponse("/", 303)
        response.delete_cookie(self._sign_in.cookie, path=self._sign_in.home)
        return response

    async def _work(self, request: Request, work: Work) -> Response:
        session = self._session(request)
        if session is None:
            return self._sign_in_page(status=401)
        posted: Form = {}
        if request.method == "POST":
            posted = await read_form(request)
            if not csrf_holds(session.secret, posted):
                return message_page(
                    texts.STALE_TITLE, texts.STALE_TEXT, status=403, link=self._sign_in.home
                )

        def with_study(study: StudyAccess) -> Response:
            context = ExperimenterContext(
                study=study,
                runs=self._runs,
                session=session,
                throttle=self._throttle,
                short_links=self._short_links,
                kiosk=self._kiosk,
                home=self._sign_in.home,
                origin=self._origin,
                version=self._changes.version,
            )
            try:
                return work(context, posted)
            except StoreError:  # the form can be sent again
                raise
            except SteerlabError as error:
                return message_page(
                    texts.CANNOT_TITLE, str(error), status=409, study=study.title, link=context.home
                )

        response = await self._study_thread.do(with_study)
        if request.method == "POST":
            await self._changes.try_look()  # it is done: nobody may be asked to do it again
        return response

    def _session(self, request: Request) -> BrowserSession | None:
        return self._sign_in.session(request.cookies.get(self._sign_in.cookie))

    def _let_in(self, session: BrowserSession) -> Response:
        response = RedirectResponse(self._sign_in.home, 303)
        response.set_cookie(
            self._sign_in.cookie,
            session.secret,
            path=self._sign_in.home,
            httponly=True,
            samesite="strict",
            secure=self._origin.startswith("https:"),
        )
        return response

    def _sign_in_page(self, *, status: int, wrong: str = "") -> Response:
        return page(
            "sign_in.html.j2",
            status=status,
            has_password=self._sign_in.has_password,
            wrong=wrong,
        )


def _source(request: Request) -> str:
    """Whose wrong codes and passwords are counted; participants' wrong links are counted apart."""
    return f"sign-in {client_source(request)}"


def enrol_participant(context: ExperimenterContext, posted: Form) -> Response:
    """Enrol the next participant, in a role."""
    if posted.get("role") not in tuple(Role):
        role = posted.get("role", "")[:80]
        raise StudyError(texts.WRONG_ROLE.format(role=role, roles=" or ".join(Role)))
    view = context.study.enrol(Role(posted["role"]), form=form_key("enrol", posted))
    return _to(context, view.id)


def new_link(participant: str, context: ExperimenterContext, posted: Form) -> Response:
    """A fresh link for the participant; shown once."""
    view = context.study.participant(participant)
    token = context.study.new_link(view.id)
    context.throttle.know(token)
    key = keep_link(context, token)
    return RedirectResponse(f"{context.home}/participants/{view.id}?link={key}", 303)


def start(participant: str, context: ExperimenterContext, posted: Form) -> Response:
    """Begin or resume the next phase at the wheel, if it is still the one that the form names.

    Raises:
        StudyError: another one is next, or one is running.
    """
    view = context.study.participant(participant)
    phase = view.next_phase
    if phase is None or phase.kind in PAGES or phase.id != posted.get("phase"):
        title = posted.get("phase", "")[:80]
        raise StudyError(texts.RUN_NOT_NEXT.format(title=title, participant=view.id))
    if not _goes_on(context, view.id, phase.id):  # else it is the same form again
        context.runs.start(view.id, phase)
    return _to(context, view.id)


def stop(participant: str, context: ExperimenterContext, posted: Form) -> Response:
    """Ask the drive that the form names to end in order; pressed again, end it at once."""
    view = context.study.participant(participant)
    context.runs.stop(view.id, posted.get("phase", ""))
    return _to(context, view.id)


def redo(participant: str, context: ExperimenterContext, posted: Form) -> Response:
    """Open a finished phase again, or the drives of it that were chosen.

    Raises:
        StudyError: it is not finished, no drive is chosen, or the participant is at the wheel.
    """
    view = context.study.participant(participant)
    phase = next((known for known, _ in view.phases if known.id == posted.get("phase")), None)
    if phase is None:
        raise StudyError(
            texts.RUN_NOT_NEXT.format(title=posted.get("phase", "")[:80], participant=view.id)
        )
    _refuse_while_driving(context, view.id)
    chosen = [name for name in phase.rollouts if posted.get(f"rollout.{name}") == "yes"]
    if posted.get("all") == "yes" or set(chosen) == set(phase.rollouts):
        chosen = []
    elif phase.rollouts and not chosen:
        raise StudyError(texts.REDO_NONE_CHOSEN.format(title=phase.title))
    key = form_key(f"redo {view.id}", posted)
    context.study.redo(view.id, phase.id, rollouts=chosen, form=key)
    return _to(context, view.id)


def note(participant: str, context: ExperimenterContext, posted: Form) -> Response:
    """Keep a remark."""
    view = context.study.participant(participant)
    text = posted.get("text", "").replace("\r\n", "\n").strip()
    if len(text) > LONGEST_NOTE:
        raise StudyError(texts.NOTE_LONG.format(count=len(text), longest=LONGEST_NOTE))
    if text:
        context.study.note(view.id, text, form=form_key(f"note {view.id}", posted))
    return _to(context, view.id)


def withdraw(participant: str, context: ExperimenterContext, posted: Form) -> Response:
    """Let a participant leave, once the outcome is chosen and the id is typed."""
    view = context.study.participant(participant)
    outcome = posted.get("outcome")
    if outcome not in ("keep", "erase"):
        return person_page(context, view.id, status=422, wrong=texts.WITHDRAW_CHOOSE)
    if posted.get("typed", "").strip() != view.id:
        mistyped = texts.WITHDRAW_MISTYPED.format(id=view.id)
        return person_page(context, view.id, status=422, wrong=mistyped)
    if outcome == "erase" and _goes_on(context, view.id, ""):  # the same form again
        return _to(context, view.id)
    _refuse_while_driving(context, view.id)
    run = context.runs.view()
    if outcome == "keep":
        context.study.withdraw(view.id, erase=False)
    elif run is None or not run.goes_on:
        context.runs.erase(view.id)
    else:  # somebody else is at the wheel, which erasing may not touch
        if not view.standing.withdrawn:
            context.study.withdraw(view.id, erase=False)
        context.runs.erase_later(view.id)
    return _to(context, view.id)


ACTS: Mapping[str, Callable[[str, ExperimenterContext, Form], Response]] = {
    "link": new_link,
    "start": start,
    "stop": stop,
    "redo": redo,
    "note": note,
    "withdraw": withdraw,
}


def _goes_on(context: ExperimenterContext, participant: str, phase: str) -> bool:
    run = context.runs.view()
    return run is not None and run.goes_on and (run.participant, run.phase) == (participant, phase)


def _refuse_while_driving(context: ExperimenterContext, participant: str) -> None:
    run = context.runs.view()
    if run is not None and run.goes_on and run.participant == participant:
        raise StudyError(
            texts.RUN_BUSY.format(title=run.title, participant=run.participant, pid=run.pid)
        )


def _to(context: ExperimenterContext, participant: str) -> RedirectResponse:
    return RedirectResponse(f"{context.home}/participants/{participant}", 303)
