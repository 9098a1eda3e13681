"""One thread on which the study is used, since a study belongs to the thread that opened it."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import TypeVar

from steerlab.study.contract import StudyAccess

T = TypeVar("T")


class StudyThread:
    """Does one thing with the study after another; what changes it is durable when done."""

    def __init__(self, open_study: Callable[[], AbstractContextManager[StudyAccess]]) -> None:
        """Open the study on a thread of its own.

        Raises:
            SteerlabError: whatever opening it raises.
        """
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="study")
        try:
            self._opened, self._study = self._thread.submit(_enter, open_study).result()
        except BaseException:
            self._thread.shutdown()
            raise

    async def do(self, work: Callable[[StudyAccess], T]) -> T:
        """``work(study)`` on the study's thread."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, work, self._study)

    def close(self) -> None:
        """Finish what is under way, then close the study."""
        self._thread.submit(self._opened.__exit__, None, None, None).result()
        self._thread.shutdown()


def _enter(
    open_study: Callable[[], AbstractContextManager[StudyAccess]],
) -> tuple[AbstractContextManager[StudyAccess], StudyAccess]:
    opened = open_study()
    return opened, opened.__enter__()
