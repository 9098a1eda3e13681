import re

import pytest

from steerlab.app.console import texts
from steerlab.study.contract import PhaseState, Standing


def _all(study, key, value="4"):
    """A valid answer to every item of a scale."""
    return {f"item__{item.id}": value for item in study.questionnaire(key).items}


def test_the_consent_page_shows_the_text_and_both_buttons(lab):
    _, token = lab.enrol()
    answer = lab.client.get(f"/p/{token}")
    assert answer.status_code == 200
    for paragraph in lab.study.consent_text("P01").text:
        assert paragraph in answer.text
    assert re.findall(r'name="decision" value="(\w+)"', answer.text) == ["yes", "no"]
    assert "Step 1 of 7" in answer.text


def test_a_yes_leads_to_the_first_questionnaire(lab):
    who, token = lab.enrol()
    answer = lab.post(token, "/consent", decision="yes", version="1")
    assert (answer.status_code, answer.headers["location"]) == (303, f"/p/{token}")
    assert lab.study.state(who, "consent") is PhaseState.DONE
    assert lab.client.get(f"/p/{token}").headers["location"] == f"/p/{token}/pre/1"


def test_a_no_ends_politely_and_stays_so(lab):
    who, token = lab.enrol()
    lab.post(token, "/consent", decision="no", version="1")
    assert lab.study.participant(who).standing is Standing.DECLINED
    page = lab.client.get(f"/p/{token}")
    assert page.status_code == 200
    assert texts.DECLINED_TITLE in page.text
    lab.post(token, "/consent", decision="yes", version="1")  # the back button, then the other
    assert lab.study.participant(who).standing is Standing.DECLINED


def test_consent_to_a_text_that_has_changed_is_asked_for_again(lab):
    who, token = lab.enrol()
    lab.study.consent_version = 2
    answer = lab.post(token, "/consent", decision="yes", version="1")
    assert answer.status_code == 409
    assert texts.CONSENT_CHANGED in answer.text
    assert lab.study.state(who, "consent") is PhaseState.WAITING


@pytest.mark.parametrize("decision", ["", "maybe"])
def test_no_decision_decides_nothing(lab, decision):
    who, token = lab.enrol()
    assert lab.post(token, "/consent", decision=decision, version="1").status_code == 303
    assert lab.study.participant(who).standing is Standing.ENROLLED


def test_questions_are_native_fieldsets_with_labels(lab):
    _, token = lab.enrol(at="pre")
    page = lab.client.get(f"/p/{token}/pre/2").text
    items = lab.study.questionnaire("mini_ipip_5").items
    assert page.count("<fieldset") == page.count("<legend>") == len(items)
    assert page.count('type="radio"') == 5 * len(items)
    assert "Very inaccurate" in page


def test_the_questionnaires_title_does_not_tell_what_is_measured(lab):
    _, token = lab.enrol(at="pre")
    assert lab.study.questionnaire("trust").title not in lab.client.get(f"/p/{token}/pre/3").text


def test_an_answer_is_kept_at_once_and_shown_again(lab):
    who, token = lab.enrol(at="pre")
    answer = lab.post(token, "/pre/2/answer", item="i03", value="4")
    assert answer.status_code == 204
    assert lab.study.answers(who, "pre", "mini_ipip_5") == {"i03": 4}
    page = lab.client.get(f"/p/{token}/pre/2").text
    assert re.findall(r'name="item\.(\w+)" value="(\d)" checked', page) == [("i03", "4")]


def test_an_emptied_number_is_taken_back(lab):
    who, token = lab.enrol(at="pre")
    assert lab.post(token, "/pre/1/answer", item="age", value="31").status_code == 204
    assert lab.study.answers(who, "pre", "demographics") == {"age": 31}
    assert lab.post(token, "/pre/1/answer", item="age", value=" ").status_code == 204
    assert lab.study.answers(who, "pre", "demographics") == {}


@pytest.mark.parametrize("value", ["0", "6", "2.5", "nan", "", "1e9", "4; DROP TABLE", "４"])
def test_an_answer_out_of_range_is_not_kept(lab, value):
    who, token = lab.enrol(at="pre")
    answer = lab.post(token, "/pre/2/answer", item="i03", value=value)
    assert (answer.status_code, answer.text) == (422, texts.WRONG_CHOICE)
    assert lab.study.answers(who, "pre", "mini_ipip_5") == {}


def test_a_number_out_of_range_says_the_range(lab):
    _, token = lab.enrol(at="pre")
    answer = lab.post(token, "/pre/1/answer", item="age", value="7")
    age = lab.study.questionnaire("demographics").item("age").format
    assert answer.status_code == 422
    assert f"from {age.minimum:g} to {age.maximum:g}" in answer.text


@pytest.mark.parametrize(
    ("path", "fields"),
    [
        ("/pre/2/answer", {"item": "nobody", "value": "1"}),
        ("/pre/2/answer", {"item": "i03"}),
        ("/pre/9/answer", {"item": "i03", "value": "1"}),
        ("/post/1/answer", {"item": "mental", "value": "5"}),
        ("/consent2/1/answer", {"item": "i03", "value": "1"}),
    ],
)
def test_an_answer_to_what_is_not_asked_now_is_refused(lab, path, fields):
    _, token = lab.enrol(at="pre")
    assert lab.post(token, path, **fields).status_code == 409
    assert lab.study.saves == []


def test_missing_answers_are_counted_named_and_focused(lab):
    who, token = lab.enrol(at="pre")
    given = _all(lab.study, "mini_ipip_5")
    del given["item__i04"], given["item__i07"]
    answer = lab.post(token, "/pre/2", go="on", **given)
    assert answer.status_code == 422
    text = " ".join(answer.text.split())
    assert "2 questions still need an answer:" in text
    assert re.findall(r'<a href="#item\.(\w+)">question (\d+)', text) == [
        ("i04", "4"),
        ("i07", "7"),
    ]
    assert re.findall(r'name="item\.(\w+)" value="\d" autofocus', text) == ["i04"]
    assert text.count(texts.PLEASE_ANSWER) == 2
    assert len(lab.study.answers(who, "pre", "mini_ipip_5")) == 18  # the others are kept


def test_without_scripts_the_form_keeps_everything_and_goes_on(lab):
    who, token = lab.enrol(at="post")
    answer = lab.post(token, "/post/1", go="on", **_all(lab.study, "raw_tlx", "35"))
    assert answer.headers["location"] == f"/p/{token}/post/2"
    answer = lab.post(token, "/post/2", go="on", **_all(lab.study, "experience_driving"))
    assert answer.headers["location"] == f"/p/{token}"
    assert lab.study.state(who, "post") is PhaseState.DONE
    assert set(lab.study.answers(who, "post", "raw_tlx").values()) == {35}


def test_back_keeps_what_was_given_and_asks_for_nothing(lab):
    who, token = lab.enrol(at="post")
    items = [item.id for item in lab.study.questionnaire("experience_driving").items]
    answer = lab.post(token, "/post/2", go="back", **{f"item__{items[0]}": "2"})
    assert answer.headers["location"] == f"/p/{token}/post/1"
    assert lab.study.answers(who, "post", "experience_driving") == {items[0]: 2}


def test_an_earlier_part_that_was_skipped_comes_back_at_the_end(lab):
    who, token = lab.enrol(at="post")
    answer = lab.post(token, "/post/2", go="on", **_all(lab.study, "experience_driving"))
    assert answer.status_code == 422
    assert f'action="/p/{token}/post/1"' in answer.text
    assert "6 questions still need an answer:" in answer.text
    assert lab.study.state(who, "post") is PhaseState.STARTED


def test_what_is_unchanged_is_not_written_again(lab):
    _, token = lab.enrol(at="post")
    lab.post(token, "/post/1", go="on", **_all(lab.study, "raw_tlx", "35"))
    before = len(lab.study.saves)
    lab.post(token, "/post/1", go="on", **_all(lab.study, "raw_tlx", "35"))
    assert len(lab.study.saves) == before


def test_what_cannot_be_kept_is_shown_again_beside_the_reason(lab):
    _, token = lab.enrol(at="pre")
    answer = lab.post(token, "/pre/1", go="on", item__age='7"><b>')
    assert answer.status_code == 422
    assert 'value="7&#34;&gt;&lt;b&gt;"' in answer.text


def test_handing_in_twice_and_the_back_button_change_nothing(lab):
    who, token = lab.enrol(at="post")
    lab.post(token, "/post/1", go="on", **_all(lab.study, "raw_tlx", "35"))
    last = {"go": "on", **_all(lab.study, "experience_driving")}
    lab.post(token, "/post/2", **last)
    kept = lab.study.answers(who, "post", "experience_driving")
    changed = {"go": "on", **_all(lab.study, "experience_driving", "1")}
    for answer in (lab.post(token, "/post/2", **changed), lab.client.get(f"/p/{token}/post/2")):
        assert (answer.status_code, answer.headers["location"]) == (303, f"/p/{token}")
    assert lab.study.answers(who, "post", "experience_driving") == kept
    late = lab.post(token, "/post/2/answer", item="x", value="1")
    assert (late.status_code, late.text) == (409, texts.CANNOT_SAVE)


def test_a_page_that_was_read_twice_is_left_once(lab):
    who, token = lab.enrol(at="how")
    assert "How the drives work" in lab.client.get(f"/p/{token}").text
    for _ in range(2):
        assert lab.post(token, "/how/done").headers["location"] == f"/p/{token}"
    assert lab.study.state(who, "how") is PhaseState.DONE
    assert lab.study.state(who, "practice") is PhaseState.WAITING


def test_no_form_finishes_a_phase_at_the_wheel(lab):
    who, token = lab.enrol(at="practice")
    lab.post(token, "/practice/done")
    lab.post(token, "/practice/1", go="on")
    assert lab.study.state(who, "practice") is PhaseState.WAITING


def test_the_wheel_page_says_that_it_runs_while_it_runs_and_then_that_it_stopped(lab, tmp_path):
    (tmp_path / "hold").touch()
    who, token = lab.enrol(at="practice")

    def seen():
        page = lab.client.get(f"/p/{token}").text
        key = re.search(r'data-seen="([^"]*)"', page).group(1)
        said = (texts.WHEEL_CALL, texts.WHEEL_RUNNING, texts.WHEEL_AFTER, texts.STOPPED_TITLE)
        return key, [words for words in said if words in page]

    before = seen()
    assert before[1] == [texts.WHEEL_CALL]
    lab.runs.start(who, lab.study.participant(who).next_phase)
    lab.study.set_state(who, "practice", PhaseState.STARTED)
    running = seen()
    assert running[1] == [texts.WHEEL_RUNNING, texts.WHEEL_AFTER]
    (tmp_path / "hold").unlink()
    lab.runs._process.wait(10)
    stopped = seen()
    assert stopped[1] == [texts.STOPPED_TITLE]
    assert len({before[0], running[0], stopped[0]}) == 3  # so that the open page follows


def test_what_another_program_began_is_not_said_to_run(lab):
    who, token = lab.enrol(at="practice")
    lab.study.set_state(who, "practice", PhaseState.STARTED)
    page = lab.client.get(f"/p/{token}").text
    assert texts.WHEEL_BEGUN in page
    assert texts.WHEEL_RUNNING not in page
    assert texts.WHEEL_AFTER not in page


def test_another_participants_drive_is_not_ones_own(lab, tmp_path):
    (tmp_path / "hold").touch()
    other, _ = lab.enrol(at="practice")
    _, token = lab.enrol(at="practice")
    lab.runs.start(other, lab.study.participant(other).next_phase)
    assert texts.WHEEL_CALL in lab.client.get(f"/p/{token}").text


def test_only_in_a_kiosk_a_participant_starts_a_drive(lab, kiosk):
    for console, starts in ((lab, False), (kiosk, True)):
        _, token = console.enrol(at="practice")
        assert (texts.WHEEL_READY in console.client.get(f"/p/{token}").text) is starts
        assert console.post(token, "/ready", phase="practice").status_code == 303
        assert (console.runs.view() is not None) is starts
    assert kiosk.runs.view().phase == "practice"


def test_a_kiosk_starts_what_is_next_alone_and_once(kiosk, tmp_path):
    (tmp_path / "hold").touch()
    _, other = kiosk.enrol(at="calibration")
    _, token = kiosk.enrol(at="practice")
    kiosk.post(token, "/ready", phase="calibration")
    assert kiosk.runs.view() is None
    kiosk.post(token, "/ready", phase="practice")
    pid = kiosk.runs.view().pid
    kiosk.post(token, "/ready", phase="practice")
    assert kiosk.runs.view().pid == pid
    answer = kiosk.post(other, "/ready", phase="calibration")
    assert (answer.status_code, texts.KIOSK_BUSY in answer.text) == (409, True)


@pytest.mark.parametrize(
    ("standing", "said"),
    [
        (Standing.WITHDRAWN_KEPT, texts.LEFT_KEPT),
        (Standing.ERASING, texts.LEFT_ERASING),
        (Standing.WITHDRAWN_ERASED, texts.LEFT_ERASED),
    ],
)
def test_who_was_withdrawn_is_thanked_told_what_is_kept_and_asked_nothing_more(lab, standing, said):
    who, token = lab.enrol(at="pre")
    lab.post(token, "/pre/2/answer", item="i03", value="4")
    lab.study.leave(who, standing)
    answer = lab.client.get(f"/p/{token}")
    assert answer.status_code == 200
    for words in (texts.LEFT_TITLE, said, texts.LEFT_END):
        assert words in answer.text
    assert not re.search(rf"\b({who}|i03|pre)\b|<form|<input", answer.text)
    assert lab.post(token, "/pre/2/answer", item="i03", value="1").status_code == 409
    for path in ("/pre/1", "/pre/2"):
        assert lab.client.get(f"/p/{token}{path}").headers["location"] == f"/p/{token}"
    assert lab.study.answers(who, "pre", "mini_ipip_5") == {"i03": 4}
    assert texts.LEFT_TITLE not in lab.client.get(f"/p/{token[:-1]}").text


def test_the_end_says_thanks(lab):
    _, token = lab.enrol(at="debrief")
    assert "You were a great help." in lab.client.get(f"/p/{token}").text
    lab.post(token, "/debrief/done")
    assert texts.THANKS_TITLE in lab.client.get(f"/p/{token}").text


def test_an_ended_link_says_so_and_what_to_do(lab):
    who, token = lab.enrol()
    lab.study.new_link(who)
    answer = lab.client.get(f"/p/{token}")
    assert answer.status_code == 404
    assert texts.EXPIRED_TITLE in answer.text


def test_a_failure_says_that_answers_are_safe_and_shows_no_innards(lab, caplog):
    _, token = lab.enrol(at="pre")
    lab.study.answers = None
    answer = lab.client.get(f"/p/{token}")
    assert answer.status_code == 500
    assert "Answers given before are safe" in answer.text
    assert "NoneType" not in answer.text
    assert answer.headers["content-security-policy"]
    assert token not in caplog.text
