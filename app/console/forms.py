"""A posted form: read within bounds, and known to come from the page that was shown."""

import hmac
from collections.abc import Mapping
from hashlib import sha256
from urllib.parse import parse_qsl

from starlette.requests import Request

from steerlab.app.console.guard import LARGEST_BODY

MOST_FIELDS = 300
CSRF_FIELD = "csrf"


class BadForm(Exception):
    """The body is too long, or no form at all; ``status`` says which."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


async def read_form(request: Request) -> Mapping[str, str]:
    """The fields of a urlencoded form; files are not taken.

    Raises:
        BadForm: it is too long, not UTF-8, or names a field twice.
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
    return fields


def csrf_token(secret: str) -> str:
    """What a page's forms carry: only who knows the link or the session's cookie can compute it.

    It follows from the secret alone, so that a page outlives a restart of the console.
    """
    return hmac.new(secret.encode(), b"steerlab console form", sha256).hexdigest()


def csrf_holds(secret: str, fields: Mapping[str, str]) -> bool:
    """The form was made for who holds ``secret``."""
    return hmac.compare_digest(csrf_token(secret).encode(), fields.get(CSRF_FIELD, "").encode())
