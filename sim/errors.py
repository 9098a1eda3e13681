"""Errors a user can fix; the command line prints them in one sentence and exits with code 2."""

import unicodedata

_TURNS_THE_ORDER = "\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
_LONGEST = 1500  # characters of a message
_LONGEST_SHOWN = 80  # characters of a value: an error is a sentence


class SteerlabError(Exception):
    """Base of every error that names a value, the cause and the remedy."""

    def __str__(self) -> str:
        """The sentences, their middle left out if a value in them is endless."""
        text = super().__str__()
        half = _LONGEST // 2
        return text if len(text) <= _LONGEST else f"{text[:half]} ... {text[-half:]}"


class InvalidConfig(SteerlabError, ValueError):
    """A setting, or a file that holds settings, is outside what it may be."""


class InvalidValue(InvalidConfig):
    """One value of a record, or of the file that it was read from, is not what it may be.

    Attributes:
        path: from the record, such as ``phases[0].kind``, counted from 0; in a file it begins with
            ``$``, which is the whole of it.
        value: what is there; None if nothing is.
        allowed: what may be.
        file, line: where, if it came from a file and the line is known.
    """

    def __init__(
        self,
        path: str,
        value: object,
        allowed: str,
        *,
        says: str = "",
        file: str = "",
        line: int | None = None,
    ) -> None:
        """``says`` takes the place of the words that follow the path."""
        self.path, self.value, self.allowed = path, value, allowed
        self.file, self.line = file, line
        self._says = says or f" is {shown(value)}; it must be {allowed}."
        where = ", ".join([*([file] if file else []), *([f"line {line}"] if line else [])])
        super().__init__(f"{where}{': ' if where else ''}{path or '$'}{self._says}")

    @classmethod
    def missing(cls, path: str, allowed: str) -> "InvalidValue":
        """The error of a value that is missing."""
        return cls(path, None, allowed, says=f" is missing; give {allowed}.")

    @classmethod
    def refused(cls, value: object, why: SteerlabError) -> "InvalidValue":
        """The error of a record that refused ``value`` with its own message ``why``."""
        return why if isinstance(why, cls) else cls("", value, "", says=f": {why}")

    def under(self, parent: str) -> "InvalidValue":
        """The same error, with a path that starts from the record's ``parent``."""
        step = "" if not self.path or self.path.startswith("[") else "."
        return InvalidValue(f"{parent}{step}{self.path}", self.value, self.allowed, says=self._says)

    def at(self, file: str, line: int | None) -> "InvalidValue":
        """The same error, in a file."""
        return InvalidValue(
            self.path, self.value, self.allowed, says=self._says, file=file, line=line
        )


class InvalidWorld(SteerlabError, ValueError):
    """A world breaks its own rules: a ball inside a block, a start outside the ground, ..."""


class MissingPackage(SteerlabError, ImportError):
    """An optional package, which this part of steerlab needs, is not installed."""


class NoPath(SteerlabError):
    """No forward-drivable path leads from a pose to the ball.

    ``reason`` is one of ``pose_in_collision``, ``no_connection``, ``goal_blocked``.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class NoRenderer(SteerlabError):
    """No OpenGL back end on this machine can draw a frame."""


class StateMismatch(SteerlabError, ValueError):
    """A stored state vector does not belong to the model it is restored into."""


def check_words(path: str, text: str) -> None:
    """Refuse a blank text.

    Raises:
        InvalidValue: it is.
    """
    if not text.strip():
        raise InvalidValue(path, text, "some words")


def unreadable(text: str) -> str:
    """The first character that would act on a terminal or a page instead of being read; "" if none.

    Control characters but tabs and ends of lines, marks that turn the order of what follows, and
    what stands for bytes that are no text.
    """
    for one in text:
        kind = unicodedata.category(one)
        if kind == "Cs" or (kind == "Cc" and one not in "\t\n") or one in _TURNS_THE_ORDER:
            return one
    return ""


def shown(value: object) -> str:
    """``value`` as an error shows it: at most 80 characters."""
    try:
        shown = repr(value)
    except ValueError:  # a whole number of more digits than Python writes
        return "a number too long to show"
    return shown if len(shown) <= _LONGEST_SHOWN else f"{shown[: _LONGEST_SHOWN - 3]}..."
