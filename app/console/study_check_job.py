"""The checks of a whole study, which take too long for a page to wait for them."""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import UTC, datetime

from steerlab.sim.errors import SteerlabError
from steerlab.study.contract import StudyAccess, StudyCheck


@dataclass(frozen=True, kw_only=True, slots=True)
class CheckupView:
    """What the last checks found.

    Attributes:
        at: when, in UTC; empty before the first have ended.
        failure: why they could not be done; empty if they could.
        busy: others are under way.
    """

    at: str = ""
    findings: Sequence[StudyCheck] = ()
    failure: str = ""
    busy: bool = False


class StudyCheckJob:
    """Checks on a thread of its own and with the study opened anew, so that no answer waits."""

    def __init__(
        self,
        open_study: Callable[[], AbstractContextManager[StudyAccess]],
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self._open_study = open_study
        self._now = now
        self._done = CheckupView()
        self._task: asyncio.Task[None] | None = None

    def view(self) -> CheckupView:
        """The last ones, and whether others are under way."""
        done = self._done
        return CheckupView(
            at=done.at, findings=done.findings, failure=done.failure, busy=self._is_busy()
        )

    def mark(self) -> str:
        """Differs whenever checks have begun or ended."""
        return f"{self._done.at}:{self._is_busy()}"

    def start(self) -> None:
        """Begin, unless others are under way; to be called in the event loop."""
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
        at = self._now().strftime("%H:%M:%S")
        self._done = CheckupView(at=at, findings=findings, failure=failure)

    def _findings(self) -> Sequence[StudyCheck]:
        with self._open_study() as study:
            return study.findings(None)
