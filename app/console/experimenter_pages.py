"""The experimenter's pages: everyone's way, one participant, the checks."""

from collections.abc import Callable, Mapping
from functools import partial

from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

from steerlab.app.console import experimenter_acts as acts
from steerlab.app.console import texts
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.experimenter_views import (
    ExperimenterContext,
    checks_page,
    people_page,
    person_page,
)
from steerlab.app.console.forms import csrf_holds, read_form
from steerlab.app.console.login_throttle import LoginThrottle, client_address
from steerlab.app.console.rendering import message_page, page
from steerlab.app.console.sign_in import BrowserSession, SignIn
from steerlab.app.console.study_check_job import StudyCheckJob
from steerlab.app.console.study_thread import StudyThread
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.sim.errors import SteerlabError
from steerlab.study.contract import StudyAccess

COOKIE = "steerlab_experimenter"

Work = Callable[[ExperimenterContext, Mapping[str, str]], Response]


class ExperimenterPages:
    """Everything but the participants' own pages; only for who signed in."""

    def __init__(
        self,
        desk: StudyThread,
        runs: WheelRuns,
        checkup: StudyCheckJob,
        changes: ChangeFeed,
        sign_in: SignIn,
        guesses: LoginThrottle,
        *,
        origin: str,
    ) -> None:
        """``origin`` is what participants' links begin with."""
        self._desk = desk
        self._runs = runs
        self._checkup = checkup
        self._changes = changes
        self._sign_in = sign_in
        self._guesses = guesses
        self._origin = origin

    async def people(self, request: Request) -> Response:
        """Everyone, and what to do next."""
        return await self._work(request, lambda bench, _: people_page(bench))

    async def person(self, request: Request) -> Response:
        """One participant."""
        participant = request.path_params["participant"]
        shown = request.query_params.get("link", "")
        return await self._work(
            request, lambda bench, _: person_page(bench, participant, link_key=shown)
        )

    async def checks(self, request: Request) -> Response:
        """The whole study's integrity; a POST checks again."""
        if request.method == "POST":
            response = await self._work(request, lambda bench, _: RedirectResponse("/checks", 303))
            if response.status_code == 303:  # signed in, and the form is ours
                self._checkup.start()
                await self._changes.look()
            return response
        if self._session(request) is not None and not self._checkup.view().at:
            self._checkup.start()
            await self._changes.look()
        return await self._work(request, lambda bench, _: checks_page(bench, self._checkup.view()))

    async def enrol(self, request: Request) -> Response:
        """The next participant."""
        return await self._work(request, acts.enrol)

    async def act(self, request: Request) -> Response:
        """One of ``acts.ACTS`` on a participant."""
        act = acts.ACTS.get(request.path_params["act"])
        if act is None:
            return message_page(texts.NOT_FOUND_TITLE, texts.NOT_FOUND_TEXT, status=404)
        return await self._work(request, partial(act, request.path_params["participant"]))

    async def events(self, request: Request) -> Response:
        """Tell the open pages whenever something changed."""
        if self._session(request) is None:
            return PlainTextResponse(texts.SIGN_IN_TITLE, 401)

        async def key() -> str:
            return self._changes.version

        return self._changes.response(key) or PlainTextResponse(texts.ERROR_TITLE, 503)

    async def enter(self, request: Request) -> Response:
        """Sign in by the terminal's one-time link."""
        token = request.path_params["token"]
        return self._let_in(request, lambda: self._sign_in.by_link(token), wrong=texts.SIGN_IN_USED)

    async def sign_in(self, request: Request) -> Response:
        """Sign in by password."""
        posted = await read_form(request)
        password = posted.get("password", "")
        return self._let_in(
            request, lambda: self._sign_in.by_password(password), wrong=texts.WRONG_PASSWORD
        )

    async def sign_out(self, request: Request) -> Response:
        """End the session."""
        session = self._session(request)
        posted = await read_form(request)
        if session is not None and csrf_holds(session.secret, posted):
            self._sign_in.sign_out(session)
        response = RedirectResponse("/", 303)
        response.delete_cookie(COOKIE)
        return response

    async def _work(self, request: Request, work: Work) -> Response:
        session = self._session(request)
        if session is None:
            return self._sign_in_page(status=401)
        posted: Mapping[str, str] = {}
        if request.method == "POST":
            posted = await read_form(request)
            if not csrf_holds(session.secret, posted):
                return message_page(texts.STALE_TITLE, texts.STALE_TEXT, status=403, link="/")

        def with_study(study: StudyAccess) -> Response:
            bench = ExperimenterContext(
                study=study,
                runs=self._runs,
                session=session,
                origin=self._origin,
                version=self._changes.version,
            )
            try:
                return work(bench, posted)
            except SteerlabError as error:
                return message_page(
                    texts.CANNOT_TITLE, str(error), status=409, study=study.title, link="/"
                )

        response = await self._desk.do(with_study)
        if request.method == "POST":
            await self._changes.look()
        return response

    def _session(self, request: Request) -> BrowserSession | None:
        return self._sign_in.session(request.cookies.get(COOKIE))

    def _let_in(
        self, request: Request, try_it: Callable[[], BrowserSession | None], *, wrong: str
    ) -> Response:
        address = client_address(request)
        wait_s = self._guesses.wait_s(address)
        if wait_s:
            said = texts.TOO_MANY_TEXT.format(seconds=wait_s)
            return message_page(texts.TOO_MANY_TITLE, said, status=429, wait_s=wait_s)
        session = try_it()
        if session is None:
            self._guesses.wrong(address)
            return self._sign_in_page(status=401, wrong=wrong)
        response = RedirectResponse("/", 303)
        response.set_cookie(
            COOKIE,
            session.secret,
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
