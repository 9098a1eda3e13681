"""How often an address may be wrong about a link or a password before it has to wait."""

from collections import OrderedDict, deque
from collections.abc import Callable
from math import ceil
from time import monotonic

from starlette.requests import Request

MOST_WRONG = 20
WINDOW_S = 60.0
MOST_ADDRESSES = 1024  # remembered; the longest unseen is forgotten first


class LoginThrottle:
    """Counts wrong guesses by client address."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._wrong: OrderedDict[str, deque[float]] = OrderedDict()

    def wait_s(self, address: str) -> int:
        """Seconds until the address may guess again; 0 if it may now."""
        times = self._wrong.get(address)
        if times is None or len(times) < MOST_WRONG:
            return 0
        return max(0, ceil(times[0] + WINDOW_S - self._clock()))

    def wrong(self, address: str) -> None:
        """The address was wrong once more."""
        times = self._wrong.setdefault(address, deque(maxlen=MOST_WRONG))
        times.append(self._clock())
        self._wrong.move_to_end(address)
        if len(self._wrong) > MOST_ADDRESSES:
            self._wrong.popitem(last=False)


def client_address(request: Request) -> str:
    """Where the connection comes from; what a header claims does not count."""
    return request.client.host if request.client else "unknown"
