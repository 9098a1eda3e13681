"""Which monitors there are, which one is meant, and which one was meant before."""

import ctypes
import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from steerlab.sim.errors import SteerlabError, shown
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.structured import toml_values, utf8_text
from steerlab.sim.files.whole_file import whole_file
from steerlab.teleop.devices.contract import DeviceError
from steerlab.teleop.devices.profile_folder import user_profile_folder
from steerlab.teleop.devices.virtual import mapped_sdl
from steerlab.teleop.sdl import pygame

_log = logging.getLogger(__name__)


class NoMonitor(SteerlabError):
    """No monitor has that number or name, or several have."""


@dataclass(frozen=True, slots=True)
class Monitor:
    """One that is plugged in; ``number`` counts from 0."""

    number: int
    name: str
    size_px: tuple[int, int]

    def __str__(self) -> str:
        return f"{self.number} ({self.name}, {self.size_px[0]}x{self.size_px[1]})"


def monitors() -> list[Monitor]:
    """Those of this computer; SDL's display must be open. Names are known on Linux only."""
    sizes = pygame.display.get_desktop_sizes()
    try:
        named = mapped_sdl().SDL_GetDisplayName
    except DeviceError:  # pygame itself tells no names
        return [Monitor(number, "no name", size) for number, size in enumerate(sizes)]
    named.restype = ctypes.c_char_p
    return [
        Monitor(number, (named(number) or b"no name").decode(errors="replace"), size)
        for number, size in enumerate(sizes)
    ]


def find_monitor(said: str, there: Sequence[Monitor]) -> Monitor:
    """The monitor with that number, that name, or the only one with that in its name.

    Raises:
        NoMonitor: there is none, or there are several.
    """
    word = said.strip().casefold()
    for fits in (
        [one for one in there if word == str(one.number)],
        [one for one in there if word == one.name.casefold()],
        [one for one in there if word and word in one.name.casefold()],
    ):
        if len(fits) == 1:
            return fits[0]
        if fits:
            raise NoMonitor(
                f"Several monitors are called {shown(said)}: {_list(fits)}. Give a number."
            )
    raise NoMonitor(f"No monitor {shown(said)} here; there is {_list(there)}.")


def choose_monitor(said: str) -> Monitor:
    """The monitor that was said, and is kept for next time; else the one that was kept; else the first.

    Raises:
        NoMonitor: it is not there.
        InvalidConfig: the file in which it was kept is damaged.
    """
    there, kept = monitors(), _kept_in()
    if said:
        monitor = find_monitor(said, there)
        _keep(said, kept)
        return monitor
    if kept is not None and kept.exists():
        before = str(toml_values(utf8_text(kept), str(kept)).get("monitor", ""))
        try:
            return find_monitor(before, there)
        except NoMonitor as error:
            raise NoMonitor(
                f"{error} It was chosen before ({kept}); choose another: --monitor 0."
            ) from None
    if len(there) > 1:
        _log.warning(
            "The window is on the first of these monitors: %s. Choose once: --monitor NUMBER or NAME.",
            _list(there),
        )
    return there[0]


def _list(there: Sequence[Monitor]) -> str:
    return " and ".join(map(str, there))


def _kept_in() -> Path | None:
    """Next to the wheels' profiles; None where a user has no home."""
    try:
        return user_profile_folder().parent / "monitor.toml"
    except DeviceError:
        return None


def _keep(said: str, path: Path | None) -> None:
    if path is None:
        _log.warning("The monitor is not remembered, since there is no home folder; set HOME.")
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as fresh:
            fresh.write_text(f"monitor = {json.dumps(said)}\n", encoding="utf-8")
    except OSError as error:
        why = refusal(error, "make the folder writable")
        _log.warning("The monitor is not remembered in %s: %s.", path, why)
