from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.baselines import IdentityMapper
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_quality import RESAMPLES, label_quality, mapper_quality, two_way_ci95
from steerlab.learning.series import LabelSeries

ARRAYS = {
    "person": np.array(["a", "a", "a", "b", "b"]),
    "raw": np.array([1.0, 2.0, 0.0, -1.0, 1.0]),
    "mapped": np.array([0.5, 1.0, 0.5, -2.0, 1.0]),
    "truth": np.array([0.0, 1.0, 1.0, 1.0, 1.0]),
}


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_hand_computed():
    # |a - o| = 1 1 1 2 0; |mapped - o| = .5 0 .5 3 0
    quality = label_quality(**ARRAYS, rng=rng())
    assert (quality.people, quality.labels) == (2, 5)
    assert quality.mae_before == pytest.approx(1.0)
    assert quality.mae_after == pytest.approx(0.8)
    assert quality.improvement == pytest.approx(0.2)
    assert quality.person_median == pytest.approx((2 / 3 - 0.5) / 2)
    assert quality.people_improved == 0.5
    assert quality.labels_worsened == pytest.approx(0.2)
    assert quality.per_sample_percent == pytest.approx(100 * (0.5 + 1.0 + 0.5 - 0.5) / 4)
    # The bootstrap draws two of two people: a a, a b or b b.
    assert quality.ci95 == (pytest.approx(-0.5), pytest.approx(2 / 3))


def test_an_error_near_zero_wrecks_the_paper_figure_and_nothing_else():
    truth = np.zeros(1000)
    raw = np.full(1000, 1.0)
    raw[0] = 1e-6
    mapped = np.full(1000, 0.4)
    quality = label_quality(np.repeat(["a", "b"], 500), raw, mapped, truth, rng())
    assert quality.improvement == pytest.approx(0.6, abs=1e-3)
    assert quality.person_median == pytest.approx(0.6, abs=1e-2)
    assert quality.per_sample_percent < -30_000


def test_a_faultless_person_made_worse_counts_against():
    person = np.array(["good", "good", "poor", "poor"])
    quality = label_quality(
        person, np.array([0.0, 0.0, 2.0, 2.0]), np.array([0.5, 0.0, 1.0, 1.0]), np.zeros(4), rng()
    )
    assert quality.people_improved == 0.5
    assert quality.person_median == -np.inf
    assert quality.improvement == pytest.approx(1 - 2.5 / 4)


@settings(deadline=None)
@given(scale=st.floats(0.1, 100.0))
def test_units_do_not_matter(scale: float):
    changed = {
        name: values if name == "person" else values * scale for name, values in ARRAYS.items()
    }
    first, second = label_quality(**ARRAYS, rng=rng()), label_quality(**changed, rng=rng())
    assert second.improvement == pytest.approx(first.improvement)
    assert second.ci95 == pytest.approx(first.ci95)


def test_the_interval_narrows_with_people_and_covers_the_figure():
    noise = rng()
    widths = []
    for people in (8, 128):
        person = np.repeat(np.arange(people), 20)
        raw = noise.normal(size=people * 20) * np.repeat(noise.uniform(0.5, 2.0, people), 20)
        quality = label_quality(person, raw, 0.5 * raw + 0.1, np.zeros_like(raw), rng())
        low, high = quality.ci95
        assert low < quality.improvement < high
        widths.append(high - low)
    assert widths[1] < widths[0] / 2


def test_one_person_has_no_interval():
    quality = label_quality(np.array(["a"]), np.ones(1), np.zeros(1), np.zeros(1), rng())
    assert np.isnan(quality.ci95).all()
    assert quality.improvement == 1.0


def test_the_same_rng_gives_the_same_interval():
    assert label_quality(**ARRAYS, rng=rng()) == label_quality(**ARRAYS, rng=rng())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"raw": np.zeros(4)}, "as many of each"),
        ({"mapped": np.array([0.0, np.nan, 0.0, 0.0, 0.0])}, "mapped has a value"),
        ({"raw": ARRAYS["truth"]}, "equal the truth"),
    ],
)
def test_what_cannot_be_scored_is_an_error(changes, message):
    with pytest.raises(InvalidLabels, match=message):
        label_quality(**(ARRAYS | changes), rng=rng())


def test_masked_steps_never_score():
    one = LabelSeries(
        person="p",
        rollout="r",
        rate_hz=20.0,
        label=np.array([1.0, np.nan, 1.0, 2.0]),
        truth=np.array([0.0, 0.0, np.nan, 0.0]),
        valid=np.array([True, False, False, False]),
    )
    assert mapper_quality(IdentityMapper(), [one], rng()).labels == 1
    with pytest.raises(InvalidLabels, match="at least one"):
        mapper_quality(IdentityMapper(), [], rng())


def _every_draw(before, after):
    """Improvements of all equally likely draws of two people and of two drives, directly."""
    found = []
    for people in product(range(2), repeat=2):
        for drives in product(range(2), repeat=2):
            cells = [(person, drive) for person in people for drive in drives]
            sums = [sum(errors[cell] for cell in cells) for errors in (before, after)]
            found.append(1.0 - sums[1] / sums[0])
    return found


def test_two_way_interval_is_the_direct_one_of_a_small_table():
    before = np.array([[4.0, 1.0], [2.0, 3.0]])
    after = np.array([[1.0, 0.8], [1.9, 0.3]])
    direct = _every_draw(before, after)  # 16: each extreme has a sixteenth of the probability
    assert two_way_ci95(before, after, rng()) == (
        pytest.approx(min(direct)),
        pytest.approx(max(direct)),
    )


def test_two_way_interval_is_the_one_of_loops_over_rows():
    """People of five drives each: resampled one draw after another, by their names."""
    chance = np.random.default_rng(4)
    before = chance.gamma(2.0, 1.0, (9, 5)) * chance.gamma(2.0, 1.0, 5)
    after = before * chance.uniform(0.1, 0.6, (9, 1))
    before[2, 3] = after[2, 3] = 0.0  # not scored
    direct = []
    for _ in range(RESAMPLES):
        people, drives = chance.integers(9, size=9), chance.integers(5, size=5)
        parts = [errors[people][:, drives].sum() for errors in (before, after)]
        direct.append(1.0 - parts[1] / parts[0])
    found = two_way_ci95(before, after, rng())
    assert found == pytest.approx(tuple(np.percentile(direct, [2.5, 97.5])), abs=0.02)
    assert two_way_ci95(before, after, rng()) == found


def test_drives_that_differ_widen_the_interval():
    """Drawing people alone, as in ``label_quality``, would not see it."""
    before = np.ones((20, 5))
    after = np.tile([0.1, 0.2, 0.5, 0.8, 0.9], (20, 1))
    low, high = two_way_ci95(before, after, rng())
    assert high - low > 0.4
    one_drive = two_way_ci95(before[:, :1], after[:, :1], rng())
    assert np.isnan(one_drive).all()


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (np.ones(3), np.ones(3), "give .people, drives. of both"),
        (np.ones((2, 3)), np.ones((3, 2)), r"are \(2, 3\) and \(3, 2\)"),
        (np.ones((2, 2)), np.full((2, 2), np.nan), "not finite"),
        (np.ones((2, 2)), -np.ones((2, 2)), "negative"),
        (np.zeros((2, 2)), np.zeros((2, 2)), "no improvement is defined"),
    ],
)
def test_what_gives_no_two_way_interval_is_said(before, after, said):
    with pytest.raises(InvalidLabels, match=said):
        two_way_ci95(before, after, rng())
