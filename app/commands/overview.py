"""What ``steerlab --help`` says: every verb in a line.

tyro would make a page of every verb's whole help, and build every verb's parser for it.
"""

from collections.abc import Callable, Mapping
from shutil import get_terminal_size
from textwrap import wrap

_WIDEST = 100
_INDENT = 2


def overview(verbs: Mapping[str, Callable[..., int]]) -> list[str]:
    """The lines, as wide as the terminal.

    Args:
        verbs: each verb's function; the first line of its docstring is what it does.
    """
    options = {
        "-h, --help": "Show this help.",
        "--version": "Show the version.",
    }
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
    width = min(get_terminal_size().columns, _WIDEST)
    column = _INDENT + 17
    lines: list[str] = []
    for name, text in rows.items():
        first, *others = wrap(text, max(width - column, 20))
        lines.append(f"{' ' * _INDENT}{name:<{column - _INDENT}}{first}")
        lines += [" " * column + other for other in others]
    return lines
