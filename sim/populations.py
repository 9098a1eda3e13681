"""Populations of scripted teachers: how styles and noise are spread over simulated people."""

from dataclasses import dataclass, replace
from math import sqrt
from typing import Literal

import numpy as np

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle

PopulationKind = Literal["paper", "low", "human", "high", "people", "sparse"]
_KINDS: dict[str, int] = {"paper": 0, "low": 1, "human": 2, "high": 3, "people": 4, "sparse": 5}
"""By kind, its number in seeds: whoever adds a kind gives it the next one."""
LONGEST_SEED = 10
"""Digits of a seed that is written in a text, as in ``scripted:human:3``."""


@dataclass(frozen=True, kw_only=True)
class PaperPopulationConfig:
    """The paper's synthetic people (section Synthetic Experiment), noise free.

    Each is delayed, anticipatory or neither, and an over- or an under-corrector by a random
    magnitude. The paper gives neither number; these are ours.
    """

    shift_s: float = 0.3
    magnitude: tuple[float, float] = (1.1, 2.5)  # over-correctors' gain; under-correctors' 1/gain


@dataclass(frozen=True, kw_only=True)
class PopulationConfig:
    """Distributions that styles are drawn from. Noise levels were set before any mapper was run.

    Delay is about the visual response time of a tracking human, 0.1-0.2 s, spread by preview on
    the one side and inattention on the other; lag is the neuromuscular lag of 0.1-0.2 s, both
    after McRuer & Jex, *A review of quasi-linear pilot models*, IEEE THFE 1967. Noise has a part
    that grows with the signal (Harris & Wolpert, *Signal-dependent noise determines motor
    planning*, Nature 1998). Gain spread, bias, dead zone and drift have no published value for
    this task; they are assumptions.

    Attributes:
        log_gain_std: standard deviation of log gain; its mean is 0.
        lag_s, noise_time_s: lowest and highest, uniform.
        dead_zone: highest, uniform from 0, in wheel units.
        constant_noise, signal_noise: median over people.
        log_noise_std: how much people differ in noise.
        drift_std: of the change of log gain with each rollout.
    """

    log_gain_std: float = 0.45
    delay_mean_s: float = 0.12
    delay_std_s: float = 0.22
    lag_s: tuple[float, float] = (0.05, 0.25)
    dead_zone: float
    constant_noise: float
    signal_noise: float
    log_noise_std: float = 0.3
    noise_time_s: tuple[float, float] = (0.1, 0.3)
    bias_std: float
    drift_std: float


ORACLE_RMS = 1.09
"""Root mean square of the calibration set's oracle labels, in wheel units."""


@dataclass(frozen=True, kw_only=True)
class PeoplePopulationConfig:
    """People as they were measured: nine who tracked a cursor with a slider.

    Yamagami, Howell, Roth & Burden, *Contributions of feedforward and feedback control in a manual
    trajectory-tracking task*, IFAC-PapersOnLine 51(34) 61-66, doi 10.1016/j.ifacol.2019.01.025;
    data: github.com/EmDash00/CPHS2017, first-order dynamics. A delay of .36 ± .03 s where they could
    not see ahead and .01 ± .09 s where they could, over people; standard deviation of log gain
    .05-.09; noise of a correlation time of .7-1.0 s and of .22-.44 of the truth's root mean square,
    which hardly depends on the signal. Half of our people see ahead, and half do not.

    What was not measured is left out: lag (the delay has it), dead zone, bias, drift and a mean gain
    other than 1. These people were in the loop: the cursor answered them. A closed loop compresses
    gain and slows noise, so people who correct a recorded drive may differ more in gain and have
    faster noise. A slider is no wheel, and nine people are few.

    Attributes:
        blind_s, preview_s: mean and standard deviation of the delay without and with a view ahead.
        noise: lowest and highest, uniform, in units of ``ORACLE_RMS``.
        noise_time_s: lowest and highest, uniform.
    """

    log_gain_std: float = 0.07
    blind_s: tuple[float, float] = (0.36, 0.03)
    preview_s: tuple[float, float] = (0.01, 0.09)
    noise: tuple[float, float] = (0.22, 0.44)
    noise_time_s: tuple[float, float] = (0.7, 1.0)

    @property
    def delay_mean_s(self) -> float:
        """Of everyone, whether they see ahead or not."""
        return (self.blind_s[0] + self.preview_s[0]) / 2.0

    @property
    def delay_std_s(self) -> float:
        """Of everyone: how either half differs, and how the halves lie apart."""
        within = (self.blind_s[1] ** 2 + self.preview_s[1] ** 2) / 2.0
        return sqrt(within + ((self.blind_s[0] - self.preview_s[0]) / 2.0) ** 2)


@dataclass(frozen=True, kw_only=True)
class SparsePopulationConfig:
    """People of the population ``human`` who leave the wheel centred while the robot is right.

    Right is what lies within their tolerance, which is an assumption: within .5 of the robot's wheel
    the truth is in 54 % of the calibration set's steps.

    Attributes:
        tolerance: lowest and highest, uniform, in wheel units.
    """

    tolerance: tuple[float, float] = (0.3, 0.7)


PAPER = PaperPopulationConfig()
PEOPLE = PeoplePopulationConfig()
SPARSE = SparsePopulationConfig()

# Execution noise alone: 10 % of the signal (van Beers, Haggard & Wolpert, J. Neurophysiol. 2004).
LOW = PopulationConfig(
    dead_zone=0.05, constant_noise=0.03, signal_noise=0.10, bias_std=0.05, drift_std=0.005
)

# The remnant of a tracking human, -20 dB of the signal as white observation noise (Levison, Baron
# & Kleinman, IEEE TMMS 1969), leaves 0.28-0.4 of the signal behind a lag of 0.2-0.1 s. That is
# compensatory tracking; teachers see the car move well ahead of its errors, so a little below.
HUMAN = PopulationConfig(
    dead_zone=0.15, constant_noise=0.08, signal_noise=0.25, bias_std=0.10, drift_std=0.01
)

# A novice, or attention shared with another task: more than twice the remnant's power (ibid.).
HIGH = PopulationConfig(
    dead_zone=0.30, constant_noise=0.15, signal_noise=0.40, bias_std=0.15, drift_std=0.02
)

_LEVELS = {"low": LOW, "human": HUMAN, "high": HIGH}


def sample_population(
    kind: PopulationKind, count: int, seed: int, *, prefix: str
) -> list[ScriptedTeacher]:
    """Draw ``count`` teachers named ``<prefix>-000``, ``<prefix>-001``, ...

    Styles and noise depend on (kind, seed, prefix): ``seen`` and ``new`` people of one seed are
    independent, and the first teachers do not change when ``count`` grows.

    Raises:
        InvalidConfig: unknown ``kind``, ``count`` below 1, negative ``seed`` or empty ``prefix``.
    """
    if kind not in _KINDS:
        raise InvalidConfig(f"No population {kind!r}; choose one of {', '.join(_KINDS)}.")
    if count < 1:
        raise InvalidConfig(f"A population of {count} teachers is empty; ask for at least 1.")
    if seed < 0:
        raise InvalidConfig(f"Population seed {seed} is negative; give a non-negative integer.")
    if not prefix:
        raise InvalidConfig("The prefix of the pseudonyms is empty; give one such as 'seen'.")
    root = np.random.SeedSequence([seed, _KINDS[kind], *prefix.encode()])
    teachers: list[ScriptedTeacher] = []
    for index, child in enumerate(root.spawn(count)):
        rng = np.random.default_rng(child)
        noise_seed = int(rng.integers(2**63))
        teachers.append(
            ScriptedTeacher(f"{prefix}-{index:03d}", sample_style(kind, rng), noise_seed)
        )
    return teachers


def sample_style(kind: PopulationKind, rng: np.random.Generator) -> TeacherStyle:
    """Draw one style of the population ``kind``."""
    if kind == "paper":
        return _sample_paper_style(PAPER, rng)
    if kind == "people":
        return _sample_people_style(PEOPLE, rng)
    if kind == "sparse":
        style = sample_style("human", rng)
        return replace(style, tolerance=float(rng.uniform(*SPARSE.tolerance)))
    config = _LEVELS[kind]
    noise_factor = float(np.exp(rng.normal(0.0, config.log_noise_std)))
    return TeacherStyle(
        gain=float(np.exp(rng.normal(0.0, config.log_gain_std))),
        delay_s=float(rng.normal(config.delay_mean_s, config.delay_std_s)),
        lag_s=float(rng.uniform(*config.lag_s)),
        dead_zone=float(rng.uniform(0.0, config.dead_zone)),
        constant_noise=noise_factor * config.constant_noise,
        signal_noise=noise_factor * config.signal_noise,
        noise_time_s=float(rng.uniform(*config.noise_time_s)),
        bias=float(rng.normal(0.0, config.bias_std)),
        drift=float(rng.normal(0.0, config.drift_std)),
    )


def _sample_paper_style(config: PaperPopulationConfig, rng: np.random.Generator) -> TeacherStyle:
    magnitude = float(rng.uniform(*config.magnitude))
    over_corrects = bool(rng.integers(2))
    shift_s = config.shift_s * int(rng.integers(-1, 2))
    return TeacherStyle(gain=magnitude if over_corrects else 1.0 / magnitude, delay_s=shift_s)


def _sample_people_style(config: PeoplePopulationConfig, rng: np.random.Generator) -> TeacherStyle:
    sees_ahead = bool(rng.integers(2))
    return TeacherStyle(
        gain=float(np.exp(rng.normal(0.0, config.log_gain_std))),
        delay_s=float(rng.normal(*(config.preview_s if sees_ahead else config.blind_s))),
        constant_noise=ORACLE_RMS * float(rng.uniform(*config.noise)),
        noise_time_s=float(rng.uniform(*config.noise_time_s)),
    )
