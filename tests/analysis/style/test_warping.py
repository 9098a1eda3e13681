"""The exact kernel against an oracle, fastdtw against the exact kernel."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.analysis.style.warping import METHODS, warp
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import sample_population

SIGNALS = st.lists(st.integers(-4, 4), min_size=1, max_size=14).map(lambda v: np.array(v, float))


def _least(label, truth) -> float:
    """The textbook recursion over the whole table."""
    cost = np.full((len(label) + 1, len(truth) + 1), np.inf)
    cost[0, 0] = 0.0
    for i, a in enumerate(label):
        for j, o in enumerate(truth):
            cost[i + 1, j + 1] = abs(a - o) + min(cost[i, j], cost[i, j + 1], cost[i + 1, j])
    return cost[-1, -1]


def _assert_is_a_path(found, label, truth):
    steps = np.stack([np.diff(found.label_index), np.diff(found.truth_index)], axis=1)
    assert (found.label_index[0], found.truth_index[0]) == (0, 0)
    assert (found.label_index[-1], found.truth_index[-1]) == (len(label) - 1, len(truth) - 1)
    assert {tuple(step) for step in steps.tolist()} <= {(0, 1), (1, 0), (1, 1)}
    along = np.abs(label[found.label_index] - truth[found.truth_index]).sum()
    assert found.distance == pytest.approx(along)


@given(label=SIGNALS, truth=SIGNALS)
@settings(deadline=None)
def test_exact_is_exact(label, truth):
    found = warp(label, truth)
    _assert_is_a_path(found, label, truth)
    assert found.distance == _least(label, truth)


@given(label=SIGNALS, truth=SIGNALS)
@settings(deadline=None)
def test_fastdtw_gives_a_path_that_is_never_shorter(label, truth):
    found = warp(label, truth, "fastdtw")
    _assert_is_a_path(found, label, truth)
    assert found.distance >= _least(label, truth)


@given(signal=SIGNALS)
@settings(deadline=None)
def test_a_signal_matches_itself_step_by_step(signal):
    """Plateaus have many paths without cost; the diagonal one is taken."""
    found = warp(signal, signal)
    assert found.label_index.tolist() == found.truth_index.tolist() == list(range(len(signal)))


@given(label=SIGNALS, truth=SIGNALS)
@settings(deadline=None)
def test_distance_does_not_depend_on_which_signal_comes_first(label, truth):
    assert warp(label, truth).distance == warp(truth, label).distance


def test_fastdtw_is_close_on_calibration_rollouts():
    """Of 60 such pairs 57 erred by less than half a percent, the worst by 2; one here by 5."""
    teachers = sample_population("human", 12, 3, prefix="style")
    errors = []
    for rollout, teacher in zip(load_calibration_set(), teachers, strict=True):
        label = teacher.respond(rollout, order=0, attempt=0)
        exact, fast = (warp(label, rollout.oracle_label, method) for method in METHODS)
        assert (exact.method, fast.method) == ("exact", "fastdtw")
        errors.append(fast.distance / exact.distance - 1.0)
    assert min(errors) >= -1e-12
    assert np.quantile(errors, 0.9) < 0.01
    assert max(errors) < 0.1


@pytest.mark.parametrize(
    ("label", "message"),
    [
        (np.array([]), "label has shape"),
        (np.array([1.0, np.nan]), "not finite"),
        (np.ones((2, 2)), r"\(2, 2\)"),
    ],
)
def test_what_is_no_signal_is_refused(label, message):
    with pytest.raises(InvalidConfig, match=message):
        warp(label, np.ones(3))


def test_an_unknown_method_lists_the_known():
    with pytest.raises(InvalidConfig, match="exact, fastdtw"):
        warp(np.ones(3), np.ones(3), "dtw")  # pyright: ignore[reportArgumentType]
