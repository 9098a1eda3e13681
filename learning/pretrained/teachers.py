"""Simulated teachers for pre-training: many at once, and of more kinds than any population's.

The structure is that of ``sim/scripted_teacher.py`` (delay, dead zone, lag, gain, bias, coloured
noise, saturation), with what people do besides: they correct only what they dislike, are late when
surprised, have another style on another drive, look away, tire or learn, turn left and right by
different amounts, and hold a wheel that comes in notches or can be turned only so fast. Some follow
drives, some ``processes``. What ``sim/unusual_teachers.py`` tests with besides is left out on purpose:
power-law gain, an underdamped hand, sample-and-hold.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from steerlab.learning.pretrained.processes import (
    ProcessRanges,
    coloured,
    lagged,
    random_truths,
    robot_motion,
)
from steerlab.learning.pretrained.style import truth_unit
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT

STYLE = ("log_gain", "delay_s", "lag_s", "dead_zone", "bias", "log_noise", "noise_time_s")
"""What a network could at best know of a teacher; the first two are what studies report."""
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
    execution noise alone, 1 a distracted novice. Shares are of teachers; each quirk is drawn by
    itself, so some have several and many none.

    Attributes:
        study_size: so many teachers make a study: they follow one kind of truth, and have part of
            their style in common.
        on_processes: share of studies that follow random truths in place of drives.
        log_gain_std, delay_mean_s, delay_std_s: normal, wider than any population studied.
        late: share whose delay is that of people who track without a preview, ``late_s``.
        constant_noise, signal_noise, dead_zone, bias_std, drift_std: at level 0 and at level 1.
        slow_noise: share whose noise is as slow as people's, ``slow_noise_time_s``.
        wandering: share of teachers whose gain and delay wander, and who have a second lag.
        sparse: share who turn the wheel only while the robot is wrong by more than ``tolerance``.
        other_drives: share with another gain and delay on every drive.
        surprised: share who are late after the truth jumped.
        lapsing, notched, slow_handed, changing, lopsided: shares who look away, whose wheel has
            notches, who cannot turn fast, whose noise grows or shrinks, who turn to one side more.
        coarse: share whose labels and truth come at 5 or 10 Hz and are read between.
    """

    study_size: int = 16
    on_processes: float = 0.4
    log_gain_std: float = 0.5
    delay_mean_s: float = 0.12
    delay_std_s: float = 0.26
    late: float = 0.2
    late_s: tuple[float, float] = (0.36, 0.08)
    lag_s: tuple[float, float] = (0.03, 0.28)
    constant_noise: tuple[float, float] = (0.02, 0.16)
    signal_noise: tuple[float, float] = (0.07, 0.42)
    log_noise_std: float = 0.35
    noise_time_s: tuple[float, float] = (0.06, 0.36)
    slow_noise: float = 0.3
    slow_noise_time_s: tuple[float, float] = (0.3, 1.2)
    slow_constant_noise: tuple[float, float] = (0.05, 0.5)
    dead_zone: tuple[float, float] = (0.05, 0.32)
    bias_std: tuple[float, float] = (0.05, 0.15)
    drift_std: tuple[float, float] = (0.005, 0.02)
    wandering: float = 0.35
    wander_log_gain: float = 0.2
    wander_delay_s: float = 0.06
    wander_time_s: float = 2.5
    second_lag_s: float = 0.15
    sparse: float = 0.2
    tolerance: tuple[float, float] = (0.2, 0.9)
    other_drives: float = 0.2
    drive_log_gain: float = 0.35
    drive_delay_s: float = 0.15
    surprised: float = 0.1
    surprise_s: tuple[float, float] = (0.1, 0.6)
    lapsing: float = 0.1
    notched: float = 0.08
    slow_handed: float = 0.08
    changing: float = 0.12
    lopsided: float = 0.15
    coarse: float = 0.1
    processes: ProcessRanges = field(default_factory=ProcessRanges)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SimulatedStudy:
    """Labels of ``people`` simulated teachers for a few drives each, padded to one length.

    Attributes:
        label: (people, rollouts, samples) within ±``WHEEL_LIMIT``; held beyond the end.
        truth: (people, rollouts, samples); held beyond the end.
        motion: (people, rollouts, samples, 3); see ``PretrainingDrive.motion``.
        present: (people, rollouts, samples) False beyond the end.
        style: (people, len(STYLE)).
        unit: (people,) size of their truths; see ``style.truth_unit``.
    """

    label: NDArray[np.float32]
    truth: NDArray[np.float32]
    motion: NDArray[np.float32]
    present: BoolArray
    style: FloatArray
    unit: FloatArray


def simulate_study(
    drives: list[PretrainingDrive],
    people: int,
    rollouts: int,
    rate_hz: float,
    rng: np.random.Generator,
    ranges: TeacherRanges | None = None,
) -> SimulatedStudy:
    """Every teacher labels ``rollouts`` drives, drawn with their mirror images, or random truths.

    Neighbours make a study; the last one may be smaller.
    """
    ranges = ranges or TeacherRanges()
    size = ranges.study_size
    studies = -(-people // size)
    pool = drives + [drive.mirrored() for drive in drives]
    samples = max(len(drive.truth) for drive in drives)
    lengths = np.array([len(drive.truth) for drive in pool])
    truths = np.stack([_held(drive.truth, samples) for drive in pool])
    motions = np.stack([_held(drive.motion, samples) for drive in pool])
    choice = np.stack([rng.choice(len(pool), rollouts, replace=False) for _ in range(people)])
    truth, motion, present = truths[choice], motions[choice], _until(lengths[choice], samples)
    others = rng.random(studies) < ranges.on_processes
    other = others.repeat(size)[:people]
    if other.any():
        count, made = int(other.sum()), int(others.sum())
        drawn = random_truths(made, rollouts * size, samples, rate_hz, rng, ranges.processes)
        truth[other] = drawn.reshape(-1, rollouts, samples)[:count]
        motion[other] = robot_motion(truth[other], rate_hz, rng, ranges.processes)
        present[other] = _until(rng.integers(samples // 2, samples + 1, (count, rollouts)), samples)
    style, label = _labels(truth, motion[..., 2], rate_hz, rng, ranges)
    coarse = rng.random(people) < ranges.coarse
    for every in (2, 4):
        these = coarse & (rng.integers(2, size=people) == every // 4)
        label[these], truth[these] = _read_between(label[these], truth[these], every)
    return SimulatedStudy(
        label=label.astype(np.float32),
        truth=truth.astype(np.float32),
        motion=motion.astype(np.float32),
        present=present,
        style=style,
        unit=np.array([truth_unit(*one) for one in zip(truth, present, strict=True)]),
    )


def _labels(
    truth: FloatArray,
    robot: FloatArray,
    rate_hz: float,
    rng: np.random.Generator,
    ranges: TeacherRanges,
) -> tuple[FloatArray, FloatArray]:
    """Draw teachers and have them label: all (people, rollouts, samples) -> style, labels."""
    from scipy.special import ndtr

    people, rollouts, samples = truth.shape
    study = np.arange(people) // ranges.study_size
    in_common = rng.uniform(-0.5, 0.95, study[-1] + 1).clip(0.0)[study]

    def normal() -> FloatArray:
        """Of unit variance, in part the same for a study."""
        common = rng.standard_normal(study[-1] + 1)[study]
        return np.sqrt(in_common) * common + np.sqrt(1.0 - in_common) * rng.standard_normal(people)

    level = -0.1 + 1.1 * ndtr(normal())

    def each(low_high: tuple[float, float]) -> FloatArray:
        return rng.uniform(*low_high, people)

    def at_level(low_high: tuple[float, float]) -> FloatArray:
        return low_high[0] * (low_high[1] / low_high[0]) ** level

    def some(share: float) -> BoolArray:
        """So many of all, who come together: half of the studies have none of them."""
        among = np.minimum(1.0, 2.0 * share) * (rng.random(study[-1] + 1) < 0.5)[study]
        return rng.random(people) < among

    wanders, slow = some(ranges.wandering), some(ranges.slow_noise)
    log_gain = ranges.log_gain_std * normal() * rng.choice([0.2, 0.6, 1.0], study[-1] + 1)[study]
    delay_s = ranges.delay_mean_s + ranges.delay_std_s * normal()
    delay_s = np.where(some(ranges.late), rng.normal(*ranges.late_s, people), delay_s)
    lag_s = each(ranges.lag_s)
    second_lag_s = wanders * each((0.0, ranges.second_lag_s))
    dead_zone = rng.random(people) * at_level(ranges.dead_zone)
    bias = rng.normal(0.0, 1.0, people) * at_level(ranges.bias_std)
    drift = rng.normal(0.0, 1.0, people) * at_level(ranges.drift_std)
    noise_factor = np.exp(rng.normal(0.0, ranges.log_noise_std, people))
    noise_time_s = np.where(slow, each(ranges.slow_noise_time_s), each(ranges.noise_time_s))

    def column(values: FloatArray) -> FloatArray:
        return np.asarray(values)[:, None, None]

    def wander(std: float) -> FloatArray:
        noise = coloured(rng, truth.shape, np.full(people, ranges.wander_time_s), rate_hz)
        return column(wanders * std * rng.uniform(0.0, 1.0, people)) * noise

    def by_drive(std: float) -> FloatArray:
        varies = some(ranges.other_drives) * rng.uniform(0.2, 1.0, people) * std
        return (varies[:, None] * rng.standard_normal((people, rollouts)))[..., None]

    late = some(ranges.surprised) * each(ranges.surprise_s)
    delay = column(delay_s) + wander(ranges.wander_delay_s) + by_drive(ranges.drive_delay_s)
    shift = (delay + column(late) * _surprise(truth, rate_hz)) * rate_hz
    position = np.arange(samples) - shift
    looked_away = np.flatnonzero(some(ranges.lapsing))
    position[looked_away] = _with_lapses(position[looked_away], rate_hz, rng)
    seen = _read_at(truth, position)
    seen = np.sign(seen) * np.maximum(np.abs(seen) - column(dead_zone), 0.0)
    lopsided = some(ranges.lopsided) * rng.normal(0.0, 0.5, people)
    seen = seen * np.exp(0.5 * column(lopsided) * np.sign(seen))
    order = rng.integers(_SESSION_ROLLOUTS, size=(people, rollouts))
    log_factor = (log_gain[:, None] + drift[:, None] * order)[..., None]
    log_factor = log_factor + wander(ranges.wander_log_gain) + by_drive(ranges.drive_log_gain)
    intended = np.exp(log_factor) * lagged(lagged(seen, lag_s, rate_hz), second_lag_s, rate_hz)
    intended = intended + column(bias)
    constant = noise_factor * at_level(ranges.constant_noise)
    constant = np.where(slow & some(0.6), each(ranges.slow_constant_noise), constant)
    signal = noise_factor * at_level(ranges.signal_noise) * np.where(slow & some(0.5), 0.2, 1.0)
    changing = some(ranges.changing) * rng.normal(0.0, 0.08, people)
    noise = np.exp(changing[:, None] * (order - 0.5 * _SESSION_ROLLOUTS))[..., None]
    noise = noise * coloured(rng, truth.shape, noise_time_s, rate_hz)
    label = intended + (column(constant) + column(signal) * np.abs(intended)) * noise
    sparse = np.flatnonzero(some(ranges.sparse))
    label[sparse] = _only_what_is_wrong(
        label[sparse], np.abs(truth - robot)[sparse], rate_hz, rng, ranges
    )
    slow_hands = np.flatnonzero(some(ranges.slow_handed))
    label[slow_hands] = _rate_limited(label[slow_hands], rate_hz, rng)
    notch = (some(ranges.notched) * rng.uniform(0.02, 0.3, people))[:, None, None]
    label = np.where(notch > 0.0, np.round(label / np.maximum(notch, 1e-9)) * notch, label)
    log_noise = np.log(signal + constant)
    style = [log_gain, delay_s, lag_s + second_lag_s, dead_zone, bias, log_noise, noise_time_s]
    return np.stack(style, axis=1), np.clip(label, -WHEEL_LIMIT, WHEEL_LIMIT)


def _surprise(truth: FloatArray, rate_hz: float) -> FloatArray:
    """1 when the truth just jumped, fading within about a second; (..., samples)."""
    back = round(0.3 * rate_hz)
    size = np.sqrt(np.square(truth).mean(axis=(1, 2), keepdims=True)) + 1e-6
    jumped = np.zeros(truth.shape)
    jumped[..., back:] = np.abs(truth[..., back:] - truth[..., :-back]) > 0.8 * size
    fade = np.exp(-1.0 / rate_hz)
    for sample in range(1, truth.shape[-1]):
        jumped[..., sample] = np.maximum(jumped[..., sample], fade * jumped[..., sample - 1])
    return jumped


def _with_lapses(position: FloatArray, rate_hz: float, rng: np.random.Generator) -> FloatArray:
    """Where they look, which stays for a while now and then; (people, rollouts, samples)."""
    per_s = rng.uniform(1.0 / 30.0, 1.0 / 6.0, (len(position), 1, 1))
    begins = rng.random(position.shape) < per_s / rate_hz
    length = rng.integers(round(0.4 * rate_hz), round(2.0 * rate_hz), position.shape)
    held, left = position.copy(), np.zeros(position.shape[:-1], dtype=np.int64)
    for sample in range(1, position.shape[-1]):
        left = np.where(
            begins[..., sample] & (left == 0), length[..., sample], np.maximum(left - 1, 0)
        )
        held[..., sample] = np.where(left > 0, held[..., sample - 1], position[..., sample])
    return held


def _only_what_is_wrong(
    label: FloatArray,
    wrong_by: FloatArray,
    rate_hz: float,
    rng: np.random.Generator,
    ranges: TeacherRanges,
) -> FloatArray:
    """The wheel rests unless the robot is wrong by more than is tolerated."""
    people = len(label)
    if not people:
        return label
    tolerated = rng.uniform(*ranges.tolerance, (people, 1))
    content = tolerated * rng.uniform(0.4, 1.0, (people, 1))
    behind = rng.integers(0, round(0.4 * rate_hz), people)
    seen = np.stack(
        [np.roll(one, late, axis=-1) for one, late in zip(wrong_by, behind, strict=True)]
    )
    for one, late in zip(seen, behind, strict=True):
        one[..., :late] = one[..., late : late + 1]
    acts = np.zeros(label.shape)
    state = seen[..., 0] > tolerated
    for sample in range(label.shape[-1]):
        now = seen[..., sample]
        state = (now > tolerated) | (state & (now > content))
        acts[..., sample] = state
    acts = lagged(acts, rng.uniform(0.0, 0.25, people), rate_hz)
    rest = rng.choice([0.0, 0.01, 0.03, 0.08], (people, 1, 1)) * rng.standard_normal(label.shape)
    return acts * label + rest


def _rate_limited(label: FloatArray, rate_hz: float, rng: np.random.Generator) -> FloatArray:
    """A wheel that is turned by so much a second at most."""
    most = rng.uniform(2.0, 8.0, (len(label), 1)) / rate_hz
    turned = label.copy()
    for sample in range(1, label.shape[-1]):
        before = turned[..., sample - 1]
        turned[..., sample] = before + np.clip(label[..., sample] - before, -most, most)
    return turned


def _read_between(
    label: FloatArray, truth: FloatArray, every: int
) -> tuple[FloatArray, FloatArray]:
    """Both as they come out when only every ``every``-th sample is known."""
    samples = label.shape[-1]
    at = np.minimum(np.arange(samples) // every, (samples - 1) // every - 1)
    weight = np.minimum(np.arange(samples) / every - at, 1.0)
    return tuple(
        (1.0 - weight) * values[..., at * every] + weight * values[..., (at + 1) * every]
        for values in (label, truth)
    )


def _until(lengths: NDArray[np.integer], samples: int) -> BoolArray:
    return np.arange(samples) < lengths[..., None]


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
