"""Scripted answers: allowed, repeatable, as reliable as asked for, and tied to style as planted."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import sample_style
from steerlab.sim.scripted_teacher import TeacherStyle
from steerlab.study.planted_effects import (
    PlantedEffect,
    check_effects,
    effects_on,
    style_score,
    trait_scales,
)
from steerlab.study.scripted_answers import (
    AnswerModel,
    ScriptedRespondent,
    answers,
    draw_traits,
)
from steerlab.study.surveys.answer_format import Choice, FreeText, Likert, Number, Option
from steerlab.study.surveys.questionnaire import Item, Questionnaire
from steerlab.study.surveys.questionnaire_file import shipped_questionnaires
from steerlab.study.surveys.reliability import cronbach_alpha
from steerlab.study.surveys.scoring import keyed_table, score

SHIPPED = shipped_questionnaires()
PEOPLE = 2000
MINI_IPIP = SHIPPED["mini_ipip_5"]


def _effect(correlation=0.5, *, scale="mini_ipip_5.extraversion", style="gain") -> PlantedEffect:
    return PlantedEffect(scale=scale, style=style, correlation=correlation)


def _people(questionnaire, model, *, population="human", seed=11, count=PEOPLE):
    """Styles, traits and answers of simulated people."""
    rng = np.random.default_rng(seed)
    styles = [sample_style(population, rng) for _ in range(count)]
    traits = [draw_traits(questionnaire, style, rng, model=model) for style in styles]
    sheets = [
        answers(questionnaire, style, rng, model=model, traits=one)
        for style, one in zip(styles, traits, strict=True)
    ]
    return styles, traits, sheets


def _correlation(one, other) -> float:
    return float(np.corrcoef(one, other)[0, 1])


def _is_near(r: float, planted: float, count: int = PEOPLE) -> bool:
    """Within four standard errors, on Fisher's scale."""
    return abs(np.arctanh(r) - np.arctanh(planted)) < 4.0 / np.sqrt(count - 3)


@pytest.mark.parametrize("key", sorted(SHIPPED))
@pytest.mark.parametrize("success", [None, 0.0, 1.0])
def test_every_answer_is_allowed_and_none_is_missing(key, success):
    found = SHIPPED[key]
    rng = np.random.default_rng(3)
    for _ in range(50):
        sheet = answers(found, None, rng, success=success)
        assert found.missing(sheet) == []
        for item, value in sheet.items():
            assert found.check(item, value) == value
        assert list(sheet) == [item.id for item in found.items if item.id in sheet]


@pytest.mark.parametrize(
    ("style", "population", "planted"),
    [
        ("gain", "human", 0.5),
        ("delay", "human", -0.3),
        ("gain", "paper", -0.5),
        ("delay", "paper", 0.3),
        ("gain", "low", 0.0),
        ("delay", "high", 0.9),
        ("gain", "people", 0.5),
        ("delay", "people", 0.5),
        ("gain", "sparse", 0.5),
    ],
)
def test_a_planted_correlation_is_recovered(style, population, planted):
    model = AnswerModel(population=population, effects=(_effect(planted, style=style),))
    styles, traits, sheets = _people(MINI_IPIP, model, population=population)
    parameter = [style_score(one, style, population) for one in styles]
    trait = [one["extraversion"] for one in traits]
    scores = keyed_table(MINI_IPIP, "extraversion", sheets).sum(axis=1)
    assert _is_near(_correlation(parameter, trait), planted)
    # the score is the trait with measurement error
    seen = _correlation(trait, scores)
    assert 0.8 < seen < 0.95
    assert _is_near(_correlation(parameter, scores), planted * seen)


def test_what_is_not_planted_does_not_correlate():
    model = AnswerModel(effects=(_effect(0.7),))
    styles, _, sheets = _people(MINI_IPIP, model)
    gain = [style_score(one, "gain", "human") for one in styles]
    delay = [style_score(one, "delay", "human") for one in styles]
    found = {
        scale.key: keyed_table(MINI_IPIP, scale.key, sheets).sum(axis=1)
        for scale in MINI_IPIP.scales
    }
    assert _correlation(gain, found["extraversion"]) > 0.5
    assert _is_near(_correlation(delay, found["extraversion"]), 0.0)
    for scale in ("agreeableness", "conscientiousness", "neuroticism", "openness"):
        assert _is_near(_correlation(gain, found[scale]), 0.0)
        assert _is_near(_correlation(found["extraversion"], found[scale]), 0.0)


def test_two_styles_can_share_a_trait():
    model = AnswerModel(effects=(_effect(0.6), _effect(-0.6, style="delay")))
    styles, traits, _ = _people(MINI_IPIP, model)
    trait = [one["extraversion"] for one in traits]
    for style, planted in (("gain", 0.6), ("delay", -0.6)):
        parameter = [style_score(one, style, "human") for one in styles]
        assert _is_near(_correlation(parameter, trait), planted)
    assert np.std(trait) == pytest.approx(1.0, abs=4 / np.sqrt(2 * PEOPLE))


@pytest.mark.parametrize("key", [key for key, one in SHIPPED.items() if one.scales])
def test_scales_are_about_as_reliable_as_peoples(key):
    _, _, sheets = _people(SHIPPED[key], AnswerModel())
    for scale in trait_scales(SHIPPED[key]):
        assert 0.7 < cronbach_alpha(keyed_table(SHIPPED[key], scale, sheets)).alpha < 0.85


@pytest.mark.parametrize("reliability", [0.0, 0.5, 0.9])
def test_the_reliability_is_the_one_asked_for(reliability):
    _, _, sheets = _people(SHIPPED["trust"], AnswerModel(reliability=reliability))
    found = cronbach_alpha(keyed_table(SHIPPED["trust"], "total", sheets))
    assert found.alpha == pytest.approx(reliability, abs=0.08)


def test_distrust_goes_against_trust():
    _, _, sheets = _people(SHIPPED["trust"], AnswerModel())
    scores = [score(SHIPPED["trust"], one) for one in sheets]
    both = [[one[key].score for one in scores] for key in ("trust", "distrust")]
    assert _correlation(*both) < -0.4


@pytest.mark.parametrize(
    ("key", "scale", "sign"),
    [("raw_tlx", "workload", -1), ("trust", "total", 1), ("fluency", "fluency", 1)],
)
def test_success_moves_what_is_asked_about_a_condition(key, scale, sign):
    found = SHIPPED[key]
    means = []
    for success in (0.0, 0.5, 1.0):
        rng = np.random.default_rng(6)
        sheets = [answers(found, None, rng, success=success) for _ in range(500)]
        means.append(np.mean([score(found, one)[scale].rescaled for one in sheets]))
    assert np.all(sign * np.diff(means) > 0.03)


def test_without_a_shift_success_moves_nothing():
    model = AnswerModel(success_shift=())
    low, high = (
        answers(SHIPPED["trust"], None, np.random.default_rng(6), model=model, success=success)
        for success in (0.0, 1.0)
    )
    assert low == high


def test_a_person_is_the_same_person_on_every_occasion():
    found = SHIPPED["trust"]
    pairs = []
    for seed in range(400):
        one = ScriptedRespondent(f"p-{seed}", None, 5)
        sheets = [one.answers(found, phase=name, success=0.5) for name in ("post-1", "post-2")]
        pairs.append([score(found, sheet)["total"].score for sheet in sheets])
    # stability .6, times the reliability of both sheets, about .8
    assert 0.3 < _correlation(*np.array(pairs).T) < 0.65


def test_answers_depend_on_seed_name_and_occasion_alone():
    style = TeacherStyle(gain=1.4)
    one = ScriptedRespondent("p-1", style, 7, AnswerModel(effects=(_effect(),)))
    first = one.answers(MINI_IPIP)
    one.answers(SHIPPED["trust"], phase="post-1", success=0.2)
    assert one.answers(MINI_IPIP) == first
    assert replace(one).answers(MINI_IPIP) == first
    assert replace(one, seed=8).answers(MINI_IPIP) != first
    assert replace(one, name="p-2").answers(MINI_IPIP) != first
    assert one.answers(MINI_IPIP, phase="again") != first


def test_demographics_are_plausible():
    _, _, sheets = _people(SHIPPED["demographics"], AnswerModel())
    ages = np.array([one["age"] for one in sheets])
    assert ages.min() >= 18
    assert ages.mean() == pytest.approx(28, abs=1.5)
    assert ages.std() == pytest.approx(11.9, abs=1.5)
    women = np.mean([one["gender"] == "woman" for one in sheets])
    assert women == pytest.approx(0.29, abs=0.05)
    assert all("gender_own_words" not in one for one in sheets)


def test_a_studys_own_questionnaire_is_answered_too():
    own = Questionnaire(
        key="own",
        title="Own",
        version=1,
        instructions="Answer.",
        citation="Ours.",
        licence_note="Ours.",
        unvalidated=True,
        items=(
            Item(id="a", text="A", format=Likert(low=0, high=3, anchors=((0, "no"), (3, "yes")))),
            Item(id="b", text="B", format=FreeText(longest=3)),
            Item(id="c", text="C", format=FreeText(), required=False),
            Item(id="d", text="D", format=Number(minimum=0.5, maximum=9.5)),
            Item(id="e", text="E", format=Number(minimum=0.5, maximum=0.6, whole=False)),
            Item(
                id="f",
                text="F",
                format=Choice(options=(Option(value="x", text="X"), Option(value="y", text="Y"))),
            ),
        ),
    )
    rng = np.random.default_rng(2)
    sheets = [answers(own, None, rng) for _ in range(200)]
    assert {one["a"] for one in sheets} == {0, 1, 2, 3}
    assert {one["d"] for one in sheets} == set(range(1, 10))
    assert {one["f"] for one in sheets} == {"x", "y"}
    assert all("c" not in one for one in sheets)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: _effect(scale="extraversion"), "name a scale as <questionnaire>.<scale>"),
        (lambda: _effect(scale="mini_ipip_5."), "name a scale as"),
        (lambda: _effect(style="noise"), "choose one of gain, delay"),
        (lambda: _effect(1.01), "between -1 and 1"),
        (lambda: _effect(float("nan")), "between -1 and 1"),
        (lambda: AnswerModel(population="martian"), "choose one of paper, low, human, high"),
        (lambda: AnswerModel(reliability=1.0), "reliability is 1.0"),
        (lambda: AnswerModel(stability=-0.1), "stability is -0.1"),
        (lambda: AnswerModel(span=float("nan")), "span is nan"),
        (lambda: answers(MINI_IPIP, None, np.random.default_rng(0), success=1.5), "success"),
        (
            lambda: answers(
                MINI_IPIP, None, np.random.default_rng(0), model=AnswerModel(effects=(_effect(),))
            ),
            "needs a teacher with a known gain",
        ),
        (
            lambda: effects_on(MINI_IPIP, [_effect(scale="mini_ipip_5.honesty")]),
            "are: extraversion, agreeableness",
        ),
        (lambda: effects_on(SHIPPED["trust"], [_effect(scale="trust.distrust")]), "are: total"),
        (
            lambda: effects_on(SHIPPED["demographics"], [_effect(scale="demographics.age")]),
            "are: none",
        ),
        (lambda: effects_on(MINI_IPIP, [_effect(), _effect(0.1)]), "keep one"),
        (lambda: effects_on(MINI_IPIP, [_effect(0.8), _effect(0.8, style="delay")]), "1.28"),
        (
            lambda: check_effects(
                [_effect(scale="mini_ipip_7.openness")], {"trust": SHIPPED["trust"]}
            ),
            "needs the questionnaire 'mini_ipip_7'; the study has trust",
        ),
    ],
)
def test_what_cannot_be_simulated_is_refused(make, message):
    with pytest.raises(InvalidConfig, match=message):
        make()


def test_effects_that_a_study_can_have_pass():
    check_effects([_effect(), _effect(-0.2, scale="trust.total", style="delay")], SHIPPED)
