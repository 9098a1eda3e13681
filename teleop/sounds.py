"""The sounds, made of waves: no file is played."""

from math import pi

import numpy as np
from numpy.typing import NDArray

RATE_HZ = 44_100
Wave = NDArray[np.float64]
"""(samples,) in [-1, 1]."""

ENGINE_HZ = tuple(34.0 * 1.13**step for step in range(12))  # one loop for each pitch
_LOOP_S = 1.0
_RUNS_AT_MPS = 10.0  # at this speed the engine has its highest pitch


def engine_loop(base_hz: float, rng: np.random.Generator) -> Wave:
    """A second of an engine that ends as it begins."""
    t_s = _time(_LOOP_S)
    whole_hz = round(base_hz * _LOOP_S) / _LOOP_S
    hum = np.zeros_like(t_s)
    for harmonic, strength in enumerate((1.0, 0.7, 0.45, 0.5, 0.2, 0.25, 0.1), start=1):
        hum += strength * np.sin(2 * pi * harmonic * whole_hz * t_s + rng.uniform(0.0, 2 * pi))
    rumble = _low_noise(rng, len(t_s), 180.0) * (0.7 + 0.3 * np.sin(2 * pi * whole_hz * t_s))
    return _loud(hum / np.abs(hum).max() + 0.5 * rumble, 0.5)


def engine_mix(speed_mps: float) -> list[float]:
    """How loud each loop is at a speed: the two pitches next to it, blended."""
    at = min(1.0, max(0.0, speed_mps / _RUNS_AT_MPS)) * (len(ENGINE_HZ) - 1)
    return [max(0.0, 1.0 - abs(at - step)) for step in range(len(ENGINE_HZ))]


def beep(hz: float, seconds: float) -> Wave:
    """One step of the countdown, or its end."""
    t_s = _time(seconds)
    fade = np.minimum(1.0, np.minimum(t_s, seconds - t_s) / 0.01)
    return 0.5 * fade * (np.sin(2 * pi * hz * t_s) + 0.2 * np.sin(4 * pi * hz * t_s)) / 1.2


def chime(notes_hz: tuple[float, ...]) -> Wave:
    """Notes one after another that ring on."""
    apart, t_s = round(0.13 * RATE_HZ), _time(0.7)
    note = [np.sin(2 * pi * hz * t_s) * np.exp(-6.0 * t_s) for hz in notes_hz]
    whole = np.zeros(len(t_s) + apart * (len(note) - 1))
    for number, wave in enumerate(note):
        whole[number * apart : number * apart + len(wave)] += wave
    return _loud(whole, 0.55)


def thud(rng: np.random.Generator) -> Wave:
    """The car against a block."""
    t_s = _time(0.6)
    fall = np.sin(2 * pi * (75.0 * t_s - 35.0 * t_s**2)) * np.exp(-7.0 * t_s)
    crash = _low_noise(rng, len(t_s), 1500.0) * np.exp(-16.0 * t_s)
    return _loud(fall + 0.8 * crash, 0.9)


def _time(seconds: float) -> Wave:
    return np.arange(round(seconds * RATE_HZ)) / RATE_HZ


def _low_noise(rng: np.random.Generator, samples: int, below_hz: float) -> Wave:
    waves = np.fft.rfft(rng.standard_normal(samples))
    waves /= 1.0 + (np.fft.rfftfreq(samples, 1.0 / RATE_HZ) / below_hz) ** 2
    noise = np.fft.irfft(waves, samples)
    return noise / np.abs(noise).max()


def _loud(wave: Wave, peak: float) -> Wave:
    return peak * wave / np.abs(wave).max()
