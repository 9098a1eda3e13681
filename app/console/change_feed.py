"""Tells open pages within a second that the study has changed, whoever changed it."""

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable

from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from steerlab.app.console.study_thread import StudyThread
from steerlab.sim.errors import SteerlabError
from steerlab.study.contract import StudyAccess

LOOK_EVERY_S = 0.4
STILL_THERE_S = 15.0  # a comment keeps the connection, and shows whether the page is still open
MOST_STREAMS = 200
MOST_OF_ONE = 8  # streams of a participant, or of a browser of the experimenter's

_LOG = logging.getLogger(__name__)


class ChangeFeed:
    """Watches the study's change count, and wakes the streams of open pages."""

    def __init__(self, study_thread: StudyThread, *marks: Callable[[], str]) -> None:
        """Follow the study, and whatever else has a mark that differs after each change."""
        self._study_thread = study_thread
        self._marks = marks
        self._then: Callable[[StudyAccess], None] | None = None
        self._version = self._answered = ""
        self._woken = asyncio.Event()
        self._closing = False
        self._lost = False
        self._streams: Counter[str] = Counter()

    def after_changes(self, then: Callable[[StudyAccess], None]) -> None:
        """Call ``then`` with the study after each change, beginning with the next look."""
        self._then = then

    @property
    def version(self) -> str:
        """Differs after each change."""
        return self._version

    async def look(self) -> None:
        """Look once, and wake the streams if something changed."""
        count = await self._study_thread.do(lambda study: study.change_count())
        version = "/".join([str(count), *(mark() for mark in self._marks)])
        if version != self._version:
            self._version = version
            self._wake()
        if self._then is not None and version != self._answered:
            await self._study_thread.do(self._then)
            self._answered = version

    async def try_look(self) -> None:
        """Look once; if that fails, open pages stand still until the next look."""
        try:
            await self.look()
            self._lost = False
        except (SteerlabError, OSError) as error:
            if not self._lost:
                _LOG.warning("Cannot see whether the study changed: %s", error)
            self._lost = True

    async def watch(self) -> None:
        """Look until ``close``; to be run as a task of the application."""
        while not self._closing:
            await self.try_look()
            await asyncio.sleep(LOOK_EVERY_S)

    def close(self) -> None:
        """End all streams; to be called in the event loop."""
        self._closing = True
        self._wake()

    def response(
        self, key: Callable[[], Awaitable[str]], owner: str = ""
    ) -> StreamingResponse | None:
        """A stream of server-sent events: ``key()`` now, and again whenever it has changed.

        It counts as ``owner``'s from now on until it has been answered. None if too many pages
        are open.
        """
        if self._streams.total() >= MOST_STREAMS or self._streams[owner] >= MOST_OF_ONE:
            return None
        self._streams[owner] += 1

        def ended() -> None:
            self._streams[owner] -= 1
            if not self._streams[owner]:
                del self._streams[owner]

        return _Stream(self._events(key), ended)

    async def _events(self, key: Callable[[], Awaitable[str]]) -> AsyncIterator[str]:
        sent = None
        while not self._closing:
            woken = self._woken
            try:
                now = await key()
            except SteerlabError:  # it cannot be read now; the page stays as it is
                now = sent
            if now is not None and now != sent:
                sent = now
                yield f"data: {now}\n\n"
            try:
                await asyncio.wait_for(woken.wait(), STILL_THERE_S)
            except TimeoutError:
                yield ": still there\n\n"

    def _wake(self) -> None:
        woken, self._woken = self._woken, asyncio.Event()
        woken.set()


class _Stream(StreamingResponse):
    """Says when it has ended, even if its client went away before it began."""

    def __init__(self, events: AsyncIterator[str], ended: Callable[[], None]) -> None:
        super().__init__(events, media_type="text/event-stream")
        self._ended = ended

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._ended()
