from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steerlab.sim.errors import InvalidConfig, InvalidValue, SteerlabError
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button, DeviceError
from steerlab.teleop.devices.joystick import JoystickInfo
from steerlab.teleop.devices.profile import (
    SYSTEMS,
    Measured,
    PedalAxis,
    ProfileMatch,
    SteeringAxis,
    WheelProfile,
)
from steerlab.teleop.devices.profile_folder import (
    StoredProfile,
    find_profile,
    profile_from_toml,
    profile_sha256,
    profile_to_toml,
    save_profile,
    shipped_profiles,
    user_profile_folder,
    user_profiles,
)

RAW = st.floats(-1.0, 1.0)
GUID = "03004f226d04000062c2000011010000"
G920 = JoystickInfo(name="G920", guid=GUID, vendor=0x046D, product=0xC262, axes=4, buttons=11)


@st.composite
def steerings(draw, *, symmetric=False):
    centre = draw(st.floats(-0.3, 0.3))
    right = draw(st.floats(0.1, 0.6))
    left = right if symmetric else draw(st.floats(0.1, 0.6))
    return SteeringAxis(
        axis=draw(st.integers(0, 3)),
        sign=draw(st.sampled_from((-1, 1))),
        minimum=centre - left,
        centre=centre,
        maximum=centre + right,
        dead_zone=draw(st.floats(0.0, 0.04)),
    )


@st.composite
def pedals(draw, axis):
    rest = draw(RAW)
    pressed = draw(RAW.filter(lambda value: abs(value - rest) >= 0.05))
    return PedalAxis(axis=axis, rest=rest, pressed=pressed)


@st.composite
def profiles(draw):
    steering = draw(steerings())
    throttle = draw(st.none() | pedals(4))
    brake = draw(st.none() | pedals(5))
    calibrated = draw(st.booleans())
    positive = st.floats(0.0, 1e6)
    measured = Measured(
        resolution=draw(positive),
        rate_hz=draw(positive),
        noise=draw(positive),
        return_error=draw(positive),
    )
    numbers = draw(st.lists(st.integers(0, 30), unique=True, max_size=3))
    name = draw(st.text(min_size=1, max_size=20).filter(lambda t: t.strip() and t.isprintable()))
    return WheelProfile(
        name=name,
        match=ProfileMatch(
            guid=draw(st.sampled_from(("", GUID))),
            vendor=draw(st.integers(0, 0xFFFF)),
            products=tuple(draw(st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=3))),
            axes=draw(st.integers(6, 64)),
            system=draw(st.sampled_from(SYSTEMS)),
        ),
        steering=steering,
        throttle=throttle,
        brake=brake,
        buttons=dict(zip(Button, numbers, strict=False)),
        measured=measured if calibrated else draw(st.none() | st.just(measured)),
        calibrated=calibrated,
    )


@given(profiles())
def test_toml_round_trip(profile):
    text = profile_to_toml(profile)
    assert profile_from_toml(text, "x.toml") == profile
    assert profile_to_toml(profile_from_toml(text, "x.toml")) == text


@given(steerings(), RAW)
def test_steering_is_bounded(steering, raw):
    assert -WHEEL_LIMIT <= steering.wheel(raw) <= WHEEL_LIMIT


@given(steerings(), RAW, RAW)
def test_steering_is_monotone(steering, one, other):
    low, high = sorted((one, other))
    assert (steering.wheel(high) - steering.wheel(low)) * steering.sign >= 0.0


@given(steerings(symmetric=True), st.floats(0.0, 0.6))
def test_steering_is_odd_about_the_centre(steering, off):
    left = steering.wheel(steering.centre + off)
    right = steering.wheel(steering.centre - off)
    assert left == pytest.approx(-right, abs=1e-9)


@given(steerings())
def test_steering_reaches_both_ends_and_zero(steering):
    assert steering.wheel(steering.maximum) == pytest.approx(WHEEL_LIMIT * steering.sign)
    assert steering.wheel(steering.minimum) == pytest.approx(-WHEEL_LIMIT * steering.sign)
    assert steering.wheel(steering.centre) == 0.0
    just_inside = 0.999 * steering.dead_zone
    assert abs(steering.wheel(steering.centre + just_inside)) < 1e-12


@given(pedals(2), RAW, RAW)
def test_pedals_are_bounded_and_monotone(pedal, one, other):
    assert (pedal.amount(pedal.rest), pedal.amount(pedal.pressed)) == (0.0, 1.0)
    low, high = sorted((one, other))
    grows = 1.0 if pedal.pressed > pedal.rest else -1.0
    assert 0.0 <= pedal.amount(one) <= 1.0
    assert (pedal.amount(high) - pedal.amount(low)) * grows >= 0.0


GOOD = """\
format = 1
name = "Good"
calibrated = true
combined_pedals = false

[match]
guid = "03004f226d04000062c2000011010000"
vendor = 0x046d
products = [0xc262]
axes = 4
os = "linux"

[steering]
axis = 0
sign = -1
minimum = -0.9
centre = 0.01
maximum = 0.9
dead_zone = 0.02

[throttle]
axis = 1
rest = 1.0
pressed = -1.0

[brake]
axis = 2
rest = 1.0
pressed = -1.0

[buttons]
pause = 9
redo = 8

[measured]
resolution = 0.001
rate_hz = 500.0
noise = 0.0005
return_error = 0.01
"""


def test_the_good_file_is_good():
    profile = profile_from_toml(GOOD, "good.toml")
    assert profile.calibrated
    assert profile.buttons == {Button.PAUSE: 9, Button.REDO: 8}
    assert profile_from_toml(profile_to_toml(profile), "again") == profile


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("format = 1", "format = 2", r"line 1: \$.format is 2"),
        ('name = "Good"', 'name = " "', r"line 2: \$.name is ' '"),
        ("calibrated = true", "calibrated = 1", r"line 3: \$.calibrated is 1.*true or false"),
        ("vendor = 0x046d", "vendor = 0x1046d", r"line 8: \$.match.vendor is 66669.*0xffff"),
        ("vendor = 0x046d", 'vendor = "046d"', r"line 8: \$.match.vendor is '046d'.*whole number"),
        ("products = [0xc262]", "products = []", r"line 9: \$.match.products is \[\]"),
        ("products = [0xc262]", 'products = ["c262"]', r"line 9: \$.match.products"),
        ("axes = 4", "axes = -1", r"line 10: \$.match.axes is -1"),
        ("axes = 4\n", "", "calibrated is True; it must be false without match.axes"),
        ('os = "linux"', 'os = "beos"', r"line 11: \$.match.os is 'beos'.*linux, windows, darwin"),
        ('guid = "0300', 'guid = "XXXX', r"line 7: \$.match.guid.*32 hexadecimal"),
        ("axis = 0", "axis = 7", r"line 14: \$.steering.axis is 7.*below match.axes, 4"),
        ("axis = 0", "axis = true", r"line 14: \$.steering.axis is True.*whole number"),
        ("sign = -1", "sign = 0", r"line 15: \$.steering.sign is 0"),
        ("minimum = -0.9", "minimum = -900", r"line 16: \$.steering.minimum is -900"),
        ("minimum = -0.9", "minimum = nan", r"line 16: \$.steering.minimum is nan"),
        ("centre = 0.01", "centre = 0.95", r"line 17: \$.steering.centre is 0.95.*between"),
        ("dead_zone = 0.02", "dead_zone = 0.8", r"line 19: \$.steering.dead_zone is 0.8"),
        ("dead_zone = 0.02", "deadzone = 0.02", r"line 19: \$.steering.deadzone.*dead_zone"),
        (
            "[throttle]\naxis = 1",
            "[throttle]\naxis = 0",
            r"line 22: \$.throttle.axis is 0.*another",
        ),
        ("pressed = -1.0\n\n[brake]", "pressed = 1.0\n\n[brake]", r"line 24: \$.throttle.pressed"),
        (
            "pressed = -1.0\n\n[brake]",
            "\n[brake]",
            r"line 21: \$.throttle.pressed is missing; give a",
        ),
        ("[brake]\naxis = 2", "[brake]\naxis = 1", r"line 4: \$.combined_pedals is False.*true"),
        ("combined_pedals = false", "combined_pedals = true", "line 4: .* is True.*false"),
        ("pause = 9", "pause = -9", r"line 32: \$.buttons.pause is -9"),
        ("pause = 9", "pause = 8", r"line 31: \$.buttons is .*different number"),
        ("pause = 9", "horn = 9", r"line 32: \$.buttons.horn is 9.*pause, redo, take_over"),
        ("noise = 0.0005", "noise = -1", r"line 38: \$.measured.noise is -1"),
        ("[measured]", "[wheels]", r"line 35: \$.wheels is"),
        ("[steering]", "[steering", "no TOML"),
    ],
)
def test_nonsense_is_named_with_line_key_value_and_what_is_allowed(old, new, words):
    assert old in GOOD
    with pytest.raises(InvalidConfig, match=words) as caught:
        profile_from_toml(GOOD.replace(old, new, 1), "bad.toml")
    assert "bad.toml" in str(caught.value)


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, len(GOOD) - 1), st.text(max_size=5))
def test_a_damaged_file_is_read_or_refused_but_never_crashes(position, junk):
    damaged = GOOD[:position] + junk + GOOD[position + 1 :]
    with suppress(InvalidConfig):  # anything else is a crash
        profile_from_toml(damaged, "damaged.toml")


def test_combined_pedals_push_to_opposite_sides():
    combined = GOOD.replace("combined_pedals = false", "combined_pedals = true")
    combined = combined.replace("rest = 1.0", "rest = 0.0").replace(
        "[brake]\naxis = 2", "[brake]\naxis = 1"
    )
    with pytest.raises(InvalidValue, match=r"brake.pressed is -1.0.*other side"):
        profile_from_toml(combined, "bad.toml")
    head, tail = combined.split("[brake]")
    good = profile_from_toml(head + "[brake]" + tail.replace("-1.0", "1.0", 1), "good.toml")
    assert good.combined_pedals
    assert (good.throttle.amount(-0.5), good.brake.amount(-0.5)) == (0.5, 0.0)


SHIPPED = {
    "Logitech G29 Driving Force": [(0x046D, 0xC24F)],
    "Logitech G920 Driving Force": [(0x046D, 0xC262)],
    "Logitech G923 (PlayStation, PC)": [(0x046D, 0xC266)],
    "Logitech G923 (Xbox, PC)": [(0x046D, 0xC26E)],
    "Thrustmaster T150": [(0x044F, 0xB677)],
    "Thrustmaster T248": [(0x044F, 0xB696)],
    "Thrustmaster T300RS": [(0x044F, 0xB66E), (0x044F, 0xB66F), (0x044F, 0xB66D)],
    "Thrustmaster TMX": [(0x044F, 0xB67F)],
    "HORI Racing Wheel Overdrive": [(0x0F0D, 0x0151), (0x0F0D, 0x0152)],
}


def test_shipped_profiles_are_starting_points_for_the_known_wheels():
    shipped = shipped_profiles()
    ids = {
        one.profile.name: [
            (one.profile.match.vendor, product) for product in one.profile.match.products
        ]
        for one in shipped
    }
    assert ids == SHIPPED
    assert not any(one.profile.calibrated for one in shipped)
    assert all(one.shipped and one.profile.match.guid == "" for one in shipped)


def stored(name="x", *, shipped=False, **match) -> StoredProfile:
    fields = {"guid": "", "vendor": 0x046D, "products": (0xC262,), "axes": 4, "system": "linux"}
    profile = WheelProfile(
        name=name,
        match=ProfileMatch(**{**fields, **match}),
        steering=SteeringAxis(axis=0, sign=-1),
    )
    return StoredProfile(profile=profile, file=f"{name}.toml", sha256="", shipped=shipped)


def test_a_guid_goes_before_usb_numbers_and_the_users_own_before_shipped():
    by_guid = stored("guid", guid=GUID, vendor=1, products=(1,))
    by_ids = stored("ids")
    shipped = stored("shipped", shipped=True)
    for order in ([by_guid, by_ids, shipped], [shipped, by_ids, by_guid]):
        assert find_profile(G920, order, "linux") is by_guid
    assert find_profile(G920, [shipped, by_ids], "linux") is by_ids
    assert find_profile(G920, [shipped], "linux") is shipped


def test_usb_numbers_need_the_same_number_of_axes():
    assert find_profile(replace(G920, axes=5), [stored()], "linux") is None
    assert find_profile(replace(G920, axes=5), [stored(axes=0)], "linux") is not None
    assert find_profile(replace(G920, product=0xC24F), [stored()], "linux") is None


def test_another_operating_system_never_matches():
    profiles = [stored(guid=GUID, system="windows"), stored("b", system="windows")]
    assert find_profile(G920, profiles, "linux") is None
    assert find_profile(G920, profiles, "windows") is profiles[0]


def test_two_that_fit_equally_are_refused():
    with pytest.raises(DeviceError, match=r"a\.toml, b\.toml"):
        find_profile(G920, [stored("a"), stored("b")], "linux")


def test_the_users_folder(config_home, monkeypatch, tmp_path):
    assert user_profile_folder() == config_home / "steerlab" / "wheels"
    monkeypatch.delenv("XDG_CONFIG_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert user_profile_folder() == tmp_path / ".config" / "steerlab" / "wheels"


def test_saving_replaces_the_same_device_and_keeps_the_others():
    assert user_profiles() == []
    profile = profile_from_toml(GOOD, "good.toml")
    first = save_profile(profile)
    other = save_profile(replace(profile, match=replace(profile.match, guid="f" * 32)))
    again = save_profile(replace(profile, buttons={}))
    assert first == again != other
    kept = {one.file: one for one in user_profiles()}
    assert set(kept) == {str(first), str(other)}
    assert kept[str(first)].profile.buttons == {}
    assert kept[str(first)].sha256 == profile_sha256(first.read_text())
    assert not kept[str(first)].shipped


def test_a_profile_from_another_system_may_end_in_capitals():
    path = save_profile(profile_from_toml(GOOD, "good.toml"))
    capitals = path.rename(path.with_suffix(".TOML"))
    assert [one.file for one in user_profiles()] == [str(capitals)]


def test_a_broken_user_profile_is_named_not_skipped():
    path = save_profile(profile_from_toml(GOOD, "good.toml"))
    path.write_text(GOOD.replace("sign = -1", "sign = 3"))
    with pytest.raises(InvalidValue, match=rf"{path.name}.*steering.sign is 3"):
        user_profiles()
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidConfig, match=path.name):
        user_profiles()


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(SteerlabError, match="cannot be kept in"):
        save_profile(profile_from_toml(GOOD, "good.toml"), blocked / "wheels")


def test_without_a_home_there_are_no_profiles_and_none_can_be_kept(monkeypatch):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", nowhere)
    monkeypatch.delenv("XDG_CONFIG_HOME")
    assert user_profiles() == []
    with pytest.raises(DeviceError, match="set HOME, or XDG_CONFIG_HOME"):
        save_profile(profile_from_toml(GOOD, "good.toml"))
