"""Branches, random orders and attention checks in a study: what counts, what is kept and found."""

import json

import pytest

from steerlab.analysis.study_data.study import why_not_counted
from steerlab.sim.errors import InvalidConfig
from steerlab.study.attention import EXCLUDED, attention_checks
from steerlab.study.contract import PhaseKind, PhaseState, Role, StudyError
from steerlab.study.item_orders import drawn_order, orders_on_record
from steerlab.study.progress import answers_of, progress_of
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.store.answers import read_responses
from steerlab.study.study import Study

FILE = """format = 1
key = "games"
title = "Games"
version = 1
unvalidated = true
order = "random"
instructions = "Please answer."
citation = "Ours."
licence_note = "Ours."

[defaults]
kind = "likert"
low = 1
high = 5
anchors = { 1 = "no", 5 = "yes" }

[[items]]
id = "played"
text = "Have you played a racing game?"
kind = "choice"
options = [{ value = "yes", text = "Yes" }, { value = "no", text = "No" }]

[[items]]
id = "liked"
text = "I liked it."
shown_if = { item = "played", is = ["yes"] }

[[items]]
id = "calm"
text = "I drive calmly."

[[items]]
id = "check"
text = "Please choose 4."
attention = 4

[[items]]
id = "remark"
text = "Anything else?"
kind = "text"
required = false
"""
KEY = "games"
PAGE = "about-you"


@pytest.fixture
def asked(folder, change):
    """The page asks ``games`` alone."""
    (folder / "questionnaires").mkdir()
    (folder / "questionnaires" / "games.toml").write_text(FILE)
    change(folder, ('["fluency", "demographics"]', '["games"]'))
    return folder


@pytest.fixture
def study(asked):
    with Study.open(asked) as opened:
        yield opened


@pytest.fixture
def who(study):
    who = study.enrol(Role.TRAINING).id
    study.consent(who, given=True)
    return who


def answer(study: Study, who: str, **answers) -> None:
    for item, value in answers.items():
        study.save_answer(who, PAGE, KEY, item, value)


def counted(study: Study, who: str) -> dict:
    return answers_of(study._opened, progress_of(study._opened, who), PAGE).get(KEY, {})


def test_a_hidden_item_is_not_missing_and_its_answer_is_kept_but_does_not_count(study, who):
    answer(study, who, played="yes", calm=2, check=4)
    assert study.submit(who, PAGE) == {KEY: ["liked"]}
    answer(study, who, liked=5)
    assert counted(study, who)["liked"] == 5
    assert study.participant(who).progress == "4 of 5 answers"
    answer(study, who, played="no")
    assert counted(study, who) == {"played": "no", "calm": 2, "check": 4}
    assert study.participant(who).progress == "3 of 4 answers"
    assert study.answers(who, PAGE, KEY)["liked"] == 5  # as the page would show it again
    assert study.submit(who, PAGE) == {}
    kept = [(one.item, one.value) for one in read_responses(study._opened.store.connection, who)]
    assert ("liked", 5) in kept
    assert study.verify().ok


def test_answers_may_come_before_what_shows_them(study, who):
    answer(study, who, liked=3)  # a page saves one by one, and tries again after an outage
    assert counted(study, who) == {}
    answer(study, who, played="yes")
    assert counted(study, who) == {"liked": 3, "played": "yes"}


def test_the_order_is_drawn_for_each_person_and_on_record(study, who):
    drawn = drawn_order(study.questionnaire(KEY), seed=2021, participant=who)
    assert study.item_order(who, PAGE, KEY) == drawn
    assert drawn[drawn.index("played") + 1] == "liked"
    others = {study.item_order(study.enrol(Role.TRAINING).id, PAGE, KEY) for _ in range(12)}
    assert len(others) > 4
    assert orders_on_record(progress_of(study._opened, who), PAGE) == {}
    answer(study, who, calm=1)
    assert orders_on_record(progress_of(study._opened, who), PAGE) == {KEY: drawn}
    query = "SELECT detail FROM phase_events WHERE phase = ? AND act = 'started'"
    assert json.loads(study._opened.store.connection.read(query, PAGE)[0][0]) == {KEY: [*drawn]}


def test_a_page_goes_on_in_the_order_on_record(study, who, folder, change):
    drawn = study.item_order(who, PAGE, KEY)
    answer(study, who, calm=1)
    file = folder / "questionnaires" / "games.toml"
    file.write_text(FILE.replace('order = "random"', 'order = "fixed"'))
    with Study.open(folder) as again:
        assert again.item_order(who, PAGE, KEY) == drawn
    file.write_text(FILE + '\n[[items]]\nid = "more"\ntext = "More."\n')
    with Study.open(folder) as again:  # other items: drawn anew, and the others keep their places
        order = again.item_order(who, PAGE, KEY)
        assert tuple(item for item in order if item != "more") == drawn


def test_a_page_of_optional_items_alone_has_its_order_on_record_as_well(study, asked, change):
    text = FILE[: FILE.index("[[items]]")] + FILE[FILE.index('[[items]]\nid = "remark"') :]
    (asked / "questionnaires" / "games.toml").write_text(text)
    with Study.open(asked) as opened:
        who = opened.enrol(Role.TRAINING).id
        opened.consent(who, given=True)
        assert opened.submit(who, PAGE) == {}
        progress = progress_of(opened._opened, who)
        assert orders_on_record(progress, PAGE) == {KEY: ("remark",)}


def test_a_phase_that_is_opened_again_has_a_record_of_its_own(study, who):
    answer(study, who, played="no", calm=2, check=4)
    assert study.submit(who, PAGE) == {}
    study.redo(who, PAGE)
    assert orders_on_record(progress_of(study._opened, who), PAGE) == {}
    answer(study, who, calm=2)
    assert set(orders_on_record(progress_of(study._opened, who), PAGE)) == {KEY}


def test_a_damaged_record_is_told_in_a_sentence(study, who, folder):
    answer(study, who, calm=1)
    connection = study._opened.store.connection
    connection.run("DROP TRIGGER update_of_phase_events")
    connection.run("UPDATE phase_events SET detail = '{' WHERE phase = ?", PAGE)
    with Study.open(folder) as again, pytest.raises(StudyError, match="study verify"):
        again.item_order(who, PAGE, KEY)


def test_a_failed_check_is_told_and_leaves_nobody_out(study, who, asked):
    answer(study, who, played="no", calm=2, check=3)
    assert attention_checks(study._opened, progress_of(study._opened, who)) == ()  # not handed in
    study.submit(who, PAGE)
    progress = progress_of(study._opened, who)
    (check,) = attention_checks(study._opened, progress)
    assert (check.item, check.expected, check.given, check.passed) == ("check", 4, 3, False)
    (told,) = [one for one in study.findings(who) if "attention" in one.found]
    assert told.found == f"failed 1 of 1 attention checks ({PAGE}: games.check is 3, not 4)"
    assert (told.ok, told.notice) == (True, True)
    assert told in study.verify().findings
    attempts = dict.fromkeys(progress.protocol.rollouts)
    assert why_not_counted(study._opened, progress, attempts) is None


def test_a_passed_check_is_said_on_the_persons_page_alone(study, who):
    answer(study, who, played="no", calm=2, check=4)
    study.submit(who, PAGE)
    (told,) = [one for one in study.findings(who) if "attention" in one.found]
    assert (told.found, told.ok, told.notice) == ("passed 1 of 1 attention checks", True, False)
    assert not [one for one in study.verify().findings if "attention" in one.found]


def test_the_plan_can_leave_out_who_failed(asked, change):
    change(asked, ("exclusions = [", f'exclusions = ["{EXCLUDED}",'))
    with Study.open(asked) as study:
        for value, why in ((4, None), (3, "failed 1 of 1 attention checks")):
            who = study.enrol(Role.TRAINING).id
            study.consent(who, given=True)
            answer(study, who, played="no", calm=2, check=value)
            study.submit(who, PAGE)
            progress = progress_of(study._opened, who)
            attempts = dict.fromkeys(progress.protocol.rollouts)
            found = why_not_counted(study._opened, progress, attempts)
            assert found is None if why is None else found.startswith(why)


def test_scripts_answer_what_they_are_shown_and_attend(asked):
    with Study.open(asked) as study:
        played = set()
        for seed in range(8):
            who = study.enrol(Role.TRAINING).id
            script = ScriptedParticipant(kind="human", seed=seed)
            for kind in (PhaseKind.CONSENT, PhaseKind.QUESTIONNAIRES):
                progress = progress_of(study._opened, who)
                script.fill(study._opened, progress, progress.of_kind(kind))
            assert study.participant(who).phases[1][1] is PhaseState.DONE
            given = study.answers(who, PAGE, KEY)
            assert given["check"] == 4
            assert ("liked" in given) == (given["played"] == "yes")
            played.add(given["played"])
        assert played == {"yes", "no"}


@pytest.mark.parametrize(
    ("protocol", "message"),
    [
        ("", r"phases\[1\]\.questionnaires\[0\] is 'games'; .*\('en'\); it is in 'de'.*games_en"),
        ('language = "de"\n', r"phases\[8\]\.after\[0\] is 'raw_tlx'; .*\('de'\); it is in 'en'"),
        ('language = "fr"\n', "language is 'fr'; it must be one of en, de"),
    ],
)
def test_a_questionnaire_in_another_language_is_refused(asked, change, protocol, message):
    file = asked / "questionnaires" / "games.toml"
    file.write_text(FILE.replace('order = "random"', 'language = "de"'))
    change(asked, ("format = 1\n", f"format = 1\n{protocol}"))
    with Study.open(asked) as study, pytest.raises(InvalidConfig, match=message):
        study.enrol(Role.TRAINING)
