"""The pages behind a participant's link: each request sees the one participant it belongs to."""

from collections.abc import Callable, Mapping
from functools import partial
from hashlib import sha256

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from steerlab.app.console import participant_acts as acts
from steerlab.app.console import texts
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.forms import csrf_holds, read_form
from steerlab.app.console.login_throttle import LoginThrottle, client_address
from steerlab.app.console.participant_views import ParticipantContext, current_page, page_key
from steerlab.app.console.rendering import message_page
from steerlab.app.console.study_thread import StudyThread
from steerlab.study.contract import StudyAccess, StudyError

LONGEST_TOKEN = 128

Work = Callable[[ParticipantContext, Mapping[str, str]], Response]


class ParticipantPages:
    """Information, consent, questionnaires, instructions, waiting and thanks."""

    def __init__(self, desk: StudyThread, changes: ChangeFeed, guesses: LoginThrottle) -> None:
        self._desk = desk
        self._changes = changes
        self._guesses = guesses
        # Links that were right once: those guessing from the same address lock out nobody.
        self._known: set[bytes] = set()

    async def show(self, request: Request) -> Response:
        """Whatever comes next for the participant."""
        return await self._visit(request, lambda visit, _: current_page(visit))

    async def questions(self, request: Request) -> Response:
        """Show or hand in one questionnaire of the phase that is open."""
        number = request.path_params["number"]
        work = acts.hand_in if request.method == "POST" else acts.show_questions
        return await self._visit(request, partial(work, request.path_params["phase"], number))

    async def answer(self, request: Request) -> Response:
        """Keep one answer; 204 only once it is durable."""
        phase, number = request.path_params["phase"], request.path_params["number"]
        return await self._visit(request, partial(acts.keep_one, phase, number))

    async def consent(self, request: Request) -> Response:
        """Keep the decision."""
        return await self._visit(request, acts.consent)

    async def done(self, request: Request) -> Response:
        """Leave a page of instructions or the debriefing."""
        return await self._visit(request, partial(acts.leave_page, request.path_params["phase"]))

    async def events(self, request: Request) -> Response:
        """Tell a waiting page when it is out of date."""
        token, address = _token(request), client_address(request)
        refusal = self._refusal(token, address)
        if refusal is not None:
            return refusal

        async def key() -> str:
            return await self._desk.do(partial(_key_of, token))

        if await key() == "":
            return self._expired(address)
        return self._changes.response(key) or PlainTextResponse(texts.ERROR_TITLE, 503)

    async def _visit(self, request: Request, work: Work) -> Response:
        token, address = _token(request), client_address(request)
        refusal = self._refusal(token, address)
        if refusal is not None:
            return refusal
        posted: Mapping[str, str] = {}
        if request.method == "POST":
            posted = await read_form(request)
            if not csrf_holds(token, posted):
                return message_page(texts.STALE_TITLE, texts.STALE_TEXT, status=403)

        def with_study(study: StudyAccess) -> Response | None:
            participant = study.participant_of(token)
            if participant is None:
                return None
            try:
                return work(
                    ParticipantContext(study=study, token=token, participant=participant), posted
                )
            except StudyError as error:
                return message_page(
                    texts.CANNOT_TITLE,
                    str(error),
                    status=409,
                    study=study.title,
                    link=f"/p/{token}",
                )

        response = await self._desk.do(with_study)
        if response is None:
            return self._expired(address)
        self._known.add(_hash(token))
        return response

    def _refusal(self, token: str, address: str) -> Response | None:
        wait_s = self._guesses.wait_s(address)
        if wait_s and _hash(token) not in self._known:
            said = texts.TOO_MANY_TEXT.format(seconds=wait_s)
            return message_page(texts.TOO_MANY_TITLE, said, status=429, wait_s=wait_s)
        return self._expired(address) if len(token) > LONGEST_TOKEN else None

    def _expired(self, address: str) -> Response:
        self._guesses.wrong(address)
        return message_page(texts.EXPIRED_TITLE, texts.EXPIRED_TEXT, status=404)


def _key_of(token: str, study: StudyAccess) -> str:
    participant = study.participant_of(token)
    return "" if participant is None else page_key(study.participant(participant))


def _token(request: Request) -> str:
    return request.path_params["token"]


def _hash(token: str) -> bytes:
    return sha256(token.encode("utf-8", "replace")).digest()
