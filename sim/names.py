"""Names that people write: when two of them look like one."""

import unicodedata
from collections.abc import Iterable

_UNSEEN = ("Cc", "Cf")  # control and format characters: zero-width blanks, marks of order, ...


def appearance(name: str) -> str:
    """What names have in common that differ only by blanks, case or Unicode form.

    Blanks of any kind and in any place: no-break, zero-width, tabs, line breaks.
    """
    folded = unicodedata.normalize("NFKC", name).casefold()
    seen = "".join(
        letter
        for letter in unicodedata.normalize("NFKC", folded)
        if not letter.isspace() and unicodedata.category(letter) not in _UNSEEN
    )
    # What stood apart may join now: a letter and an accent that had a blank between them.
    return seen if seen == name else appearance(seen)


def alike(names: Iterable[str]) -> tuple[str, str] | None:
    """The first two different names that look like one, in the order given; None if none do."""
    first_of: dict[str, str] = {}
    for name in names:
        first = first_of.setdefault(appearance(name), name)
        if first != name:
            return first, name
    return None


def both_shown(one: str, other: str) -> str:
    """Two names as an error shows them, so that their difference can be seen."""
    show = repr
    if unicodedata.normalize("NFKC", one) == unicodedata.normalize("NFKC", other):
        show = ascii
    return f"{show(one)} and {show(other)} differ only by blanks, case or Unicode form"
