"""The verb ``study``: a human study from its protocol to its last participant."""

from typing import Annotated

import tyro

from steerlab.app.verbs.study_people import Amend, Enrol, New, Note, Redo, Status, Withdraw
from steerlab.app.verbs.study_run import Resume, Run, Train, Verify

_Act = Annotated[
    Annotated[New, tyro.conf.subcommand("new")]
    | Annotated[Enrol, tyro.conf.subcommand("enrol")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Resume, tyro.conf.subcommand("resume")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Status, tyro.conf.subcommand("status")]
    | Annotated[Withdraw, tyro.conf.subcommand("withdraw")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
    | Annotated[Redo, tyro.conf.subcommand("redo")]
    | Annotated[Note, tyro.conf.subcommand("note")]
    | Annotated[Amend, tyro.conf.subcommand("amend")],
    tyro.conf.arg(name=""),
]


def study(act: _Act) -> int:
    """A human study: protocol, participants, phases, checks, withdrawal.

    Example: steerlab study new my-study --template mind-meld
    """
    return act.do()
