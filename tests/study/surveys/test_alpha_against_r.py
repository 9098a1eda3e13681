"""Cronbach's alpha and Feldt's interval as R's ``psych::alpha`` (2.2.9) gives them.

The items and R's values are in ``tests/analysis/statistics/reference.json``; ``reference.R`` there
made them.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from steerlab.study.surveys.reliability import cronbach_alpha

REFERENCE = Path(__file__).parents[2] / "analysis" / "statistics" / "reference.json"


@pytest.mark.parametrize(("key", "items"), [("three", 3), ("four", 4)])
def test_alpha_is_psychs(key, items):
    values = json.loads(REFERENCE.read_text())
    found = cronbach_alpha(np.array(values["data"]["items"], dtype=float)[:, :items])
    assert found.alpha == pytest.approx(values["alpha"][key], abs=1e-10)
    low, high = values["alpha"][f"{key}_interval"]
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-6)
