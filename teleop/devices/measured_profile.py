"""The profile of a wheel from what the wizard measured."""

from collections.abc import Mapping

from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button
from steerlab.teleop.devices.joystick import JoystickInfo
from steerlab.teleop.devices.measuring import AxisRest, Motion, SteeringEnds
from steerlab.teleop.devices.profile import (
    Measured,
    PedalAxis,
    ProfileMatch,
    SteeringAxis,
    WheelProfile,
)


def measured_profile(
    joystick: JoystickInfo,
    *,
    system: str,
    name: str,
    ends: SteeringEnds,
    rests: tuple[AxisRest, AxisRest],
    motion: Motion,
    throttle: PedalAxis | None,
    brake: PedalAxis | None,
    buttons: Mapping[Button, int],
) -> WheelProfile:
    """Put it together; raw measures become wheel units.

    Args:
        rests: two places where the released wheel came to rest.
    """
    one, other = rests
    error = abs(one.centre - other.centre)
    to_wheel = WHEEL_LIMIT / ends.side
    shared = throttle is not None and brake is not None and throttle.axis == brake.axis
    return WheelProfile(
        name=name,
        match=ProfileMatch(
            guid=joystick.guid,
            vendor=joystick.vendor,
            products=(joystick.product,),
            axes=joystick.axes,
            system=system,
        ),
        steering=SteeringAxis(
            axis=ends.axis,
            sign=1 if ends.left > ends.right else -1,
            minimum=min(ends.left, ends.right),
            centre=(one.centre + other.centre) / 2.0,
            maximum=max(ends.left, ends.right),
            dead_zone=error / 2.0 + max(one.peak, other.peak),  # wherever it rests, it reads 0
        ),
        throttle=throttle,
        brake=brake,
        combined_pedals=shared,
        buttons=dict(buttons),
        measured=Measured(
            resolution=motion.resolution(ends.axis) * to_wheel,
            rate_hz=motion.rate_hz,
            noise=max(one.noise, other.noise) * to_wheel,
            return_error=error * to_wheel,
        ),
        calibrated=True,
    )
