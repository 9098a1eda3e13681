"""Which items are shown: some only after certain answers to an earlier one."""

from dataclasses import dataclass, field

from steerlab.sim.errors import InvalidValue
from steerlab.study.surveys.answer_format import Value


@dataclass(frozen=True, kw_only=True, slots=True)
class ShownIf:
    """An item is shown only while an earlier one is shown and has one of these answers.

    Attributes:
        item: the earlier one's id.
        answers: the key ``is`` in a file.
    """

    item: str
    answers: tuple[Value, ...] = field(metadata={"key": "is"})

    def __post_init__(self) -> None:
        if not self.answers:
            raise InvalidValue("is", [], "one or more answers")
