"""What the study's runner asks for in a teaching phase, and ``StudyTeaching``, which does it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.folder_lock import FolderLock
from steerlab.sim.progress import Progress
from steerlab.study.contract import Phase
from steerlab.study.protocol import StudyProtocol
from steerlab.study.teaching.conditions import TAUGHT
from steerlab.teleop.devices.contract import Device
from steerlab.teleop.markers import Markers
from steerlab.teleop.screen.config import WindowChoice

UNAVAILABLE = "not available in this version"


class TeachingError(SteerlabError):
    """A robot cannot be taught as asked; says why, and what is kept."""


@dataclass(frozen=True, kw_only=True)
class TeachRequest:
    """One participant is to teach under one condition.

    Attributes:
        mapper: the network with the participant's w; only for conditions that map labels.
        device: a specification, or a script's device itself.
        lock: the study's, which the caller holds; a recorder takes it over.
        viewer: also show the drives live in Rerun.
        recordings: write a Rerun recording of each attempt.
        window: what was chosen for this computer.
        settings: kept with the session, such as the protocol's version.
        markers: told of each attempt and step; None for nobody.
        after: what comes next on the participant's page; empty if nothing does.
    """

    folder: Path
    participant: str
    phase: Phase
    protocol: StudyProtocol
    mapper: Path | None
    device: str | Device
    lock: FolderLock
    progress: Progress
    viewer: bool = False
    recordings: bool = True
    window: WindowChoice = field(default_factory=WindowChoice)
    settings: Mapping[str, str] = field(default_factory=dict)
    markers: Markers | None = None
    after: str = ""


@dataclass(frozen=True, kw_only=True)
class TeachingResult:
    """How it ended; ``detail`` is kept with the phase."""

    finished: bool
    detail: str


class Teaching(Protocol):
    """Lets people teach under a condition; resumes where an earlier call was stopped."""

    def teach(self, request: TeachRequest) -> TeachingResult:
        """Teach, and keep what was taught, durable when this returns.

        Raises:
            SteerlabError: device, display or study cannot be used; what is finished stays.
        """
        ...


Teachings = Mapping[str, Teaching]
"""By condition; a phase of any other condition is skipped, on record."""


class StudyTeaching:
    """The ``Teaching`` of every condition in ``TAUGHT``."""

    def teach(self, request: TeachRequest) -> TeachingResult:
        """Teach; see ``run_teaching``.

        Raises:
            TeachingError: policies cannot be kept or read, or a drive cannot be learnt from.
            BallNeverReached: the first demonstration never got there.
            SteerlabError: device, display or study cannot be used; what is finished stays.
        """
        from steerlab.study.teaching.run_teaching import teach  # torch, MuJoCo: seconds to import

        # pyright knows this module under two names, with a ``TeachRequest`` in each
        finished, detail = teach(request)  # pyright: ignore[reportArgumentType]
        return TeachingResult(finished=finished, detail=detail)


def all_teachings() -> Teachings:
    """A ``Teaching`` for every condition that a protocol may name."""
    return dict.fromkeys(TAUGHT, StudyTeaching())
