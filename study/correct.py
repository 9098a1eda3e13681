"""``steerlab correct``: a participant corrects the calibration rollouts, from where they left off."""

from dataclasses import dataclass, field
from pathlib import Path

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.names import alike, both_shown
from steerlab.sim.progress import Progress
from steerlab.sim.rollout import Rollout
from steerlab.study.calibration_session import (
    CalibrationSession,
    CalibrationSessionConfig,
    Corrected,
)
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import STUDY_FILE, StudyStore
from steerlab.teleop.attempt import SessionConfig
from steerlab.teleop.markers import Markers
from steerlab.teleop.screen.config import ScreenConfig


@dataclass(frozen=True, kw_only=True)
class CorrectConfig:
    """Who corrects what, and how it looks.

    Attributes:
        rollouts: how many of the calibration set, from its first.
        viewer: also show the drives live in Rerun.
        pictures: draw the camera into the recordings when the session is over.
        markers: told of each attempt and step; None for nobody.
    """

    participant: str
    role: str = "training"
    rollouts: int = 12
    viewer: bool = False
    pictures: bool = True
    screen: ScreenConfig = field(default_factory=ScreenConfig)
    session: SessionConfig = field(default_factory=SessionConfig)
    markers: Markers | None = None


def rollouts_left(folder: Path, participant: str, rollouts: list[Rollout]) -> list[Rollout]:
    """Those of ``rollouts`` that the participant has not finished yet.

    Raises:
        InvalidConfig: the study has somebody whose name only looks like the participant's.
    """
    if not (folder / STUDY_FILE).exists():
        return rollouts
    with StudyStore.open(folder / STUDY_FILE, read_only=True) as store:
        for known in store.participants():
            if alike((known, participant)):
                raise InvalidConfig(
                    f"Participants {both_shown(participant, known)}. Give --participant "
                    f"{known!r} if it is the same person, or another name if not."
                )
        finished = {
            attempt.rollout
            for attempt in store.attempts(AttemptStatus.FINISHED)
            if attempt.participant == participant
        }
    return [rollout for rollout in rollouts if rollout.name not in finished]


def correct(folder: Path, device_spec: str, config: CorrectConfig, progress: Progress) -> Corrected:
    """Let the participant correct what they have not finished yet, and keep it in ``folder``.

    Raises:
        SteerlabError: device, display or study cannot be used; what is finished stays.
    """
    rollouts = list(load_calibration_set())
    if not 1 <= config.rollouts <= len(rollouts):
        raise InvalidConfig(
            f"rollouts is {config.rollouts}; the calibration set has {len(rollouts)}."
        )
    rollouts = rollouts[: config.rollouts]
    session = CalibrationSession(
        folder=folder,
        participant=config.participant,
        role=config.role,
        left=rollouts_left(folder, config.participant, rollouts),
        total=config.rollouts,
        config=CalibrationSessionConfig(
            viewer=config.viewer,
            pictures=config.pictures,
            screen=config.screen,
            session=config.session,
            markers=config.markers,
        ),
    )
    return session.correct(device_spec, progress)
