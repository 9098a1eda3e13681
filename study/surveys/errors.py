"""What can be wrong with a questionnaire."""

from steerlab.sim.errors import InvalidConfig


class QuestionnaireError(InvalidConfig):
    """A questionnaire holds nonsense.

    Attributes:
        key: such as ``items[3].high``, counted from 1.
        value: what it is.
        allowed: what it may be.
        file, line: where, if it came from a file.
    """

    def __init__(
        self, key: str, value: object, allowed: str, *, file: str = "", line: int | None = None
    ) -> None:
        self.key, self.value, self.allowed = key, value, allowed
        self.file, self.line = file, line
        where = file and f"{file}{f', line {line}' if line else ''}: "
        super().__init__(f"{where}{key} is {value!r}; it must be {allowed}.")

    def at(self, file: str, line: int | None) -> "QuestionnaireError":
        """The same error, with its place."""
        return QuestionnaireError(self.key, self.value, self.allowed, file=file, line=line)

    def under(self, prefix: str) -> "QuestionnaireError":
        """The same error, of the record at ``prefix``."""
        return QuestionnaireError(f"{prefix}.{self.key}", self.value, self.allowed)
