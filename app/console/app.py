"""The console as one web application: which address leads to which page."""

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import ASGIApp

from steerlab.app.console import texts
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.data_export import DataExport
from steerlab.app.console.experimenter_pages import ExperimenterPages
from steerlab.app.console.guard import BadForm, Guard
from steerlab.app.console.own_steps import OwnSteps
from steerlab.app.console.participant_pages import ParticipantPages
from steerlab.app.console.rendering import busy_page, message_page, static_file
from steerlab.app.console.short_links import ShortLinks
from steerlab.app.console.sign_in import LoginThrottle, SignIn
from steerlab.app.console.study_thread import StudyCheckJob, StudyThread
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.study.store.errors import StoreError

_LOG = logging.getLogger(__name__)


def make_app(
    study_thread: StudyThread,
    runs: WheelRuns,
    check_job: StudyCheckJob,
    sign_in: SignIn,
    exports: DataExport,
    *,
    origins: Sequence[str],
    address: str,
    throttle: LoginThrottle | None = None,
    changes: ChangeFeed | None = None,
    kiosk: bool = False,
) -> ASGIApp:
    """The application, behind its guard.

    Args:
        origins: every ``scheme://host:port`` it may be opened by.
        address: the one that participants' links begin with.
        throttle: limits wrong links and passwords.
        changes: given by a caller who wants to end the streams of open pages.
        kiosk: the participant's page is on the computer at the wheel, and starts the drives.
    """
    changes = changes or ChangeFeed(study_thread, runs.mark, check_job.mark)
    throttle = throttle or LoginThrottle()
    changes.after_changes(OwnSteps(runs))
    short_links = ShortLinks()
    person = ParticipantPages(study_thread, runs, changes, throttle, short_links, kiosk=kiosk)
    lab = ExperimenterPages(
        study_thread,
        runs,
        check_job,
        changes,
        sign_in,
        throttle,
        exports,
        short_links,
        origin=address,
        kiosk=kiosk,
    )

    @asynccontextmanager
    async def follow(app: Starlette) -> AsyncIterator[None]:
        await changes.try_look()
        watching = asyncio.create_task(changes.watch())
        try:
            yield
        finally:
            changes.close()
            watching.cancel()
            with suppress(asyncio.CancelledError):
                await watching

    home = sign_in.home
    questions = "/p/{token}/{phase}/{number:int}"
    post = ["POST"]
    routes = [
        Route("/", lab.front),
        Route("/enter/{code}", lab.enter),
        Route("/sign-in", lab.sign_in, methods=post),
        Route(home, lab.people),
        Route(f"{home}/sign-out", lab.sign_out, methods=post),
        Route(f"{home}/checks", lab.checks, methods=["GET", "POST"]),
        Route(f"{home}/events", lab.events),
        Route(f"{home}/export", lab.export, methods=post),
        Route(f"{home}/enrol", lab.enrol, methods=post),
        Route(f"{home}/participants/{{participant}}", lab.person),
        Route(f"{home}/participants/{{participant}}/{{act}}", lab.act, methods=post),
        Route("/go", person.enter, methods=post),
        Route("/go", person.short),
        Route("/go/{code}", person.short),
        Route("/p/{token}", person.show),
        Route("/p/{token}/ready", person.ready, methods=post),
        Route("/p/{token}/events", person.events),
        Route("/p/{token}/consent", person.consent, methods=post),
        Route("/p/{token}/consent/copy", person.consent_copy),
        Route("/p/{token}/{phase}/done", person.done, methods=post),
        Route(questions, person.questions, methods=["GET", "POST"]),
        Route(f"{questions}/answer", person.answer, methods=post),
        Route("/static/{name}", static_file),
    ]

    async def not_found(request: Request, error: Exception) -> Response:
        status = error.status_code if isinstance(error, HTTPException) else 404
        path = request.url.path
        if status == 405:  # the back button after a form was sent: GET of what only takes POST
            link = f"/p/{request.path_params['token']}" if "token" in request.path_params else "/"
            if path.startswith(f"{home}/"):
                link = home
            return message_page(texts.STALE_TITLE, texts.STALE_TEXT, status=405, link=link)
        if path.startswith("/lab/") and not path.startswith(f"{home}/"):  # before a restart
            return await lab.front(request)
        return message_page(texts.NOT_FOUND_TITLE, texts.NOT_FOUND_TEXT, status=status)

    async def no_store(request: Request, error: Exception) -> Response:
        _LOG.warning("The study could not be used: %s", error)
        posted = getattr(request.state, "posted", None)
        said = [texts.BUSY_READ if posted is None else texts.BUSY_SENT]
        path = request.url.path
        if path.startswith(home):  # participants need not know where the study lies
            said.append(str(error))
        return busy_page(*said, path=path, posted=posted)

    app = Starlette(
        routes=routes,
        lifespan=follow,
        exception_handlers={
            HTTPException: not_found,
            StoreError: no_store,
            ClientDisconnect: _gone,
            BadForm: _bad_form,
            Exception: _went_wrong,
        },
    )
    app.router.redirect_slashes = False
    return Guard(app, origins=origins)


async def _gone(request: Request, error: Exception) -> Response:
    return Response(status_code=400)  # nobody is there to read it


async def _bad_form(request: Request, error: Exception) -> Response:
    status = error.status if isinstance(error, BadForm) else 400
    said = texts.REFUSED_SIZE if status == 413 else texts.REFUSED_KIND
    return message_page(texts.REFUSED_TITLE, said, status=status)


async def _went_wrong(request: Request, error: Exception) -> Response:
    _LOG.error("A page failed", exc_info=error)  # not its address, which holds a link
    return message_page(texts.ERROR_TITLE, texts.ERROR_TEXT, status=500)
