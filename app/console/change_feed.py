"""Tells open pages within a second that the study has changed, whoever changed it."""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable

from starlette.responses import StreamingResponse

from steerlab.app.console.study_thread import StudyThread
from steerlab.sim.errors import SteerlabError

LOOK_EVERY_S = 0.4
STILL_THERE_S = 15.0  # a comment keeps the connection, and shows whether the page is still open
MOST_STREAMS = 200

_LOG = logging.getLogger(__name__)


class ChangeFeed:
    """Watches the study's change count, and wakes the streams of open pages."""

    def __init__(self, study_thread: StudyThread, *marks: Callable[[], str]) -> None:
        """Follow the study, and whatever else has a mark that differs after each change."""
        self._study_thread = study_thread
        self._marks = marks
        self._version = ""
        self._woken = asyncio.Event()
        self._closing = False
        self._streams = 0

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

    async def watch(self) -> None:
        """Look until ``close``; to be run as a task of the application."""
        while not self._closing:
            try:
                await self.look()
            except SteerlabError as error:  # pages stand still; the next look may succeed
                _LOG.warning("Cannot see whether the study changed: %s", error)
            await asyncio.sleep(LOOK_EVERY_S)

    def close(self) -> None:
        """End all streams; to be called in the event loop."""
        self._closing = True
        self._wake()

    def response(self, key: Callable[[], Awaitable[str]]) -> StreamingResponse | None:
        """A stream of server-sent events: ``key()`` now, and again whenever it has changed.

        None if too many pages are open.
        """
        if self._streams >= MOST_STREAMS:
            return None
        return StreamingResponse(self._events(key), media_type="text/event-stream")

    async def _events(self, key: Callable[[], Awaitable[str]]) -> AsyncIterator[str]:
        self._streams += 1
        try:
            sent = None
            while not self._closing:
                woken = self._woken
                now = await key()
                if now != sent:
                    sent = now
                    yield f"data: {now}\n\n"
                try:
                    await asyncio.wait_for(woken.wait(), STILL_THERE_S)
                except TimeoutError:
                    yield ": still there\n\n"
        finally:
            self._streams -= 1

    def _wake(self) -> None:
        woken, self._woken = self._woken, asyncio.Event()
        woken.set()
