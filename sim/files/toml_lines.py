"""The line of a TOML file that holds a key, so that an error can point at it."""

import re

_HEADING = re.compile(r"\s*(\[\[?)\s*([\w.\-]+)\s*\]\]?\s*(?:#.*)?$")
_ASSIGNMENT = re.compile(r"\s*([\w\-]+(?:\s*\.\s*[\w\-]+)*|\"[^\"]*\"|'[^']*')\s*=\s*(.*)$")
_LAST_STEP = re.compile(r"(\[[^\[\]]*\]|\.[^.\[\]]+)$")


def line_of(text: str, path: str) -> int | None:
    """The line of ``path``, else of the nearest table around it; None if none is in the file.

    Args:
        text: valid TOML.
        path: such as ``$.items[2].anchors.7``, counted from 0. What is within an inline table or
            list has the line on which that begins.
    """
    lines = _lines(text)
    while path not in lines:
        outer = _LAST_STEP.sub("", path)
        if outer == path:
            return None
        path = outer
    return lines[path]


def _lines(text: str) -> dict[str, int]:
    """The line of every table's heading and of every key that begins a line."""
    found: dict[str, int] = {}
    counts: dict[str, int] = {}
    table = "$"
    quote = ""  # of the multi-line string that the line is in
    depth = 0  # of the lists that the line is in
    for number, line in enumerate(text.splitlines(), start=1):
        if not quote and depth == 0:
            heading = _HEADING.match(line)
            if heading:
                table = f"$.{_path(heading[2], counts)}"
                if heading[1] == "[[":
                    counts[table] = counts.get(table, -1) + 1
                    table = f"{table}[{counts[table]}]"
                found.setdefault(table, number)
                continue
            assignment = _ASSIGNMENT.match(line)
            if assignment:
                name = assignment[1].strip("\"'").replace(" ", "")
                found.setdefault(f"{table}.{name}", number)
                line = assignment[2]
        quote, depth = _rest(line, quote, depth)
    return found


def _path(heading: str, counts: dict[str, int]) -> str:
    """``items.anchors`` as ``items[2].anchors`` if three ``[[items]]`` came before."""
    first, dot, rest = heading.partition(".")
    last = counts.get(f"$.{first}")
    return f"{first}[{last}].{rest}" if dot and last is not None else heading


def _rest(line: str, quote: str, depth: int) -> tuple[str, int]:
    """Which multi-line string, and how many open lists, the line leaves behind it."""
    place = 0
    while place < len(line):
        here = line[place:]
        if quote:
            if here.startswith("\\") and '"' in quote:
                place += 2
            elif here.startswith(quote):
                place, quote = place + len(quote), ""
            else:
                place += 1
            continue
        if here.startswith(('"""', "'''")):
            quote = here[:3]
        elif here[0] in "\"'":
            quote = here[0]
        elif here[0] == "#":
            break
        else:
            depth += (here[0] in "[{") - (here[0] in "]}")
        place += len(quote) or 1
    return (quote if len(quote) == 3 else ""), depth
