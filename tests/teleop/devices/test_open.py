import numpy as np
import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population
from steerlab.teleop.devices.contract import DeviceError, InputKind
from steerlab.teleop.devices.joystick import list_joysticks
from steerlab.teleop.devices.open import DEVICE_SPECS, open_device
from steerlab.teleop.devices.profile_folder import save_profile
from steerlab.teleop.devices.scripted import ScriptedDevice
from steerlab.teleop.devices.virtual import VirtualJoystick

ROLLOUT = load_calibration_set()[3]


@pytest.mark.parametrize("kind", ["paper", "low", "human", "high", "people", "sparse"])
def test_a_scripted_device_says_bit_for_bit_what_its_teacher_says(kind):
    device = open_device(f"scripted:{kind}:3")
    (teacher,) = sample_population(kind, 1, 3, prefix="scripted")
    device.connect()
    device.begin(ROLLOUT, order=2, attempt=1)
    teacher.begin(ROLLOUT, order=2, attempt=1)
    said = [device.read(step).wheel for step in range(ROLLOUT.steps)]
    expected = [teacher.label(step) for step in range(ROLLOUT.steps)]
    assert said == expected
    assert np.ptp(said) > 0.0


def test_a_scripted_device_that_gives_no_label_is_not_ok():
    class Absent:
        name = "absent"

        def begin(self, rollout, *, order, attempt):
            pass

        def label(self, step):
            return None if step == 1 else 0.5

    device = ScriptedDevice(Absent())
    device.begin(ROLLOUT, order=0, attempt=0)
    assert [device.read(step).ok for step in range(3)] == [True, False, True]
    with pytest.raises(DeviceError, match="recorded rollouts"):
        device.begin(None, order=0, attempt=0)


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        ("wheel", InputKind.WHEEL),
        ("wheel:G29", InputKind.WHEEL),
        ("gamepad", InputKind.GAMEPAD),
        ("gamepad:Xbox: One", InputKind.GAMEPAD),
        ("keyboard", InputKind.KEYBOARD),
        ("mouse", InputKind.MOUSE),
        ("scripted:human:3", InputKind.SCRIPTED),
    ],
)
def test_each_spec_makes_its_kind(events, spec, kind):
    assert open_device(spec, events).info.kind is kind


def test_a_trace_file(tmp_path):
    path = tmp_path / "a trace.csv"
    path.write_text("step,wheel\n0,1.5\n")
    device = open_device(f"trace:{path}")
    device.connect()
    assert device.read(0).wheel == 1.5


@pytest.mark.parametrize(
    "spec",
    ["", "weel", "Wheel", "wheel:", "keyboard:x", "mouse:2", "trace", "trace:", "joystick:0"],
)
def test_an_unknown_spec_lists_the_valid_ones(events, spec):
    with pytest.raises(DeviceError) as caught:
        open_device(spec, events)
    assert all(valid in str(caught.value) for valid in DEVICE_SPECS)


@pytest.mark.parametrize(
    "spec",
    ["scripted", "scripted:human", "scripted:human:", "scripted:human:-1", "scripted:expert:3",
     "scripted:human:3.5", "scripted:human:3:4", "scripted:human:²"],
)  # fmt: skip
def test_a_scripted_spec_that_is_none_says_how(spec):
    with pytest.raises(DeviceError, match=r"scripted:KIND:SEED.*paper, low, human, high"):
        open_device(spec)


@pytest.mark.parametrize("spec", ["wheel", "gamepad", "keyboard", "mouse"])
def test_what_needs_sdl_says_so(spec):
    with pytest.raises(DeviceError, match="SdlEvents"):
        open_device(spec)


@pytest.mark.parametrize("spec", ["wheel", "wheel:G29", "gamepad"])
def test_a_missing_device_never_becomes_another(events, spec):
    """The keyboard is there, and another joystick too: neither is taken."""
    with VirtualJoystick(name="Flight stick", vendor=0x231D, product=0x0126, axes=0):
        device = open_device(spec, events)
        with pytest.raises(DeviceError):
            device.connect()
        assert not device.read().ok


def test_without_a_motor_the_wheel_says_why_force_feedback_is_off(events, profile_for):
    with VirtualJoystick():
        (info,) = list_joysticks()
        save_profile(profile_for(info).profile)
        for autocentre, words in ((0.3, "off: no input device 046d:c262"), (None, "off: not ask")):
            device = open_device("wheel", events, autocentre=autocentre)
            device.connect()
            assert device.info.force_feedback.startswith(words)
            device.disconnect()
