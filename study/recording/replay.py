"""``steerlab replay``: a recording rebuilt from the study's database, then shown, saved or drawn."""

import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import NoPath, NoRenderer
from steerlab.sim.geometry import Pose2D
from steerlab.sim.progress import Progress
from steerlab.sim.world import WorldSpec
from steerlab.study.recording.rebuild import View, rebuild_recording
from steerlab.study.recording.viewer import RecordingUnavailable, open_in_viewer, screenshot
from steerlab.study.store.records import Attempt

if TYPE_CHECKING:
    from steerlab.sim.ground_truth import Planner

PICTURE_PX = (480, 270)
PLANNER_SEED = 0


@dataclass(frozen=True, kw_only=True)
class ReplayConfig:
    """What to show, and how.

    Attributes:
        participant, rollout, attempt: choose the attempts; None stands for all.
        pictures: draw the camera's view again from the stored poses.
        save: write the recording to this file instead of showing it.
        screenshot: draw the viewer to this PNG file, without a display, instead of showing it.
        at_s: time of the screenshot, from the attempt's start.
    """

    participant: str | None = None
    rollout: str | None = None
    attempt: int | None = None
    pictures: bool = True
    save: Path | None = None
    screenshot: Path | None = None
    at_s: float | None = None


def replay(
    path: Path,
    config: ReplayConfig | None = None,
    *,
    progress: Progress = lambda what, share: None,
    show: Callable[[Sequence[Path]], None] = open_in_viewer,
) -> list[Attempt]:
    """Rebuild the chosen attempts, and save, draw or show them.

    Args:
        path: of a study folder or its database; or of an .rrd file, which is shown as it is.
        show: opens files, and returns when the viewer is closed.

    Returns:
        the attempts in the order in which they are shown; none for an .rrd file.

    Raises:
        RecordingUnavailable: there is nothing to show, or nothing to show it with.
        StoreError: the study cannot be read.
    """
    config = config or ReplayConfig()
    if path.suffix == ".rrd" and path.is_file():
        _present(path, config, show)
        return []
    temporary = nullcontext() if config.save is not None else tempfile.TemporaryDirectory()
    with temporary as folder:
        out = config.save or Path(folder or "") / "replay.rrd"
        try:
            attempts = rebuild_recording(
                path,
                out,
                participant=config.participant,
                rollout=config.rollout,
                attempt=config.attempt,
                open_view=view_of if config.pictures else None,
                oracle_path=oracle_path,
                progress=progress,
            )
        except NoRenderer as error:
            raise RecordingUnavailable(
                f"The camera's pictures cannot be drawn: {error} Or leave them out with "
                f"--no-pictures."
            ) from error
        _present(out, config, show)
    return attempts


def _present(file: Path, config: ReplayConfig, show: Callable[[Sequence[Path]], None]) -> None:
    if config.screenshot is not None:
        screenshot(file, config.screenshot, at_s=config.at_s)
    elif config.save is None:
        show([file])


def view_of(world: WorldSpec) -> AbstractContextManager[View]:
    """The car's camera, at the size of the pictures in a recording."""
    from steerlab.sim.engine.camera import CameraConfig
    from steerlab.sim.engine.world_view import WorldView

    width, height = PICTURE_PX
    return WorldView(world, CameraConfig(width=width, height=height))


def oracle_path(world: WorldSpec, start: Pose2D) -> FloatArray | None:
    """The oracle's path from ``start`` to the ball, (points, 2); None where there is none."""
    try:
        return _planner(world).plan(start).points
    except NoPath:
        return None


@lru_cache(maxsize=2)
def _planner(world: WorldSpec) -> "Planner":
    from steerlab.sim.ground_truth import Planner

    return Planner(world, seed=PLANNER_SEED)
