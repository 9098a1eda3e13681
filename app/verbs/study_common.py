"""What the acts of ``study`` share: arguments, and opening one."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from steerlab.study.study import Study

Folder = Annotated[
    tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR", help="The study's folder.")
]
Person = Annotated[
    tyro.conf.Positional[str], tyro.conf.arg(metavar="PARTICIPANT", help="Their pseudonym.")
]
RoleName = Annotated[
    Literal["training", "test"],
    tyro.conf.arg(help="Training participants teach the network; test participants use it."),
]
AsJson = Annotated[bool, tyro.conf.arg(name="json", help="Print as JSON.")]


def open_study(folder: Path, *, read_only: bool = False) -> "Study":
    """The study in ``folder``; imports what that needs only now."""
    from steerlab.study.study import Study

    return Study.open(folder, read_only=read_only)
