"""``steerlab drive``: the practice drive."""

from typing import Annotated

import tyro

from steerlab.app.commands.arguments import (
    MAX_SEED,
    DeviceSpec,
    FullScreen,
    Size,
    TextScale,
    View,
    screen_config,
    whole,
)


def drive(
    device: DeviceSpec = "wheel",
    balls: Annotated[
        int, whole("balls", 1, 1000), tyro.conf.arg(help="How many balls to reach.")
    ] = 5,
    pedals: Annotated[bool, tyro.conf.arg(help="Drive with throttle and brake.")] = True,
    size: Size = "960x540",
    full_screen: FullScreen = False,
    view: View = "front",
    text_scale: TextScale = 1.0,
    seed: Annotated[int, whole("seed", 0, MAX_SEED), tyro.conf.arg(help="Of the worlds.")] = 0,
) -> int:
    """The practice drive: drive to one ball after another, to get used to wheel and pedals.

    Example: steerlab drive --device keyboard --no-pedals
    """
    from steerlab.study.calibration_session import practise
    from steerlab.teleop.practice import PracticeConfig

    config = PracticeConfig(balls=balls, pedals=pedals, seed=seed)
    result = practise(device, config, screen_config(size, full_screen, view, text_scale))
    print(f"{result.balls} of {balls} balls reached, {result.crashes} blocks hit")
    return 0
