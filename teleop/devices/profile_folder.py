"""Wheel profiles as TOML files: written, read, and matched to a device.

Shipped profiles know a model's name and axes, nothing of the wheel at hand: they are a starting
point. The user's own folder holds those that the wizard measured. What is wrong in a file is named
with its line, key and value.
"""

import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.by_suffix import files_with
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.structured import structured, toml_values, utf8_text, versioned, within_file
from steerlab.sim.files.whole_file import whole_file, workspace
from steerlab.teleop.devices.contract import DeviceError
from steerlab.teleop.devices.joystick import JoystickInfo
from steerlab.teleop.devices.profile import WheelProfile

FORMAT = 1


@dataclass(frozen=True, kw_only=True)
class StoredProfile:
    """A profile and the file it came from."""

    profile: WheelProfile
    file: str
    sha256: str
    shipped: bool


def user_profile_folder() -> Path:
    """``$XDG_CONFIG_HOME/steerlab/wheels``, by default below ``~/.config``; it may not exist.

    Raises:
        DeviceError: the user has no home folder, and nothing else is said.
    """
    config = os.environ.get("XDG_CONFIG_HOME")
    try:
        folder = Path(config) if config else Path.home() / ".config"
    except RuntimeError as error:  # neither HOME nor an entry in the system's list of users
        raise DeviceError(
            "There is no home folder to keep wheel profiles in; set HOME, or XDG_CONFIG_HOME."
        ) from error
    return folder / "steerlab" / "wheels"


def shipped_profiles() -> list[StoredProfile]:
    """The profiles of ``assets/wheel_profiles``, by file name."""
    folder = files("steerlab.assets").joinpath("wheel_profiles")
    entries = sorted(folder.iterdir(), key=lambda entry: entry.name)
    return [
        _stored(entry.read_text(encoding="utf-8"), entry.name, shipped=True)
        for entry in entries
        if entry.name.endswith(".toml")
    ]


def user_profiles(folder: Path | None = None) -> list[StoredProfile]:
    """The profiles that the wizard wrote, by file name; none if there is no such folder yet.

    Raises:
        InvalidConfig: a file holds nonsense, is no TOML, or cannot be read.
    """
    profiles, damaged = sound_profiles(folder)
    if damaged:
        raise damaged[0]
    return profiles


def sound_profiles(
    folder: Path | None = None,
) -> tuple[list[StoredProfile], list[SteerlabError]]:
    """The user's profiles that can be read, and what is wrong with each of the others."""
    try:
        folder = folder or user_profile_folder()
    except DeviceError:  # nobody could have written any
        return [], []
    profiles: list[StoredProfile] = []
    damaged: list[SteerlabError] = []
    for path in files_with(folder, ".toml"):
        try:
            profiles.append(_stored(utf8_text(path), str(path), shipped=False))
        except SteerlabError as error:
            damaged.append(error)
    return profiles, damaged


def save_profile(profile: WheelProfile, folder: Path | None = None) -> Path:
    """Keep a user's profile; an earlier one for the same device is replaced as a whole.

    Raises:
        SteerlabError: it cannot be written.
    """
    slug = re.sub(r"[^a-z0-9]+", "-", profile.name.casefold()).strip("-") or "wheel"
    with _writing_into(folder) as writable:
        path = writable / f"{slug}-{profile.match.guid}-{profile.match.system}.toml"
        with whole_file(path) as fresh:
            fresh.write_text(profile_to_toml(profile), encoding="utf-8")
    return path


def check_profile_folder(folder: Path | None = None) -> None:
    """Find out whether a profile can be kept, before a person calibrates for it.

    Raises:
        SteerlabError: it cannot.
    """
    with _writing_into(folder) as writable, workspace(writable / "profile"):
        pass


@contextmanager
def _writing_into(folder: Path | None) -> Iterator[Path]:
    folder = folder or user_profile_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield folder
    except OSError as error:
        raise SteerlabError(
            f"The profile cannot be kept in {folder}: "
            f"{refusal(error, 'make the folder writable, or set XDG_CONFIG_HOME')}."
        ) from error


def find_profile(
    device: JoystickInfo, profiles: Sequence[StoredProfile], system: str
) -> StoredProfile | None:
    """The profile for ``device`` on ``system``: by GUID, else by vendor, product and axes.

    Of each kind the user's own go before the shipped ones.

    Raises:
        DeviceError: two profiles fit equally well.
    """
    candidates = [stored for stored in profiles if stored.profile.match.system == system]

    def by_guid(stored: StoredProfile) -> bool:
        return stored.profile.match.guid == device.guid

    def by_model(stored: StoredProfile) -> bool:
        match = stored.profile.match
        return (
            match.vendor == device.vendor
            and device.product in match.products
            and match.axes in (0, device.axes)
        )

    rules: tuple[Callable[[StoredProfile], bool], ...] = (by_guid, by_model)
    for rule in rules:
        for shipped in (False, True):
            fitting = [
                stored for stored in candidates if stored.shipped is shipped and rule(stored)
            ]
            if len(fitting) > 1:
                names = ", ".join(stored.file for stored in fitting)
                raise DeviceError(f"Several profiles fit {device}: {names}; remove all but one.")
            if fitting:
                return fitting[0]
    return None


def _stored(text: str, file: str, *, shipped: bool) -> StoredProfile:
    return StoredProfile(
        profile=profile_from_toml(text, file),
        file=file,
        sha256=profile_sha256(text),
        shipped=shipped,
    )


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
        f"products = [{', '.join(f'{product:#06x}' for product in match.products)}]",
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
    """The hash of a profile file's text, kept with each session."""
    return sha256(text.encode()).hexdigest()


def _table(name: str, part: object) -> list[str]:
    names = [field.name for field in fields(part)]  # pyright: ignore[reportArgumentType]
    return ["", f"[{name}]", *(f"{key} = {getattr(part, key)!r}" for key in names)]


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # its escapes are TOML's too
