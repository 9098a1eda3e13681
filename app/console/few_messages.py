"""Keeps whoever sends nonsense to the console from filling its terminal, or a log on the disk."""

import logging
from collections import deque
from collections.abc import Callable
from time import monotonic

MOST_MESSAGES = 20  # of a logger within ``WINDOW_S``
WINDOW_S = 60.0
LOGGERS = (
    "asyncio",
    "uvicorn.error",
    "steerlab.app.console.app",
    "steerlab.app.console.change_feed",
    "steerlab.app.console.connections",
)


class FewMessages(logging.Filter):
    """Lets a logger say so much a minute; the last message says that more are left out."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._said: deque[float] = deque(maxlen=MOST_MESSAGES)

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the record is shown."""
        now = self._clock()
        if len(self._said) == MOST_MESSAGES and now - self._said[0] < WINDOW_S:
            return False
        self._said.append(now)
        if len(self._said) == MOST_MESSAGES and now - self._said[0] < WINDOW_S:
            record.msg = f"{record.getMessage()} (More of this within a minute is left out.)"
            record.args = None
        return True


def say_few() -> None:
    """Limit what the console's loggers say; to be called once."""
    for name in LOGGERS:
        logging.getLogger(name).addFilter(FewMessages())
