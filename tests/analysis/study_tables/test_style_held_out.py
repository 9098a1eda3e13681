"""H3 finds nothing where people do not differ: the noise of a drive is never in both w and style."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from steerlab.analysis.statistics.multiple_correlation import multiple_correlation
from steerlab.analysis.study_data.networks import embeddings_of, network_for
from steerlab.analysis.study_data.records import Embeddings, Person, StudyData
from steerlab.analysis.study_tables.constructs import NO_HELD_OUT
from steerlab.analysis.study_tables.tables import AnalysisConfig, analyse, exact_styles
from steerlab.learning.presets import LAB
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import split_rollouts, split_study

PEOPLE, DRIVES, STEPS = 30, 8, 80
NAMES = tuple(f"drive-{number}" for number in range(DRIVES))


def teachers_without_style(seed: int) -> tuple[LabelSeries, ...]:
    """Everyone's gain differs from drive to drive by the same chance; on average all are alike."""
    rng = np.random.default_rng(seed)
    t = np.arange(STEPS) / 20.0
    return tuple(
        LabelSeries(
            person=f"T{person:02d}",
            rollout=name,
            rate_hz=20.0,
            label=np.clip(np.exp(rng.normal(0.0, 0.3)) * truth, -2.5, 2.5),
            truth=truth,
            valid=np.ones(STEPS, dtype=bool),
        )
        for person in range(PEOPLE)
        for number, name in enumerate(NAMES)
        for truth in (np.sin(1.3 * t + number) + 0.4 * np.sin(4.0 * t),)
    )


def study_of(series: tuple[LabelSeries, ...], *networks: Embeddings) -> StudyData:
    return StudyData(
        kind="study",
        title="No styles",
        simulated=True,
        people=tuple(
            Person(id=who, role="training") for who in dict.fromkeys(s.person for s in series)
        ),
        series=series,
        embeddings=networks,
        enrolled=PEOPLE,
    )


def mean_gain(series: tuple[LabelSeries, ...], rollouts: tuple[str, ...]) -> Embeddings:
    """The w that a good mapper would find: each person's mean log gain, and a second number."""
    people = tuple(dict.fromkeys(one.person for one in series))
    gains = [
        [
            np.log(np.abs(one.label).sum() / np.abs(one.truth).sum())
            for one in series
            if one.person == who and one.rollout in rollouts
        ]
        for who in people
    ]
    w = np.column_stack([np.mean(gains, axis=1), np.std(gains, axis=1)])
    held_out = tuple(name for name in NAMES if name not in rollouts)
    return Embeddings(seed=0, source="mean gain", people=people, w=w, held_out=held_out)


def h3a(data: StudyData) -> dict:
    tables = analyse(data, AnalysisConfig(permutations=199)).tables
    return next(row for row in tables["hypotheses"] if row["id"] == "H3a")


def same_drives(data: StudyData, w: Embeddings, rollouts: tuple[str, ...]) -> tuple[float, float]:
    """R and p as they were computed before: style on the drives that w was fitted on."""
    values = np.array([s.amplitude_total for s in exact_styles(data, rollouts=rollouts)])
    rng = np.random.default_rng(0)
    found = multiple_correlation(w.of(w.people), values, rng=rng, permutations=199)
    return found.r, found.p


def test_style_on_the_drives_of_w_is_inflated_and_on_others_it_is_not():
    parts = split_rollouts(NAMES)
    before, now, rejected = [], [], 0
    for seed in range(20):
        series = teachers_without_style(seed)
        w = mean_gain(series, parts.train)
        data = study_of(series, w)
        r, p = same_drives(data, w, parts.train)
        found = h3a(data)
        before.append(r)
        now.append(found["effect"]["value"] ** 2)
        rejected += found["p"] < 0.05
        assert p < 0.05  # every one of twenty studies would have found styles that are not there
    assert min(before) > 0.9
    chance = 2.0 / (PEOPLE - 1)  # mean R² of two dimensions with nothing
    error = chance / np.sqrt(20)  # R² of two dimensions is exponential, nearly
    assert np.mean(now) == pytest.approx(chance, abs=3.0 * error)
    assert rejected <= 4  # of twenty at 5 %: more has a chance of .3 %


@pytest.mark.slow
def test_a_trained_network_is_no_exception(tmp_path: Path):
    series, parts = teachers_without_style(1), split_rollouts(NAMES)
    config = replace(LAB, training=replace(LAB.training, epochs=15))
    split = split_study(series, parts, ())
    mapper = network_for(split, config, seed=0, cache=tmp_path, progress=lambda what, share: None)
    people = tuple(dict.fromkeys(one.person for one in series))
    w = embeddings_of(mapper, people, seed=0, source="trained", held_out=parts.held_out)
    assert w is not None
    data = study_of(series, w)
    r, p = same_drives(data, w, parts.train)
    assert p < 0.05 < h3a(data)["p"]
    assert r > h3a(data)["effect"]["value"] + 0.2


def test_without_a_network_that_holds_drives_out_h3_is_not_tested():
    series = teachers_without_style(0)
    fitted_on_all = replace(mean_gain(series, NAMES), held_out=())
    found = h3a(study_of(series, fitted_on_all))
    assert (found["verdict"], found["why"]) == ("not testable", NO_HELD_OUT)
