"""All pairs of conditions, corrected together."""

import numpy as np
import pytest

from steerlab.analysis.statistics.corrections import holm
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import all_pairs, mcnemar, wilcoxon
from steerlab.sim.errors import InvalidConfig

NAMES = ("bc", "dagger", "mind_meld")


def test_pairs_are_corrected_together(r_values):
    table = r_values["data"]["scores"]
    found = all_pairs(table, NAMES, wilcoxon)
    alone = [wilcoxon(table[:, i], table[:, j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    assert [(one.first, one.second) for one in found] == [
        ("bc", "dagger"),
        ("bc", "mind_meld"),
        ("dagger", "mind_meld"),
    ]
    assert [one.test for one in found] == alone
    assert [one.p_holm for one in found] == holm(np.array([one.p for one in alone])).tolist()


def test_a_pair_that_cannot_be_tested_is_no_test():
    """Two of three conditions are equal, so Holm counts two tests."""
    success = np.repeat([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [7, 1], axis=0)
    equal, one, other = all_pairs(success, NAMES, mcnemar)
    assert isinstance(equal.p_holm, NotComputable)
    assert one.p_holm == other.p_holm == pytest.approx(2 * one.test.p)


def test_names_must_fit():
    for names in (NAMES[:2], ("a", "a", "b")):
        with pytest.raises(InvalidConfig, match="3 columns"):
            all_pairs(np.eye(5)[:, :3], names, wilcoxon)
