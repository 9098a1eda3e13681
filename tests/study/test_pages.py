"""Consent, answers and pages: durable when acknowledged, once only, and never out of range."""

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

from steerlab.study.contract import PhaseState, Role, Standing, StudyError
from steerlab.study.store.answers import read_responses
from steerlab.study.study import Study
from steerlab.study.surveys.answer_format import InvalidAnswer


def answer_all(study: Study, who: str, phase: str = "about-you") -> None:
    at = study.participant(who).next_phase
    assert at.id == phase
    for key in at.questionnaires:
        for item in study.questionnaire(key).items:
            kind = item.kind
            if kind == "likert":
                study.save_answer(who, phase, key, item.id, item.format.low)
            elif kind == "choice":
                study.save_answer(who, phase, key, item.id, item.format.options[0].value)


def test_consent_is_kept_with_version_and_hash(study):
    who = study.enrol(Role.TRAINING).id
    shown = study.consent_text(who)
    version, text = shown.version, shown.text
    with pytest.raises(StudyError, match="is at 'consent', not at 'about-you'"):
        study.save_answer(who, "about-you", "fluency", "fluency_1", 3)
    study.consent(who, given=True)
    study.consent(who, given=True)  # a second click
    rows = study._opened.store.connection.read("SELECT given, version, sha256 FROM consents")
    assert len(rows) == 1
    assert rows[0][:2] == (1, version)
    from hashlib import sha256

    assert rows[0][2] == sha256("\n\n".join(text).encode()).hexdigest()
    with pytest.raises(StudyError, match="withdraw them instead"):
        study.consent(who, given=False)
    assert study.participant(who).next_phase.id == "about-you"


def test_consent_is_to_the_newest_text(study, folder, change):
    who = study.enrol(Role.TRAINING).id
    change(folder, ("version = 1", "version = 2"), ("Taking part is voluntary.", "You may refuse."))
    study.amend("the committee's wording")
    shown = study.consent_text(who)
    assert shown.version == 2
    assert shown.text[-1].startswith("You may refuse.")
    with pytest.raises(StudyError, match=r"decided on version 1 .* version 2 is valid now"):
        study.consent(who, given=True, shown=1)
    study.consent(who, given=True, shown=2)
    rows = study._opened.store.connection.read("SELECT version FROM consents")
    assert rows == [(2,)]


def test_who_has_decided_sees_what_they_decided_on(study, folder, change, at_about_you):
    before = study.consent_text(at_about_you)
    change(folder, ("version = 1", "version = 2"), ("Taking part is voluntary.", "You may refuse."))
    study.amend("the committee's wording")
    assert study.consent_text(at_about_you) == before
    assert study.consent_text(study.enrol(Role.TRAINING).id).version == 2
    with pytest.raises(StudyError, match="'P9' is not enrolled"):
        study.consent_text("P9")


def test_a_changed_text_needs_another_version(study, folder, change):
    study.enrol(Role.TRAINING)
    change(folder, ("Taking part is voluntary.", "You may refuse."))
    with pytest.raises(StudyError, match=r"still called version 1; set consent\.version to 2"):
        study.amend("the committee's wording")
    change(folder, ("version = 1", "version = 2"))
    assert study.amend("the committee's wording") == 2
    change(folder, ("version = 2", "version = 1"))  # one that named other words
    with pytest.raises(StudyError, match=r"set consent\.version to 3"):
        study.amend("back again")


def test_who_refuses_has_left(study):
    who = study.enrol(Role.TRAINING).id
    study.consent(who, given=False)
    view = study.participant(who)
    assert view.standing is Standing.DECLINED
    assert view.next_phase is None
    with pytest.raises(StudyError, match="enrol them anew"):
        study.consent(who, given=True)
    with pytest.raises(StudyError, match="has left"):
        study.submit(who, "about-you")


def test_answers_are_saved_one_by_one_and_the_page_says_what_is_missing(study, at_about_you):
    who = at_about_you
    items = [item.id for item in study.questionnaire("fluency").items]
    assert study.participant(who).phases[1][1] is PhaseState.WAITING
    study.save_answer(who, "about-you", "fluency", items[0], "3")  # as a form sends it
    assert study.participant(who).phases[1][1] is PhaseState.STARTED
    assert study.participant(who).progress.startswith("1 of ")
    assert study.answers(who, "about-you", "fluency") == {items[0]: 3}
    study.save_answer(who, "about-you", "fluency", items[0], 5)
    study.save_answer(who, "about-you", "fluency", items[1], 4)
    study.save_answer(who, "about-you", "fluency", items[1], None)
    assert study.answers(who, "about-you", "fluency") == {items[0]: 5}
    missing = study.submit(who, "about-you")
    assert missing["fluency"] == items[1:]
    assert "gender" in missing["demographics"]
    assert study.participant(who).next_phase.id == "about-you"
    history = [one.value for one in read_responses(study._opened.store.connection, who)]
    assert history == [3, 5, 4, None]


def test_a_double_submission_changes_nothing(study, at_about_you):
    who = at_about_you
    answer_all(study, who)
    count = study.change_count()
    answer_all(study, who)  # every answer again
    assert study.change_count() == count
    assert study.submit(who, "about-you") == {}
    count = study.change_count()
    assert study.submit(who, "about-you") == {}
    assert study.change_count() == count
    assert study.participant(who).next_phase.id == "before-practice"


@pytest.mark.parametrize("value", [0, 8, "8", 3.5, "three", "", True, float("nan"), "9" * 999])
def test_an_answer_out_of_range_is_refused(study, at_about_you, value):
    item = study.questionnaire("fluency").items[0].id
    count = study.change_count()
    with pytest.raises(InvalidAnswer, match="whole number from 1 to 7"):
        study.save_answer(at_about_you, "about-you", "fluency", item, value)
    assert study.change_count() == count
    study.save_answer(at_about_you, "about-you", "fluency", item, 7)


def test_what_is_not_asked_is_not_kept(study, at_about_you):
    who = at_about_you
    count = study.change_count()
    for questionnaire, item, said in (
        ("fluency", "nonsense", "has no item 'nonsense'"),
        ("trust", "item_01", "does not ask 'trust'"),
    ):
        for value in (3, None):
            with pytest.raises(StudyError, match=said):
                study.save_answer(who, "about-you", questionnaire, item, value)
    with pytest.raises(StudyError, match="has no phase 'nowhere'"):
        study.save_answer(who, "nowhere", "fluency", "x", 3)
    with pytest.raises(StudyError, match="is at 'about-you', not at 'debrief'"):
        study.submit(who, "debrief")
    assert study.change_count() == count


def test_a_finished_page_stays_as_it_is(study, at_about_you):
    who = at_about_you
    item = study.questionnaire("fluency").items[0].id
    answer_all(study, who)
    study.submit(who, "about-you")
    with pytest.raises(StudyError, match="is finished"):
        study.save_answer(who, "about-you", "fluency", item, 7)
    assert study.answers(who, "about-you", "fluency")[item] == 1


def test_a_page_that_is_opened_again_starts_empty_and_keeps_what_was(study, at_about_you):
    who = at_about_you
    answer_all(study, who)
    with pytest.raises(StudyError, match="is not over yet"):
        study.redo(who, "about-you")
    study.submit(who, "about-you")
    kept = len(read_responses(study._opened.store.connection, who))
    study.redo(who, "about-you")
    assert study.participant(who).next_phase.id == "about-you"
    assert study.answers(who, "about-you", "fluency") == {}
    answer_all(study, who)
    assert study.submit(who, "about-you") == {}
    assert len(read_responses(study._opened.store.connection, who)) == 2 * kept
    with pytest.raises(StudyError, match="Consent is given once"):
        study.redo(who, "consent")


def test_a_wheel_phase_is_not_finished_by_a_page(study, at_about_you):
    answer_all(study, at_about_you)
    study.submit(at_about_you, "about-you")
    study.submit(at_about_you, "before-practice")
    with pytest.raises(StudyError, match="is a practice phase"):
        study.submit(at_about_you, "practice")


def test_links_are_unguessable_single_and_kept_as_hashes(study, folder):
    who, other = study.enrol(Role.TRAINING).id, study.enrol(Role.TEST).id
    first, theirs = study.new_link(who), study.new_link(other)
    assert study.participant_of(first) == who
    second = study.new_link(who)
    assert len(second) >= 43  # 256 bits
    assert study.participant_of(first) is None
    assert study.participant_of(second) == who
    assert study.participant_of(theirs) == other
    assert study.participant_of("\ud800nonsense") is None
    for erase in (False, True):  # their page thanks them, and says what became of the data
        study.withdraw(who, erase=erase)
        assert study.participant_of(second) == who
        assert study.participant_of(first) is None
    with pytest.raises(StudyError, match="has left"):
        study.new_link(who)
    study.close()
    raw = (folder / "study.db").read_bytes()
    assert not any(token.encode() in raw for token in (first, second, theirs))


def test_places_follow_every_program_and_are_read_once(study, folder, at_about_you, monkeypatch):
    item = study.questionnaire("fluency").items[0].id
    with Study.open(folder) as other:
        assert study.participant(at_about_you).progress == ""
        other.save_answer(at_about_you, "about-you", "fluency", item, 3)
        assert study.participant(at_about_you).progress.startswith("1 of ")
        (view,) = study.participants()
        assert view.progress.startswith("1 of ")
        monkeypatch.setattr("steerlab.study.progress.everybody", None)
        monkeypatch.setattr("steerlab.study.progress.progress_of", None)
        assert study.participants() == [view]  # nothing changed: nothing is worked out
        assert study.participant(at_about_you) == view
        monkeypatch.undo()
        other.enrol(Role.TEST)
        assert len(study.participants()) == 2


def test_what_was_rolled_back_is_not_remembered(study, folder, at_about_you):
    connection = study._opened.store.connection
    with suppress(RuntimeError), connection.transaction("fail"):
        connection.log("something", "else")
        assert study.participant(at_about_you).standing is Standing.RUNNING
        raise RuntimeError
    with Study.open(folder) as other:  # writes the entry of that number
        other.withdraw(at_about_you, erase=False)
    assert study.participant(at_about_you).standing is Standing.WITHDRAWN_KEPT


def test_notes_are_kept_with_their_time(study, at_about_you):
    study.note(at_about_you, "  asked what\nthe ball is ")
    study.note(None, "moved the wheel's table")
    assert [text for _, text in study.notes(at_about_you)] == ["asked what\nthe ball is"]
    ((at_utc, text),) = study.notes(None)
    assert at_utc.endswith("Z")
    assert text == "moved the wheel's table"
    with pytest.raises(StudyError, match="between 1 and"):
        study.note(None, "   ")
    with pytest.raises(StudyError, match="not enrolled"):
        study.note("P77", "who?")


def test_sql_in_what_people_type_is_text(study, at_about_you):
    """Statements are fixed; all that comes from outside is a parameter."""
    nasty = """'); DELETE FROM notes; -- ' OR '1'='1"""
    study.note(at_about_you, nasty)
    study.save_answer(at_about_you, "about-you", "demographics", "gender_own_words", nasty)
    assert study.notes(at_about_you)[0][1] == nasty
    assert study.answers(at_about_you, "about-you", "demographics") == {"gender_own_words": nasty}
    for act in (
        lambda: study.participant(nasty),
        lambda: study.answers(at_about_you, nasty, "demographics"),
        lambda: study.save_answer(at_about_you, "about-you", "demographics", nasty, "x"),
        lambda: study.save_answer(at_about_you, "about-you", nasty, "x", "x"),
        lambda: study.redo(at_about_you, nasty),
        lambda: study.withdraw(nasty, erase=True),
    ):
        with pytest.raises(StudyError):
            act()
    assert study.participant_of(nasty) is None
    assert study.verify().ok


ANSWERERS = """
import os, sys
from pathlib import Path
from steerlab.study.study import Study

folder, who = Path(sys.argv[1]), sys.argv[2]
with Study.open(folder) as study:
    study.participant(who)  # what is read once is read before the forks
for _ in sys.stdin:  # each line asks for another process that answers until it is killed
    pid = os.fork()
    if pid == 0:
        with Study.open(folder) as study:
            item = study.questionnaire("fluency").items[0].id
            print("ready", os.getpid(), flush=True)
            n = 0
            while True:
                n += 1
                study.save_answer(who, "about-you", "fluency", item, 1 + n % 7)
                os.write(1, b"%d\\n" % n)
    os.waitpid(pid, 0)
    print("dead", flush=True)
"""


@pytest.mark.slow
def test_kill_9_right_after_the_answer_fifty_times_loses_nothing(study, folder, at_about_you):
    """An answering process is killed as soon as it told of an answer; each one must be there."""
    who = at_about_you
    connection = study._opened.store.connection
    item = study.questionnaire("fluency").items[0].id
    answerers = subprocess.Popen(
        [sys.executable, "-c", ANSWERERS, str(folder), who],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    for kill in range(50):
        before = len(read_responses(connection, who))
        latest = study.answers(who, "about-you", "fluency").get(item)
        answerers.stdin.write("go\n")
        answerers.stdin.flush()
        word, pid = answerers.stdout.readline().split()
        assert word == "ready"
        told = [answerers.stdout.readline() for _ in range(1 + kill % 3)]
        os.kill(int(pid), signal.SIGKILL)
        while (line := answerers.stdout.readline()) != "dead\n":  # what it said before it died
            told.append(line)
        expected = [1 + int(n) % 7 for n in told]
        if expected[0] == latest:  # the same answer again is no new row
            expected = expected[1:]
        kept = [one.value for one in read_responses(connection, who)][before:]
        assert kept[: len(expected)] == expected
        assert len(kept) <= len(expected) + 1  # one may be kept and not yet acknowledged
    answerers.stdin.close()
    answerers.stdout.close()
    assert answerers.wait() == 0
    study.close()
    with Study.open(folder) as again:
        assert all(one.ok for one in again.verify().findings if one.what != who)
