"""Who may open the experimenter's pages: whoever reads the terminal, or knows the password."""

import hmac
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from time import monotonic

SESSION_S = 12 * 3600.0  # a working day; after that the terminal's next link is needed
MOST_SESSIONS = 16


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
            announce: is told each new one-time token, to show it in the terminal.
            password: lets in as well, where one is set.
        """
        self._announce = announce
        self._password = password
        self._clock = clock
        self._sessions: dict[str, BrowserSession] = {}
        self._link = secrets.token_urlsafe(32)

    @property
    def has_password(self) -> bool:
        """A password lets in."""
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
        found = self._sessions.get(_name(cookie))
        return found if found is not None and found.ends_s > self._clock() else None

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
