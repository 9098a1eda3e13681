"""The shipped instruments: keyed as published, and honest about what is not validated."""

import pytest

from steerlab.study.surveys.questionnaire_file import shipped_questionnaires
from steerlab.study.surveys.scoring import score

SHIPPED = {key: one for key, one in shipped_questionnaires().items() if not one.translates}
EXPERIENCE = ("experience_games", "experience_sim_driving", "experience_driving")
# The published key (Donnellan et al. 2006, appendix): number, factor, sign.
MINI_IPIP = """1+E 2+A 3+C 4+N 5+I 6-E 7-A 8-C 9-N 10-I
               11+E 12+A 13+C 14+N 15-I 16-E 17-A 18-C 19-N 20-I"""
FACTORS = {
    "E": "extraversion",
    "A": "agreeableness",
    "C": "conscientiousness",
    "N": "neuroticism",
    "I": "openness",  # the source calls it Intellect/Imagination
}


def test_all_are_there():
    assert set(SHIPPED) == {
        "mini_ipip_5",
        "mini_ipip_7",
        "trust",
        *EXPERIENCE,
        "demographics",
        "raw_tlx",
        "fluency",
    }


@pytest.mark.parametrize("high", [5, 7])
def test_the_mini_ipip_is_keyed_as_published(high):
    found = SHIPPED[f"mini_ipip_{high}"]
    keys = {
        (scale.key, item, item in scale.reversed) for scale in found.scales for item in scale.items
    }
    published = set()
    for word in MINI_IPIP.split():
        published.add((FACTORS[word[-1]], f"i{int(word[:-2]):02d}", word[-2] == "-"))
    assert keys == published
    assert sum(reverse for *_, reverse in keys) == 11
    for scale in found.scales:
        assert found.score_range(scale.key) == (4, 4 * high)


def test_the_two_mini_ipip_ask_the_same():
    five, seven = SHIPPED["mini_ipip_5"], SHIPPED["mini_ipip_7"]
    assert [item.text for item in five.items] == [item.text for item in seven.items]
    assert five.scales == seven.scales
    assert (five.unvalidated, seven.unvalidated) == (False, True)


def test_only_seven_points_can_give_the_papers_openness():
    """18.4 ± 5.2: one standard deviation above is past what five points allow."""
    assert 18.4 + 5.2 > SHIPPED["mini_ipip_5"].score_range("openness")[1] == 20
    assert SHIPPED["mini_ipip_7"].score_range("openness")[1] > 18.4 + 5.2


def test_trust_has_a_total_and_two_sub_scores():
    found = SHIPPED["trust"]
    answers = {item.id: 7 if number <= 5 else 2 for number, item in enumerate(found.items, 1)}
    scores = {key: one.score for key, one in score(found, answers).items()}
    assert scores == {"total": 5 * 1 + 7 * 2, "trust": 14, "distrust": 35}
    ranges = {scale.key: found.score_range(scale.key) for scale in found.scales}
    assert ranges == {"total": (12, 84), "trust": (7, 49), "distrust": (5, 35)}
    assert "deceptive" in found.items[0].text
    assert "confident" in found.items[5].text


@pytest.mark.parametrize("key", EXPERIENCE)
def test_experience_has_the_papers_length_and_format(key):
    found = SHIPPED[key]
    assert len(found.items) == 8
    assert all(item.format.points[0] == (1, "Strongly disagree") for item in found.items)
    assert all(item.format.points[-1] == (7, "Strongly agree") for item in found.items)
    backwards = [found.item(item).text for item in found.scale("experience").reversed]
    assert [("rarely" in text, "difficult" in text) for text in backwards] == [
        (True, False),
        (False, True),
    ]


def test_performance_in_the_tlx_runs_from_perfect_to_failure():
    found = SHIPPED["raw_tlx"]
    assert len(found.items) == 6
    assert all((i.format.low, i.format.high, i.format.step) == (0, 100, 5) for i in found.items)
    performance = found.item("performance").format
    assert (performance.low_label, performance.high_label) == ("Perfect", "Failure")
    assert not found.scale("workload").reversed
    answers = dict(zip([item.id for item in found.items], (0, 10, 20, 30, 40, 50), strict=True))
    assert score(found, answers)["workload"].score == 25.0


def test_every_choice_about_a_person_can_be_declined():
    found = SHIPPED["demographics"]
    for item in found.items:
        if item.kind == "choice":
            assert found.check(item.id, "prefer_not_to_say")
        else:
            assert not item.required
    assert found.check("gender", "self_described")
    assert found.check("gender_own_words", "agender") == "agender"


def test_what_is_ours_says_so():
    ours = {key for key, one in SHIPPED.items() if one.unvalidated}
    assert ours == {*EXPERIENCE, "fluency", "mini_ipip_7"}
    for key in (*EXPERIENCE, "fluency"):
        assert SHIPPED[key].citation.startswith("Our own items")
        assert "unvalidated" in SHIPPED[key].citation


@pytest.mark.parametrize("key", sorted(SHIPPED))
@pytest.mark.parametrize("end", [0, -1])
def test_the_range_of_every_scale_is_what_extreme_answers_give(key, end):
    found = SHIPPED[key]
    for scale in found.scales:
        bounds = found.item_range(scale.key)
        answers = {
            item: bounds[end] if item not in scale.reversed else bounds[-1 - end]
            for item in scale.items
        }
        one = score(found, answers)[scale.key]
        assert one.score == found.score_range(scale.key)[end]
        assert one.rescaled == abs(end)
