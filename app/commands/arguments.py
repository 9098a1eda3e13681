"""Arguments that several commands share, of types that keep ``--help`` quick.

For ``Path | None`` and ``tuple[str, ...]`` tyro asks typeguard whether a default fits. typeguard
imports asyncio and unittest, which takes longer than all else that ``--help`` does. tyro checks an
``Optional`` itself, and any default fits an ``object``: so tuples are an ``object`` to tyro, with a
description of how their words are read.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Optional

import tyro
from tyro.constructors import PrimitiveConstructorSpec

if TYPE_CHECKING:
    from steerlab.teleop.screen.config import ScreenConfig

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

Out = Annotated[Path, tyro.conf.arg(metavar="DIR", help="Folder for the results.")]
Force = Annotated[bool, tyro.conf.arg(help="Replace the folder if it is not empty.")]
Seed = Annotated[int, tyro.conf.arg(help="The same seed gives the same labels and figures.")]
Json = Annotated[bool, tyro.conf.arg(help="Print the summary as JSON.")]
Noise = Literal["paper", "low", "human", "high"]
Preset = Literal["lab", "paper"]
Ladder = Literal["full", "quick"]
Name = Annotated[str, tyro.conf.arg(help="Part of the wheel's name, if there are several.")]
DeviceSpec = Annotated[
    str,
    tyro.conf.arg(
        help="wheel, wheel:NAME, gamepad, keyboard, mouse, scripted:KIND:SEED or trace:FILE."
    ),
]
Size = Annotated[str, tyro.conf.arg(help="Of the window, such as 960x540 or 1280x720.")]
FullScreen = Annotated[bool, tyro.conf.arg(help="Fill the screen.")]
TextScale = Annotated[float, tyro.conf.arg(help="0.8 to 2; larger is easier to read.")]
View = Annotated[Literal["front", "chase"], tyro.conf.arg(help="From the car, or from behind it.")]


def screen_config(
    size: str, full_screen: bool = False, view: View = "front", text_scale: float = 1.0
) -> "ScreenConfig":
    """The settings of a window.

    Raises:
        InvalidConfig: the size is none.
    """
    from steerlab.sim.errors import InvalidConfig
    from steerlab.teleop.screen.config import ScreenConfig

    width, cross, height = size.partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise InvalidConfig(f"size is {size!r}; give width x height in pixels, such as 960x540.")
    return ScreenConfig(
        width=int(width),
        height=int(height),
        full_screen=full_screen,
        view=view,
        text_scale=text_scale,
    )
