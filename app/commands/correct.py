"""``steerlab correct``: a participant corrects the calibration rollouts."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import (
    DeviceSpec,
    Json,
    Lsl,
    Monitor,
    SizeOrNone,
    Sound,
    TextScale,
    View,
    Windowed,
    screen_config,
    whole,
)
from steerlab.app.commands.printing import print_json, progress_bar


def correct(
    study: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY")],
    participant: Annotated[str, tyro.conf.arg(help="A pseudonym, never a name.")],
    device: DeviceSpec = "wheel",
    rollouts: Annotated[
        int, whole("rollouts", 1, 12), tyro.conf.arg(help="How many of the twelve.")
    ] = 12,
    show_agent_wheel: Annotated[
        bool, tyro.conf.arg(help="Show the robot's wheel too; it may anchor the labels.")
    ] = False,
    viewer: Annotated[bool, tyro.conf.arg(help="Show the drives live in Rerun as well.")] = False,
    pictures: Annotated[
        bool, tyro.conf.arg(help="Draw the camera into the recordings at the end.")
    ] = True,
    monitor: Monitor = "",
    windowed: Windowed = False,
    size: SizeOrNone = None,
    view: View = "driver",
    text_scale: TextScale = 1.0,
    sound: Sound = True,
    lsl: Lsl = False,
    json: Json = False,
) -> int:
    """Correct the calibration rollouts: watch each drive, and steer as the car should have.

    STUDY is a folder; it is made if there is none. What a participant has finished is not asked
    for again, so a session that was stopped goes on where it was left.

    Example: steerlab correct my-study --participant P01 --device wheel
    """
    from dataclasses import asdict
    from shlex import quote

    from steerlab.study.correct import CorrectConfig
    from steerlab.study.correct import correct as run
    from steerlab.study.recording.lsl import lsl_markers, study_source
    from steerlab.teleop.attempt import SessionConfig

    screen = screen_config(
        size or "960x540",
        full_screen=not windowed and size is None,
        monitor=monitor,
        view=view,
        text_scale=text_scale,
        sound=sound,
    )
    with lsl_markers(study_source(study) if lsl else None) as markers, progress_bar() as progress:
        config = CorrectConfig(
            participant=participant,
            rollouts=rollouts,
            viewer=viewer,
            pictures=pictures,
            screen=screen,
            session=SessionConfig(show_agent_wheel=show_agent_wheel),
            markers=markers,
        )
        done = run(study, device, config, progress)
    if json:
        print_json(asdict(done))
    else:
        if done.resumed:
            print(f"{done.resumed} attempts were cut off by a crash; they do not count.")
        print(f"{participant}: {done.done} of {done.total} rollouts corrected; {done.end}.")
        who = quote(participant)
        print(f"See it: steerlab replay {quote(str(study))} --participant {who}")
    return 0
