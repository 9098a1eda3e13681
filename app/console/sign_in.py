"""Who may open pages: one-time links, the password, browsers' sessions, a limit on wrong guesses."""

import hmac
import secrets
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from ipaddress import IPv6Address, IPv6Network, ip_address
from math import ceil
from time import monotonic

from starlette.requests import Request

SESSION_S = 12 * 3600.0  # a working day; after that the terminal's next link is needed
MOST_SESSIONS = 16
MOST_WRONG = 20  # guesses of a source within ``WINDOW_S``
MOST_WRONG_PASSWORDS = 60  # of all sources together
WINDOW_S = 60.0
MOST_ADDRESSES = 1024  # that are remembered; the one unseen for longest is forgotten first
CODE_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # none that looks like another
CODE_LENGTH = 16  # of 31 letters: 79 bits, beyond all guessing over a network


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
    """One-time codes, the password, and the sessions they open; all end with the console.

    A browser sends a cookie to every port of a host, where another program may listen. So the
    session's cookie is for one path alone, which nobody knows who has not signed in, and the path
    is of no use without the cookie. The cookie's name is a secret too: else another port could
    set one of the same name.

    Attributes:
        home: the path of the experimenter's pages.
        cookie: the name of the session's cookie.
    """

    def __init__(
        self,
        *,
        announce: Callable[[str], None],
        password: str | None = None,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        """Begin with one code.

        Args:
            announce: called with each new one-time code, to show it in the terminal.
            password: lets in as well, where one is set.
        """
        self._announce = announce
        self._password = password
        self._clock = clock
        self._sessions: dict[str, BrowserSession] = {}
        self._code = _new_code()
        self.home = f"/lab/{secrets.token_urlsafe(16)}"
        self.cookie = f"steerlab_{secrets.token_hex(8)}"

    @property
    def has_password(self) -> bool:
        """Whether the experimenter can sign in by password."""
        return self._password is not None

    def announce_link(self) -> None:
        """Show the code that is valid now."""
        self._announce(self._code)

    def by_code(self, typed: str) -> BrowserSession | None:
        """A session, if the one-time code is right; the next one is announced."""
        right = plain_code(self._code).encode()
        if not hmac.compare_digest(plain_code(typed).encode("utf-8", "replace"), right):
            return None
        self._code = _new_code()
        self._announce(self._code)
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


def _new_code() -> str:
    letters = [secrets.choice(CODE_LETTERS) for _ in range(CODE_LENGTH)]
    return "-".join("".join(letters[start : start + 4]) for start in range(0, CODE_LENGTH, 4))


def plain_code(typed: str) -> str:
    """A code as it is compared: in whatever case, with or without its hyphens."""
    return "".join(typed.lower().replace("-", " ").split())


class LoginThrottle:
    """Counts wrong guesses by source; too many within a minute have to wait.

    Passwords, which people choose, are counted over all sources as well. Whoever fills that count
    keeps nobody out: the one-time code, which cannot be guessed, is never made to wait, nor is a
    participant's link that is known to be right.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._wrong: OrderedDict[str, deque[float]] = OrderedDict()
        self._wrong_passwords: deque[float] = deque(maxlen=MOST_WRONG_PASSWORDS)
        self._right: set[bytes] = set()

    def wait_s(self, source: str) -> int:
        """Seconds until the source may guess again; 0 if it may now."""
        return self._wait_s(self._wrong.get(source))

    def password_wait_s(self, source: str) -> int:
        """Seconds until the source may try a password; 0 if it may now."""
        return max(self.wait_s(source), self._wait_s(self._wrong_passwords))

    def wrong(self, source: str) -> None:
        """Count a wrong guess of the source."""
        times = self._wrong.setdefault(source, deque(maxlen=MOST_WRONG))
        times.append(self._clock())
        self._wrong.move_to_end(source)
        if len(self._wrong) > MOST_ADDRESSES:
            self._wrong.popitem(last=False)

    def wrong_password(self, source: str) -> None:
        """Count a wrong password of the source."""
        self.wrong(source)
        self._wrong_passwords.append(self._clock())

    def know(self, token: str) -> None:
        """A participant's link is right, so that no guesses of others make it wait."""
        self._right.add(sha256(token.encode("utf-8", "replace")).digest())

    def knows(self, token: str) -> bool:
        """Whether a participant's link was right before."""
        return sha256(token.encode("utf-8", "replace")).digest() in self._right

    def _wait_s(self, times: deque[float] | None) -> int:
        if times is None or len(times) != times.maxlen:
            return 0
        return max(0, ceil(times[0] + WINDOW_S - self._clock()))


def client_source(request: Request) -> str:
    """Where the connection comes from; the address that a header claims is not trusted."""
    return source_of(request.client.host) if request.client else "unknown"


def source_of(host: str) -> str:
    """What counts as one client: an IPv4 address, or an IPv6 network, of which each has one."""
    try:
        address = ip_address(host.partition("%")[0])
    except ValueError:  # a test client has a name
        return host
    if isinstance(address, IPv6Address):
        if address.ipv4_mapped is not None:
            return str(address.ipv4_mapped)
        return str(IPv6Network((address, 64), strict=False))
    return str(address)
