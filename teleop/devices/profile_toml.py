"""Wheel profiles as TOML; what is wrong in a file is named with its line, key and value."""

import json
import re
import tomllib
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

from steerlab.teleop.devices.contract import Button, DeviceError
from steerlab.teleop.devices.profile import (
    Measured,
    PedalAxis,
    ProfileError,
    ProfileMatch,
    SteeringAxis,
    WheelProfile,
)

FORMAT = 1
_KEYS: dict[str, dict[str, tuple[type, ...]]] = {
    "": {
        "format": (int,),
        "name": (str,),
        "calibrated": (bool,),
        "combined_pedals": (bool,),
        **{
            table: (dict,)
            for table in ("match", "steering", "throttle", "brake", "buttons", "measured")
        },
    },
    "match": {"guid": (str,), "vendor": (int,), "products": (list,), "axes": (int,), "os": (str,)},
    "steering": {
        "axis": (int,),
        "sign": (int,),
        **dict.fromkeys(("minimum", "centre", "maximum", "dead_zone"), (int, float)),
    },
    "throttle": {"axis": (int,), "rest": (int, float), "pressed": (int, float)},
    "brake": {"axis": (int,), "rest": (int, float), "pressed": (int, float)},
    "buttons": {str(button): (int,) for button in Button},
    "measured": dict.fromkeys(("resolution", "rate_hz", "noise", "return_error"), (int, float)),
}
_NEEDED = {
    "": ("format", "name", "calibrated", "match", "steering"),
    "match": ("vendor", "products", "os"),
    "steering": ("axis", "sign"),
    "throttle": ("axis", "rest", "pressed"),
    "brake": ("axis", "rest", "pressed"),
    "buttons": (),
    "measured": ("resolution", "rate_hz", "noise", "return_error"),
}
_WORDS = {
    int: "a whole number",
    float: "a number",
    str: "a text",
    bool: "true or false",
    list: "a list of whole numbers",
    dict: "a table",
}


def profile_from_toml(text: str, file: str) -> WheelProfile:
    """Read one profile; ``file`` is named in errors.

    Raises:
        ProfileError: with line, key, value and what is allowed.
        DeviceError: the text is no TOML at all.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DeviceError(f"{file} is no TOML: {error}. Mend it, or calibrate again.") from error
    try:
        return _profile(content)
    except ProfileError as error:
        raise error.at(file, _line_of(text, error.key)) from None


def profile_to_toml(profile: WheelProfile) -> str:
    """The file's text; reading it gives an equal profile."""
    match, steering = profile.match, profile.steering
    lines = [
        f"format = {FORMAT}",
        f"name = {_text(profile.name)}",
        f"calibrated = {str(profile.calibrated).lower()}",
        f"combined_pedals = {str(profile.combined_pedals).lower()}",
        "",
        "[match]",
        f"guid = {_text(match.guid)}",
        f"vendor = {match.vendor:#06x}",
        f"products = [{', '.join(f'{one:#06x}' for one in match.products)}]",
        f"axes = {match.axes}",
        f"os = {_text(match.system)}",
    ]
    lines += _table("steering", steering, _KEYS["steering"])
    for name in ("throttle", "brake", "measured"):
        part = getattr(profile, name)
        if part is not None:
            lines += _table(name, part, _KEYS[name])
    if profile.buttons:
        lines += ["", "[buttons]", *(f"{name} = {n}" for name, n in profile.buttons.items())]
    return "\n".join(lines) + "\n"


def profile_sha256(text: str) -> str:
    """Of a profile file's text; kept with each session."""
    return sha256(text.encode()).hexdigest()


def _profile(content: dict[str, Any]) -> WheelProfile:
    _check_table("", content)
    for name in _KEYS:
        if name and name in content:
            _check_table(name, content[name])
    if content["format"] != FORMAT:
        raise ProfileError("format", content["format"], f"{FORMAT}, the only one there is")
    match = content["match"]
    for number in match["products"]:
        if type(number) is not int:
            raise ProfileError("match.products", match["products"], _WORDS[list])
    measured = content.get("measured")
    return WheelProfile(
        name=content["name"],
        match=ProfileMatch(
            guid=match.get("guid", ""),
            vendor=match["vendor"],
            products=tuple(match["products"]),
            axes=match.get("axes", 0),
            system=match["os"],
        ),
        steering=SteeringAxis(**content["steering"]),
        throttle=_pedal("throttle", content),
        brake=_pedal("brake", content),
        combined_pedals=content.get("combined_pedals", False),
        buttons={Button(name): number for name, number in content.get("buttons", {}).items()},
        measured=None if measured is None else Measured(**measured),
        calibrated=content["calibrated"],
    )


def _pedal(name: str, content: Mapping[str, Any]) -> PedalAxis | None:
    if name not in content:
        return None
    try:
        return PedalAxis(**content[name])
    except ProfileError as error:
        raise ProfileError(f"{name}.{error.key}", error.value, error.allowed) from None


def _check_table(table: str, content: Mapping[str, Any]) -> None:
    dot = f"{table}." if table else ""
    for key, value in content.items():
        kinds = _KEYS[table].get(key)
        if kinds is None:
            raise ProfileError(f"{dot}{key}", value, f"one of the keys {', '.join(_KEYS[table])}")
        if type(value) not in kinds:  # a bool is an int to isinstance
            raise ProfileError(f"{dot}{key}", value, _WORDS[kinds[-1]])
    for key in _NEEDED[table]:
        if key not in content:
            words = _WORDS[_KEYS[table][key][-1]]
            raise ProfileError(f"{dot}{key}", None, f"given: {words}")


def _line_of(text: str, key: str) -> int | None:
    """The line of ``table.key``, or of its table's head; None if neither is there."""
    table, _, name = key.rpartition(".")
    inside, head = not table, None
    for number, line in enumerate(text.splitlines(), start=1):
        heading = re.match(r"\s*\[\s*([\w.]+)\s*\]", line)
        if heading:
            inside = heading[1] == table
            if heading[1] in (table, key):
                head = number
        elif inside and re.match(rf"\s*{re.escape(name)}\s*=", line):
            return number
    return head


def _table(name: str, part: object, keys: Mapping[str, object]) -> list[str]:
    return ["", f"[{name}]", *(f"{key} = {getattr(part, key)!r}" for key in keys)]


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # its escapes are TOML's too
