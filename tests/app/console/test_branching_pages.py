"""Questions that follow from others: hidden ones ask for nothing, and no script is needed."""

import json
import re

import pytest

from steerlab.app.console import texts
from steerlab.study.contract import PhaseState


@pytest.fixture
def branched(lab):
    """The lab, at a page of questions that depend on each other; a participant and their token."""
    lab.study.branch()
    return (lab, *lab.enrol(at="pre"))


def _seen(page):
    return re.search(r'name="seen" value="([^"]*)"', page)[1]


def _hidden(page):
    return re.findall(
        r'data-item="(\w+)" data-shown-if="\w+" data-shown-after="[^"]*" hidden', page
    )


def _hand_in(lab, token, page, **answers):
    """Send the page as a browser without scripts does."""
    fields = {f"item__{item}": value for item, value in answers.items()}
    return lab.post(token, "/pre/1", go="on", seen=_seen(page), **fields)


def test_hidden_questions_are_in_the_page_with_their_rule_and_are_not_counted(branched):
    lab, _, token = branched
    page = lab.client.get(f"/p/{token}/pre/1").text
    assert _hidden(page) == ["hours", "fast"]
    rules = re.findall(r'data-shown-if="(\w+)" data-shown-after="([^"]*)"', page)
    assert [(item, json.loads(said.replace("&#34;", '"'))) for item, said in rules] == [
        ("played", ["yes"]),
        ("hours", [3]),
    ]
    assert re.findall(r'class="number">(\d*)<', page) == ["1", "", "", "2", "3"]
    assert _seen(page) == "played calm check"


def test_hidden_questions_ask_for_nothing(branched):
    lab, who, token = branched
    page = lab.client.get(f"/p/{token}/pre/1").text
    answer = _hand_in(lab, token, page, played="no", calm="2", check="4")
    assert answer.status_code == 303
    assert lab.study.state(who, "pre") is PhaseState.DONE


def test_without_scripts_the_page_comes_again_with_what_follows(branched):
    lab, who, token = branched
    page = lab.client.get(f"/p/{token}/pre/1").text
    answer = _hand_in(lab, token, page, played="yes", calm="2", check="4")
    assert answer.status_code == 422
    assert texts.FOLLOWS_ONE in answer.text
    assert texts.PLEASE_ANSWER not in answer.text  # nothing was left out
    assert _hidden(answer.text) == ["fast"]
    assert answer.text.count(" autofocus") == 1
    answer = _hand_in(lab, token, answer.text, played="yes", hours="3", calm="2", check="4")
    assert answer.status_code == 422
    assert _hidden(answer.text) == []  # an optional one: shown once, though it may be left empty
    answer = _hand_in(lab, token, answer.text, played="yes", hours="3", calm="2", check="4")
    assert answer.status_code == 303
    assert lab.study.state(who, "pre") is PhaseState.DONE


def test_what_was_left_out_and_what_follows_are_told_apart(branched):
    lab, _, token = branched
    page = lab.client.get(f"/p/{token}/pre/1").text
    text = " ".join(_hand_in(lab, token, page, played="yes", calm="2").text.split())
    assert f'{texts.MISSING_ONE} <a href="#item.check">question 4</a>' in text
    assert f'{texts.FOLLOWS_ONE} <a href="#item.hours">question 2</a>' in text
    assert re.findall(r'name="item\.(\w+)" value="[^"]*"[^>]* autofocus', text) == ["hours"]


def test_what_stands_in_a_hidden_field_is_neither_kept_nor_wrong(branched):
    lab, who, token = branched
    page = lab.client.get(f"/p/{token}/pre/1").text
    answer = _hand_in(lab, token, page, played="no", hours="many", calm="2", check="4")
    assert answer.status_code == 303
    assert set(lab.study.answers(who, "pre", "branched")) == {"played", "calm", "check"}


def test_a_changed_mind_hides_and_shows_again_with_the_answer(branched):
    lab, _, token = branched
    for item, value in (("played", "yes"), ("hours", "5"), ("played", "no")):
        assert lab.post(token, "/pre/1/answer", item=item, value=value).status_code == 204
    page = lab.client.get(f"/p/{token}/pre/1").text
    assert _hidden(page) == ["hours", "fast"]
    assert re.search(r'name="item\.hours" value="5"', page)
    answer = _hand_in(lab, token, page, played="yes", hours="5", calm="2", check="4")
    assert _hidden(answer.text) == ["fast"]  # answered before, and looked at once more
    assert (
        _hand_in(lab, token, answer.text, played="yes", hours="5", calm="2", check="4").headers[
            "location"
        ]
        == f"/p/{token}"
    )


def test_an_answer_sent_before_what_shows_it_is_kept(branched):
    lab, who, token = branched
    assert lab.post(token, "/pre/1/answer", item="hours", value="5").status_code == 204
    assert lab.study.answers(who, "pre", "branched") == {"hours": 5}


def test_back_asks_for_nothing_that_follows(branched):
    lab, _, token = branched
    answer = lab.post(token, "/pre/1", go="back", seen="played", item__played="yes")
    assert answer.status_code == 303


def test_questions_come_in_the_participants_order(branched):
    lab, _, token = branched
    lab.study.orders["branched"] = ["calm", "check", "played", "hours", "fast"]
    page = lab.client.get(f"/p/{token}/pre/1").text
    assert re.findall(r'data-item="(\w+)"', page) == lab.study.orders["branched"]
    assert re.findall(r'class="number">(\d*)<', page) == ["1", "2", "3", "", ""]
