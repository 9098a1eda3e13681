"""Verbs for people at a wheel: ``wheel``, ``drive``, ``correct``, and ``replay`` to look back."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from steerlab.app.verbs.common import Json, print_json, progress_bar
from steerlab.app.verbs.quick_types import FloatOrNone, IntOrNone, PathOrNone, TextOrNone

if TYPE_CHECKING:
    from steerlab.teleop.screen.config import ScreenConfig

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


def wheel(
    act: Annotated[
        tyro.conf.Positional[Literal["list", "calibrate", "test"]], tyro.conf.arg(metavar="ACT")
    ],
    name: Name = "",
    text: Annotated[bool, tyro.conf.arg(help="test: in the terminal, without a window.")] = False,
    size: Size = "960x540",
    json: Json = False,
) -> int:
    """Steering wheels: list what is plugged in, calibrate one, or see what it says.

    A wheel gives labels only after it was calibrated here: which axis steers, which way, and how
    far differ between models, drivers and systems.

    Example: steerlab wheel calibrate
    """
    from steerlab.app import wheel_commands
    from steerlab.teleop.sdl import SdlEvents

    with SdlEvents(window=act == "calibrate" or (act == "test" and not text)) as events:
        if act == "list":
            found = wheel_commands.find_wheels(events)
            if json:
                print_json([one.to_dict() for one in found])
            else:
                print("\n".join(wheel_commands.list_lines(found)))
            return 0
        if act == "calibrate":
            from steerlab.teleop.screen.drive_screen import open_screen

            with open_screen(events, _screen(size)) as screen:
                kept = wheel_commands.calibrate_wheel(screen, events, name=name)
            print("Stopped; nothing was kept." if kept is None else f"Wrote {kept}")
            return 1 if kept is None else 0
        return _test(wheel_commands, events, name, text=text, size=size)


def _test(wheel_commands, events, name: str, *, text: bool, size: str) -> int:
    from steerlab.teleop.devices.wheel import WheelDevice

    device = WheelDevice(events, name=name)
    device.connect()
    try:
        if text:
            for line in wheel_commands.watch_lines(events, device):
                print(f"\r{line:<100}", end="", flush=True)
        else:
            from steerlab.teleop.screen.drive_screen import open_screen

            with open_screen(events, _screen(size)) as screen:
                wheel_commands.watch_on_screen(screen, events, device)
    finally:
        device.disconnect()
    return 0


def drive(
    device: DeviceSpec = "wheel",
    balls: Annotated[int, tyro.conf.arg(help="How many balls to reach.")] = 5,
    pedals: Annotated[bool, tyro.conf.arg(help="Drive with throttle and brake.")] = True,
    size: Size = "960x540",
    full_screen: FullScreen = False,
    view: View = "front",
    text_scale: TextScale = 1.0,
    seed: Annotated[int, tyro.conf.arg(help="Of the worlds.")] = 0,
) -> int:
    """The practice drive: drive to one ball after another, to get used to wheel and pedals.

    Example: steerlab drive --device keyboard --no-pedals
    """
    from steerlab.study.calibration_session import practise
    from steerlab.teleop.practice import PracticeConfig

    config = PracticeConfig(balls=balls, pedals=pedals, seed=seed)
    result = practise(device, config, _screen(size, full_screen, view, text_scale))
    print(f"{result.balls} of {balls} balls reached, {result.crashes} blocks hit")
    return 0


def correct(
    study: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY")],
    participant: Annotated[str, tyro.conf.arg(help="A pseudonym, never a name.")],
    device: DeviceSpec = "wheel",
    rollouts: Annotated[int, tyro.conf.arg(help="How many of the twelve.")] = 12,
    show_agent_wheel: Annotated[
        bool, tyro.conf.arg(help="Show the robot's wheel too; it may anchor the labels.")
    ] = False,
    viewer: Annotated[bool, tyro.conf.arg(help="Show the drives live in Rerun as well.")] = False,
    pictures: Annotated[
        bool, tyro.conf.arg(help="Draw the camera into the recordings at the end.")
    ] = True,
    size: Size = "960x540",
    full_screen: FullScreen = False,
    view: View = "front",
    text_scale: TextScale = 1.0,
    json: Json = False,
) -> int:
    """Correct the calibration rollouts: watch each drive, and steer as the car should have.

    STUDY is a folder; it is made if there is none. What a participant has finished is not asked
    for again, so a session that was stopped goes on where it was left.

    Example: steerlab correct my-study --participant P01 --device wheel
    """
    from dataclasses import asdict

    from steerlab.study.correct import CorrectConfig
    from steerlab.study.correct import correct as run
    from steerlab.teleop.session import SessionConfig

    config = CorrectConfig(
        participant=participant,
        rollouts=rollouts,
        viewer=viewer,
        pictures=pictures,
        screen=_screen(size, full_screen, view, text_scale),
        session=SessionConfig(show_agent_wheel=show_agent_wheel),
    )
    with progress_bar() as progress:
        done = run(study, device, config, progress)
    if json:
        print_json(asdict(done))
    else:
        if done.resumed:
            print(f"{done.resumed} attempts were cut off by a crash; they do not count.")
        print(f"{participant}: {done.done} of {done.total} rollouts corrected; {done.end}.")
        print(f"See it: steerlab replay {study} --participant {participant}")
    return 0


def replay(
    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")],
    participant: Annotated[TextOrNone, tyro.conf.arg(help="Only this participant's.")] = None,
    rollout: Annotated[TextOrNone, tyro.conf.arg(help="Only attempts at this rollout.")] = None,
    attempt: Annotated[IntOrNone, tyro.conf.arg(help="Only this attempt, from 0.")] = None,
    pictures: Annotated[bool, tyro.conf.arg(help="Draw the camera's view again.")] = True,
    save: Annotated[
        PathOrNone, tyro.conf.arg(metavar="FILE", help="Write an .rrd file instead.")
    ] = None,
    screenshot: Annotated[
        PathOrNone, tyro.conf.arg(metavar="FILE", help="Write a .png instead; no display needed.")
    ] = None,
    at_s: Annotated[FloatOrNone, tyro.conf.arg(help="Moment of the screenshot.")] = None,
) -> int:
    """Open a session in Rerun: the drive, the camera, wheels, timing and what happened.

    PATH is a study's folder, from whose database the recording is made anew, or an .rrd file.

    Example: steerlab replay my-study --participant P01 --save p01.rrd
    """
    from steerlab.study.replay import ReplayConfig
    from steerlab.study.replay import replay as run

    config = ReplayConfig(
        participant=participant,
        rollout=rollout,
        attempt=attempt,
        pictures=pictures,
        save=save,
        screenshot=screenshot,
        at_s=at_s,
    )
    with progress_bar() as progress:
        shown = run(path, config, progress=progress)
    for file in (save, screenshot):
        if file is not None:
            print(f"Wrote {file}")
    if shown:
        print(f"{len(shown)} attempts shown")
    return 0


def _screen(
    size: str, full_screen: bool = False, view: View = "front", text_scale: float = 1.0
) -> "ScreenConfig":
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
