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
from steerlab.sim.files.by_suffix import has_suffix
from steerlab.sim.files.output_folder import check_output_file
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
        participant, rollout, attempt: choose the attempts; None stands for all. A screenshot shows
            the last of them, and only that one is made for it.
        pictures: draw the camera's view again from the stored poses.
        save: write the recording to this file instead of showing it.
        screenshot: draw the viewer to this PNG file, without a display, instead of showing it.
        at_s: time of the screenshot, from the attempt's start.
        video: write a video of the last attempt chosen to this .mp4 file instead of showing it.
    """

    participant: str | None = None
    rollout: str | None = None
    attempt: int | None = None
    pictures: bool = True
    save: Path | None = None
    screenshot: Path | None = None
    at_s: float | None = None
    video: Path | None = None


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
        OutputError: a file cannot be written.
        StoreError: the study cannot be read.
    """
    config = config or ReplayConfig()
    for target in (config.save, config.screenshot, config.video):
        if target is not None:
            check_output_file(target)
    if config.video is not None:
        shown = [_video(path, config, config.video, progress)]
        if config.save is None and config.screenshot is None:
            return shown
    if has_suffix(path, ".rrd") and path.is_file():
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
                last_only=config.save is None and config.screenshot is not None,
                progress=progress,
            )
        except NoRenderer as error:
            raise RecordingUnavailable(
                f"The camera's pictures cannot be drawn: {error} Or leave them out with "
                f"--no-pictures."
            ) from error
        _present(out, config, show)
    return attempts


def _video(path: Path, config: ReplayConfig, out: Path, progress: Progress) -> Attempt:
    from steerlab.study.recording.video import VIDEO_PX, make_video

    if not has_suffix(out, ".mp4"):
        raise RecordingUnavailable(f"{out} does not end in .mp4, which a video does; rename it.")
    try:
        return make_video(
            path,
            out,
            participant=config.participant,
            rollout=config.rollout,
            attempt=config.attempt,
            open_view=lambda world: view_of(world, VIDEO_PX),
            progress=progress,
        )
    except NoRenderer as error:
        raise RecordingUnavailable(f"A video cannot be drawn: {error}") from error


def _present(file: Path, config: ReplayConfig, show: Callable[[Sequence[Path]], None]) -> None:
    if config.screenshot is not None:
        screenshot(file, config.screenshot, at_s=config.at_s)
    elif config.save is None:
        show([file])


def view_of(
    world: WorldSpec, size_px: tuple[int, int] = PICTURE_PX
) -> AbstractContextManager[View]:
    """The car's camera, by default at the size of the pictures in a recording."""
    from steerlab.sim.engine.camera import CameraConfig
    from steerlab.sim.engine.world_view import WorldView

    width, height = size_px
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
