"""The wizard end to end: SDL's virtual joystick, a screen, the profile's file, and the wheel."""

import pytest

from steerlab.app.wheel_commands import (
    NONE_FOUND,
    calibrate_wheel,
    find_wheels,
    list_lines,
    live_page,
    text_view,
    watch_lines,
    watch_on_screen,
)
from steerlab.sim.errors import SteerlabError
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button, DeviceError
from steerlab.teleop.devices.profile_folder import save_profile, user_profiles
from steerlab.teleop.devices.virtual import GAMEPAD, VirtualJoystick
from steerlab.teleop.devices.wheel import WheelDevice
from steerlab.teleop.screen.contract import Act


class Person:
    """A screen, and whoever sits in front of it: a generator that yields what it asks for."""

    focused = True

    def __init__(self, script):
        self.pages = []
        self._script = script(self)

    def acts(self):
        return next(self._script, [Act.STOP])

    def enter(self, world):
        raise AssertionError("the wizard shows no world")

    def show_drive(self, view):
        raise AssertionError("the wizard shows no drive")

    def show_page(self, page):
        self.pages.append(page)


class Time:
    def __init__(self):
        self.ns = 0

    def __call__(self):
        return self.ns

    def sleep(self, seconds):
        self.ns += round(seconds * 1e9)


def calibrated(events, script, **arguments):
    time = Time()
    person = Person(script)
    path = calibrate_wheel(person, events, now_ns=time, sleep_s=time.sleep, **arguments)
    return path, person


def turned(wheel, axis, *values):
    """Put an axis to each value in turn; each takes a poll to arrive."""
    for value in values:
        wheel.axis(axis, value)
        yield []
        yield []


def hold(wheel, axis, *values):
    yield from turned(wheel, axis, *values)
    yield [Act.CONFIRM]


def until_measured():
    yield from ([] for _ in range(1700))  # 1.5 s at a millisecond each


def steering(wheel, left, right, centre):
    yield [Act.CONFIRM]
    yield from until_measured()
    yield from hold(wheel, 0, left / 2, left)
    yield from hold(wheel, 0, right / 2, right)
    for _ in range(2):  # nothing was heard of it before it moved
        yield from hold(wheel, 0, centre + 0.1, centre)
        yield from until_measured()


def pedal(wheel, axis, pressed, rest):
    for _ in range(2):
        yield from hold(wheel, axis, pressed)
        yield from hold(wheel, axis, rest)


def buttons(wheel, *numbers):
    for number in numbers:
        for down in (True, False):
            wheel.button(number, down)
            yield []
            yield []


def check(wheel, left, right, centre):
    yield from hold(wheel, 0, left, right, centre)
    yield []


@pytest.mark.parametrize(("left", "right", "centre"), [(-0.8, 0.9, 0.02), (1.0, -1.0, -0.05)])
def test_from_an_unknown_wheel_to_labels(events, left, right, centre):
    with VirtualJoystick(name="Virtual G920") as wheel:

        def script(person):
            yield from steering(wheel, left, right, centre)
            yield from pedal(wheel, 2, -1.0, 1.0)  # inverted
            yield from pedal(wheel, 1, 0.9, -0.9)
            yield from buttons(wheel, 9, 8, 4)
            yield from check(wheel, left, right, centre)

        path, person = calibrated(events, script)
        assert path is not None
        assert person.pages[-1].tone == "good"
        assert [one.file for one in user_profiles()] == [str(path)]

        device = WheelDevice(events)
        device.connect()
        assert device.info.details["profile"] == "Logitech G920 Driving Force"
        assert device.info.profile_sha256 == user_profiles()[0].sha256
        events.poll()
        assert not device.read().ok  # opened afresh: unknown until it moves
        wheel.axis(0, 0.5)
        events.poll()
        for raw, position in ((left, WHEEL_LIMIT), (right, -WHEEL_LIMIT), (centre, 0.0)):
            wheel.axis(0, raw)
            events.poll()
            assert device.read().ok
            assert device.read().wheel == position
        for axis, raw in ((2, 0.0), (2, -1.0), (1, 0.0), (1, -0.9)):
            wheel.axis(axis, raw)
            events.poll()
        wheel.button(8, True)
        events.poll()
        sample = device.read()
        assert (sample.throttle, sample.brake) == (1.0, 0.0)
        assert sample.buttons == {Button.REDO}
        device.disconnect()


def test_combined_pedals_no_buttons_and_a_gamepad_that_is_a_wheel(events):
    hori = {"name": "HORI", "vendor": 0x0F0D, "product": 0x0151, "axes": 6, "kind": GAMEPAD}
    with VirtualJoystick(**hori) as wheel:

        def script(person):
            yield from steering(wheel, -1.0, 1.0, 0.0)
            yield from pedal(wheel, 5, 1.0, 0.0)
            yield from pedal(wheel, 5, -1.0, 0.0)
            yield from ([Act.PAUSE] for _ in range(3))  # "use no button for this"
            yield from check(wheel, -1.0, 1.0, 0.0)

        path, _ = calibrated(events, script)
        (stored,) = user_profiles()
    assert stored.file == str(path)
    assert stored.profile.name == "HORI Racing Wheel Overdrive"
    assert stored.profile.combined_pedals
    assert stored.profile.buttons == {}


def test_unplugged_in_the_middle_it_starts_over_and_gets_there(events):
    with VirtualJoystick() as wheel:

        def script(person):
            yield from steering(wheel, -1.0, 1.0, 0.0)
            wheel.unplug()
            yield from ([] for _ in range(50))
            assert "unplugged" in person.pages[-1].lines[0]
            wheel.plug_in()
            yield []
            yield from steering(wheel, -0.9, 0.9, 0.0)
            yield from ([Act.PAUSE] for _ in range(5))
            yield from check(wheel, -0.9, 0.9, 0.0)

        path, _ = calibrated(events, script)
    assert path is not None
    assert user_profiles()[0].profile.steering.maximum == pytest.approx(0.9, abs=1e-4)


def test_stopping_keeps_nothing(events):
    with VirtualJoystick() as wheel:
        path, _ = calibrated(events, lambda person: steering(wheel, -1.0, 1.0, 0.0))
    assert path is None
    assert user_profiles() == []


def test_starting_over_from_the_keyboard(events):
    with VirtualJoystick() as wheel:

        def script(person):
            yield from steering(wheel, -1.0, 1.0, 0.0)
            yield [Act.REDO]
            yield from ([] for _ in range(50))
            assert person.pages[-1].title.endswith("hands off")

        calibrated(events, script)


def test_a_folder_that_cannot_be_written_is_said_before_anybody_turns_the_wheel(events, tmp_path):
    (tmp_path / "file").write_text("")

    def nobody(person):
        raise AssertionError("the person was asked to do something")
        yield

    with VirtualJoystick(name="Virtual G920"), pytest.raises(SteerlabError, match="cannot be kept"):
        calibrated(events, nobody, folder=tmp_path / "file" / "wheels")


def test_which_joystick_is_calibrated_is_never_guessed(events):
    def nobody(person):
        yield [Act.STOP]

    with pytest.raises(DeviceError, match="found: none"):
        calibrated(events, nobody)
    with VirtualJoystick(name="Pad", product=1, kind=GAMEPAD), VirtualJoystick(name="Wheel"):
        with pytest.raises(DeviceError, match=r"Several.*'Pad'.*'Wheel'"):
            calibrated(events, nobody)
        _, person = calibrated(events, nobody, name="wheel")
        assert person.pages == []


def test_the_list_says_what_is_plugged_in_and_what_to_do(events, profile_for):
    assert list_lines(find_wheels(events)) == [NONE_FOUND]
    with (
        VirtualJoystick(name="My G920"),
        VirtualJoystick(name="Odd", vendor=0x1234, product=0x5678),
    ):
        found = find_wheels(events)
        text = "\n".join(list_lines(found))
        assert "My G920  046d:c262  4 axes, 14 buttons" in text
        assert "Logitech G920 Driving Force, not calibrated; run: steerlab wheel calibrate" in text
        assert "unknown; if it is a wheel, run" in text
        assert [one.to_dict()["calibrated"] for one in found] == [False, False]
        path = save_profile(profile_for(found[0].joystick).profile)
        found = find_wheels(events)
        assert f"calibrated: {path}" in "\n".join(list_lines(found))
        assert found[0].to_dict()["profile_file"] == str(path)
        path.with_name("another.toml").write_text("format = [")
        assert find_wheels(events) == found


@pytest.fixture
def connected(events, profile_for):
    with VirtualJoystick() as wheel:
        (found,) = find_wheels(events)
        device = WheelDevice(events, profiles=[profile_for(found.joystick)])
        device.connect()
        yield wheel, device
        device.disconnect()


def test_the_live_view_on_screen_follows_the_wheel_until_stopped(events, connected):
    wheel, device = connected

    def script(person):
        yield []
        wheel.axis(0, -1.0)
        wheel.button(9, True)
        yield []
        yield []
        yield [Act.STOP]

    person = Person(script)
    watch_on_screen(person, events, device, sleep_s=lambda seconds: None)
    assert person.pages[0].needle is None
    assert person.pages[0].tone == "warning"
    assert person.pages[-1].needle == WHEEL_LIMIT
    assert any("pause" in line for line in person.pages[-1].lines)
    assert live_page(device, device.read()).title == "Virtual wheel"


def test_the_live_view_in_a_terminal(events, connected):
    wheel, device = connected
    lines = watch_lines(events, device, sleep_s=lambda seconds: None)
    assert "unknown" in next(lines)
    wheel.axis(0, -1.0)
    wheel.axis(2, -1.0)
    left = next(lines)
    assert left.startswith("[O")
    assert "+2.50" in left
    assert "throttle 1.00" in left
    assert "brake ?" in left
    wheel.axis(0, 1.0)
    assert "O] -2.50" in next(lines)
    wheel.unplug()
    assert "unknown" in next(lines)


def test_a_centred_wheel_stands_in_the_middle(events, connected):
    wheel, device = connected
    wheel.axis(0, 0.5)
    events.poll()
    wheel.axis(0, 0.0)
    events.poll()
    text = text_view(device.read())
    bar = text[1 : text.index("]")]
    assert bar.index("O") == len(bar) // 2
