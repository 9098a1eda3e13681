"""More quirks that no mapper is trained on, for test teachers outside the scripted family.

Like those of ``unusual_teachers``, a quirk changes what a scripted teacher responds to. Strengths
are assumptions: each changes labels by about as much as the population's own styles do.
"""

from dataclasses import dataclass
from math import pi
from typing import Literal, get_args

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.unusual_teachers import Quirk, UnusualTeacher, sample_unusual

OutOfFamilyKind = Literal["asymmetric", "bang-bang", "dither", "late-braking", "fatigue"]
OUT_OF_FAMILY: tuple[OutOfFamilyKind, ...] = get_args(OutOfFamilyKind)
_NUMBERS: dict[OutOfFamilyKind, int] = {
    "asymmetric": 0,
    "bang-bang": 1,
    "dither": 2,
    "late-braking": 3,
    "fatigue": 4,
}
"""By kind, its number in seeds: whoever adds a kind gives it the next one."""
_STREAM = 0x0DD


@dataclass(frozen=True, kw_only=True)
class BangBang:
    """Turns fully one way, fully the other, or not at all: a relay with a dead band."""

    level: float
    threshold: float

    def __post_init__(self) -> None:
        if self.level <= 0.0 or self.threshold < 0.0:
            raise InvalidConfig(f"{self} is no relay; give level > 0 and threshold >= 0.")

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """0, or ±``level``."""
        return np.where(np.abs(stimulus) > self.threshold, self.level * np.sign(stimulus), 0.0)


@dataclass(frozen=True, kw_only=True)
class Dither:
    """Wriggles the wheel about where it should be, as some drivers do to feel the road."""

    amplitude: float
    frequency_hz: float

    def __post_init__(self) -> None:
        if self.amplitude < 0.0 or self.frequency_hz <= 0.0:
            raise InvalidConfig(f"{self} is no dither; give amplitude >= 0 and a frequency > 0.")

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """A sine of random phase on top."""
        t_s = np.arange(len(stimulus)) * step_s
        return stimulus + self.amplitude * np.sin(
            2.0 * pi * (self.frequency_hz * t_s + rng.uniform())
        )


@dataclass(frozen=True, kw_only=True)
class LateBraking:
    """Begins a correction in time but ends it late: the wheel comes back slowly."""

    release_s: float

    def __post_init__(self) -> None:
        if self.release_s <= 0.0:
            raise InvalidConfig(f"LateBraking.release_s is {self.release_s}; it must be positive.")

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """Outwards at once; inwards with time constant ``release_s``."""
        keep = float(np.exp(-step_s / self.release_s))
        hand, now = np.empty_like(stimulus), float(stimulus[0])
        for step, wanted in enumerate(stimulus.tolist()):
            outwards = wanted * now >= 0.0 and abs(wanted) >= abs(now)
            now = wanted if outwards else wanted + keep * (now - wanted)
            hand[step] = now
        return hand


@dataclass(frozen=True, kw_only=True)
class Fatigue:
    """Corrects less and less within a drive, and is fresh again in the next."""

    half_life_s: float

    def __post_init__(self) -> None:
        if self.half_life_s <= 0.0:
            raise InvalidConfig(f"Fatigue.half_life_s is {self.half_life_s}; it must be positive.")

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """The gain halves every ``half_life_s``."""
        t_s = np.arange(len(stimulus)) * step_s
        return stimulus * np.exp2(-t_s / self.half_life_s)


def sample_out_of_family(
    family: OutOfFamilyKind, kind: PopulationKind, count: int, seed: int, *, prefix: str
) -> list[UnusualTeacher]:
    """Draw ``count`` teachers of ``kind`` and give each the quirk in a strength of its own.

    Raises:
        InvalidConfig: unknown ``family``, or see ``sample_population``.
    """
    if family not in OUT_OF_FAMILY:
        raise InvalidConfig(f"No family {family!r}; choose one of {', '.join(OUT_OF_FAMILY)}.")
    if family == "asymmetric":
        return sample_unusual("asymmetric", kind, count, seed, prefix=prefix)
    scripted = sample_population(kind, count, seed, prefix=prefix)
    root = np.random.SeedSequence([_STREAM, seed, _NUMBERS[family], *prefix.encode()])
    return [
        UnusualTeacher(teacher, _draw(family, np.random.default_rng(child)))
        for teacher, child in zip(scripted, root.spawn(count), strict=True)
    ]


def _draw(family: OutOfFamilyKind, rng: np.random.Generator) -> Quirk:
    if family == "bang-bang":
        return BangBang(level=float(rng.uniform(0.8, 1.6)), threshold=float(rng.uniform(0.15, 0.4)))
    if family == "dither":
        return Dither(
            amplitude=float(rng.uniform(0.3, 0.8)), frequency_hz=float(rng.uniform(0.5, 1.5))
        )
    if family == "late-braking":
        return LateBraking(release_s=float(rng.uniform(0.3, 0.9)))
    return Fatigue(half_life_s=float(rng.uniform(6.0, 15.0)))
