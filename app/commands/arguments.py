"""Arguments that several commands share, of types that keep ``--help`` quick.

For ``Path | None`` and ``tuple[str, ...]`` tyro asks typeguard whether a default fits. typeguard
imports asyncio and unittest, which takes longer than all else that ``--help`` does. tyro checks an
``Optional`` itself, and any default fits an ``object``: so tuples are an ``object`` to tyro, with a
description of how their words are read.

A number says what it may be: one that is none, is not finite or out of range is refused in words,
before anything is read or run.
"""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Optional

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from steerlab.sim.errors import SteerlabError, shown

if TYPE_CHECKING:
    from steerlab.teleop.screen.config import ScreenConfig

PathOrNone = Optional[Path]  # noqa: UP045 - see above
TextOrNone = Optional[str]  # noqa: UP045
IntOrNone = Optional[int]  # noqa: UP045
FloatOrNone = Optional[float]  # noqa: UP045


MAX_SEED = 2**32 - 1
MANY = 10_000
"""People, rounds, drives: more would fill the memory, or run for years."""


class BadArgument(SteerlabError):
    """An argument is not what it may be; no ``ValueError``, which tyro would put into a box."""


def whole(name: str, least: int, most: int) -> PrimitiveConstructorSpec[Any]:
    """The option ``name`` is a whole number in this range, both ends included."""
    return _one(name, "INT", lambda word: _read(name, int, word, least, most))


def decimal(name: str, least: float, most: float) -> PrimitiveConstructorSpec[Any]:
    """The option ``name`` is a number in this range, both ends included."""
    return _one(name, "FLOAT", lambda word: _read(name, float, word, least, most))


def wholes(name: str, least: int, most: int) -> PrimitiveConstructorSpec[Any]:
    """The option ``name`` is any number of whole numbers in this range."""
    return _several(lambda word: _read(name, int, word, least, most), "INT")


def words(name: str, choices: tuple[str, ...]) -> PrimitiveConstructorSpec[Any]:
    """The option ``name`` is any number of these words."""

    def read(word: str) -> str:
        if word not in choices:
            raise BadArgument(f"{name} is {shown(word)}; choose from {', '.join(choices)}.")
        return word

    return _several(read, "|".join(choices))


def _read(name: str, kind: Callable[[str], Any], word: str, least: float, most: float) -> Any:
    value: Any = word
    try:
        value = kind(word)
        if math.isfinite(value) and least <= value <= most:
            return value
    except (ValueError, OverflowError):  # no number, or too long a one
        pass
    what = "a whole number" if kind is int else "a number"
    raise BadArgument(
        f"{name} is {shown(value)}; it must be {what} from {least:.10g} to {most:.10g}."
    )


def _one(name: str, metavar: str, read: Callable[[str], Any]) -> PrimitiveConstructorSpec[Any]:
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda words: read(words[0]),
        is_instance=lambda value: value is None or isinstance(value, (int, float)),
        str_from_instance=lambda value: [str(value)],
    )


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
    Words = tuple[str, ...]
else:
    Texts = Annotated[object, _several(str, "STR")]
    Ints = object  # with ``wholes``
    Words = object  # with ``words``

Lsl = Annotated[
    bool,
    tyro.conf.arg(help="Send markers to Lab Streaming Layer as well; needs steerlab[lsl]."),
]
READ_AS = ConstructorRegistry()
"""How the command line reads what no option says more about: a path, whose ``~`` is a home."""


@READ_AS.primitive_rule
def _path(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    if info.type is not Path:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="PATH",
        instance_from_str=lambda words: expanded(words[0]),
        is_instance=lambda value: isinstance(value, Path),
        str_from_instance=lambda value: [str(value)],
    )


def expanded(word: str) -> Path:
    """The path that a person means by ``word``: shells leave the ``~`` of ``--out=~/x`` alone.

    Raises:
        BadArgument: it is empty, nobody's home is known by that name, or it is no text to others.
    """
    if not word:
        raise BadArgument("A path is empty; name a file or a folder, such as . for the one here.")
    try:
        path = Path(word).expanduser()
    except RuntimeError:
        home = word.partition("/")[0]
        raise BadArgument(
            f"{shown(word)} begins with {home}, and no such home folder is known; give the whole "
            f"path, or ./{home} for a name that begins so."
        ) from None
    check_encoding(path)
    return path


def check_encoding(path: Path) -> None:
    """Refuse a path that Python and the libraries that write files would take for different ones.

    Those encode every name as UTF-8; Python as the locale says, and keeps bytes that are no text.

    Raises:
        BadArgument: they differ.
    """
    whole = os.path.abspath(path)
    if os.fsencode(whole) != whole.encode("utf-8", "replace"):
        raise BadArgument(
            f"{shown(whole)} cannot be written in UTF-8 as it stands; set LC_ALL=C.UTF-8 if it "
            "looks right in your terminal, or else choose a name of plain letters."
        )


Out = Annotated[Path, tyro.conf.arg(metavar="DIR", help="Folder for the results.")]
Force = Annotated[bool, tyro.conf.arg(help="Replace the folder if it is not empty.")]
Seed = Annotated[
    int,
    whole("seed", 0, MAX_SEED),
    tyro.conf.arg(help="The same seed gives the same labels and figures."),
]
Jobs = Annotated[
    int,
    whole("jobs", 1, 1024),
    tyro.conf.arg(help="Processes; results do not depend on it."),
]
Json = Annotated[bool, tyro.conf.arg(help="Print the summary as JSON.")]
Noise = Literal["paper", "low", "human", "high", "people", "sparse"]
Preset = Literal["lab", "paper", "paper-text"]
Ladder = Literal["full", "quick"]
Name = Annotated[str, tyro.conf.arg(help="Part of the wheel's name, if there are several.")]
DeviceSpec = Annotated[
    str,
    tyro.conf.arg(
        help="wheel, wheel:NAME, gamepad, keyboard, mouse, scripted:KIND:SEED or trace:FILE."
    ),
]
Size = Annotated[str, tyro.conf.arg(help="Of the window, such as 960x540 or 1280x720.")]
SizeOrNone = Annotated[
    TextOrNone, tyro.conf.arg(metavar="WxH", help="In a window of this size, such as 1280x720.")
]
Monitor = Annotated[
    str,
    tyro.conf.arg(metavar="N|NAME", help="Which to fill, from 0; it is remembered."),
]
Windowed = Annotated[bool, tyro.conf.arg(help="In a window of 960x540, not on the full screen.")]
Sound = Annotated[bool, tyro.conf.arg(help="Engine, contact, countdown.")]
TextScale = Annotated[
    float,
    decimal("text-scale", 0.8, 2.0),
    tyro.conf.arg(help="0.8 to 2; larger is easier to read."),
]
_LONGEST_SIZE = 20  # characters
View = Annotated[
    Literal["driver", "front", "chase"],
    tyro.conf.arg(help="From behind the hood, from the bumper, or from behind the car."),
]


def screen_config(
    size: str,
    *,
    full_screen: bool = False,
    monitor: str = "",
    view: View = "driver",
    text_scale: float = 1.0,
    sound: bool = False,
) -> "ScreenConfig":
    """The settings of a window.

    Raises:
        InvalidConfig: the size is none.
    """
    from steerlab.sim.errors import InvalidConfig
    from steerlab.teleop.screen.config import ScreenConfig

    width, cross, height = size.partition("x")
    if not (cross and width.isdecimal() and height.isdecimal() and len(size) < _LONGEST_SIZE):
        raise InvalidConfig(
            f"size is {shown(size)}; give width x height in pixels, such as 960x540."
        )
    return ScreenConfig(
        width=int(width),
        height=int(height),
        full_screen=full_screen,
        monitor=monitor,
        sound=sound,
        view=view,
        text_scale=text_scale,
    )
