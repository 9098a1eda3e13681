from dataclasses import replace

import pytest

from steerlab.teleop.devices.contract import Button
from steerlab.teleop.devices.joystick import usb_ids
from steerlab.teleop.devices.profile import (
    Measured,
    PedalAxis,
    ProfileMatch,
    SteeringAxis,
    WheelProfile,
    this_system,
)
from steerlab.teleop.devices.profile_folder import StoredProfile, profile_sha256, profile_to_toml
from steerlab.teleop.sdl import SdlEvents


@pytest.fixture(autouse=True)
def config_home(tmp_path, monkeypatch):
    """No test reads or writes the wheel profiles of whoever runs it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config"


@pytest.fixture
def events():
    """SDL opened and closed around each test, so that no joystick survives into the next."""
    with SdlEvents(window=False) as queue:
        yield queue


@pytest.fixture
def profile_for():
    """Makes the calibrated profile of a joystick: right is positive, pedals rest at +1."""

    def make(info, **changes) -> StoredProfile:
        vendor, product = usb_ids(info.guid)
        profile = WheelProfile(
            name="Test wheel",
            match=ProfileMatch(
                guid=info.guid,
                vendor=vendor,
                products=(product,),
                axes=info.axes,
                system=this_system(),
            ),
            steering=SteeringAxis(axis=0, sign=-1),
            throttle=PedalAxis(axis=2, rest=1.0, pressed=-1.0),
            brake=PedalAxis(axis=3, rest=1.0, pressed=-1.0),
            buttons={Button.PAUSE: 9, Button.REDO: 8, Button.TAKE_OVER: 4},
            measured=Measured(resolution=0.01, rate_hz=500.0, noise=0.001, return_error=0.01),
            calibrated=True,
        )
        profile = replace(profile, **changes)
        text = profile_to_toml(profile)
        return StoredProfile(
            profile=profile, file="test.toml", sha256=profile_sha256(text), shipped=False
        )

    return make
