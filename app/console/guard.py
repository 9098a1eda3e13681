"""Which requests and forms are let through to a page, and the headers that every answer carries.

A page of another site that the experimenter has open can send requests to this machine, and can
point a name of its own at it (DNS rebinding): so the Host header must be ours, a request that
changes something must come from a page of ours, and its form must fit into memory.
"""

import hmac
import json
from collections.abc import Collection, Mapping
from hashlib import sha256
from urllib.parse import parse_qsl

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from steerlab.app.console import texts

LARGEST_BODY = 64 * 1024  # bytes; the longest questionnaire posts about 2 kB
FORM = "application/x-www-form-urlencoded"
LONGEST_LENGTH = 10  # digits
READING = ("GET",)  # not HEAD: it would use up what a GET shows once, and no page sends it
MOST_FIELDS = 300
CSRF_FIELD = "csrf"
ONCE_FIELD = "once"

CONTENT_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "connect-src 'self'",
        "form-action 'self'",
        "frame-ancestors 'none'",
        "base-uri 'none'",
    )
)
HEADERS = {
    "content-security-policy": CONTENT_POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), display-capture=()",
    "x-frame-options": "DENY",
}
TLS_HEADERS = {"strict-transport-security": "max-age=2592000"}  # 30 days


class Guard:
    """Refuses what no page of ours would send; wraps the whole application."""

    def __init__(self, app: ASGIApp, *, origins: Collection[str]) -> None:
        """Guard ``app``; ``origins`` are the addresses it may be opened by."""
        self._app = app
        self._origins = frozenset(origins)
        self._hosts = frozenset(origin.split("//")[1] for origin in origins)
        has_tls = all(origin.startswith("https:") for origin in origins)
        self._headers = HEADERS | (TLS_HEADERS if has_tls else {})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return  # the server offers no other kind

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._headers.items():
                    headers[name] = value
                headers.setdefault("cache-control", "no-store")
            await send(message)

        refusal = self._refusal(scope["method"], Headers(scope=scope))
        if refusal is not None:
            await refusal(scope, receive, send_with_headers)
            return
        await self._app(scope, receive, send_with_headers)

    def _refusal(self, method: str, headers: Headers) -> PlainTextResponse | None:
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0].lower() not in self._hosts:
            said = texts.REFUSED_HOST.format(hosts=", ".join(sorted(self._hosts)))
            return PlainTextResponse(said, 421)
        if method in READING:
            return None
        if method != "POST":
            return PlainTextResponse(texts.REFUSED_KIND, 405, {"allow": "GET, POST"})
        if not self._is_ours(headers):
            return PlainTextResponse(texts.REFUSED_ORIGIN, 403)
        if headers.get("content-type", "").split(";")[0].strip().lower() != FORM:
            return PlainTextResponse(texts.REFUSED_KIND, 415)
        length = headers.get("content-length", "0")
        is_number = length.isascii() and length.isdigit() and len(length) <= LONGEST_LENGTH
        if not is_number or int(length) > LARGEST_BODY:
            return PlainTextResponse(texts.REFUSED_SIZE, 413)
        return None

    def _is_ours(self, headers: Headers) -> bool:
        """Whether a page of ours sent it, according to the browser.

        Under ``no-referrer`` a browser sends ``Origin: null`` with a native form, so that there
        ``Sec-Fetch-Site`` must tell; no page can set it.
        """
        origins = headers.getlist("origin")
        if len(origins) > 1:
            return False
        if origins and origins[0] != "null":
            return origins[0].lower() in self._origins
        return headers.get("sec-fetch-site") == "same-origin"


class BadForm(Exception):
    """The body is too long or is no form; ``status`` is the HTTP status to answer with."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


async def read_form(request: Request) -> Mapping[str, str]:
    """The fields of a urlencoded form; files are not taken.

    They are kept in ``request.state.posted``, for a page that asks to send them again.

    Raises:
        BadForm: it is too long, not UTF-8, or names a field twice.
        ClientDisconnect: the client went away, or was too slow.
    """
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > LARGEST_BODY:  # a chunked request names no length beforehand
            raise BadForm(413)
    try:
        pairs = parse_qsl(
            bytes(body).decode("ascii"),
            keep_blank_values=True,
            encoding="utf-8",
            errors="strict",
            max_num_fields=MOST_FIELDS,
        )
    except ValueError as error:  # UnicodeDecodeError is one
        raise BadForm(400) from error
    fields = dict(pairs)
    if len(fields) != len(pairs):
        raise BadForm(400)
    request.state.posted = fields
    return fields


def csrf_token(secret: str) -> str:
    """The token in a page's forms: only who knows the link or the session's cookie can compute it.

    It follows from the secret alone, so that a page outlives a restart of the console.
    """
    return hmac.new(secret.encode(), b"steerlab console form", sha256).hexdigest()


def csrf_holds(secret: str, fields: Mapping[str, str]) -> bool:
    """Whether the form was made for whoever holds ``secret``."""
    return hmac.compare_digest(csrf_token(secret).encode(), fields.get(CSRF_FIELD, "").encode())


def form_key(act: str, fields: Mapping[str, str]) -> str | None:
    """Names one form of one page with what was filled in, so that sending it again is no new act.

    None for a form without the page's own ``ONCE_FIELD``, which no page of ours sends.
    """
    if not fields.get(ONCE_FIELD):
        return None
    said = sorted((name, value) for name, value in fields.items() if name != CSRF_FIELD)
    text = json.dumps([act, said])
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
