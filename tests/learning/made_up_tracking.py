"""``docs/example-tracking.csv``: made-up people hold a cursor on a reference.

``python -m tests.learning.made_up_tracking`` writes it anew. Each of five people answers the error that
they saw a while ago, each with an own gain and delay, and with slow noise. Of five rollouts two are
mirror images, so there are four drives: in two the cursor is pushed about, in two the reference moves.
"""

import csv
import io
from pathlib import Path

import numpy as np

EXAMPLE = Path(__file__).parents[2] / "docs" / "example-tracking.csv"
PEOPLE = 5
RATE_HZ = 10.0
SECONDS = 6.5
_FINE = 10  # steps of the simulation to one of the table
_AMPLITUDES = (0.45, 0.35, 0.25)
_HERTZ = (0.13, 0.29, 0.47)
ROLLOUTS = {  # seed of the drive, whether the reference moves, mirror image
    "pushed-1": (1, False, 1.0),
    "pushed-1-mirrored": (1, False, -1.0),
    "pushed-2": (2, False, 1.0),
    "chase-1": (3, True, 1.0),
    "chase-2": (4, True, 1.0),
}


def made_up_tracking(seed: int = 0) -> str:
    """The file: a header, and a row a step."""
    rng = np.random.default_rng(seed)
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(["person", "rollout", "t_s", "reference", "disturbance", "input"])
    for person in range(PEOPLE):
        gain, delay_s = rng.uniform(1.2, 2.2), rng.uniform(0.15, 0.35)
        for rollout, (drive, moves, side) in ROLLOUTS.items():
            t_s = np.arange(round(SECONDS * RATE_HZ) * _FINE) / (_FINE * RATE_HZ)
            sines = side * _sines(np.random.default_rng([seed, drive]), t_s)
            reference = sines if moves else 0.0 * t_s
            disturbance = 0.0 * t_s if moves else sines
            given = _track(reference, disturbance, gain, delay_s, rng)
            columns = (t_s, reference, disturbance, given)
            for at, *row in zip(*(column[::_FINE] for column in columns), strict=True):
                cells = [f"{value + 0.0:.3f}" for value in row]
                writer.writerow([f"p{person}", rollout, f"{at:.1f}", *cells])
    return sink.getvalue().replace("-0.000", "0.000")


def _sines(rng: np.random.Generator, t_s: np.ndarray) -> np.ndarray:
    """A sum of sines from 0 on, (steps,)."""
    phases = rng.uniform(0.0, 2.0 * np.pi, len(_HERTZ))
    parts = zip(_AMPLITUDES, _HERTZ, phases, strict=True)
    total = sum(size * np.sin(2.0 * np.pi * hz * t_s + phase) for size, hz, phase in parts)
    return np.clip(t_s, 0.0, 1.0) * total


def _track(
    reference: np.ndarray,
    disturbance: np.ndarray,
    gain: float,
    delay_s: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """What the person gives, (steps,), in closed loop with a cursor of gain 1."""
    step_s = 1.0 / (_FINE * RATE_HZ)
    late, keeps = round(delay_s / step_s), np.exp(-step_s / 0.5)
    given, error = np.zeros(len(reference)), np.zeros(len(reference))
    cursor = noise = 0.0
    for step in range(len(reference)):
        error[step] = reference[step] - cursor
        noise = keeps * noise + 0.15 * np.sqrt(1.0 - keeps**2) * rng.standard_normal()
        given[step] = gain * (error[step - late] if step >= late else 0.0) + noise
        cursor += step_s * (given[step] + disturbance[step])
    return given


if __name__ == "__main__":
    EXAMPLE.write_text(made_up_tracking(), encoding="utf-8")
