"""Simulated teachers for pre-training: the scripted family, its ranges widened, many at once.

The structure is that of ``sim/scripted_teacher.py`` (delay, dead zone, lag, gain, bias, coloured
signal-dependent noise, drift, saturation) plus what makes a model robust: a second lag, and gain
and delay that wander within a rollout. What ``sim/unusual_teachers.py`` tests with is left out on
purpose: asymmetric or power-law gain, an underdamped hand, sample-and-hold, lapses.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steerlab.learning.pretrained.style import SIGNED, STYLE_SIZE
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT

STYLE = ("log_gain", "delay_s", "lag_s", "dead_zone", "bias", "log_noise", "noise_time_s")
"""What a network could at best know of a teacher; the first two are what studies report."""
_CENTRE = np.array([0.0, 0.12, 0.15, 0.1, 0.0, np.log(0.17), 0.2])  # by ``STYLE``
_SPREAD = np.array([0.45, 0.22, 0.06, 0.1, 0.1, 0.6, 0.08])
_SLOTS = [0, 1, 2, 3, SIGNED[0], 4, 5]
_SESSION_ROLLOUTS = 12


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PretrainingDrive:
    """The truth of a rollout and the car's own motion.

    Attributes:
        truth: (steps,) oracle labels, all valid.
        motion: (steps, 3) yaw_rate_radps, speed_mps, robot_wheel, as ``series.CONTEXT``.
    """

    truth: FloatArray
    motion: FloatArray

    @classmethod
    def from_rollout(cls, rollout: Rollout) -> "PretrainingDrive":
        """What a mapper may know of a rollout.

        Raises:
            InvalidConfig: a step has no oracle label.
        """
        if not rollout.oracle_valid.all():
            raise InvalidConfig(f"Rollout {rollout.name!r} has steps without a label; drop it.")
        motion = np.column_stack(
            [rollout.velocity[:, 2], rollout.velocity[:, 0], rollout.robot_wheel]
        )
        return cls(truth=rollout.oracle_label, motion=motion)

    def mirrored(self) -> "PretrainingDrive":
        """Left and right exchanged; speed keeps its sign."""
        return PretrainingDrive(truth=-self.truth, motion=self.motion * np.array([-1.0, 1.0, -1.0]))


@dataclass(frozen=True, kw_only=True)
class TeacherRanges:
    """How simulated teachers are drawn; times in seconds, labels in wheel units.

    Noise, dead zone, bias and drift grow together with a level drawn for each teacher: 0 is
    execution noise alone, 1 a distracted novice.

    Attributes:
        log_gain_std, delay_mean_s, delay_std_s: normal, wider than any population studied.
        constant_noise, signal_noise, dead_zone, bias_std, drift_std: at level 0 and at level 1.
        wandering: share of teachers whose gain and delay wander, and who have a second lag.
    """

    log_gain_std: float = 0.5
    delay_mean_s: float = 0.12
    delay_std_s: float = 0.26
    lag_s: tuple[float, float] = (0.03, 0.28)
    constant_noise: tuple[float, float] = (0.02, 0.16)
    signal_noise: tuple[float, float] = (0.07, 0.42)
    log_noise_std: float = 0.35
    noise_time_s: tuple[float, float] = (0.06, 0.36)
    dead_zone: tuple[float, float] = (0.05, 0.32)
    bias_std: tuple[float, float] = (0.05, 0.15)
    drift_std: tuple[float, float] = (0.005, 0.02)
    wandering: float = 0.35
    wander_log_gain: float = 0.2
    wander_delay_s: float = 0.06
    wander_time_s: float = 2.5
    second_lag_s: float = 0.15


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SimulatedStudy:
    """Labels of ``people`` simulated teachers for a few drives each, padded to one length.

    Attributes:
        label: (people, rollouts, samples) within ±``WHEEL_LIMIT``; held beyond the end.
        truth: (people, rollouts, samples); held beyond the end.
        motion: (people, rollouts, samples, 3); see ``PretrainingDrive.motion``.
        present: (people, rollouts, samples) False beyond the end.
        style: (people, len(STYLE)).
    """

    label: NDArray[np.float32]
    truth: NDArray[np.float32]
    motion: NDArray[np.float32]
    present: BoolArray
    style: FloatArray


def simulate_study(
    drives: list[PretrainingDrive],
    people: int,
    rollouts: int,
    rate_hz: float,
    rng: np.random.Generator,
    ranges: TeacherRanges | None = None,
) -> SimulatedStudy:
    """Every teacher labels ``rollouts`` drives, drawn with their mirror images."""
    ranges = ranges or TeacherRanges()
    pool = drives + [drive.mirrored() for drive in drives]
    samples = max(len(drive.truth) for drive in drives)
    lengths = np.array([len(drive.truth) for drive in pool])
    truths = np.stack([_held(drive.truth, samples) for drive in pool])
    motions = np.stack([_held(drive.motion, samples) for drive in pool])
    choice = np.stack([rng.choice(len(pool), rollouts, replace=False) for _ in range(people)])
    style, label = _labels(truths[choice], rate_hz, rng, ranges)
    return SimulatedStudy(
        label=label.astype(np.float32),
        truth=truths[choice].astype(np.float32),
        motion=motions[choice].astype(np.float32),
        present=np.arange(samples) < lengths[choice][..., None],
        style=style,
    )


def _labels(
    truth: FloatArray, rate_hz: float, rng: np.random.Generator, ranges: TeacherRanges
) -> tuple[FloatArray, FloatArray]:
    """Draw teachers and have them label: truth (people, rollouts, samples) -> style, labels."""
    people, rollouts, samples = truth.shape
    level = rng.uniform(-0.1, 1.0, people)

    def each(low_high: tuple[float, float]) -> FloatArray:
        return rng.uniform(*low_high, people)

    def at_level(low_high: tuple[float, float]) -> FloatArray:
        return low_high[0] * (low_high[1] / low_high[0]) ** level

    wanders = rng.random(people) < ranges.wandering
    log_gain = rng.normal(0.0, ranges.log_gain_std, people)
    delay_s = rng.normal(ranges.delay_mean_s, ranges.delay_std_s, people)
    lag_s = each(ranges.lag_s)
    second_lag_s = wanders * each((0.0, ranges.second_lag_s))
    dead_zone = rng.random(people) * at_level(ranges.dead_zone)
    bias = rng.normal(0.0, 1.0, people) * at_level(ranges.bias_std)
    drift = rng.normal(0.0, 1.0, people) * at_level(ranges.drift_std)
    noise_factor = np.exp(rng.normal(0.0, ranges.log_noise_std, people))
    noise_time_s = each(ranges.noise_time_s)

    def column(values: FloatArray) -> FloatArray:
        return np.asarray(values)[:, None, None]

    def wander(std: float) -> FloatArray:
        noise = _coloured(rng, truth.shape, np.full(people, ranges.wander_time_s), rate_hz)
        return column(wanders * std * rng.uniform(0.0, 1.0, people)) * noise

    shift = (column(delay_s) + wander(ranges.wander_delay_s)) * rate_hz
    seen = _read_at(truth, np.arange(samples) - shift)
    seen = np.sign(seen) * np.maximum(np.abs(seen) - column(dead_zone), 0.0)
    hand = _lagged(_lagged(seen, lag_s, rate_hz), second_lag_s, rate_hz)
    order = rng.integers(_SESSION_ROLLOUTS, size=(people, rollouts))
    log_factor = log_gain[:, None] + drift[:, None] * order
    intended = np.exp(log_factor[..., None] + wander(ranges.wander_log_gain)) * hand + column(bias)
    constant, signal = (
        column(noise_factor * at_level(part))
        for part in (ranges.constant_noise, ranges.signal_noise)
    )
    noise = (constant + signal * np.abs(intended)) * _coloured(
        rng, truth.shape, noise_time_s, rate_hz
    )
    label = np.clip(intended + noise, -WHEEL_LIMIT, WHEEL_LIMIT)
    log_noise = np.log(noise_factor * at_level(ranges.signal_noise))
    total_lag_s = lag_s + second_lag_s
    style = [log_gain, delay_s, total_lag_s, dead_zone, bias, log_noise, noise_time_s]
    return np.stack(style, axis=1), label


def _held(values: FloatArray, samples: int) -> FloatArray:
    return values[np.minimum(np.arange(samples), len(values) - 1)]


def _read_at(signal: FloatArray, position: FloatArray) -> FloatArray:
    """``signal`` at fractional samples, linear between, its ends held."""
    last = signal.shape[-1] - 1
    position = np.clip(position, 0.0, last)
    below = np.minimum(position.astype(np.int64), last - 1)
    low = np.take_along_axis(signal, below, axis=-1)
    high = np.take_along_axis(signal, below + 1, axis=-1)
    return low + (position - below) * (high - low)


def _lagged(signal: FloatArray, lag_s: FloatArray, rate_hz: float) -> FloatArray:
    """First-order lag of each person, exact for a signal linear between samples."""
    per_step = np.maximum(lag_s * rate_hz, 1e-3)
    decay = np.exp(-1.0 / per_step)
    now = (1.0 - (1.0 - decay) * per_step)[:, None]
    decay = decay[:, None]
    before = 1.0 - decay - now
    lagged = np.empty_like(signal)
    state = lagged[..., 0] = signal[..., 0]
    for sample in range(1, signal.shape[-1]):
        state = decay * state + now * signal[..., sample] + before * signal[..., sample - 1]
        lagged[..., sample] = state
    return lagged


def _coloured(
    rng: np.random.Generator, shape: tuple[int, ...], time_s: FloatArray, rate_hz: float
) -> FloatArray:
    """Stationary AR(1) noise of unit variance, (people, rollouts, samples)."""
    decay = np.exp(-1.0 / (time_s * rate_hz))[:, None]
    noise = rng.standard_normal(shape)
    fresh = np.sqrt(1.0 - decay**2)
    for sample in range(1, shape[-1]):
        noise[..., sample] = decay * noise[..., sample - 1] + fresh * noise[..., sample]
    return noise


def known_style(parameters: FloatArray) -> FloatArray:
    """True parameters (..., len(STYLE)) in the place of w, (..., STYLE_SIZE)."""
    style = np.zeros((*parameters.shape[:-1], STYLE_SIZE))
    style[..., _SLOTS] = (parameters - _CENTRE) / _SPREAD
    return style


def known_readout() -> FloatArray:
    """The inverse of ``known_style`` as a linear readout, (1 + STYLE_SIZE, len(STYLE))."""
    readout = np.zeros((1 + STYLE_SIZE, len(STYLE)))
    readout[0] = _CENTRE
    for column, slot in enumerate(_SLOTS):
        readout[1 + slot, column] = _SPREAD[column]
    return readout
