"""Answers to a translation are answers to what it translates, in tables and in exports."""

from dataclasses import replace

import pytest

from steerlab.analysis.export.asked import asked_columns, places
from steerlab.analysis.study_data.asked import Asking
from steerlab.analysis.study_data.study import read_study
from steerlab.analysis.study_data.whole_study import read_whole_study
from steerlab.analysis.study_tables.constructs import survey_constructs
from steerlab.sim.language import ENGLISH, speak
from steerlab.study.contract import Role
from steerlab.study.study import Study
from tests.study.conftest import _run_scripted, edit, make_small

ASKED = '["fluency", "demographics"]'
GERMAN = '["trust_de", "demographics_de"]'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One scripted participant corrected the drives of a study in German."""
    made = make_small(tmp_path_factory.mktemp("german") / "study")
    edit(
        made,
        ("format = 1\n", 'format = 1\nlanguage = "de"\n'),
        (ASKED, GERMAN),
        ('["raw_tlx", "trust", "fluency"]', '["raw_tlx_de", "trust_de", "fluency_de"]'),
    )
    with Study.open(made) as study:
        _run_scripted(study, Role.TRAINING, 1)
    speak(ENGLISH)  # the run spoke German
    return made


def test_tables_have_the_original_construct_marked_as_unvalidated(folder):
    data = read_study(folder, networks=0, progress=lambda what, share: None)
    (person,) = data.people
    assert set(person.answers) == {"trust", "demographics"}
    (construct,) = survey_constructs(data, data.people)
    assert (construct.key, construct.topic, construct.people) == ("trust.total", "trust", ("T001",))
    assert data.questionnaires["trust"].unvalidated
    assert not data.questionnaires["mini_ipip_5"].unvalidated  # nobody was asked it
    (said,) = [notice for notice in data.notices if "translation" in notice]
    assert said.endswith("demographics_de, trust_de.")  # the test participants' are not asked yet


def test_columns_are_named_as_the_originals_and_tell_the_file(folder):
    with Study.open(folder, read_only=True) as study:
        whole = read_whole_study(study._opened, with_withdrawn=False)
    columns = {one.variable.name: one.variable for one in asked_columns(whole, free_text=False)}
    assert {"trust_t01", "trust_total_score", "demographics_age", "bc_trust_t01"} <= set(columns)
    assert (source := columns["trust_t01"].source)
    assert source.questionnaire == "trust_de"
    assert columns["trust_t01"].label == "Das System ist irreführend."
    assert [level.value for level in columns["demographics_gender"].levels][:2] == ["woman", "man"]
    both = replace(
        whole, asked=(*whole.asked, Asking(phase="x", condition=None, questionnaire="trust"))
    )
    names = {place.questionnaire.key: place.name for place in places(both)}
    assert (names["trust"], names["trust_de"]) == ("trust", "trust_de")
    assert names["demographics_de"] == "demographics"
