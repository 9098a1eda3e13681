"""Several networks' embeddings together, and an embedding as one number a person."""

import numpy as np
import pytest

from steerlab.analysis.statistics.multiple_correlation import (
    first_component,
    multiple_correlation,
    several_embeddings,
)
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.sim.errors import InvalidConfig

PEOPLE = 24


def _networks(rng: np.random.Generator, count: int) -> tuple[list[np.ndarray], np.ndarray]:
    style = rng.standard_normal((PEOPLE, 2))
    turned = [
        style @ rng.standard_normal((2, 3)) + 0.3 * rng.standard_normal((PEOPLE, 3))
        for _ in range(count)
    ]
    return turned, style


def test_one_network_is_multiple_r():
    rng = np.random.default_rng(1)
    (w,), style = _networks(rng, 1)
    construct = style[:, 0] + rng.standard_normal(PEOPLE)
    alone = multiple_correlation(w, construct, rng=np.random.default_rng(3), permutations=999)
    found = several_embeddings([w], construct, rng=np.random.default_rng(3), permutations=999)
    assert found.r == pytest.approx(alone.r)
    assert found.p == alone.p
    assert found.interval == alone.interval
    assert found.lowest == found.highest == pytest.approx(alone.r)


def test_the_same_network_twice_changes_nothing():
    rng = np.random.default_rng(2)
    (w,), style = _networks(rng, 1)
    construct = style[:, 1] + rng.standard_normal(PEOPLE)
    once, twice = (
        several_embeddings(several, construct, rng=np.random.default_rng(3), permutations=499)
        for several in ([w], [w, 3.0 * w @ np.diag([1.0, -2.0, 0.5]) + 7.0])
    )
    assert twice.p == once.p
    assert twice.r == pytest.approx(once.r)


def test_r_is_the_root_of_the_mean_of_squares():
    rng = np.random.default_rng(4)
    networks, style = _networks(rng, 3)
    construct = style[:, 0] + rng.standard_normal(PEOPLE)
    each = [multiple_correlation(w, construct, rng=rng, permutations=19).r2 for w in networks]
    found = several_embeddings(networks, construct, rng=rng, permutations=99)
    assert found.r**2 == pytest.approx(np.mean(each))
    assert (found.lowest**2, found.highest**2) == pytest.approx((min(each), max(each)))


@pytest.mark.slow
def test_dependent_networks_reject_a_true_null_at_their_level():
    rejected = 0
    studies, alpha = 600, 0.05
    for seed in range(studies):
        rng = np.random.default_rng([seed, 8])
        networks, _ = _networks(rng, 3)  # of the same people: far from independent
        construct = rng.exponential(size=PEOPLE)
        rejected += several_embeddings(networks, construct, rng=rng, permutations=99).p <= alpha
    assert abs(rejected / studies - alpha) < 3.0 * np.sqrt(alpha * (1.0 - alpha) / studies)


def test_what_is_not_defined_says_so():
    rng = np.random.default_rng(5)
    networks, _ = _networks(rng, 2)
    flat = several_embeddings(networks, np.ones(PEOPLE), rng=rng)
    assert flat == NotComputable(reason="all values of the construct are 1")
    networks[1][:, 2] = 4.0
    constant = several_embeddings(networks, rng.standard_normal(PEOPLE), rng=rng)
    assert constant == NotComputable(reason="network 2: all values of dimension 2 are 4")
    with pytest.raises(InvalidConfig, match="give one embedding or more"):
        several_embeddings([], np.ones(PEOPLE), rng=rng)


def test_the_first_component_is_where_people_differ_most(rng):
    along = rng.standard_normal(50)
    embedding = 3.0 + np.outer(along, [0.6, -0.8]) + 0.01 * rng.standard_normal((50, 2))
    found = first_component(embedding)
    assert found.direction == pytest.approx([-0.6, 0.8], abs=0.01)
    assert np.corrcoef(found.scores, along)[0, 1] < -0.99
    assert found.explained > 0.99
    assert found.scores.mean() == pytest.approx(0.0, abs=1e-12)


def test_a_constant_embedding_has_no_direction():
    found = first_component(np.ones((8, 2)))
    assert isinstance(found, NotComputable)
    assert "everyone has the same embedding" in found.reason
    assert isinstance(first_component(np.eye(3)), NotComputable)
