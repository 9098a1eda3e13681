"""``steerlab``: the command line, and the only place where everything is put together.

Each verb is a typed function in ``commands``. Only the named verb's module is read, and what a verb
needs is imported inside it, so that ``--help`` answers at once.
"""

import io
import os
import signal
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, TextIO

VERBS = (
    "demo",
    "doctor",
    "wheel",
    "drive",
    "correct",
    "replay",
    "study",
    "console",
    "simulate",
    "fit",
    "synthetic",
    "teach",
    "analyze",
    "export",
    "power",
    "calibration-set",
)
"""Each is a function of its name in a module of its name in ``commands``."""

_RERUNS_LOG = ("RUST_LOG", "off")  # what concerns the user comes as an error or a warning of ours
_WIDEST_HELP = 100  # characters
_NARROWEST, _WIDEST = 40, 1000  # of a terminal: tyro never ends in a narrower one
_SIGPIPE = getattr(signal, "SIGPIPE", 13)  # Windows has no such signal


def main(arguments: list[str] | None = None) -> int:
    """Run one verb: 0 all well, 1 it found something wrong, 2 it could not be done."""
    _print_every_character()
    _write_as_wide_as_can_be_read()
    try:
        try:
            return _run(list(sys.argv[1:] if arguments is None else arguments))
        finally:
            stdout: TextIO | None = sys.stdout  # none where it was closed, as by >&-
            if stdout is not None:
                stdout.flush()  # here, where a reader that has gone can still be told of
    except BrokenPipeError:  # whoever read what we print has seen enough, such as ``head``
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + _SIGPIPE
    except OSError as error:
        from steerlab.sim.files.refusal import refusal

        where = f"{error.filename}: " if error.filename else ""
        print(f"steerlab: {where}{refusal(error, 'check the path')}.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("steerlab: stopped.", file=sys.stderr)
        return 128 + signal.SIGINT


def _print_every_character() -> None:
    """Files get UTF-8, as all that steerlab writes; a terminal shows ? for what it cannot.

    A name of a file that is no text goes to files as the bytes that it is.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            if stream.isatty():
                stream.reconfigure(errors="replace")
            else:
                stream.reconfigure(encoding="utf-8", errors="surrogateescape")


def _write_as_wide_as_can_be_read() -> None:
    """Take a terminal for 40 to 1000 characters wide, whatever it says."""
    from shutil import get_terminal_size

    width = get_terminal_size().columns
    if not _NARROWEST <= width <= _WIDEST:
        os.environ["COLUMNS"] = str(min(max(width, _NARROWEST), _WIDEST))


def verb_function(verb: str) -> Callable[..., int]:
    """What does the work of a verb; imports its module, and no other's."""
    name = verb.replace("-", "_")
    return getattr(import_module(f"steerlab.app.commands.{name}"), name)


def _run(arguments: list[str]) -> int:
    first, *rest = arguments or ["--help"]
    verb = first.replace("_", "-")
    if verb in VERBS:
        return _run_verb(verb, rest)
    if first in ("-h", "--help"):
        print("\n".join(_overview({name: verb_function(name) for name in VERBS})))
        return 0
    if first == "--version":
        from importlib.metadata import version

        print(f"steerlab {version('steerlab')}")
        return 0
    if first.startswith("--tyro-"):  # writes a shell's completion, which knows every verb
        import tyro

        every: dict[str, Callable[..., Any]] = {name: verb_function(name) for name in VERBS}
        return tyro.extras.subcommand_cli_from_dict(every, prog="steerlab", args=arguments)
    print(f"steerlab: {_no_verb(first)}", file=sys.stderr)
    return 2


def _overview(verbs: Mapping[str, Callable[..., int]]) -> list[str]:
    """What ``steerlab --help`` says: every verb in a line, as wide as the terminal.

    tyro would make a page of every verb's whole help, and build every verb's parser for it.

    Args:
        verbs: each verb's function; the first line of its docstring is what it does.
    """
    options = {"-h, --help": "Show this help.", "--version": "Show the version."}
    does = {name: (function.__doc__ or "").partition("\n")[0] for name, function in verbs.items()}
    return [
        "usage: steerlab [-h] [--version] VERB ...",
        "",
        "A driving lab for studying how people teach robots.",
        "",
        "verbs:",
        *_table(does),
        "",
        "options:",
        *_table(options),
        "",
        "steerlab VERB --help has a verb's options, and an example.",
    ]


def _table(rows: Mapping[str, str]) -> list[str]:
    from shutil import get_terminal_size
    from textwrap import wrap

    width = min(get_terminal_size().columns, _WIDEST_HELP)
    column = 19  # where a verb's sentence begins
    lines: list[str] = []
    for name, text in rows.items():
        first, *others = wrap(text, max(width - column, 20))
        lines.append(f"  {name:<{column - 2}}{first}")
        lines += [" " * column + other for other in others]
    return lines


def _run_verb(verb: str, arguments: list[str]) -> int:
    import logging

    import tyro
    from tyro._errors import ParseErrorEvent, on_parse_error

    from steerlab.app.commands.arguments import READ_AS, BadArgument
    from steerlab.sim.errors import SteerlabError
    from steerlab.sim.files.machine import check_handles

    logging.basicConfig(format="steerlab: %(message)s", level=logging.WARNING)
    os.environ.setdefault(*_RERUNS_LOG)
    function = verb_function(verb)

    def refuse(event: ParseErrorEvent) -> None:
        from steerlab.app.refusals import refusal_of

        if sentence := refusal_of(event, function, arguments):
            raise BadArgument(sentence)

    try:
        check_handles()
        with on_parse_error(refuse):
            return tyro.cli(function, prog=f"steerlab {verb}", args=arguments, registry=READ_AS)
    except SteerlabError as error:
        print(f"steerlab: {error}", file=sys.stderr)
        return 2


def _no_verb(given: str) -> str:
    from difflib import get_close_matches

    close = get_close_matches(given, VERBS, n=1)
    cause = f"{given!r} is no verb"
    if given.startswith("-"):
        cause = (
            f"{given!r} comes before a verb; options follow the verb, as in steerlab VERB {given}"
        )
    meant = f" Did you mean {close[0]}?" if close else ""
    return f"{cause}.{meant} Choose from {', '.join(VERBS)}; steerlab --help says more."


if __name__ == "__main__":
    sys.exit(main())
