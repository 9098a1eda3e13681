"""What is asked beside the decision: enforced, kept without names, and covered by the hash."""

import json
from hashlib import sha256

import pytest

from steerlab.sim.errors import InvalidValue
from steerlab.study.consent import ConsentEntries, ConsentText
from steerlab.study.contract import PhaseState, Role, Standing, StudyError
from steerlab.study.scripted import ScriptedParticipant

ASKING = """[consent]
ticks = ["I have read it.", "I agree."]
signature = true
minimum_age = 18
"""


@pytest.fixture
def asking(folder, change):
    change(folder, ("[consent]\n", ASKING))


ALL = ConsentEntries(ticked=frozenset({0, 1}), of_age=True, signed=True)


def test_a_text_alone_keeps_the_hash_that_studies_have():
    text = ConsentText(version=1, text=("One.", "Two."))
    assert text.sha256 == sha256(b"One.\n\nTwo.").hexdigest()
    others = [
        ConsentText(version=1, text=text.text, **more)
        for more in (
            {"ticks": ("Yes.",)},
            {"ticks": ("No.",)},
            {"signature": True},
            {"minimum_age": 18},
            {"minimum_age": 21},
        )
    ]
    assert len({one.sha256 for one in (text, *others)}) == 6


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"ticks": ("A.", " ")}, r"^ticks\[1\] is ' '; it must be some words"),
        ({"ticks": ("A.", "A.")}, "^ticks is .*statements that differ"),
        ({"ticks": tuple(map(str, range(21)))}, "20 at most"),
        ({"minimum_age": 0}, "^minimum_age is 0; it must be from 1 to 120 years"),
        ({"minimum_age": 121}, "^minimum_age is 121"),
    ],
)
def test_what_cannot_be_asked_is_refused(more, message):
    with pytest.raises(InvalidValue, match=message):
        ConsentText(version=1, text=("One.",), **more)


@pytest.mark.parametrize(
    ("entries", "lacking"),
    [
        (ConsentEntries(), "tick.0, tick.1, age, signature"),
        (ConsentEntries(ticked=frozenset({1, 7}), of_age=True, signed=True), "tick.0"),
        (ConsentEntries(ticked=frozenset({0, 1}), signed=True), "age"),
        (ConsentEntries(ticked=frozenset({0, 1}), of_age=True), "signature"),
    ],
)
def test_a_yes_needs_all_that_is_asked_for(asking, study, entries, lacking):
    who = study.enrol(Role.TRAINING).id
    with pytest.raises(StudyError, match=f"lacks {lacking}"):
        study.consent(who, given=True, entries=entries)
    assert study.consent_record(who) is None
    assert study.participant(who).next_phase.id == "consent"
    study.consent(who, given=True, entries=ALL)
    assert study.participant(who).next_phase.id == "about-you"


def test_what_is_kept_of_it_is_counts_and_never_a_name(asking, study):
    who = study.enrol(Role.TRAINING).id
    study.consent(who, given=True, entries=ALL)
    record = study.consent_record(who)
    assert record.given
    assert record.entries == ALL
    assert record.ticked == ("I have read it.", "I agree.")
    (row,) = study._opened.store.connection.read(
        "SELECT detail FROM phase_events WHERE phase = 'consent'"
    )
    assert json.loads(row[0]) == {"ticked": [0, 1], "of_age": True, "signed": True}
    assert (
        record.text.sha256
        == study._opened.store.connection.read("SELECT sha256 FROM consents")[0][0]
    )


def test_a_no_needs_nothing(asking, study):
    who = study.enrol(Role.TRAINING).id
    study.consent(who, given=False)
    assert study.participant(who).standing is Standing.DECLINED
    assert not study.consent_record(who).too_young


def test_who_is_too_young_has_ended_whatever_they_pressed(asking, study):
    who = study.enrol(Role.TRAINING).id
    young = ConsentEntries(ticked=frozenset({0, 1}), of_age=False, signed=True)
    study.consent(who, given=True, entries=young)
    study.consent(who, given=True, entries=young)  # a second click
    record = study.consent_record(who)
    assert not record.given
    assert record.too_young
    assert study.participant(who).standing is Standing.DECLINED
    with pytest.raises(StudyError, match="has left"):
        study.save_answer(who, "about-you", "fluency", "f1", 3)
    said = [check for check in study.findings(who) if "younger than 18" in check.found]
    assert [(check.ok, check.notice) for check in said] == [(True, True)]
    with pytest.raises(StudyError, match="enrol them anew"):
        study.consent(who, given=True, entries=ALL)


def test_an_age_that_contradicts_the_consent_is_told(asking, study):
    who = study.enrol(Role.TRAINING).id
    study.consent(who, given=True, entries=ALL)
    study.save_answer(who, "about-you", "demographics", "age", 18)
    assert not [check for check in study.findings(who) if check.notice]
    study.save_answer(who, "about-you", "demographics", "age", 17)
    (told,) = [check for check in study.findings(who) if check.notice]
    assert told.found == "said to be 18 or older, and 17 afterwards"
    assert "erase" in told.mend
    assert told in study.verify().findings


def test_changed_statements_need_another_version(asking, study, folder, change):
    study.enrol(Role.TRAINING)
    change(folder, ('"I agree."', '"I agree to everything."'))
    with pytest.raises(StudyError, match=r"still called version 1; set consent\.version to 2"):
        study.amend("another statement")


def test_an_erased_consent_is_gone(asking, study):
    who = study.enrol(Role.TRAINING).id
    study.consent(who, given=True, entries=ALL)
    study.withdraw(who, erase=True)
    assert study.consent_record(who) is None


def test_scripts_tick_and_sign(asking, study, run_scripted):
    script = ScriptedParticipant(kind="human", seed=1)
    who = study.enrol(Role.TRAINING).id
    from steerlab.study.progress import progress_of

    progress = progress_of(study._opened, who)
    script.fill(study._opened, progress, progress.phase("consent"))
    assert study.participant(who).phases[0][1] is PhaseState.DONE
    assert study.consent_record(who).entries == ALL
