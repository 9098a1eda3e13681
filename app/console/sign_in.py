"""Who may open pages: one-time links, the password, browsers' sessions, a limit on wrong guesses."""

import hmac
import secrets
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from math import ceil
from time import monotonic

from starlette.requests import Request

SESSION_S = 12 * 3600.0  # a working day; after that the terminal's next link is needed
MOST_SESSIONS = 16
MOST_WRONG = 20  # guesses of an address within ``WINDOW_S``
WINDOW_S = 60.0
MOST_ADDRESSES = 1024  # that are remembered; the one unseen for longest is forgotten first


@dataclass(frozen=True, kw_only=True, slots=True)
class BrowserSession:
    """A browser that was let in.

    Attributes:
        secret: what its cookie holds.
        ends_s: when, on the clock.
        links: participants' new links that wait for the one page that shows them.
    """

    secret: str
    ends_s: float
    links: dict[str, str] = field(default_factory=dict)


class SignIn:
    """One-time links, the password, and the sessions they open; all end with the console."""

    def __init__(
        self,
        *,
        announce: Callable[[str], None],
        password: str | None = None,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        """Begin with one link.

        Args:
            announce: called with each new one-time token, to show it in the terminal.
            password: lets in as well, where one is set.
        """
        self._announce = announce
        self._password = password
        self._clock = clock
        self._sessions: dict[str, BrowserSession] = {}
        self._link = secrets.token_urlsafe(32)

    @property
    def has_password(self) -> bool:
        """Whether the experimenter can sign in by password."""
        return self._password is not None

    def announce_link(self) -> None:
        """Show the link that is valid now."""
        self._announce(self._link)

    def by_link(self, token: str) -> BrowserSession | None:
        """A session, if the one-time token is right; the next one is announced."""
        if not hmac.compare_digest(token.encode(), self._link.encode()):
            return None
        self._link = secrets.token_urlsafe(32)
        self._announce(self._link)
        return self._open()

    def by_password(self, password: str) -> BrowserSession | None:
        """A session, if a password is set and this is it."""
        if self._password is None:
            return None
        right = hmac.compare_digest(password.encode(), self._password.encode())
        return self._open() if right else None

    def session(self, cookie: str | None) -> BrowserSession | None:
        """The session that a cookie names, if it has not ended."""
        if not cookie:
            return None
        session = self._sessions.get(_name(cookie))
        return session if session is not None and session.ends_s > self._clock() else None

    def sign_out(self, session: BrowserSession) -> None:
        """End a session."""
        self._sessions.pop(_name(session.secret), None)

    def _open(self) -> BrowserSession:
        session = BrowserSession(secret=secrets.token_urlsafe(32), ends_s=self._clock() + SESSION_S)
        while len(self._sessions) >= MOST_SESSIONS:
            del self._sessions[next(iter(self._sessions))]
        self._sessions[_name(session.secret)] = session
        return session


def _name(cookie: str) -> str:
    """Looked up by a hash, so that the time it takes says nothing about the secret."""
    return sha256(cookie.encode("utf-8", "replace")).hexdigest()


class LoginThrottle:
    """Counts wrong guesses by client address; too many within a minute have to wait."""

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
        """Count a wrong guess of the address."""
        times = self._wrong.setdefault(address, deque(maxlen=MOST_WRONG))
        times.append(self._clock())
        self._wrong.move_to_end(address)
        if len(self._wrong) > MOST_ADDRESSES:
            self._wrong.popitem(last=False)


def client_address(request: Request) -> str:
    """Where the connection comes from; the address that a header claims is not trusted."""
    return request.client.host if request.client else "unknown"
