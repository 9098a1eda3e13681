"""One way to derive a random generator from a seed."""

import numpy as np


def rng_for(seed: int, *names: str) -> np.random.Generator:
    """The generator of one use of ``seed``: by name, so that no list's order decides anything.

    Args:
        names: what it is for, such as ``("table 2", "openness")``.
    """
    return np.random.default_rng([seed, *"/".join(names).encode()])
