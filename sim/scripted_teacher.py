"""Scripted teachers: known styles that turn oracle labels into a person's labels."""

from dataclasses import dataclass
from hashlib import sha256
from math import exp, isfinite

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.rollout import Rollout
from steerlab.sim.sparse_correction import correcting
from steerlab.sim.vehicle import WHEEL_LIMIT


class TeacherNotReady(SteerlabError, RuntimeError):
    """A label was asked for before ``begin``, or for a step the rollout does not have."""


@dataclass(frozen=True, kw_only=True)
class TeacherStyle:
    """How a teacher departs from the oracle; the parameters are the truth of a simulated study.

    In this order: shift by ``delay_s``, dead zone, first-order lag, gain, bias, noise, saturation
    at ±``WHEEL_LIMIT``. Times are in seconds, so a style means the same at any control rate.

    With a ``tolerance``, they correct only while the robot was wrong ``delay_s`` ago
    (``sparse_correction``). They take the wheel up with their lag, and let go at once: it centres
    itself. Its label is then 0, a wheel that is there and centred, and not None, no wheel at all.

    Attributes:
        gain: above 1 over-corrects, below 1 under-corrects.
        delay_s: positive labels late; negative previews. Fractions of a step are interpolated.
        lag_s: time constant of the first-order neuromuscular lag.
        dead_zone: stimuli up to this wheel position are ignored, larger ones reduced by it.
        constant_noise: standard deviation of the label noise at rest, in wheel units.
        signal_noise: standard deviation of the noise per wheel unit intended.
        noise_time_s: correlation time of the noise; 0 is white.
        bias: added to every label.
        drift: change of log gain with each rollout of the session.
        tolerance: how far, in wheel units, the robot's wheel may be from the oracle label before
            they correct; 0 always corrects.
    """

    gain: float = 1.0
    delay_s: float = 0.0
    lag_s: float = 0.0
    dead_zone: float = 0.0
    constant_noise: float = 0.0
    signal_noise: float = 0.0
    noise_time_s: float = 0.0
    bias: float = 0.0
    drift: float = 0.0
    tolerance: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not isfinite(value):
                raise InvalidConfig(f"TeacherStyle.{name} is {value}; it must be finite.")
        if self.gain <= 0.0:
            raise InvalidConfig(f"TeacherStyle.gain is {self.gain}; it must be positive.")
        for name in (
            "lag_s",
            "dead_zone",
            "constant_noise",
            "signal_noise",
            "noise_time_s",
            "tolerance",
        ):
            if getattr(self, name) < 0.0:
                raise InvalidConfig(
                    f"TeacherStyle.{name} is {getattr(self, name)}; it must not be negative."
                )


class WholeResponse:
    """Hands out, step by step, labels that were computed for a whole rollout at once.

    Args:
        teacher: the pseudonym, for errors.
    """

    def __init__(self, teacher: str) -> None:
        self._teacher = teacher
        self._labels: FloatArray | None = None

    def begin(self, labels: FloatArray) -> None:
        """Answer from ``labels``, (steps,), until the next call."""
        self._labels = labels

    def label(self, step: int) -> float:
        """The label for ``step`` of the rollout last begun.

        Raises:
            TeacherNotReady: ``begin`` was not called, or the rollout has no such step.
        """
        if self._labels is None:
            raise TeacherNotReady(
                f"{self._teacher} has no rollout; call begin(rollout, ...) first."
            )
        if not 0 <= step < len(self._labels):
            raise TeacherNotReady(
                f"{self._teacher}: step {step} is outside the rollout's 0..{len(self._labels) - 1}."
            )
        return float(self._labels[step])


@dataclass
class ScriptedTeacher:
    """A ``Teacher`` with a known style.

    Offline it sees the whole rollout: a negative delay reads the rollout's actual future.

    Attributes:
        name: the pseudonym; part of the noise seed, so two teachers never share noise.
        seed: entropy of the noise. The noise of a rollout depends on (seed, name, rollout name,
            attempt) alone, never on the order of calls.
    """

    name: str
    style: TeacherStyle
    seed: int

    def __post_init__(self) -> None:
        if not self.name:
            raise InvalidConfig("A teacher's name is empty; give a pseudonym such as 'seen-007'.")
        if self.seed < 0:
            raise InvalidConfig(f"{self.name}: seed is {self.seed}; give a non-negative integer.")
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
            InvalidConfig: the rollout has no oracle label to respond to, or ``order`` or
                ``attempt`` is negative.
        """
        if order < 0 or attempt < 0:
            raise InvalidConfig(
                f"{self.name}: order {order} and attempt {attempt} must not be negative."
            )
        style = self.style
        step_s = 1.0 / rollout.control_hz
        truth = stimulus(rollout)
        active = np.ones(rollout.steps, dtype=np.bool_)
        if style.tolerance > 0.0:
            difference = _shift(truth - rollout.robot_wheel, style.delay_s, step_s)
            active = correcting(difference, style.tolerance)
        seen = np.where(active, _shift(truth, style.delay_s, step_s), 0.0)
        seen = np.sign(seen) * np.maximum(np.abs(seen) - style.dead_zone, 0.0)
        intended = style.gain * exp(style.drift * order) * _lag(seen, style.lag_s, step_s)
        intended += style.bias
        noise_std = style.constant_noise + style.signal_noise * np.abs(intended)
        rng = np.random.default_rng(self.noise_seed(rollout.name, attempt))
        noise = noise_std * _coloured_noise(rng, rollout.steps, style.noise_time_s, step_s)
        label = np.clip(intended + noise, -WHEEL_LIMIT, WHEEL_LIMIT)
        return np.where(active, label, 0.0)

    def noise_seed(self, rollout_name: str, attempt: int) -> np.random.SeedSequence:
        """The seed of the noise on one attempt at one rollout."""
        return np.random.SeedSequence(
            [self.seed, *_words(self.name), *_words(rollout_name), attempt]
        )


def _words(text: str) -> list[int]:
    """128 bits of entropy from a name, the same in every process."""
    digest = sha256(text.encode()).digest()
    return [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]


def stimulus(rollout: Rollout) -> FloatArray:
    """What the teacher responds to: a person bridges masked steps; the data stay masked."""
    valid = rollout.oracle_valid
    if not valid.any():
        raise InvalidConfig(
            f"Rollout {rollout.name!r} has no valid oracle label; a scripted teacher needs one."
        )
    steps = np.arange(rollout.steps, dtype=np.float64)
    return np.interp(steps, steps[valid], rollout.oracle_label[valid])


def _shift(signal: FloatArray, delay_s: float, step_s: float) -> FloatArray:
    """``signal(t - delay_s)``, linear between steps; the first and last value hold outside."""
    steps = np.arange(len(signal), dtype=np.float64)
    return np.interp(steps - delay_s / step_s, steps, signal)


def _lag(signal: FloatArray, lag_s: float, step_s: float) -> FloatArray:
    """First-order lag, starting settled; exact for a signal linear between steps.

    Exactness makes the response independent of the control rate up to interpolation.
    """
    if lag_s == 0.0:
        return signal.copy()
    from scipy.signal import lfilter

    decay = exp(-step_s / lag_s)
    now = 1.0 - (1.0 - decay) * lag_s / step_s
    before = 1.0 - decay - now
    settled = (before + decay) * signal[0]
    lagged, _ = lfilter([now, before], [1.0, -decay], signal, zi=[settled])
    return np.asarray(lagged, dtype=np.float64)


def _coloured_noise(
    rng: np.random.Generator, steps: int, correlation_s: float, step_s: float
) -> FloatArray:
    """Stationary AR(1) noise of unit variance with the given correlation time, (steps,)."""
    white = rng.standard_normal(steps)
    if correlation_s == 0.0:
        return white
    from scipy.signal import lfilter

    decay = exp(-step_s / correlation_s)
    innovations = white * np.sqrt(1.0 - decay**2)
    innovations[0] = white[0]
    return np.asarray(lfilter([1.0], [1.0, -decay], innovations), dtype=np.float64)
