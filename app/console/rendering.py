"""Pages from templates, and the few static files; nothing else is ever served."""

from collections.abc import Mapping
from datetime import datetime
from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.prose import prose

STATIC_TYPES = {
    "console.css": "text/css; charset=utf-8",
    "follow.js": "text/javascript; charset=utf-8",
    "answers.js": "text/javascript; charset=utf-8",
    "copy.js": "text/javascript; charset=utf-8",
    "print.js": "text/javascript; charset=utf-8",
}


def local_time(at_utc: str) -> str:
    """A time as clocks show it where the console's computer stands, with the zone."""
    moment = datetime.fromisoformat(at_utc).astimezone()
    return f"{moment:%Y-%m-%d, %H:%M} (UTC{moment.isoformat()[-6:]})"


def moment(at_utc: str) -> Markup:
    """``local_time`` for a template, with the exact time for machines."""
    return Markup('<time datetime="{}">{}</time>').format(at_utc, local_time(at_utc))


def fill(words: str, **values: str | Markup) -> Markup:
    """``words.format(...)`` for a template, where a value may be markup."""
    return escape(words).format(**values)


def page(template: str, *, status: int = 200, **values: Any) -> HTMLResponse:
    """A page; ``t`` in a template holds all words of ``texts``."""
    return HTMLResponse(_environment().get_template(template).render(**values), status)


def message_page(
    title: str, *paragraphs: str, status: int, study: str = "", link: str = "", copy: str = ""
) -> HTMLResponse:
    """A page that only shows a message; ``link`` leads on from it, ``copy`` to a copy to keep."""
    return page(
        "message.html.j2",
        status=status,
        study=study,
        title=title,
        paragraphs=paragraphs,
        link=link,
        copy=copy,
    )


def busy_page(*paragraphs: str, path: str, posted: Mapping[str, str] | None) -> HTMLResponse:
    """Says that the study cannot be reached now; a form that was sent can be sent again from it.

    Args:
        posted: the form's fields; None if the page was only to be read.
    """
    response = page(
        "busy.html.j2",
        status=503,
        study="",
        title=texts.BUSY_TITLE,
        paragraphs=paragraphs,
        path=path,
        posted=posted,
    )
    response.headers["retry-after"] = "5"
    return response


def too_many_page(wait_s: int, *, sign_in: bool = False) -> HTMLResponse:
    """Says how long to wait after too many wrong links or passwords."""
    words = texts.TOO_MANY_SIGN_INS if sign_in else texts.TOO_MANY_TEXT
    said = words.format(seconds=wait_s)
    response = message_page(texts.TOO_MANY_TITLE, said, status=429)
    response.headers["retry-after"] = str(wait_s)
    return response


async def static_file(request: Request) -> Response:
    """One of the files of ``STATIC_TYPES``; a name never becomes a path."""
    file = static_files().get(request.path_params["name"])
    if file is None:
        return PlainTextResponse(texts.NOT_FOUND_TITLE, 404)
    content, kind, tag = file
    headers = {"etag": tag, "cache-control": "no-cache"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    return Response(content, media_type=kind, headers=headers)


@cache
def static_files() -> Mapping[str, tuple[bytes, str, str]]:
    """Content, type and entity tag, by name."""
    folder = files("steerlab.app.console") / "static"
    contents = {name: (folder / name).read_bytes() for name in STATIC_TYPES}
    return {
        name: (content, STATIC_TYPES[name], f'"{sha256(content).hexdigest()[:20]}"')
        for name, content in contents.items()
    }


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("steerlab.app.console", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["t"] = texts
    environment.filters |= {"prose": prose, "moment": moment, "fill": fill}
    return environment
