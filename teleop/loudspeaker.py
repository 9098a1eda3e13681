"""What a drive sounds like: the engine at its speed, the countdown, and how the drive ended."""

import logging
import os
from typing import Protocol

import numpy as np

from steerlab.sim.rollout import Outcome
from steerlab.teleop import sounds
from steerlab.teleop.screen.contract import DriveView, Page
from steerlab.teleop.sdl import pygame

_log = logging.getLogger(__name__)
_ENGINE_VOLUME, _CUE_VOLUME = 0.25, 0.6
_BUFFER = 512  # samples: 12 ms


class Loudspeaker(Protocol):
    """Hears what is shown.

    Attributes:
        said: ``on``, or ``off: why``; kept with each session, since labels may depend on it.
    """

    said: str

    def drive(self, view: DriveView) -> None:
        """A frame of a drive is shown."""
        ...

    def page(self, page: Page) -> None:
        """A page is shown."""
        ...

    def close(self) -> None:
        """Be silent."""
        ...


def open_loudspeaker(wanted: bool) -> Loudspeaker:
    """The computer's; a silent one, and a notice, where there is no sound device."""
    if not wanted:
        return Silence("off: not wanted")
    os.environ.setdefault("SDL_APP_NAME", "steerlab")
    try:
        pygame.mixer.init(sounds.RATE_HZ, -16, 1, _BUFFER, allowedchanges=0)
    except pygame.error as error:
        _log.warning(
            "No sound, for no sound device can be opened (%s); connect one, or say --no-sound.",
            error,
        )
        return Silence(f"off: no sound device ({error})")
    return Mixer()


class Silence:
    """No sound, and the reason."""

    def __init__(self, said: str) -> None:
        self.said = said

    def drive(self, view: DriveView) -> None:
        """Nothing is heard."""

    def page(self, page: Page) -> None:
        """Nothing is heard."""

    def close(self) -> None:
        """Nothing to end."""


class Mixer:
    """SDL's mixer, which must be open: a channel for each pitch of the engine, and one for cues."""

    def __init__(self) -> None:
        self.said = "on"
        rng = np.random.default_rng(0)
        self._cues = {
            name: _sound(wave, _CUE_VOLUME)
            for name, wave in (
                ("count", sounds.beep(440.0, 0.12)),
                ("go", sounds.beep(880.0, 0.35)),
                (Outcome.BALL_REACHED, sounds.chime((523.3, 659.3, 784.0, 1046.5))),
                (Outcome.BLOCK_HIT, sounds.thud(rng)),
                (Outcome.OUT_OF_BOUNDS, sounds.chime((392.0, 311.1))),
                (Outcome.TIME_LIMIT, sounds.chime((392.0, 311.1))),
                ("done", sounds.chime((392.0, 523.3, 659.3, 784.0))),
            )
        }
        loops = [sounds.engine_loop(hz, rng) for hz in sounds.ENGINE_HZ]
        pygame.mixer.set_num_channels(len(loops) + 1)
        self._cue_channel = pygame.mixer.Channel(len(loops))
        self._engine = [pygame.mixer.Channel(number) for number in range(len(loops))]
        self._volumes = [0.0] * len(loops)
        for channel, wave in zip(self._engine, loops, strict=True):
            channel.set_volume(0.0)
            channel.play(_sound(wave, 1.0), loops=-1)
            channel.set_volume(0.0)  # playing makes a channel loud again
        self._big, self._outcome, self._done = "", Outcome.RUNNING, False

    def drive(self, view: DriveView) -> None:
        """The engine, the countdown's end, and how the drive ended."""
        if self._big == "1":
            self._play("go")
        self._big, self._done = "", False
        if view.outcome is not self._outcome and view.outcome is not Outcome.RUNNING:
            self._play(view.outcome)
        self._outcome = view.outcome
        over = view.outcome is not Outcome.RUNNING
        waiting = 0.5 if over or view.elapsed_s <= 0.0 else 1.0
        mix = sounds.engine_mix(0.0 if over else view.speed_mps)
        self._set_engine([waiting * _ENGINE_VOLUME * share for share in mix])

    def page(self, page: Page) -> None:
        """The countdown's digits, and the end of everything; the engine rests."""
        self._set_engine([0.0] * len(self._engine))
        if page.over_drive and page.big.isdigit() and page.big != self._big:
            self._play("count")
        self._big = page.big
        done = 0 < page.count == page.done and page.tone == "good"
        if done and not self._done:
            self._play("done")
        self._done = done

    def close(self) -> None:
        """Stop every sound; calling it again does nothing."""
        if pygame.mixer.get_init():
            pygame.mixer.quit()

    def _play(self, cue: str) -> None:
        self._cue_channel.play(self._cues[cue])

    def _set_engine(self, volumes: list[float]) -> None:
        for channel, volume, before in zip(self._engine, volumes, self._volumes, strict=True):
            if volume != before:
                channel.set_volume(volume)
        self._volumes = volumes


def _sound(wave: sounds.Wave, volume: float) -> pygame.mixer.Sound:
    samples = np.round(32_767 * np.clip(wave * volume, -1.0, 1.0)).astype(np.int16)
    return pygame.mixer.Sound(buffer=samples.tobytes())
