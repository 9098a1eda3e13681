"""Random truths to pre-train on, beside drives: sums of sines, filtered noise, steps, bursts.

People are asked to follow more than roads: what a mapper learns only from our drives' truths it does
not know of anybody's else. With each truth comes a robot that follows it more or less well, since
people who correct only what they dislike look at the robot.
"""

from dataclasses import dataclass

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

_KINDS = 4  # of ``random_truths``


@dataclass(frozen=True, kw_only=True)
class ProcessRanges:
    """How random truths and robots are drawn; frequencies in Hz, times in s.

    Attributes:
        log_size: mean and standard deviation of the log of a truth's root mean square.
        saturating: share of truths that are enlarged until they often reach the wheel's limit.
        slowest_hz, fastest_hz: of the sines; the roll-off of their amplitudes is drawn from 0 to
            ``steepest`` (power of the frequency).
        noise_time_s: correlation time of filtered noise.
        step_s: mean time between steps.
        robot_error: standard deviation of a robot's error, in root mean squares of the truth.
        strange_robots: share of robots that do not follow the truth at all.
    """

    log_size: tuple[float, float] = (-0.2, 0.6)
    saturating: float = 0.15
    slowest_hz: float = 0.03
    fastest_hz: float = 2.0
    steepest: float = 2.0
    noise_time_s: tuple[float, float] = (0.1, 2.5)
    step_s: tuple[float, float] = (0.7, 4.0)
    robot_error: tuple[float, float] = (0.1, 1.2)
    robot_error_time_s: tuple[float, float] = (0.3, 3.0)
    strange_robots: float = 0.2


def random_truths(
    people: int,
    rollouts: int,
    samples: int,
    rate_hz: float,
    rng: np.random.Generator,
    ranges: ProcessRanges,
) -> FloatArray:
    """Truths (people, rollouts, samples) within ±``WHEEL_LIMIT``; a person's are of one kind."""
    kind = rng.integers(_KINDS, size=people)
    truth = np.empty((people, rollouts, samples))
    for number, made in enumerate((_sines, _noise, _steps, _bursts)):
        chosen = kind == number
        if chosen.any():
            truth[chosen] = made(int(chosen.sum()), rollouts, samples, rate_hz, rng, ranges)
    size = np.sqrt(np.square(truth).mean(axis=(1, 2), keepdims=True)) + 1e-6
    wanted = np.exp(rng.normal(*ranges.log_size, size=(people, 1, 1)))
    wanted *= np.where(rng.random((people, 1, 1)) < ranges.saturating, 3.0, 1.0)
    return np.clip(truth / size * wanted, -WHEEL_LIMIT, WHEEL_LIMIT)


def robot_motion(
    truth: FloatArray, rate_hz: float, rng: np.random.Generator, ranges: ProcessRanges
) -> FloatArray:
    """Yaw rate, speed and wheel of a robot that follows ``truth`` more or less, (..., samples, 3)."""
    people, rollouts = truth.shape[:2]
    size = np.sqrt(np.square(truth).mean(axis=(1, 2), keepdims=True)) + 1e-6
    error_time_s = rng.uniform(*ranges.robot_error_time_s, people)
    error = size * rng.uniform(*ranges.robot_error, (people, 1, 1))
    error = error * coloured(rng, truth.shape, error_time_s, rate_hz)
    strange = rng.random((people, 1, 1)) < ranges.strange_robots
    other = np.roll(truth, rollouts // 2, axis=1)[..., ::-1] if rollouts > 1 else -truth
    gain = np.exp(rng.normal(-0.1, 0.25, (people, 1, 1)))
    wheel = np.clip(gain * np.where(strange, other, truth) + error, -WHEEL_LIMIT, WHEEL_LIMIT)
    turned = lagged(wheel, rng.uniform(0.1, 0.4, people), rate_hz)
    yaw = rng.uniform(0.1, 0.4, (people, 1, 1)) * turned
    return np.stack([yaw, np.full_like(wheel, 5.0), wheel], axis=-1)


def lagged(signal: FloatArray, lag_s: FloatArray, rate_hz: float) -> FloatArray:
    """First-order lag of each person, exact for a signal linear between samples."""
    per_step = np.maximum(lag_s * rate_hz, 1e-3)
    decay = np.exp(-1.0 / per_step)
    now = (1.0 - (1.0 - decay) * per_step)[:, None]
    decay = decay[:, None]
    before = 1.0 - decay - now
    found = np.empty_like(signal)
    state = found[..., 0] = signal[..., 0]
    for sample in range(1, signal.shape[-1]):
        state = decay * state + now * signal[..., sample] + before * signal[..., sample - 1]
        found[..., sample] = state
    return found


def coloured(
    rng: np.random.Generator, shape: tuple[int, ...], time_s: FloatArray, rate_hz: float
) -> FloatArray:
    """Stationary AR(1) noise of unit variance, (people, rollouts, samples)."""
    decay = np.exp(-1.0 / (time_s * rate_hz))[:, None]
    noise = rng.standard_normal(shape)
    fresh = np.sqrt(1.0 - decay**2)
    for sample in range(1, shape[-1]):
        noise[..., sample] = decay * noise[..., sample - 1] + fresh * noise[..., sample]
    return noise


def _sines(
    people: int, rollouts: int, samples: int, rate_hz: float, rng: np.random.Generator,
    ranges: ProcessRanges,
) -> FloatArray:  # fmt: skip
    """A few sines of everybody's own frequencies; phases differ between rollouts."""
    count, t_s = 10, np.arange(samples) / rate_hz
    fastest = np.exp(rng.uniform(np.log(0.3), np.log(ranges.fastest_hz), (people, 1)))
    span = np.log(fastest / ranges.slowest_hz)
    frequency = ranges.slowest_hz * np.exp(span * rng.random((people, count)))
    amplitude = frequency ** -rng.uniform(0.0, ranges.steepest, (people, 1))
    amplitude *= np.arange(count) < rng.integers(3, count + 1, (people, 1))
    truth = np.zeros((people, rollouts, samples))
    for number in range(count):
        phase = rng.uniform(0.0, 2.0 * np.pi, (people, rollouts, 1))
        turn = 2.0 * np.pi * frequency[:, number, None, None] * t_s
        truth += amplitude[:, number, None, None] * np.sin(turn + phase)
    return truth


def _noise(
    people: int, rollouts: int, samples: int, rate_hz: float, rng: np.random.Generator,
    ranges: ProcessRanges,
) -> FloatArray:  # fmt: skip
    """Noise through one to three lags."""
    low, high = np.log(ranges.noise_time_s)
    truth = coloured(
        rng, (people, rollouts, samples), np.exp(rng.uniform(low, high, people)), rate_hz
    )
    for share in (0.9, 0.5):
        lag_s = np.exp(rng.uniform(np.log(0.05), np.log(0.8), people))
        truth = lagged(truth, np.where(rng.random(people) < share, lag_s, 0.0), rate_hz)
    return truth


def _steps(
    people: int, rollouts: int, samples: int, rate_hz: float, rng: np.random.Generator,
    ranges: ProcessRanges,
) -> FloatArray:  # fmt: skip
    """Levels that change at random moments, rounded off."""
    shape = (people, rollouts, samples)
    mean_s = rng.uniform(*ranges.step_s, (people, 1, 1))
    changes = rng.random(shape) < 1.0 / (mean_s * rate_hz)
    changes[..., 0] = True
    at = np.maximum.accumulate(np.where(changes, np.arange(samples), 0), axis=-1)
    levels = np.take_along_axis(rng.standard_normal(shape), at, axis=-1)
    rounded = lagged(levels, np.exp(rng.uniform(np.log(0.05), np.log(0.6), people)), rate_hz)
    return lagged(rounded, rng.uniform(0.02, 0.3, people), rate_hz)


def _bursts(
    people: int, rollouts: int, samples: int, rate_hz: float, rng: np.random.Generator,
    ranges: ProcessRanges,
) -> FloatArray:  # fmt: skip
    """Nothing to do for a while, then something: noise times a slow switch."""
    truth = _noise(people, rollouts, samples, rate_hz, rng, ranges)
    slow = coloured(rng, truth.shape, rng.uniform(0.8, 3.0, people), rate_hz)
    return truth * (1.0 / (1.0 + np.exp(-6.0 * (slow - rng.normal(0.0, 0.5, (people, 1, 1))))))
