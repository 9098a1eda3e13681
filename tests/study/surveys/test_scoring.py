"""Scores follow the key; a missing answer leaves a score empty."""

import numpy as np
import pytest

from steerlab.sim.errors import InvalidValue
from steerlab.study.surveys.answer_format import InvalidAnswer
from steerlab.study.surveys.scoring import keyed, keyed_table, score


def test_sum_and_mean_with_a_reversed_item(small):
    found = score(small, {"a": 2, "b": 1, "c": 4})
    assert found["all"].score == 2 + (1 + 5 - 1) + 4
    assert found["two"].score == 1.5  # b is not reversed there
    assert (found["all"].low, found["all"].high, found["all"].reason) == (3, 15, "")
    assert found["all"].rescaled == pytest.approx(8 / 12)
    assert found["two"].rescaled == pytest.approx(0.125)


def test_a_missing_answer_is_never_imputed(small):
    found = score(small, {"a": 5, "b": 5})
    assert found["all"].score is None
    assert found["all"].rescaled is None
    assert (found["all"].answered, found["all"].asked) == (2, 3)
    assert found["all"].reason == "no answer to c"
    assert found["two"].score == 5.0
    nothing = score(small, {})["all"]
    assert (nothing.score, nothing.answered) == (None, 0)
    assert nothing.reason == "no answer to a, b, c"


def test_answers_as_a_form_sends_them_score_alike(small):
    assert score(small, {"a": "2", "b": "1", "c": "4"}) == score(small, {"a": 2, "b": 1, "c": 4})


@pytest.mark.parametrize("answers", [{"a": 6}, {"z": 1}, {"pick": "other"}])
def test_a_wrong_answer_is_refused_not_skipped(small, answers):
    with pytest.raises(InvalidAnswer):
        score(small, answers)


def test_keyed_answers_of_several_people(small):
    assert keyed(small, "all", {"a": 1, "b": 1}) == (1, 5, None)
    table = keyed_table(small, "all", [{"a": 1, "b": 1, "c": 1}, {"a": 3, "c": 4}])
    np.testing.assert_array_equal(table, [[1, 5, 1], [3, np.nan, 4]])
    assert keyed_table(small, "all", []).shape == (0, 3)
    with pytest.raises(InvalidValue):
        keyed_table(small, "none", [])
