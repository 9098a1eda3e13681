"""A made-up study whose answers, labels and w are drawn from a seed: every case is cheap to build."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from steerlab.analysis.study_data.records import (
    ConditionValue,
    Embeddings,
    HeldOut,
    Person,
    Plan,
    PlannedHypothesis,
    StudyData,
)
from steerlab.analysis.study_tables.tables import Analysis, AnalysisConfig, analyse
from steerlab.learning.series import LabelSeries
from steerlab.study.surveys.questionnaire_file import shipped_questionnaires

QUESTIONNAIRES = (
    "demographics",
    "experience_games",
    "experience_driving",
    "trust",
    "mini_ipip_5",
)
STEPS, RATE_HZ = 80, 20.0


def made_up_study(people: int = 16, *, test_people: int = 0, seed: int = 4) -> StudyData:
    """Gains and delays are in w; neuroticism follows the gain, nothing else follows anything."""
    rng = np.random.default_rng(seed)
    asked = {key: shipped_questionnaires()[key] for key in QUESTIONNAIRES}
    everyone = [f"T{n + 1:03d}" for n in range(people)]
    tested = [f"P{n + 1:03d}" for n in range(test_people)]
    names = [*everyone, *tested]
    log_gain = dict(zip(names, rng.normal(0.0, 0.4, len(names)), strict=True))
    delay = {who: int(rng.integers(0, 6)) for who in log_gain}
    members = tuple(
        Person(
            id=who,
            role="training" if who in everyone else "test",
            answers={key: _answers(one, rng, log_gain[who]) for key, one in asked.items()},
        )
        for who in log_gain
    )
    series = tuple(
        _series(who, rollout, log_gain[who], delay[who], rng)
        for who in log_gain
        for rollout in ("a", "b", "c")
    )
    style = np.array([[log_gain[who], delay[who]] for who in everyone])
    w = style / [0.4, 1.7] + rng.normal(0.0, 0.2, style.shape)
    before = rng.uniform(0.3, 0.8, people)
    return StudyData(
        kind="study",
        title="A made-up study",
        simulated=True,
        people=members,
        series=series,
        questionnaires=asked,
        embeddings=(
            Embeddings(seed=0, source="the frozen network", people=tuple(everyone), w=w),
            Embeddings(
                seed=1,
                source="another one",
                people=tuple(everyone),
                w=w @ [[0.0, 2.0], [-1.0, 0.5]] + rng.normal(0.0, 0.1, w.shape),
                held_out=("c",),
            ),
        ),
        held_out=(
            HeldOut(
                seed=0,
                role="training",
                people=tuple(everyone),
                before=100.0 * before,
                after=40.0 * before,
                labels=np.full(people, 100),
                worsened=300,
                ratios=700.0,
                with_error=100 * people,
            ),
        ),
        enrolled=people + test_people,
    )


def made_up_outcomes(
    people: int = 12, *, means: dict[str, float] | None = None, rounds: int = 3, seed: int = 5
) -> tuple[ConditionValue, ...]:
    """Success by round: it rises to the condition's mean."""
    rng = np.random.default_rng(seed)
    means = means or {"mind_meld": 0.8, "bc": 0.3, "dagger": 0.5}
    found: list[ConditionValue] = []
    for number in range(people):
        skill = rng.normal(0.0, 0.05)
        order = rng.permutation(len(means)).tolist()
        for place, (name, mean) in enumerate(means.items()):
            for round_ in range(rounds):
                value = mean * round_ / (rounds - 1) + skill + rng.normal(0.0, 0.05)
                found.append(
                    ConditionValue(
                        person=f"P{number + 1:03d}",
                        condition=name,
                        metric="success",
                        value=float(np.clip(value, 0.0, 1.0)),
                        round=round_,
                        position=order[place],
                    )
                )
    return tuple(found)


def plan(**changes: object) -> Plan:
    """The plan of the shipped protocol, as far as it matters here."""
    outcomes = {
        "H1": (
            "mean absolute error of labels against the ground truth, held-out rollouts, per person",
            "paired, mapped against given",
        ),
        "H3a": ("multiple R of w with the signed DTW distance (Eq. 3)", "permutation"),
        "H3b": ("multiple R of w with the mean lag along the DTW path", "permutation"),
    }
    values: dict[str, object] = {
        "alpha": 0.05,
        "correction": "holm",
        "hypotheses": tuple(
            PlannedHypothesis(id=name, text=f"{name}.", outcome=what, test=test, primary=True)
            for name, (what, test) in outcomes.items()
        ),
        "exclusions": (
            "A participant without a finished attempt at every calibration rollout is left out.",
        ),
        "version": 1,
        "sha256": "ab" * 32,
        "protocol_sha256": "cd" * 32,
        "frozen_utc": "2026-01-01T00:00:00.000Z",
    }
    return Plan(**(values | changes))


@pytest.fixture
def study() -> Callable[..., StudyData]:
    """``study(people, test_people=..., seed=...)``."""
    return made_up_study


@pytest.fixture
def outcomes() -> Callable[..., tuple[ConditionValue, ...]]:
    """``outcomes(people, means=..., rounds=...)``."""
    return made_up_outcomes


@pytest.fixture
def make_plan() -> Callable[..., Plan]:
    """``make_plan(alpha=...)``."""
    return plan


@pytest.fixture
def tables_of() -> Callable[[StudyData], dict]:
    """The tables of a study, with few permutations."""
    return lambda data: analysed(data).tables


@pytest.fixture(scope="session")
def whole() -> Analysis:
    """A study with everything in it, analysed once."""
    data = replace(made_up_study(20, test_people=4), conditions=made_up_outcomes(), plan=plan())
    return analysed(data)


def analysed(data: StudyData) -> Analysis:
    return analyse(data, AnalysisConfig(permutations=499))


def _answers(questionnaire, rng: np.random.Generator, log_gain: float) -> dict:
    if questionnaire.key == "demographics":
        return {"age": int(rng.integers(18, 60)), "gender": str(rng.choice(["woman", "man"]))}
    found: dict[str, int] = {}
    for scale in questionnaire.scales:
        low, high = questionnaire.item_range(scale.key)
        trait = 2.5 * log_gain if scale.key == "neuroticism" else rng.normal()
        for item in scale.items:
            if item in found:
                continue
            middle = (low + high) / 2.0 + (high - low) / 4.0 * (trait + rng.normal(0.0, 0.5))
            value = int(np.clip(round(middle), low, high))
            found[item] = low + high - value if item in scale.reversed else value
    return found


def _series(
    who: str, rollout: str, log_gain: float, delay: int, rng: np.random.Generator
) -> LabelSeries:
    t = np.arange(STEPS) / RATE_HZ
    truth = np.sin(2.0 * t + ord(rollout)) + 0.3 * np.sin(5.0 * t)
    late = np.roll(truth, delay)
    late[:delay] = truth[0]
    label = np.clip(np.exp(log_gain) * late + rng.normal(0.0, 0.03, STEPS), -2.5, 2.5)
    return LabelSeries(
        person=who,
        rollout=rollout,
        rate_hz=RATE_HZ,
        label=label,
        truth=truth,
        valid=np.ones(STEPS, dtype=bool),
    )
