"""What every device promises, whatever it is."""

from math import isfinite

import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import InputKind
from steerlab.teleop.devices.gamepad import GamepadDevice
from steerlab.teleop.devices.joystick import list_joysticks
from steerlab.teleop.devices.keyboard import KeyboardDevice
from steerlab.teleop.devices.mouse import MouseDevice
from steerlab.teleop.devices.scripted import ScriptedDevice
from steerlab.teleop.devices.trace import TraceDevice
from steerlab.teleop.devices.virtual import GAMEPAD, VirtualJoystick
from steerlab.teleop.devices.wheel import WheelDevice
from steerlab.teleop.sdl import pygame

PHYSICAL = (InputKind.WHEEL, InputKind.GAMEPAD, InputKind.KEYBOARD, InputKind.MOUSE)
ROLLOUT = load_calibration_set()[3]


@pytest.fixture(params=list(InputKind), ids=str)
def bench(request, events, profile_for):
    """A device of each kind, and a function that moves it to the left."""
    kind = request.param
    if kind in (InputKind.WHEEL, InputKind.GAMEPAD):
        is_wheel = kind is InputKind.WHEEL
        ids = {} if is_wheel else {"vendor": 0x045E, "product": 0x028E, "kind": GAMEPAD}
        with VirtualJoystick(axes=6, **ids) as joystick:
            (info,) = list_joysticks()
            device = (
                WheelDevice(events, profiles=[profile_for(info)])
                if is_wheel
                else GamepadDevice(events)
            )

            def move():
                joystick.axis(0, -0.6)
                events.poll()
                joystick.axis(0, -0.5)  # opened before, SDL may have announced it long ago

            yield kind, device, move
    elif kind is InputKind.KEYBOARD:
        press = pygame.event.Event(pygame.KEYDOWN, key=pygame.K_LEFT)
        yield kind, KeyboardDevice(events), lambda: pygame.event.post(press)
    elif kind is InputKind.MOUSE:
        motion = pygame.event.Event(pygame.MOUSEMOTION, rel=(-40, 0), pos=(0, 0), buttons=())
        yield kind, MouseDevice(events), lambda: pygame.event.post(motion)
    elif kind is InputKind.SCRIPTED:
        (teacher,) = sample_population("human", 1, 3, prefix="p")
        yield kind, ScriptedDevice(teacher), lambda: None
    else:
        rows = [{"step": step, "wheel": 0.5} for step in range(ROLLOUT.steps)]
        yield kind, TraceDevice(rows), lambda: None


def check(sample):
    if sample.ok:
        assert sample.wheel is not None
    for value, low, high in (
        (sample.wheel, -WHEEL_LIMIT, WHEEL_LIMIT),
        (sample.throttle, 0.0, 1.0),
        (sample.brake, 0.0, 1.0),
    ):
        assert value is None or (isfinite(value) and low <= value <= high)


def test_every_device_keeps_the_contract(bench, events):
    kind, device, move = bench
    before = device.read()
    assert not before.ok
    assert before.wheel is None

    for _ in range(2):  # it can be connected again after it was disconnected
        device.connect()
        assert device.info.kind is kind
        assert device.info.name
        assert device.info.force_feedback.startswith("off: ")
        for attempt in range(2):
            device.begin(ROLLOUT, order=0, attempt=attempt)
            events.poll()
            check(device.read())
            move()
            events.poll()
            for step in range(5):
                events.poll()
                sample = device.read(step)
                check(sample)
                assert sample.ok
            assert device.read().ok
        device.disconnect()
        device.disconnect()
        assert not device.read().ok
        assert device.read().wheel is None


@pytest.mark.parametrize("bench", PHYSICAL, indirect=True, ids=str)
def test_left_is_positive(bench, events):
    _, device, move = bench
    device.connect()
    device.begin(ROLLOUT, order=0, attempt=0)
    move()
    events.poll()
    device.read()
    assert device.read().wheel > 0.0
    device.disconnect()


@pytest.mark.parametrize("bench", PHYSICAL, indirect=True, ids=str)
def test_a_device_with_events_says_when_the_last_one_came(bench, events):
    _, device, move = bench
    device.connect()
    device.begin(ROLLOUT, order=0, attempt=0)
    move()
    events.poll()
    first = device.read().t_event_ns
    assert first is not None
    events.poll()
    assert device.read().t_event_ns == first  # an old event stays old
    device.disconnect()


@pytest.mark.parametrize("bench", PHYSICAL, indirect=True, ids=str)
def test_a_device_that_is_not_connected_hears_nothing(bench, events):
    _, device, move = bench
    move()
    events.poll()
    assert not device.read().ok
