"""A study database that another program holds: nothing is lost, and nobody is told a path."""

import html
import re
import sqlite3
import time

import httpx
import pytest

from steerlab.app.console import study_thread, texts
from steerlab.app.console.guard import csrf_token
from steerlab.study.contract import PhaseState, Role
from steerlab.study.store.errors import StoreError
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study

HELD = "Cannot keep an answer in /somewhere/study.db: database is locked; try again."


def _hold(monkeypatch, study, *names):
    def fail(*_, **__):
        raise StoreError(HELD)

    for name in names:
        monkeypatch.setattr(study, name, fail)


def _form(page):
    """Where the page's form goes, and its fields."""
    fields = re.findall(r'<input type="hidden" name="([^"]*)" value="([^"]*)">', page)
    action = re.search(r'<form method="post" action="([^"]*)"', page).group(1)
    return action, {name: html.unescape(value) for name, value in fields}


@pytest.mark.parametrize("held", ["participant_of", "participant", "save_answer", "answers"])
def test_a_questionnaire_that_was_handed_in_can_be_sent_again(lab, monkeypatch, held):
    who, token = lab.enrol(at="pre")
    fields = {"item__age": "34", "item__gender": "woman", "go": "on"}
    with monkeypatch.context() as patch:
        _hold(patch, lab.study, held)
        answer = lab.post(token, "/pre/1", **fields)
    assert answer.status_code == 503
    assert "retry-after" in answer.headers
    assert texts.BUSY_TITLE in answer.text
    assert texts.TRY_AGAIN in answer.text
    assert "somewhere" not in answer.text
    action, kept = _form(answer.text)
    assert {"item.age": "34", "item.gender": "woman", "go": "on"}.items() <= kept.items()
    lab.client.post(action, data=kept, headers={"origin": "http://127.0.0.1:8765"})
    assert lab.study.answers(who, "pre", "demographics")["age"] == 34


def test_what_was_typed_is_still_text_on_that_page(lab, monkeypatch):
    _, token = lab.enrol(at="pre")
    _hold(monkeypatch, lab.study, "participant_of")
    typed = '"><script>alert(1)</script> ü\nsecond line'
    answer = lab.post(token, "/pre/1", item__age=typed)
    assert "<script>" not in answer.text
    assert _form(answer.text)[1]["item.age"] == typed


def test_consent_and_pages_that_were_read_can_be_sent_again(lab, monkeypatch):
    who, token = lab.enrol()
    with monkeypatch.context() as patch:
        _hold(patch, lab.study, "consent")
        answer = lab.post(token, "/consent", decision="yes", version="1")
    assert answer.status_code == 503
    assert lab.study.state(who, "consent") is PhaseState.WAITING
    action, kept = _form(answer.text)
    lab.client.post(action, data=kept, headers={"origin": "http://127.0.0.1:8765"})
    assert lab.study.state(who, "consent") is PhaseState.DONE
    lab.study.bring_to(who, "how")
    with monkeypatch.context() as patch:
        _hold(patch, lab.study, "submit")
        assert lab.post(token, "/how/done").status_code == 503


def test_a_single_answer_is_tried_again_by_the_page(lab, monkeypatch):
    _, token = lab.enrol(at="pre")
    _hold(monkeypatch, lab.study, "save_answer")
    assert lab.post(token, "/pre/1/answer", item="age", value="30").status_code == 503


@pytest.mark.parametrize("path", ["", "/pre/1", "/events"])
def test_a_page_that_cannot_be_read_says_so(lab, monkeypatch, path, caplog):
    _, token = lab.enrol(at="pre")
    _hold(monkeypatch, lab.study, "participant_of")
    answer = lab.client.get(f"/p/{token}{path}")
    assert answer.status_code == 503
    assert f'href="/p/{token}{path}"' in answer.text
    assert all(record.exc_info is None for record in caplog.records)
    assert HELD in caplog.text  # in the experimenter's terminal


@pytest.mark.parametrize(
    ("held", "path", "fields"),
    [
        ("enrol", "/enrol", {"role": "training"}),
        ("note", "/participants/P01/note", {"text": "a long remark"}),
        ("new_link", "/participants/P01/link", {}),
        ("participant", "/participants/P01/start", {"phase": "practice"}),
        ("withdraw", "/participants/P01/withdraw", {"outcome": "keep", "typed": "P01"}),
        ("redo", "/participants/P01/redo", {"phase": "consent"}),
    ],
)
def test_the_experimenters_forms_can_be_sent_again(lab, monkeypatch, held, path, fields):
    lab.enrol(at="practice")
    lab.sign_in()
    with monkeypatch.context() as patch:
        _hold(patch, lab.study, held)
        answer = lab.act(path, **fields)
    assert answer.status_code == 503
    assert "database is locked" in answer.text
    action, kept = _form(answer.text)
    assert action == lab.at(path)
    assert fields.items() <= kept.items()
    again = lab.client.post(action, data=kept, headers={"origin": "http://127.0.0.1:8765"})
    assert again.status_code == 303


def test_what_is_done_is_not_asked_for_again(lab, monkeypatch):
    """The look after an act fails; the act does not."""
    lab.sign_in()
    _hold(monkeypatch, lab.study, "change_count")
    assert lab.act("/enrol", role="training").status_code == 303
    assert len(lab.study.participants()) == 1


def test_an_outage_is_said_once(lab, monkeypatch, caplog):
    _hold(monkeypatch, lab.study, "change_count")
    lab.client.portal.call(lab.changes.try_look)
    lab.client.portal.call(lab.changes.try_look)
    time.sleep(1.0)  # and the feed has looked too
    assert caplog.text.count(HELD) == 1


def test_whoever_waited_too_long_behind_others_is_not_served_late(lab, monkeypatch):
    """What was refused must not be done later, when it has been sent again."""
    lab.sign_in()
    monkeypatch.setattr(study_thread, "LONGEST_TURN_S", -1.0)
    answer = lab.act("/enrol", role="training")
    assert answer.status_code == 503
    assert lab.study.participants() == []


@pytest.mark.slow
def test_a_real_database_that_is_held_for_longer_than_five_seconds(serving, tmp_path):
    folder = tmp_path / "study"
    new_study(folder, "mind-meld")
    with Study.open(folder) as study:
        who = study.enrol(Role.TRAINING).id
        study.consent(who, given=True)
        token = study.new_link(who)
    path = f"/p/{token}/about-you/2"
    fields = {"csrf": csrf_token(token), "item.i05": "4", "go": "on"}
    with (
        serving(lambda: Study.open(folder), folder) as (address, _, _),
        httpx.Client(base_url=address, headers={"origin": address}, timeout=30) as client,
    ):
        holder = sqlite3.connect(folder / "study.db", isolation_level=None)
        holder.execute("BEGIN IMMEDIATE")
        answer = client.post(path, data=fields)
        assert answer.status_code == 503
        assert client.post(f"{path}/answer", data=fields).status_code in (409, 503)
        holder.execute("ROLLBACK")
        holder.close()
        action, kept = _form(answer.text)
        assert client.post(action, data=kept).status_code == 422  # other answers are missing
        assert re.search(r'name="item.i05" value="4" checked', client.get(path).text)
