"""Wheel profiles as TOML; what is wrong in a file is named with its line, key and value."""

import json
from dataclasses import fields
from hashlib import sha256

from steerlab.sim.files.structured import structured, toml_values, versioned, within_file
from steerlab.teleop.devices.profile import WheelProfile

FORMAT = 1


def profile_from_toml(text: str, file: str) -> WheelProfile:
    """Read one profile; ``file`` is named in errors.

    Raises:
        InvalidConfig: with line, key, value and what is allowed.
    """
    values = toml_values(text, file)
    with within_file(file, text):
        return structured(WheelProfile, versioned(WheelProfile, values, "format", FORMAT))


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
    lines += _table("steering", steering)
    for name in ("throttle", "brake", "measured"):
        part = getattr(profile, name)
        if part is not None:
            lines += _table(name, part)
    if profile.buttons:
        lines += ["", "[buttons]", *(f"{name} = {n}" for name, n in profile.buttons.items())]
    return "\n".join(lines) + "\n"


def profile_sha256(text: str) -> str:
    """Of a profile file's text; kept with each session."""
    return sha256(text.encode()).hexdigest()


def _table(name: str, part: object) -> list[str]:
    names = [one.name for one in fields(part)]  # pyright: ignore[reportArgumentType]
    return ["", f"[{name}]", *(f"{key} = {getattr(part, key)!r}" for key in names)]


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # its escapes are TOML's too
