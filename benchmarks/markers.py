"""What markers for Lab Streaming Layer cost the loop. ``python -m benchmarks.markers``.

A receiver in the same process listens, which takes more from the loop than one elsewhere.
"""

from time import perf_counter_ns, sleep

import numpy as np

from benchmarks.rows import Row, at_most, print_rows
from steerlab.study.recording.lsl import lsl_markers

STEPS = 1200
RATE_HZ = 200.0
STEP_P99_LIMIT_US = 50.0  # 0.1 % of a control step
WAIT_S = 20.0


def run() -> list[Row]:
    """One row a figure."""
    from pylsl import StreamInlet, resolve_byprop

    handed_us: list[float] = []
    with lsl_markers("steerlab-benchmark") as markers:
        assert markers is not None
        (found,) = resolve_byprop("source_id", "steerlab-benchmark-steps", 1, WAIT_S)
        inlet = StreamInlet(found)
        inlet.open_stream(WAIT_S)
        for step in range(STEPS):
            sleep(1.0 / RATE_HZ)
            began_ns = perf_counter_ns()
            markers.step(0, step, began_ns)
            handed_us.append((perf_counter_ns() - began_ns) / 1e3)
        arrived = [inlet.pull_sample(WAIT_S)[0] for _ in range(STEPS)]
        inlet.close_stream()
    return [
        at_most("a step's marker, p50", float(np.median(handed_us)), STEP_P99_LIMIT_US, "µs"),
        at_most(
            "a step's marker, p99", float(np.quantile(handed_us, 0.99)), STEP_P99_LIMIT_US, "µs"
        ),
        at_most("markers that were lost", float(arrived.count(None)), 0.0),
    ]


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
