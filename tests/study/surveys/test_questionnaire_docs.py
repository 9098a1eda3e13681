"""What the documentation says of questionnaires is so."""

import re
from pathlib import Path

import pytest

from steerlab.sim.errors import InvalidValue
from steerlab.study.surveys.questionnaire_file import (
    questionnaire_from_toml,
    shipped_questionnaires,
)

PAGE = (Path(__file__).parents[3] / "docs" / "questionnaires.md").read_text(encoding="utf-8")
EXAMPLE = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[0]


def test_the_table_lists_what_is_shipped():
    rows = re.findall(r"^\| `(\w+)` \| (\d+) \|(.*)$", PAGE, re.MULTILINE)
    shipped = {key: one for key, one in shipped_questionnaires().items() if not one.translates}
    assert {key: int(items) for key, items, _ in rows} == {
        key: len(one.items) for key, one in shipped.items()
    }
    for key, _, rest in rows:
        assert ("**unvalidated**" in rest) == shipped[key].unvalidated
        for scale in shipped[key].scales:
            low, high = shipped[key].score_range(scale.key)
            assert scale.key in rest
            assert f"{low}-{high}" in rest


def test_the_example_is_a_questionnaire_and_its_error_is_the_one_shown():
    assert questionnaire_from_toml(EXAMPLE, "sickness.toml").score_range("sickness") == (0, 3)
    with pytest.raises(InvalidValue) as caught:
        questionnaire_from_toml(EXAMPLE.replace('3 = "Severe"\n', "", 1), "sickness.toml")
    assert f"`{caught.value}`" in PAGE
