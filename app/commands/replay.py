"""``steerlab replay``: look back in Rerun."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import (
    MANY,
    FloatOrNone,
    IntOrNone,
    PathOrNone,
    TextOrNone,
    decimal,
    whole,
)
from steerlab.app.commands.printing import progress_bar


def replay(
    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")],
    participant: Annotated[TextOrNone, tyro.conf.arg(help="Only this participant's.")] = None,
    rollout: Annotated[TextOrNone, tyro.conf.arg(help="Only attempts at this rollout.")] = None,
    attempt: Annotated[
        IntOrNone, whole("attempt", 0, MANY), tyro.conf.arg(help="Only this attempt, from 0.")
    ] = None,
    pictures: Annotated[bool, tyro.conf.arg(help="Draw the camera's view again.")] = True,
    save: Annotated[
        PathOrNone, tyro.conf.arg(metavar="FILE", help="Write an .rrd file instead.")
    ] = None,
    screenshot: Annotated[
        PathOrNone,
        tyro.conf.arg(
            metavar="FILE",
            help="Draw the last attempt chosen to a .png instead; no display needed.",
        ),
    ] = None,
    video: Annotated[
        PathOrNone,
        tyro.conf.arg(
            metavar="FILE",
            help="Write the last attempt chosen as an .mp4 instead; needs steerlab[video].",
        ),
    ] = None,
    at_s: Annotated[
        FloatOrNone, decimal("at-s", 0.0, 86_400.0), tyro.conf.arg(help="Moment of the screenshot.")
    ] = None,
) -> int:
    """Open a session in Rerun: the drive, the camera, wheels, timing and what happened.

    PATH is a study's folder, from whose database the recording is made anew, or an .rrd file.

    Example: steerlab replay my-study --participant P01 --save p01.rrd
    """
    from steerlab.study.recording.replay import ReplayConfig
    from steerlab.study.recording.replay import replay as run

    config = ReplayConfig(
        participant=participant,
        rollout=rollout,
        attempt=attempt,
        pictures=pictures,
        save=save,
        screenshot=screenshot,
        at_s=at_s,
        video=video,
    )
    with progress_bar() as progress:
        shown = run(path, config, progress=progress)
    for file in (save, screenshot, video):
        if file is not None:
            print(f"Wrote {file}")
    if len(shown) == 1:
        print(f"Shown: {shown[0]}")
    elif shown:
        print(f"{len(shown)} attempts shown")
    return 0
