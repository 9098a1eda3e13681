"""``steerlab drive``: the practice drive."""

from typing import Annotated

import tyro

from steerlab.app.commands.arguments import (
    MAX_SEED,
    DeviceSpec,
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


def drive(
    device: DeviceSpec = "wheel",
    balls: Annotated[
        int, whole("balls", 1, 1000), tyro.conf.arg(help="How many balls to reach.")
    ] = 5,
    pedals: Annotated[bool, tyro.conf.arg(help="Drive with throttle and brake.")] = True,
    monitor: Monitor = "",
    windowed: Windowed = False,
    size: SizeOrNone = None,
    view: View = "driver",
    text_scale: TextScale = 1.0,
    sound: Sound = True,
    lsl: Lsl = False,
    seed: Annotated[int, whole("seed", 0, MAX_SEED), tyro.conf.arg(help="Of the worlds.")] = 0,
) -> int:
    """The practice drive: drive to one ball after another, to get used to wheel and pedals.

    A script drives straight at each ball, without a window.

    Example: steerlab drive --device keyboard --no-pedals
    """
    from steerlab.study.calibration_session import practise
    from steerlab.study.recording.lsl import lsl_markers, new_source
    from steerlab.study.scripted_practice import practise_scripted
    from steerlab.teleop.devices.contract import DeviceError, InputKind
    from steerlab.teleop.devices.open import open_device
    from steerlab.teleop.practice import PracticeConfig

    config = PracticeConfig(balls=balls, pedals=pedals, seed=seed)
    kind = device.partition(":")[0]
    if kind == InputKind.TRACE:
        raise DeviceError(f"{device} has no practice drive in it; give what a person holds.")
    screen = screen_config(
        size or "960x540",
        full_screen=not windowed and size is None,
        monitor=monitor,
        view=view,
        text_scale=text_scale,
        sound=sound,
    )
    if kind == InputKind.SCRIPTED:
        open_device(device)  # refuses what names no script
        result = practise_scripted(config)
    else:
        with lsl_markers(new_source() if lsl else None) as markers:
            result = practise(device, config, screen, markers=markers)
    print(f"{result.balls} of {balls} balls reached, {result.crashes} blocks hit")
    return 0
