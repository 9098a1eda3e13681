"""Gamepad, keyboard and mouse: wheels made of something else, moved by time or motion."""

import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button, DeviceError
from steerlab.teleop.devices.gamepad import GamepadConfig, GamepadDevice
from steerlab.teleop.devices.joystick import list_joysticks
from steerlab.teleop.devices.keyboard import KeyboardConfig, KeyboardDevice
from steerlab.teleop.devices.mouse import MouseConfig, MouseDevice
from steerlab.teleop.devices.profile_folder import save_profile
from steerlab.teleop.devices.virtual import GAMEPAD, VirtualJoystick
from steerlab.teleop.sdl import pygame

XBOX = {"name": "Xbox pad", "vendor": 0x045E, "product": 0x028E, "axes": 6, "kind": GAMEPAD}


class Time:
    def __init__(self):
        self.ns = 1_000_000_000

    def __call__(self):
        return self.ns

    def pass_s(self, seconds):
        self.ns += round(seconds * 1e9)


@pytest.fixture
def time():
    return Time()


def heard(device, kind, **fields):
    """An event at the device's own time."""
    device._on_event(pygame.event.Event(kind, **fields), device._now_ns())


@pytest.fixture
def keyboard(events, time):
    config = KeyboardConfig(turn_per_s=2.0, return_per_s=4.0)
    device = KeyboardDevice(events, config, now_ns=time)
    device.connect()
    return device


@pytest.mark.parametrize(
    ("key", "sign"),
    [(pygame.K_LEFT, 1.0), (pygame.K_a, 1.0), (pygame.K_RIGHT, -1.0), (pygame.K_d, -1.0)],
)
def test_keys_turn_at_their_rate_and_stop_at_the_limit(keyboard, time, key, sign):
    heard(keyboard, pygame.KEYDOWN, key=key)
    time.pass_s(0.5)
    assert keyboard.read().wheel == pytest.approx(sign * 1.0)
    time.pass_s(10.0)
    assert keyboard.read().wheel == sign * WHEEL_LIMIT
    heard(keyboard, pygame.KEYUP, key=key)
    time.pass_s(0.25)
    assert keyboard.read().wheel == pytest.approx(sign * 1.5)
    time.pass_s(10.0)
    assert keyboard.read().wheel == 0.0


def test_how_often_it_is_read_does_not_matter(events, time):
    often = KeyboardDevice(events, now_ns=time)
    seldom = KeyboardDevice(events, now_ns=time)
    for device in (often, seldom):
        device.connect()
        heard(device, pygame.KEYDOWN, key=pygame.K_LEFT)
    for _ in range(300):
        time.pass_s(0.001)
        often.read()
    assert seldom.read().wheel == pytest.approx(often.read().wheel)
    assert 0.0 < seldom.read().wheel < WHEEL_LIMIT


def test_both_keys_centre_and_pedals_and_shift_are_there(keyboard, time):
    for key in (pygame.K_LEFT, pygame.K_d, pygame.K_UP, pygame.K_LSHIFT):
        heard(keyboard, pygame.KEYDOWN, key=key)
    time.pass_s(0.3)
    sample = keyboard.read()
    assert sample.wheel == 0.0
    assert (sample.throttle, sample.brake) == (1.0, 0.0)
    assert sample.buttons == {Button.TAKE_OVER}


def test_losing_the_focus_lets_all_keys_go(keyboard, time):
    heard(keyboard, pygame.KEYDOWN, key=pygame.K_LEFT)
    time.pass_s(0.5)
    heard(keyboard, pygame.WINDOWFOCUSLOST)
    time.pass_s(0.1)
    assert keyboard.read().wheel == pytest.approx(0.6)


def test_an_attempt_begins_centred_and_other_keys_are_no_input(keyboard, time):
    heard(keyboard, pygame.KEYDOWN, key=pygame.K_p)
    assert keyboard.read().t_event_ns is None
    heard(keyboard, pygame.KEYDOWN, key=pygame.K_LEFT)
    time.pass_s(0.5)
    keyboard.begin(None, order=0, attempt=0)
    assert keyboard.read().wheel == 0.0
    assert keyboard.read().t_event_ns is not None


def test_the_mouse_turns_by_motion_and_is_bounded(events):
    mouse = MouseDevice(events, MouseConfig(pixels_to_lock=100.0))
    mouse.connect()

    def move(pixels):
        event = pygame.event.Event(pygame.MOUSEMOTION, rel=(pixels, 5), pos=(0, 0), buttons=())
        pygame.event.post(event)
        events.poll()
        return mouse.read().wheel

    assert move(-40) == pytest.approx(1.0)
    assert move(-500) == WHEEL_LIMIT
    assert move(20) == pytest.approx(2.0)  # the overshoot was not wound up
    mouse.begin(None, order=0, attempt=0)
    assert mouse.read().wheel == 0.0
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, button=1, pos=(0, 0)))
    events.poll()
    assert mouse.read().buttons == {Button.TAKE_OVER}
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONUP, button=1, pos=(0, 0)))
    events.poll()
    assert mouse.read().buttons == frozenset()


def test_the_pointer_is_kept_during_a_drive_and_let_go_after(events, monkeypatch):
    grabs = []  # the dummy driver grabs nothing
    monkeypatch.setattr(pygame.event, "set_grab", grabs.append)
    mouse = MouseDevice(events)
    mouse.connect()
    mouse.begin(None, order=0, attempt=0)
    assert grabs == []  # no window
    pygame.display.set_mode((64, 64))
    mouse.begin(None, order=0, attempt=0)
    assert grabs == [True]
    assert not pygame.mouse.get_visible()
    mouse.disconnect()
    mouse.disconnect()
    assert grabs == [True, False]
    assert pygame.mouse.get_visible()


@pytest.fixture
def pad(events):
    with VirtualJoystick(**XBOX) as virtual:
        yield virtual


@pytest.fixture
def gamepad(events, pad, time):
    config = GamepadConfig(dead_zone=0.2, slew_per_s=4.0)
    device = GamepadDevice(events, config, now_ns=time)
    device.connect()
    yield device
    device.disconnect()


def test_a_stick_is_followed_at_a_limited_rate(events, gamepad, pad, time):
    assert not gamepad.read().ok  # not moved yet
    pad.axis(0, -1.0)
    events.poll()
    assert gamepad.read().wheel == 0.0
    time.pass_s(0.25)
    assert gamepad.read().wheel == pytest.approx(1.0)
    time.pass_s(5.0)
    assert gamepad.read().wheel == WHEEL_LIMIT
    pad.axis(0, 0.1)  # inside the dead zone
    events.poll()
    time.pass_s(0.5)
    assert gamepad.read().wheel == pytest.approx(0.5)
    time.pass_s(5.0)
    assert gamepad.read().wheel == 0.0


def test_time_while_the_stick_is_unknown_does_not_count(events, gamepad, pad, time):
    pad.axis(0, -1.0)
    events.poll()
    time.pass_s(5.0)
    pad.unplug()
    events.poll()
    assert not gamepad.read().ok
    pad.plug_in()
    events.poll()
    time.pass_s(60.0)
    assert gamepad.read().wheel is None
    pad.axis(0, -0.9)
    events.poll()
    assert gamepad.read().wheel == 0.0


def test_triggers_and_buttons(events, gamepad, pad):
    pad.axis(0, 0.5)
    events.poll()
    assert (gamepad.read().throttle, gamepad.read().brake) == (None, None)
    pad.axis(5, 1.0)
    pad.axis(2, -1.0)
    pad.button(7, True)
    events.poll()
    assert (gamepad.read().throttle, gamepad.read().brake) == (1.0, 0.0)
    assert gamepad.read().buttons == {Button.PAUSE}


def test_a_steering_wheel_is_no_gamepad(events):
    with VirtualJoystick(name="HORI", vendor=0x0F0D, product=0x0151, axes=6, kind=GAMEPAD):
        with pytest.raises(DeviceError, match="No gamepad; found: none"):
            GamepadDevice(events).connect()
        with pytest.raises(DeviceError, match="steering wheel; use it as wheel:HORI"):
            GamepadDevice(events, name="hori").connect()


def test_a_calibrated_wheel_of_an_unknown_make_is_no_gamepad_either(events, profile_for):
    with VirtualJoystick(name="Odd", vendor=0x1234, product=0x5678):
        (info,) = list_joysticks()
        save_profile(profile_for(info).profile)
        with pytest.raises(DeviceError, match="No gamepad"):
            GamepadDevice(events).connect()


def test_two_gamepads_are_told_apart_by_name(events, pad):
    with VirtualJoystick(**{**XBOX, "name": "Second pad", "product": 0x02FF}):
        with pytest.raises(DeviceError, match=r"Several.*'Xbox pad'.*'Second pad'"):
            GamepadDevice(events).connect()
        device = GamepadDevice(events, name="second")
        device.connect()
        assert device.info.name == "Second pad"
        device.disconnect()


@pytest.mark.parametrize(
    "make",
    [
        lambda: KeyboardConfig(turn_per_s=0.0),
        lambda: MouseConfig(pixels_to_lock=-1.0),
        lambda: GamepadConfig(slew_per_s=0.0),
        lambda: GamepadConfig(dead_zone=1.0),
    ],
)
def test_impossible_settings_are_refused(make):
    with pytest.raises(InvalidConfig):
        make()
