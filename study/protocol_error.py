"""How a protocol is refused: with the key, the value, and what is allowed."""

from steerlab.study.contract import StudyError


class ProtocolError(StudyError):
    """A protocol holds nonsense.

    Attributes:
        key: such as ``phases[3].kind``, counted from 1.
        value: what it is.
        allowed: what it may be.
    """

    def __init__(self, key: str, value: object, allowed: str, *, place: str = "") -> None:
        self.key, self.value, self.allowed = key, value, allowed
        super().__init__(f"{place}{key} is {value!r}; it must be {allowed}.")

    def at(self, file: str, line: int | None) -> "ProtocolError":
        """The same error, with its place."""
        place = f"{file}{f', line {line}' if line else ''}: "
        return ProtocolError(self.key, self.value, self.allowed, place=place)

    def under(self, prefix: str) -> "ProtocolError":
        """The same error, of the record at ``prefix``."""
        return ProtocolError(f"{prefix}.{self.key}", self.value, self.allowed)


def check_words(key: str, text: str) -> None:
    """Refuse a blank text.

    Raises:
        ProtocolError: it is.
    """
    if not text.strip():
        raise ProtocolError(key, text, "some words")
