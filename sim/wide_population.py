"""Teachers who differ widely in gain and delay, for the comparison of learners.

The populations of ``populations.py`` hold few people whose labels are far off. What a better label
is worth to a driver shows with people who correct far too little or too much, half a second early
or late. Gain and delay are uniform over the ranges of the comparison's prototype, on which its goals
were set; everything else is the population ``human``.
"""

from dataclasses import dataclass, replace

import numpy as np

from steerlab.sim.populations import sample_population
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle

_STREAM = 0x71DE


@dataclass(frozen=True, kw_only=True)
class WidePopulationConfig:
    """Ranges (lowest, highest) of gain, uniform in its logarithm, and delay, uniform."""

    gain: tuple[float, float] = (0.3, 3.0)
    delay_s: tuple[float, float] = (-0.5, 0.8)


WIDE = WidePopulationConfig()


def sample_wide(count: int, seed: int, *, prefix: str) -> list[ScriptedTeacher]:
    """Draw ``count`` teachers; the first do not change when ``count`` grows.

    Raises:
        InvalidConfig: see ``sample_population``.
    """
    people = sample_population("human", count, seed, prefix=prefix)
    root = np.random.SeedSequence([_STREAM, seed, *prefix.encode()])
    return [
        ScriptedTeacher(person.name, _widened(person, np.random.default_rng(child)), person.seed)
        for person, child in zip(people, root.spawn(count), strict=True)
    ]


def _widened(person: ScriptedTeacher, rng: np.random.Generator) -> TeacherStyle:
    log_gain = rng.uniform(*np.log(WIDE.gain))
    delay_s = rng.uniform(*WIDE.delay_s)
    return replace(person.style, gain=float(np.exp(log_gain)), delay_s=float(delay_s))
