"""Where wheel profiles are kept, and which one belongs to a device.

Shipped profiles know a model's name and axes, nothing of the wheel at hand: they are a starting
point. The user's own folder holds those that the wizard measured.
"""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.structured import utf8_text
from steerlab.sim.files.whole_file import whole_file
from steerlab.teleop.devices.contract import DeviceError
from steerlab.teleop.devices.joystick import JoystickInfo
from steerlab.teleop.devices.profile import WheelProfile
from steerlab.teleop.devices.profile_toml import (
    profile_from_toml,
    profile_sha256,
    profile_to_toml,
)


@dataclass(frozen=True, kw_only=True)
class StoredProfile:
    """A profile and the file it came from."""

    profile: WheelProfile
    file: str
    sha256: str
    shipped: bool


def user_profile_folder() -> Path:
    """``$XDG_CONFIG_HOME/steerlab/wheels``, by default below ``~/.config``; it may not exist."""
    config = os.environ.get("XDG_CONFIG_HOME")
    return (Path(config) if config else Path.home() / ".config") / "steerlab" / "wheels"


def shipped_profiles() -> list[StoredProfile]:
    """Those of ``assets/wheel_profiles``, by file name."""
    folder = files("steerlab.assets").joinpath("wheel_profiles")
    found = sorted(folder.iterdir(), key=lambda entry: entry.name)
    return [
        _stored(entry.read_text(encoding="utf-8"), entry.name, shipped=True)
        for entry in found
        if entry.name.endswith(".toml")
    ]


def user_profiles(folder: Path | None = None) -> list[StoredProfile]:
    """Those the wizard wrote, by file name; none if there is no such folder yet.

    Raises:
        InvalidConfig: a file holds nonsense, is no TOML, or cannot be read.
    """
    folder = folder or user_profile_folder()
    return [
        _stored(utf8_text(path), str(path), shipped=False) for path in sorted(folder.glob("*.toml"))
    ]


def save_profile(profile: WheelProfile, folder: Path | None = None) -> Path:
    """Keep a user's profile; an earlier one for the same device is replaced as a whole.

    Raises:
        SteerlabError: it cannot be written.
    """
    folder = folder or user_profile_folder()
    slug = re.sub(r"[^a-z0-9]+", "-", profile.name.casefold()).strip("-") or "wheel"
    path = folder / f"{slug}-{profile.match.guid}-{profile.match.system}.toml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as fresh:
            fresh.write_text(profile_to_toml(profile), encoding="utf-8")
    except OSError as error:
        raise SteerlabError(
            f"The profile cannot be kept in {folder}: {error.strerror}. Make the folder writable, "
            "or set XDG_CONFIG_HOME."
        ) from error
    return path


def find_profile(
    device: JoystickInfo, profiles: Sequence[StoredProfile], system: str
) -> StoredProfile | None:
    """The profile for ``device`` on ``system``: by GUID, else by vendor, product and axes.

    Of each kind the user's own go before the shipped ones.

    Raises:
        DeviceError: two profiles fit equally well.
    """
    here = [one for one in profiles if one.profile.match.system == system]

    def by_guid(one: StoredProfile) -> bool:
        return one.profile.match.guid == device.guid

    def by_model(one: StoredProfile) -> bool:
        match = one.profile.match
        return (
            match.vendor == device.vendor
            and device.product in match.products
            and match.axes in (0, device.axes)
        )

    rules: tuple[Callable[[StoredProfile], bool], ...] = (by_guid, by_model)
    for rule in rules:
        for shipped in (False, True):
            fitting = [one for one in here if one.shipped is shipped and rule(one)]
            if len(fitting) > 1:
                names = ", ".join(one.file for one in fitting)
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
