"""``auto``: chosen on labels that no candidate was fitted on; and what motion alone gives away."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.learning.baselines import NoLabelsMapper
from steerlab.learning.baselines.auto import AutoMapper
from steerlab.learning.baselines.choosing import choose
from steerlab.learning.errors import InvalidLabels, NotFitted
from steerlab.learning.series import CONTEXT, LabelSeries

PEOPLE, DRIVES, STEPS = 7, 6, 60


def drive(person: int, number: int, rng: np.random.Generator) -> LabelSeries:
    truth = np.sin(0.1 * np.arange(STEPS) * (1 + number)) + 0.1 * number
    motion = np.column_stack([0.2 * truth, np.full(STEPS, 5.0), truth + 0.3])
    return LabelSeries(
        person=f"P{person}",
        rollout=f"drive-{number}",
        rate_hz=20.0,
        label=np.clip(1.5 * truth + rng.normal(0.0, 0.2, STEPS), -2.5, 2.5),
        truth=truth,
        valid=np.ones(STEPS, dtype=bool),
        context=motion,
        context_names=CONTEXT,
    )


@pytest.fixture
def series() -> list[LabelSeries]:
    rng = np.random.default_rng(3)
    return [drive(person, number, rng) for person in range(PEOPLE) for number in range(DRIVES)]


class Off:
    """Maps every label to the truth plus a constant, and remembers what it was given."""

    def __init__(self, name: str, by: float) -> None:
        self.name, self.by = name, by
        self.learned: list[LabelSeries] = []
        self.mapped: list[LabelSeries] = []

    def fit(self, series):
        self.learned += series

    def calibrate(self, series):
        self.learned += series

    def map(self, series):
        self.mapped.append(series)
        return series.truth + self.by


class Refuses(Off):
    def fit(self, series):
        raise InvalidLabels("It takes more.")


def test_who_is_right_alone_is_chosen_alone(series):
    builders = {"right": lambda: Off("right", 0.01), "wrong": lambda: Off("wrong", 0.4)}
    choice = choose(series, builders, seed=0)
    assert choice.weights == {"right": 1.0}
    assert choice.improvement["right"] == choice.blended > choice.improvement["wrong"]


def test_errors_of_opposite_sign_are_blended_away(series):
    builders = {"high": lambda: Off("high", 0.3), "low": lambda: Off("low", -0.3)}
    choice = choose(series, builders, seed=0)
    assert choice.weights == {"high": 0.5, "low": 0.5}
    assert choice.blended == pytest.approx(1.0)
    auto = AutoMapper({name: build() for name, build in builders.items()}, choice)
    assert auto.map(series[0]) == pytest.approx(series[0].truth)
    assert "0.5 high + 0.5 low" in str(choice)


def test_nothing_is_judged_on_a_drive_that_a_candidate_learned_from(series):
    """One truth under two names is one drive; a third of the people is new to every candidate."""
    again = [replace(one, rollout="again") for one in series if one.rollout == "drive-2"]
    candidate = Off("one", 0.1)
    choose([*series, *again], {"one": lambda: candidate}, seed=0)
    learned = {one.truth.tobytes() for one in candidate.learned}
    judged = {one.truth.tobytes() for one in candidate.mapped}
    assert not learned & judged
    assert {one.rollout for one in candidate.mapped} >= {"drive-2", "again"}
    assert {one.person for one in candidate.mapped} == {one.person for one in series}


def test_a_candidate_that_cannot_be_fitted_is_named(series):
    builders = {"one": lambda: Off("one", 0.1), "other": lambda: Refuses("other", 0.0)}
    choice = choose(series, builders, seed=0)
    assert choice.left_out == {"other": "It takes more."}
    with pytest.raises(NotFitted, match="blends one, which it was not given"):
        AutoMapper({}, choice)


def test_motion_alone_needs_no_label_and_takes_what_the_robot_gives_away(series):
    mapper = NoLabelsMapper()
    mapper.fit(series)
    one = series[0]
    found = mapper.map(one)
    assert np.abs(found - one.truth).mean() < 0.05 * np.abs(one.label - one.truth).mean()
    other = replace(one, label=-one.label)
    assert np.array_equal(mapper.map(other), found)
    late = np.arange(STEPS) >= 5
    masked = replace(one, label=np.where(late, one.label, np.nan), valid=late)
    assert np.isnan(mapper.map(masked)[:5]).all()
    with pytest.raises(InvalidLabels, match="has no yaw_rate_radps, robot_wheel"):
        mapper.map(replace(one, context=np.empty((0, 0)), context_names=()))
    with pytest.raises(NotFitted):
        NoLabelsMapper().map(one)
