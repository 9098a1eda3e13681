"""Types of arguments that tyro judges by itself, for a ``--help`` that answers at once.

Whether a default fits ``Path | None`` or ``tuple[str, ...]`` it asks typeguard, which imports
asyncio and unittest: longer than everything else that a ``--help`` does. An ``Optional`` it judges
itself, and anything is an ``object``; how several words are read is said here then.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

from tyro.constructors import PrimitiveConstructorSpec

PathOrNone = Optional[Path]  # noqa: UP045 - see above
TextOrNone = Optional[str]  # noqa: UP045
IntOrNone = Optional[int]  # noqa: UP045
FloatOrNone = Optional[float]  # noqa: UP045


def _several(read: Callable[[str], Any], name: str) -> PrimitiveConstructorSpec[Any]:
    return PrimitiveConstructorSpec(
        nargs="*",
        metavar=f"[{name} [{name} ...]]",
        instance_from_str=lambda words: tuple(map(read, words)),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda values: list(map(str, values)),
    )


if TYPE_CHECKING:
    Texts = tuple[str, ...]
    Ints = tuple[int, ...]
else:
    Texts = Annotated[object, _several(str, "STR")]
    Ints = Annotated[object, _several(int, "INT")]
