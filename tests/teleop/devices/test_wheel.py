from dataclasses import replace

import pytest

from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button, DeviceError, InputKind
from steerlab.teleop.devices.force_feedback import ForceFeedback
from steerlab.teleop.devices.joystick import list_joysticks
from steerlab.teleop.devices.profile import PedalAxis, SteeringAxis
from steerlab.teleop.devices.profile_folder import save_profile
from steerlab.teleop.devices.virtual import GAMEPAD, VirtualJoystick
from steerlab.teleop.devices.wheel import WheelDevice


@pytest.fixture
def joystick(events):
    with VirtualJoystick(name="Virtual G920") as virtual:
        yield virtual


@pytest.fixture
def wheel(events, joystick, profile_for):
    """Connected, and never moved."""
    (info,) = list_joysticks()
    device = WheelDevice(events, profiles=[profile_for(info)])
    device.connect()
    yield device
    device.disconnect()


def test_nothing_is_known_before_the_first_event(events, wheel, joystick):
    events.poll()
    sample = wheel.read()
    assert (sample.wheel, sample.throttle, sample.brake) == (None, None, None)
    assert not sample.ok
    joystick.axis(0, 0.4)
    events.poll()
    sample = wheel.read()
    assert sample.ok
    assert sample.wheel == pytest.approx(-1.0, abs=1e-3)
    assert sample.throttle is None  # not half throttle, which a raw 0 would be


@pytest.mark.parametrize(
    ("raw", "wheel_position"), [(-1.0, WHEEL_LIMIT), (1.0, -WHEEL_LIMIT), (0.5, -WHEEL_LIMIT / 2)]
)
def test_the_ends_are_the_limits(events, wheel, joystick, raw, wheel_position):
    joystick.axis(0, raw)
    events.poll()
    assert wheel.read().wheel == pytest.approx(wheel_position, abs=1e-3)


def test_inverted_pedals(events, wheel, joystick):
    joystick.axis(2, 1.0)
    joystick.axis(3, -1.0)
    events.poll()
    assert (wheel.read().throttle, wheel.read().brake) == (0.0, 1.0)
    joystick.axis(2, -1.0)
    joystick.axis(3, 0.5)
    events.poll()
    assert wheel.read().throttle == 1.0
    assert wheel.read().brake == pytest.approx(0.25, abs=1e-3)


def test_combined_pedals(events, joystick, profile_for):
    (info,) = list_joysticks()
    profile = profile_for(
        info,
        throttle=PedalAxis(axis=1, rest=0.0, pressed=-1.0),
        brake=PedalAxis(axis=1, rest=0.0, pressed=1.0),
        combined_pedals=True,
    )
    device = WheelDevice(events, profiles=[profile])
    device.connect()
    for raw, throttle, brake in ((-1.0, 1.0, 0.0), (0.25, 0.0, 0.25), (0.0, 0.0, 0.0)):
        joystick.axis(1, raw)
        events.poll()
        assert device.read().throttle == pytest.approx(throttle, abs=1e-3)
        assert device.read().brake == pytest.approx(brake, abs=1e-3)
    device.disconnect()


def test_buttons_have_meanings(events, wheel, joystick):
    for number in (9, 8, 4, 0):
        joystick.button(number, True)
    events.poll()
    assert wheel.read().buttons == {Button.PAUSE, Button.REDO, Button.TAKE_OVER}


def test_unplug_and_replug_in_the_middle_of_reading(events, wheel, joystick):
    joystick.axis(0, 0.4)
    events.poll()
    assert [wheel.read(step).ok for step in range(3)] == [True] * 3
    joystick.unplug()
    events.poll()
    lost = wheel.read(3)
    assert not lost.ok
    assert lost.wheel is None  # not the plausible 0.0 that polling reads
    joystick.plug_in()
    events.poll()
    assert not wheel.read(4).ok  # back, and unknown: it may have been turned meanwhile
    joystick.axis(0, -0.4)
    events.poll()
    assert wheel.read(5).wheel == pytest.approx(1.0, abs=1e-3)


def test_info_tells_what_labels_were_given_with(wheel, profile_for):
    (joystick,) = list_joysticks()
    info = wheel.info
    assert (info.kind, info.name, info.guid) == (InputKind.WHEEL, "Virtual G920", joystick.guid)
    assert info.profile_sha256 == profile_for(joystick).sha256
    assert info.force_feedback == "off: not asked for"
    details = {"vendor", "product", "os", "resolution", "rate_hz", "noise", "dead_zone_raw"}
    assert details <= set(info.details)


def test_a_shipped_profile_alone_gives_no_labels(events, joystick):
    with pytest.raises(DeviceError, match=r"Logitech G920.*not calibrated.*wheel calibrate"):
        WheelDevice(events).connect()


def test_an_unknown_wheel_gives_no_labels(events):
    with VirtualJoystick(name="Odd wheel", vendor=0x1234, product=0x5678):
        with pytest.raises(DeviceError, match=r"'Odd wheel'.*wheel calibrate"):
            WheelDevice(events).connect()
        with pytest.raises(DeviceError, match=r"'Odd wheel'.*unknown here.*wheel calibrate"):
            WheelDevice(events, name="Odd").connect()


def test_no_wheel_at_all(events):
    with pytest.raises(DeviceError, match="No wheel; found: none"):
        WheelDevice(events).connect()


def test_the_calibrated_profile_comes_from_the_users_folder(events, joystick, profile_for):
    (info,) = list_joysticks()
    save_profile(profile_for(info).profile)
    device = WheelDevice(events)
    device.connect()
    assert device.info.details["profile"] == "Test wheel"
    device.disconnect()


def test_a_profile_of_another_operating_system_does_not_count(events, joystick, profile_for):
    (info,) = list_joysticks()
    stored = profile_for(info)
    match = replace(stored.profile.match, system="windows")
    elsewhere = replace(stored, profile=replace(stored.profile, match=match))
    with pytest.raises(DeviceError, match="calibrate"):
        WheelDevice(events, profiles=[elsewhere]).connect()
    WheelDevice(events, profiles=[elsewhere], system="windows").connect()


def test_another_driver_with_other_axes_needs_calibrating_again(events, joystick, profile_for):
    (info,) = list_joysticks()
    stored = profile_for(replace(info, axes=6))
    with pytest.raises(DeviceError, match="has 4 axes now, 6 when"):
        WheelDevice(events, profiles=[stored]).connect()


def test_two_wheels_are_told_apart_by_name_never_by_order(events, profile_for):
    with (
        VirtualJoystick(name="Alpha", product=0xC24F) as alpha,
        VirtualJoystick(name="Beta") as beta,
    ):
        profiles = [profile_for(info) for info in list_joysticks()]
        with pytest.raises(DeviceError, match=r"Several.*'Alpha'.*'Beta'"):
            WheelDevice(events, profiles=profiles).connect()
        device = WheelDevice(events, name="beta", profiles=profiles)
        device.connect()
        alpha.axis(0, 0.9)
        events.poll()
        assert device.read().wheel is None
        beta.axis(0, 0.4)
        events.poll()
        assert device.read().wheel == pytest.approx(-1.0, abs=1e-3)
        device.disconnect()


def test_two_of_one_model_are_refused(events, profile_for):
    with VirtualJoystick(), VirtualJoystick():
        profiles = [profile_for(list_joysticks()[0])]
        for name in ("", "virtual"):
            with pytest.raises(DeviceError, match="unplug one"):
                WheelDevice(events, name=name, profiles=profiles).connect()


def test_the_only_calibrated_one_is_meant_even_beside_a_gamepad(events, profile_for):
    with (
        VirtualJoystick(name="Pad", vendor=0x045E, product=0x028E, kind=GAMEPAD),
        VirtualJoystick(name="Wheel"),
    ):
        wheel = next(info for info in list_joysticks() if info.name == "Wheel")
        device = WheelDevice(events, profiles=[profile_for(wheel)])
        device.connect()
        assert device.info.name == "Wheel"
        device.disconnect()


def test_a_lost_wheel_is_never_replaced_by_another_calibrated_one(events, wheel, joystick):
    joystick.axis(0, 0.4)
    events.poll()
    joystick.unplug()
    with VirtualJoystick(name="Beta", product=0xC24F) as beta:
        beta.axis(0, 0.9)
        events.poll()
        beta.axis(0, 0.8)
        events.poll()
        assert not wheel.read().ok
        assert wheel.info.name == "Virtual G920"


def test_a_hori_wheel_appears_as_a_gamepad_and_is_a_wheel_all_the_same(events, profile_for):
    with VirtualJoystick(
        name="HORI Overdrive", vendor=0x0F0D, product=0x0152, axes=6, kind=GAMEPAD
    ) as hori:
        with pytest.raises(DeviceError, match=r"HORI Racing Wheel Overdrive.*not calibrated"):
            WheelDevice(events).connect()
        (info,) = list_joysticks()
        profile = profile_for(
            info,
            steering=SteeringAxis(axis=0, sign=-1),
            throttle=PedalAxis(axis=5, rest=-1.0, pressed=1.0),
            brake=PedalAxis(axis=2, rest=-1.0, pressed=1.0),
        )
        device = WheelDevice(events, profiles=[profile])
        device.connect()
        hori.axis(0, -1.0)
        hori.axis(5, 1.0)
        events.poll()
        sample = device.read()
        assert device.info.kind is InputKind.WHEEL
        assert (sample.wheel, sample.throttle, sample.brake) == (WHEEL_LIMIT, 1.0, None)
        device.disconnect()


def test_force_feedback_opens_with_the_wheel_and_again_after_replugging(
    events, joystick, profile_for
):
    (info,) = list_joysticks()
    opened, closed = [], []

    class Motor(ForceFeedback):
        def close(self):
            closed.append(self.text)

    def open_feedback(device):
        opened.append((device.vendor, device.product))
        return Motor(f"autocentre {len(opened)}")

    device = WheelDevice(events, profiles=[profile_for(info)], open_feedback=open_feedback)
    assert device.force_feedback is None
    device.connect()
    assert opened == [(0x046D, 0xC262)]
    assert device.info.force_feedback == "autocentre 1"
    device.begin(None, order=0, attempt=0)
    assert len(opened) == 1
    joystick.unplug()
    joystick.plug_in()
    events.poll()
    device.begin(None, order=0, attempt=1)
    assert device.info.force_feedback == "autocentre 2"
    device.disconnect()
    assert closed == ["autocentre 1", "autocentre 2"]
