import ctypes
import re
from types import SimpleNamespace

import pytest

from steerlab.teleop.devices import force_feedback
from steerlab.teleop.devices.force_feedback import open_force_feedback

G920 = (0x046D, 0xC262)
ECODES = SimpleNamespace(EV_FF=0x15, FF_AUTOCENTER=0x61, FF_SPRING=0x53)


class Condition(ctypes.Structure):
    _fields_ = (
        ("right_saturation", ctypes.c_uint16),
        ("left_saturation", ctypes.c_uint16),
        ("right_coeff", ctypes.c_int16),
        ("left_coeff", ctypes.c_int16),
        ("deadband", ctypes.c_uint16),
        ("center", ctypes.c_int16),
    )


class FakeEvdev:
    """The part of evdev that is used, over a motor that only remembers."""

    ecodes = ECODES
    ff = SimpleNamespace(
        Condition=Condition,
        EffectType=lambda ff_condition_effect: SimpleNamespace(conditions=ff_condition_effect),
        Trigger=lambda *values: values,
        Replay=lambda *values: values,
        Effect=lambda *values: SimpleNamespace(type=values[0], id=values[1], u=values[5]),
    )

    def __init__(self, effects=(0x61, 0x53), *, opening=None, writing=None):
        self.effects, self.opening, self.writing = effects, opening, writing
        self.opened, self.log, self.uploaded = [], [], []

    def InputDevice(self, path):
        self.opened.append(path)
        if self.opening:
            raise self.opening
        return self

    def capabilities(self):
        return {0x15: list(self.effects)} if self.effects else {0x03: [0]}

    def write(self, *what):
        if self.writing:
            raise self.writing
        self.log.append(what)

    def upload_effect(self, effect):
        self.uploaded.append(effect)
        return len(self.uploaded)

    def erase_effect(self, number):
        self.log.append(("erase", number))

    def close(self):
        self.log.append("close")


@pytest.fixture
def inputs(tmp_path):
    """A keyboard that also has lights, the wheel, and a power button without USB numbers."""
    for name, ids in (("event0", (0x1234, 0x0001)), ("event5", G920), ("event7", None)):
        folder = tmp_path / name / "device" / "id"
        folder.mkdir(parents=True)
        if ids is not None:
            (folder / "vendor").write_text(f"{ids[0]:04x}\n")
            (folder / "product").write_text(f"{ids[1]:04x}\n")
    return tmp_path


def opened(evdev, inputs, **changes):
    return open_force_feedback(*G920, evdev=evdev, inputs=inputs, system="linux", **changes)


def test_the_wheels_own_motor_gets_a_fixed_centring_force_and_stays_open(inputs):
    evdev = FakeEvdev()
    motor = opened(evdev, inputs, autocentre=0.5)
    assert evdev.opened == ["/dev/input/event5"]
    assert evdev.log == [(0x15, 0x61, 32768)]
    assert motor.text == "autocentre 0.50"


def test_a_spring_for_the_practice_drive(inputs):
    evdev = FakeEvdev()
    motor = opened(evdev, inputs)
    assert motor.spring(0.5) == "spring 0.50"
    effect = evdev.uploaded[0]
    assert (effect.type, effect.id) == (0x53, -1)
    assert effect.u.conditions[0].right_coeff == effect.u.conditions[0].left_coeff == 16384
    assert evdev.log[-1] == (0x15, 1, 1)
    motor.spring(0.2)
    assert evdev.log[-2:] == [("erase", 1), (0x15, 2, 1)]


def test_closing_takes_the_forces_away_once(inputs):
    evdev = FakeEvdev()
    motor = opened(evdev, inputs)
    motor.spring(0.5)
    evdev.log.clear()
    motor.close()
    motor.close()
    assert evdev.log == [("erase", 1), (0x15, 0x61, 0), "close"]
    assert motor.spring(0.5).startswith("off: ")


@pytest.mark.parametrize(
    ("evdev", "words"),
    [
        (FakeEvdev(opening=PermissionError(13, "no")), "off: no permission.*event5.*'input'"),
        (FakeEvdev(opening=OSError(19, "No such device")), "off: .*event5 does not open.*No such"),
        (FakeEvdev(effects=()), "off: the wheel has no centring motor"),
        (FakeEvdev(effects=(0x53,)), "off: the wheel has no centring motor"),
        (FakeEvdev(writing=OSError(22, "Invalid")), "off: .*refused the centring force"),
    ],
)
def test_what_prevents_it_is_said(inputs, evdev, words):
    motor = opened(evdev, inputs)
    assert re.match(words, motor.text)
    assert motor.spring(0.5) == motor.text
    motor.close()


def test_a_wheel_without_a_spring(inputs):
    motor = opened(FakeEvdev(effects=(0x61,)), inputs)
    assert motor.text.startswith("autocentre")
    assert motor.spring(0.5) == "off: the wheel has no spring"


def test_a_wheel_that_went_away_meanwhile_closes_all_the_same(inputs):
    evdev = FakeEvdev()
    motor = opened(evdev, inputs)
    evdev.writing = OSError(19, "No such device")
    assert motor.spring(0.5) == "off: the wheel refused the spring (No such device)"
    motor.close()
    assert evdev.log[-1] == "close"


def test_no_such_wheel_other_systems_and_no_package(inputs, monkeypatch):
    evdev = FakeEvdev()
    other = open_force_feedback(1, 2, evdev=evdev, inputs=inputs, system="linux")
    assert other.text == "off: no input device 0001:0002"
    assert evdev.opened == []
    windows = open_force_feedback(*G920, evdev=evdev, inputs=inputs, system="windows")
    assert windows.text == "off: force feedback needs Linux"

    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(force_feedback.importlib, "import_module", missing)
    assert opened(None, inputs).text.startswith("off: evdev is missing (pip install")
