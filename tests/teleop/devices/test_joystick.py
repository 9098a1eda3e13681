import ctypes
import os

import pytest

from steerlab.teleop.devices.contract import DeviceError
from steerlab.teleop.devices.joystick import (
    JoystickInfo,
    RawJoystick,
    choose_joystick,
    list_joysticks,
    usb_ids,
)
from steerlab.teleop.devices.virtual import GAMEPAD, VirtualJoystick, mapped_sdl
from steerlab.teleop.sdl import SdlEvents, pygame


def open_only(events):
    (info,) = list_joysticks()
    joystick = RawJoystick(events, info)
    joystick.open()
    return joystick


def test_a_virtual_joystick_is_listed_with_its_usb_numbers(events):
    with VirtualJoystick(name="Wheel", vendor=0x046D, product=0xC24F, axes=5, buttons=25):
        (info,) = list_joysticks()
    assert (info.name, info.axes, info.buttons) == ("Wheel", 5, 25)
    assert (info.vendor, info.product) == (0x046D, 0xC24F)
    events.poll()
    assert list_joysticks() == []


def test_an_axis_is_unknown_until_it_moves(events):
    """SDL announces 0 for each axis at first, and polling reads 0: half throttle on a real pedal."""
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        assert joystick.raw().axes == (None,) * 4
        events.poll()
        assert joystick.raw().axes == (None,) * 4
        assert pygame.joystick.Joystick(0).get_axis(2) == 0.0  # what polling would believe
        wheel.axis(2, 1.0)
        events.poll()
        assert joystick.raw().axes == (None, None, 1.0, None)
        wheel.axis(2, 0.0)
        events.poll()
        assert joystick.raw().axes[2] == 0.0  # a real zero counts


@pytest.mark.parametrize("value", [-1.0, -0.7, -1 / 3, 0.123, 0.5, 1.0])
def test_events_are_scaled_by_32767_alone(events, value):
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        wheel.axis(0, value)
        events.poll()
        assert joystick.raw().axes[0] == pytest.approx(round(value * 32767) / 32767, abs=1e-12)
        polled = pygame.joystick.Joystick(0).get_axis(0)
        assert polled != joystick.raw().axes[0]  # get_axis divides by 32768


def test_the_lowest_raw_value_is_minus_one(events):
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        wheel.raw_axis(0, -32768)
        events.poll()
        assert joystick.raw().axes[0] == -1.0


def test_buttons_motions_and_event_time(events):
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        events.poll()
        before = joystick.raw()
        wheel.button(3, True)
        wheel.button(7, True)
        events.poll()
        pressed = joystick.raw()
        wheel.button(3, False)
        wheel.axis(1, 0.5)
        events.poll()
        after = joystick.raw()
    assert pressed.buttons == {3, 7}
    assert after.buttons == {7}
    assert after.motions == before.motions + 1
    assert before.t_event_ns < pressed.t_event_ns < after.t_event_ns


def test_unplugging_is_seen_though_polling_still_reads_a_plausible_zero(events):
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        handle = pygame.joystick.Joystick(0)
        wheel.axis(0, 0.8)
        wheel.button(1, True)
        events.poll()
        assert not joystick.raw().lost
        wheel.unplug()
        events.poll()
    assert handle.get_axis(0) == 0.0
    raw = joystick.raw()
    assert raw.lost
    assert raw.axes == (None,) * 4
    assert raw.buttons == frozenset()


def test_the_same_device_comes_back_with_unknown_axes(events):
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        wheel.axis(0, 0.8)
        events.poll()
        wheel.unplug()
        events.poll()
        with VirtualJoystick(name="Another wheel", product=0xC24F) as other:
            events.poll()
            other.axis(0, 0.3)
            events.poll()
            assert joystick.raw().lost  # another device is never taken in its place
            wheel.plug_in()
            events.poll()
            assert not joystick.raw().lost
            assert joystick.raw().axes == (None,) * 4
            wheel.axis(0, -0.5)
            events.poll()
            assert joystick.raw().axes[0] == pytest.approx(-0.5, abs=1e-4)
    assert joystick.openings == 2


def test_unplugged_and_back_between_two_polls(events):
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        wheel.axis(0, 0.8)
        events.poll()
        wheel.unplug()
        wheel.plug_in()
        events.poll()
        assert not joystick.raw().lost
        assert joystick.raw().axes[0] is None


def test_another_joystick_does_not_move_it(events):
    with VirtualJoystick(name="One") as one, VirtualJoystick(name="Two") as two:
        infos = {info.name: info for info in list_joysticks()}
        joystick = RawJoystick(events, infos["Two"])
        joystick.open()
        one.axis(0, 0.9)
        one.button(2, True)
        events.poll()
        assert joystick.raw().axes[0] is None
        assert joystick.raw().buttons == frozenset()
        two.axis(0, 0.2)
        one.unplug()
        events.poll()
        assert joystick.raw().axes[0] == pytest.approx(0.2, abs=1e-4)
        assert not joystick.raw().lost


def test_two_of_one_model_are_refused(events):
    with VirtualJoystick(), VirtualJoystick():
        info = list_joysticks()[0]
        with pytest.raises(DeviceError, match="2 times"):
            RawJoystick(events, info).open()


def test_a_joystick_that_went_away_is_refused(events):
    with VirtualJoystick():
        (info,) = list_joysticks()
    events.poll()
    with pytest.raises(DeviceError, match="not plugged in"):
        RawJoystick(events, info).open()


def test_closed_it_no_longer_listens(events):
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        joystick.close()
        joystick.close()
        wheel.axis(0, 0.8)
        events.poll()
        assert joystick.raw().lost
        assert joystick.raw().axes[0] is None


def _hint(value: bytes) -> None:
    override = 2  # SDL_HINT_OVERRIDE: beats the environment
    sdl = mapped_sdl()
    sdl.SDL_SetHintWithPriority.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int]
    assert sdl.SDL_SetHintWithPriority(b"SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", value, override)


def test_motion_counts_without_the_focus(events):
    """Without the variable SDL passes on only motion towards the centre, which biases labels."""
    assert os.environ["SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS"] == "1"
    with VirtualJoystick() as wheel:
        joystick = open_only(events)
        pygame.display.set_mode((64, 64))
        assert not pygame.key.get_focused()

        def position(value):
            wheel.axis(0, value)
            events.poll()
            return joystick.raw().axes[0]

        assert position(0.5) == pytest.approx(0.5, abs=1e-4)
        try:
            _hint(b"0")
            assert position(0.9) == pytest.approx(0.5, abs=1e-4)  # outward motion is kept back
            assert position(0.2) == pytest.approx(0.2, abs=1e-4)  # centring motion is not
        finally:
            _hint(b"1")
        assert position(-0.9) == pytest.approx(-0.9, abs=1e-4)


def test_without_sdl_it_says_so():
    assert not pygame.joystick.get_init()
    with pytest.raises(DeviceError, match="SdlEvents"):
        list_joysticks()
    with pytest.raises(DeviceError, match="SdlEvents"), VirtualJoystick():
        pass


def test_a_virtual_joystick_refuses_what_it_has_not(events):
    wheel = VirtualJoystick(axes=2, buttons=1, kind=GAMEPAD)
    with pytest.raises(DeviceError, match="not plugged in"):
        wheel.axis(0, 0.0)
    with wheel:
        for call in (
            lambda: wheel.axis(2, 0.0),
            lambda: wheel.axis(0, 1.5),
            lambda: wheel.axis(0, float("nan")),
            lambda: wheel.button(1, True),
        ):
            with pytest.raises(DeviceError):
                call()


def test_a_virtual_joystick_survives_sdl_being_closed():
    with SdlEvents(window=False):
        wheel = VirtualJoystick()
        wheel.plug_in()
    wheel.unplug()
    with SdlEvents(window=False):
        assert list_joysticks() == []


def _info(name, guid="1" * 32):
    return JoystickInfo(name=name, guid=guid, vendor=1, product=2, axes=4, buttons=4)


def test_choosing_by_name_part_of_a_name_or_guid():
    g29, g920 = _info("Logitech G29", "a" * 32), _info("Logitech G920", "b" * 32)
    pad = _info("Pad", "c" * 32)
    found = [pad, g29, g920]
    assert choose_joystick(found, "g29") is g29
    assert choose_joystick(found, "PAD") is pad
    assert choose_joystick(found, "b" * 32) is g920
    assert choose_joystick([g29], "") is g29
    exact, longer = _info("Wheel", "d" * 32), _info("Wheel 2", "e" * 32)
    assert choose_joystick([longer, exact], "wheel") is exact


@pytest.mark.parametrize(
    ("found", "name", "words"),
    [
        ([], "", "found: none"),
        ([_info("Pad")], "G29", "called 'G29'.*'Pad'"),
        ([_info("A", "a" * 32), _info("B", "b" * 32)], "", "Several.*'A'.*'B'.*name one"),
        ([_info("A"), _info("A")], "A", "Several.*unplug one"),
    ],
)
def test_choosing_never_guesses(found, name, words):
    with pytest.raises(DeviceError, match=words):
        choose_joystick(found, name)


def test_a_guid_that_holds_a_name_has_no_usb_numbers():
    assert usb_ids("03004f226d04000062c2000011010000") == (0x046D, 0xC262)
    name = b"My Joystic".hex()
    assert usb_ids("05000000" + name + "00" * 2) == (0, 0)
