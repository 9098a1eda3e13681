"""Teachers outside the scripted family: what a mapper taught by simulation must survive.

Each quirk changes what a scripted teacher responds to; delay, dead zone, lag, gain, noise and
saturation of its ``TeacherStyle`` follow. No mapper may be trained or tuned on them. There are two
families: ``QUIRKS`` test mappers, ``OUT_OF_FAMILY`` are test teachers of the learner comparison.
Strengths are assumptions: each changes labels by about as much as the population's own styles do.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, pi, sqrt
from typing import Literal, get_args

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher, WholeResponse, stimulus

QuirkKind = Literal["asymmetric", "power", "underdamped", "hold", "lapses"]
QUIRKS: tuple[QuirkKind, ...] = get_args(QuirkKind)
OutOfFamilyKind = Literal["asymmetric", "bang-bang", "dither", "late-braking", "fatigue"]
OUT_OF_FAMILY: tuple[OutOfFamilyKind, ...] = get_args(OutOfFamilyKind)
_QUIRK_NUMBERS: dict[QuirkKind, int] = {
    "asymmetric": 0,
    "power": 1,
    "underdamped": 2,
    "hold": 3,
    "lapses": 4,
}
_FAMILY_NUMBERS: dict[OutOfFamilyKind, int] = {
    "asymmetric": 0,
    "bang-bang": 1,
    "dither": 2,
    "late-braking": 3,
    "fatigue": 4,
}
"""By kind, its number in seeds: whoever adds a kind gives it the next one."""

Quirk = Callable[[FloatArray, float, np.random.Generator], FloatArray]
"""(stimulus (steps,), step_s, rng) -> what the teacher responds to, (steps,)."""

_QUIRK_STREAM = 0x51D  # the quirk's randomness is not the noise's
_FAMILY_STREAM = 0x0DD


@dataclass(frozen=True, kw_only=True)
class AsymmetricGain:
    """Turns left ``exp(log_ratio)`` times as far as right; the mean log gain is the style's."""

    log_ratio: float

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """Left is positive."""
        return stimulus * np.exp(0.5 * self.log_ratio * np.sign(stimulus))


@dataclass(frozen=True, kw_only=True)
class PowerGain:
    """Responds to ``|o|^exponent`` (Stevens, *Psychological Review* 1957); 1 stays 1."""

    exponent: float

    def __post_init__(self) -> None:
        if self.exponent <= 0.0:
            raise InvalidConfig(f"PowerGain.exponent is {self.exponent}; it must be positive.")

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """Odd in the stimulus."""
        return np.sign(stimulus) * np.abs(stimulus) ** self.exponent


@dataclass(frozen=True, kw_only=True)
class UnderdampedHand:
    """A second-order hand that overshoots and rings; its gain at rest is 1."""

    natural_hz: float
    damping: float

    def __post_init__(self) -> None:
        if self.natural_hz <= 0.0 or not 0.0 < self.damping < 1.0:
            raise InvalidConfig(
                f"{self} is no underdamped hand; give a positive frequency and 0 < damping < 1."
            )

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """Exact for a stimulus held over each step; starts settled."""
        from scipy.signal import lfilter

        decay = exp(-2.0 * pi * self.natural_hz * self.damping * step_s)
        swing = 2.0 * pi * self.natural_hz * sqrt(1.0 - self.damping**2) * step_s
        ratio = self.damping / sqrt(1.0 - self.damping**2)
        poles = [1.0, -2.0 * decay * np.cos(swing), decay**2]
        first = 1.0 - decay * (np.cos(swing) + ratio * np.sin(swing))
        second = decay**2 + decay * (ratio * np.sin(swing) - np.cos(swing))
        settled = stimulus[0]
        hand = lfilter([0.0, first, second], poles, stimulus - settled)
        return np.asarray(hand, dtype=np.float64) + settled


@dataclass(frozen=True, kw_only=True)
class SampleAndHold:
    """Looks every ``period_s`` and holds in between (Craik's intermittent operator, 1947)."""

    period_s: float

    def __post_init__(self) -> None:
        if self.period_s <= 0.0:
            raise InvalidConfig(f"SampleAndHold.period_s is {self.period_s}; it must be positive.")

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """The first look is at a random moment of the first period."""
        t_s = np.arange(len(stimulus)) * step_s + self.period_s * rng.uniform()
        look = np.floor(t_s / self.period_s)
        first = np.r_[True, look[1:] != look[:-1]]
        return stimulus[np.maximum.accumulate(np.where(first, np.arange(len(stimulus)), 0))]


@dataclass(frozen=True, kw_only=True)
class Lapses:
    """Now and then looks away and leaves the wheel where it is."""

    per_minute: float
    length_s: float

    def __post_init__(self) -> None:
        if self.per_minute < 0.0 or self.length_s <= 0.0:
            raise InvalidConfig(f"{self} is no rate of lapses; give a rate >= 0 and a length > 0.")

    def __call__(self, stimulus: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
        """Lapses begin at random (Poisson); lengths are within ±50 % of ``length_s``."""
        steps = len(stimulus)
        begins = np.flatnonzero(rng.random(steps) < self.per_minute / 60.0 * step_s)
        held = np.arange(steps)
        for begin in begins:
            length = round(self.length_s * rng.uniform(0.5, 1.5) / step_s)
            held[begin : begin + length] = held[begin]
        return stimulus[held]


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


@dataclass
class UnusualTeacher:
    """A ``Teacher``: a scripted one that responds to a changed stimulus.

    Attributes:
        scripted: what follows the quirk; its name is the pseudonym.
        quirk: what is unusual.
    """

    scripted: ScriptedTeacher
    quirk: Quirk

    def __post_init__(self) -> None:
        self.name = self.scripted.name
        self._response = WholeResponse(self.name)

    def begin(self, rollout: Rollout, *, order: int, attempt: int) -> None:
        """Compute the whole response to ``rollout``, the ``order``-th of the session."""
        self._response.begin(self.respond(rollout, order=order, attempt=attempt))

    def label(self, step: int) -> float | None:
        """The label for ``step`` of the rollout last begun.

        Raises:
            TeacherNotReady: ``begin`` was not called, or the rollout has no such step.
        """
        return self._response.label(step)

    def respond(self, rollout: Rollout, *, order: int, attempt: int) -> FloatArray:
        """Labels for all steps, shape (steps,), within ±``WHEEL_LIMIT``.

        Raises:
            InvalidConfig: the rollout has no oracle label, or a number is negative.
        """
        if not rollout.oracle_valid.any() or attempt < 0:
            return self.scripted.respond(
                rollout, order=order, attempt=attempt
            )  # says what is wrong
        entropy = self.scripted.noise_seed(rollout.name, attempt).generate_state(4)
        rng = np.random.default_rng([_QUIRK_STREAM, *entropy.tolist()])
        seen = self.quirk(stimulus(rollout), 1.0 / rollout.control_hz, rng)
        everywhere = np.ones_like(rollout.oracle_valid)
        changed = replace(rollout, oracle_label=seen, oracle_valid=everywhere)
        return self.scripted.respond(changed, order=order, attempt=attempt)


def sample_unusual(
    quirk: QuirkKind, kind: PopulationKind, count: int, seed: int, *, prefix: str
) -> list[UnusualTeacher]:
    """Draw ``count`` teachers of ``kind`` and give each a quirk of its own strength.

    Raises:
        InvalidConfig: unknown ``quirk``, or see ``sample_population``.
    """
    if quirk not in QUIRKS:
        raise InvalidConfig(f"No quirk {quirk!r}; choose one of {', '.join(QUIRKS)}.")
    scripted = sample_population(kind, count, seed, prefix=prefix)
    root = np.random.SeedSequence([_QUIRK_STREAM, seed, _QUIRK_NUMBERS[quirk], *prefix.encode()])
    return [
        UnusualTeacher(teacher, _draw_quirk(quirk, np.random.default_rng(child)))
        for teacher, child in zip(scripted, root.spawn(count), strict=True)
    ]


def _draw_quirk(kind: QuirkKind, rng: np.random.Generator) -> Quirk:
    """Strengths that change labels by about as much as the population's own styles do."""
    side = float(rng.choice((-1.0, 1.0)))
    if kind == "asymmetric":
        return AsymmetricGain(log_ratio=side * float(rng.uniform(0.3, 0.9)))
    if kind == "power":
        return PowerGain(exponent=float(np.exp(side * rng.uniform(0.2, 0.6))))
    if kind == "underdamped":
        return UnderdampedHand(
            natural_hz=float(rng.uniform(0.8, 2.0)), damping=float(rng.uniform(0.15, 0.5))
        )
    if kind == "hold":
        return SampleAndHold(period_s=float(rng.uniform(0.25, 0.7)))
    return Lapses(per_minute=float(rng.uniform(5.0, 15.0)), length_s=float(rng.uniform(0.6, 1.4)))


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
    root = np.random.SeedSequence([_FAMILY_STREAM, seed, _FAMILY_NUMBERS[family], *prefix.encode()])
    return [
        UnusualTeacher(teacher, _draw_family(family, np.random.default_rng(child)))
        for teacher, child in zip(scripted, root.spawn(count), strict=True)
    ]


def _draw_family(family: OutOfFamilyKind, rng: np.random.Generator) -> Quirk:
    if family == "bang-bang":
        return BangBang(level=float(rng.uniform(0.8, 1.6)), threshold=float(rng.uniform(0.15, 0.4)))
    if family == "dither":
        return Dither(
            amplitude=float(rng.uniform(0.3, 0.8)), frequency_hz=float(rng.uniform(0.5, 1.5))
        )
    if family == "late-braking":
        return LateBraking(release_s=float(rng.uniform(0.3, 0.9)))
    return Fatigue(half_life_s=float(rng.uniform(6.0, 15.0)))
