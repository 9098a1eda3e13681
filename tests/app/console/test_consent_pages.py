"""The consent page with statements, age and signature, the copy to keep, and Markdown in texts."""

import re
import time

import pytest

from steerlab.app.console import texts
from steerlab.app.console.participant_pages import keep_decision
from steerlab.app.console.participant_views import ParticipantContext
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.study.contract import PhaseState, Role, Standing
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study

NAME = "Augusta Ada Whatsername"
ALL = {"tick__0": "yes", "tick__1": "yes", "age": "yes", "signature": NAME}


@pytest.fixture
def asking(lab):
    lab.study.ask_everything()
    return lab


def _decide(lab, token, decision="yes", **fields):
    return lab.post(token, "/consent", decision=decision, version="1", **fields)


def test_texts_are_markdown(lab):
    lab.study.paragraphs = ("## Why\n\nIt is *voluntary*.", "<script>alert(1)</script>")
    _, token = lab.enrol()
    page = lab.client.get(f"/p/{token}").text
    assert "<h3>Why</h3>\n<p>It is <em>voluntary</em>.</p>" in page
    assert "<p>&lt;script&gt;alert(1)&lt;/script&gt;</p>" in page


def test_the_page_asks_for_all_that_the_text_asks_for(asking):
    _, token = asking.enrol()
    page = asking.client.get(f"/p/{token}").text
    for statement in asking.study.asking["ticks"]:
        assert statement in page
    assert page.count('type="checkbox"') == 2
    assert re.findall(r'type="radio" name="age" value="(\w+)"', page) == ["yes", "no"]
    assert texts.CONSENT_OF_AGE.format(age=18) in page
    assert 'name="signature"' in page
    assert " checked" not in page


@pytest.mark.parametrize(
    ("left_out", "said"),
    [
        ("tick__0", texts.CONSENT_TICK_MISSING),
        ("tick__1", texts.CONSENT_TICK_MISSING),
        ("age", texts.CONSENT_AGE_MISSING),
        ("signature", texts.CONSENT_SIGNATURE_MISSING),
    ],
)
def test_a_yes_that_lacks_something_is_asked_for_it_and_loses_nothing(asking, left_out, said):
    who, token = asking.enrol()
    given = {name: value for name, value in ALL.items() if name != left_out}
    answer = _decide(asking, token, **given)
    assert answer.status_code == 422
    assert answer.text.count(said) == 1
    assert texts.CONSENT_LACKING in answer.text
    assert answer.text.count(" autofocus") == 1
    assert answer.text.count(" checked") == sum(name != "signature" for name in given)
    assert (NAME in answer.text) == (left_out != "signature")
    assert asking.study.state(who, "consent") is PhaseState.WAITING
    assert asking.study.decisions == {}


@pytest.mark.parametrize("signature", ["", "   ", "\t"])
def test_blanks_are_no_signature(asking, signature):
    _, token = asking.enrol()
    assert _decide(asking, token, **ALL | {"signature": signature}).status_code == 422


@pytest.mark.parametrize("age", ["", "18", "YES"])
def test_another_age_than_those_offered_is_none(asking, age):
    _, token = asking.enrol()
    assert _decide(asking, token, **ALL | {"age": age}).status_code == 422


def test_a_no_needs_no_ticks(asking):
    who, token = asking.enrol()
    assert _decide(asking, token, "no").status_code == 303
    assert asking.study.participant(who).standing is Standing.DECLINED
    page = asking.client.get(f"/p/{token}").text
    assert texts.DECLINED_TITLE in page
    copy = asking.client.get(f"/p/{token}/consent/copy").text
    assert texts.COPY_REFUSED in copy
    assert texts.COPY_SIGNED not in copy


def test_who_is_too_young_is_thanked_and_asked_nothing_more(asking):
    who, token = asking.enrol()
    assert _decide(asking, token, age="no").status_code == 303  # whatever else is not filled in
    assert asking.study.participant(who).standing is Standing.DECLINED
    page = asking.client.get(f"/p/{token}").text
    assert texts.TOO_YOUNG_TITLE in page
    assert texts.TOO_YOUNG_TEXT.format(age=18) in page
    assert _decide(asking, token, **ALL).status_code == 303
    assert asking.study.participant(who).standing is Standing.DECLINED


def test_a_signed_consent_answers_with_the_copy_which_alone_has_the_name(asking):
    who, token = asking.enrol()
    answer = _decide(asking, token, **ALL)
    assert answer.status_code == 200
    assert texts.COPY_NAME.format(name=NAME) in answer.text
    assert answer.headers["cache-control"] == "no-store"
    assert asking.study.state(who, "consent") is PhaseState.DONE
    again = _decide(asking, token, **ALL)  # the page was loaded again
    assert again.status_code == 303
    copy = asking.client.get(f"/p/{token}/consent/copy")
    assert NAME not in copy.text
    assert texts.COPY_SIGNED in copy.text


def test_a_name_is_text(asking):
    _, token = asking.enrol()
    answer = _decide(asking, token, **ALL | {"signature": "<b>Bobby</b>" + "x" * 300})
    assert "&lt;b&gt;Bobby&lt;/b&gt;" in answer.text
    assert "x" * 200 not in answer.text


def test_the_copy_has_text_statements_decision_version_and_local_time(asking, monkeypatch):
    monkeypatch.setenv("TZ", "Etc/GMT-3")  # three hours before UTC
    time.tzset()
    try:
        who, token = asking.enrol()
        _decide(asking, token, **ALL)
        copy = asking.client.get(f"/p/{token}/consent/copy").text
    finally:
        monkeypatch.undo()
        time.tzset()
    for words in (*asking.study.paragraphs, *asking.study.asking["ticks"]):
        assert words in copy
    assert "2026-03-02, 13:15 (UTC+03:00), version 1 of this information" in copy
    assert texts.CONSENT_OF_AGE.format(age=18) in copy
    assert texts.COPY_GIVEN in copy
    assert who not in copy  # whoever finds it learns nothing of the data


def test_the_copy_is_there_once_there_is_a_decision(lab):
    who, token = lab.enrol()
    link = f'href="/p/{token}/consent/copy"'
    assert link not in lab.client.get(f"/p/{token}").text
    answer = lab.client.get(f"/p/{token}/consent/copy")
    assert answer.headers["location"] == f"/p/{token}"
    assert _decide(lab, token).headers["location"] == f"/p/{token}"
    assert link in lab.client.get(f"/p/{token}/pre/1").text
    lab.study.bring_to(who, "practice")
    assert link in lab.client.get(f"/p/{token}").text
    lab.study.leave(who, Standing.WITHDRAWN_ERASED)
    assert link not in lab.client.get(f"/p/{token}").text
    assert lab.client.get("/p/guess/consent/copy").status_code == 404


def test_a_typed_name_is_in_no_file_of_the_study(tmp_path):
    folder = tmp_path / "study"
    new_study(folder, "mind-meld")
    file = folder / "study.toml"
    file.write_text(file.read_text().replace("[consent]\n", "[consent]\nsignature = true\n"))
    with Study.open(folder) as study:
        who = study.enrol(Role.TRAINING).id
        token = study.new_link(who)
        context = ParticipantContext(
            study=study, runs=WheelRuns(folder), token=token, participant=who, kiosk=False
        )
        posted = {"decision": "yes", "version": "1", "signature": NAME}
        assert NAME.encode() in keep_decision(context, posted).body
        assert study.consent_record(who).entries.signed
        files = [path for path in folder.rglob("*") if path.is_file()]
        assert any(who.encode() in path.read_bytes() for path in files)  # also what the log holds
        assert not [path for path in files if b"Whatsername" in path.read_bytes()]
