"""``steerlab demo``: a small simulated study."""

from pathlib import Path

from steerlab.app.commands.arguments import Force, Json, Out, Seed
from steerlab.app.commands.simulate import simulate_population


def demo(
    out: Out = Path("steerlab-demo"), seed: Seed = 0, force: Force = False, json: Json = False
) -> int:
    """A small simulated study from end to end, with a report to open; takes half a minute.

    Example: steerlab demo --out my-demo
    """
    return simulate_population(
        out,
        force,
        json,
        teachers=16,
        new_teachers=16,
        noise="human",
        rollouts=8,
        ladder="quick",
        seed=seed,
    )
