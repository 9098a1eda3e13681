"""R's numbers, frozen: ``reference.R`` beside this file made ``reference.json``."""

import json
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="session")
def r_values() -> dict:
    """Everything R computed, by test; ``data`` holds what it computed it from, as arrays."""
    values = json.loads((Path(__file__).parent / "reference.json").read_text())
    values["data"] = {name: np.array(one, dtype=float) for name, one in values["data"].items()}
    return values


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)
