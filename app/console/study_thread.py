"""The threads on which the console uses a study, which belongs to the thread that opened it."""

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from time import monotonic
from typing import TypeVar

from steerlab.sim.errors import SteerlabError
from steerlab.study.contract import StudyAccess, StudyCheck
from steerlab.study.store.errors import StoreError

LONGEST_TURN_S = 10.0  # that a request waits for those before it

T = TypeVar("T")


class StudyThread:
    """Does one thing with the study after another; what changes it is durable when done."""

    def __init__(
        self,
        open_study: Callable[[], AbstractContextManager[StudyAccess]],
        begin: Callable[[], None] | None = None,
    ) -> None:
        """Open the study on a thread of its own, which calls ``begin`` first.

        Raises:
            SteerlabError: whatever opening it raises.
        """
        self._thread = ThreadPoolExecutor(
            max_workers=1, thread_name_prefix="study", initializer=begin
        )
        try:
            self._opened, self._study = self._thread.submit(_enter, open_study).result()
        except BaseException:
            self._thread.shutdown()
            raise

    async def do(self, work: Callable[[StudyAccess], T]) -> T:
        """``work(study)`` on the study's thread.

        Raises:
            StoreError: those before it took too long, as while another program holds the database;
                it was not done.
            SteerlabError: whatever ``work`` raises.
        """
        asked_s = monotonic()

        def turn() -> T:
            waited_s = monotonic() - asked_s
            if waited_s > LONGEST_TURN_S:
                raise StoreError(
                    f"The study was busy for {waited_s:.0f} s, so this was not done; try again."
                )
            return work(self._study)

        return await asyncio.get_running_loop().run_in_executor(self._thread, turn)

    def close(self) -> None:
        """Finish what is under way, then close the study."""
        self._thread.submit(self._opened.__exit__, None, None, None).result()
        self._thread.shutdown()


def _enter(
    open_study: Callable[[], AbstractContextManager[StudyAccess]],
) -> tuple[AbstractContextManager[StudyAccess], StudyAccess]:
    opened = open_study()
    return opened, opened.__enter__()


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyCheckResults:
    """Results of the last checks of the whole study.

    Attributes:
        at: when, in UTC; empty before the first have ended.
        failure: why they could not be done; empty if they could.
        busy: new checks are running.
    """

    at: str = ""
    findings: Sequence[StudyCheck] = ()
    failure: str = ""
    busy: bool = False


class StudyCheckJob:
    """Checks the whole study on a thread of its own, so that no page waits for the checks."""

    def __init__(
        self,
        open_study: Callable[[], AbstractContextManager[StudyAccess]],
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self._open_study = open_study
        self._now = now
        self._done = StudyCheckResults()
        self._task: asyncio.Task[None] | None = None

    def view(self) -> StudyCheckResults:
        """The last results, and whether new checks are running."""
        return replace(self._done, busy=self._is_busy())

    def mark(self) -> str:
        """Differs whenever checks have begun or ended."""
        return f"{self._done.at}:{self._is_busy()}"

    def start(self) -> None:
        """Begin, unless checks are running; to be called in the event loop."""
        if not self._is_busy():
            self._task = asyncio.create_task(self._check())

    def _is_busy(self) -> bool:
        return self._task is not None and not self._task.done()

    async def _check(self) -> None:
        findings: Sequence[StudyCheck] = ()
        failure = ""
        try:
            findings = await asyncio.to_thread(self._findings)
        except (SteerlabError, OSError) as error:
            failure = str(error)
        at = self._now().strftime("%Y-%m-%dT%H:%M:%SZ")
        self._done = StudyCheckResults(at=at, findings=findings, failure=failure)

    def _findings(self) -> Sequence[StudyCheck]:
        with self._open_study() as study:
            return study.findings(None)
