"""A form that is sent twice, by two presses or from the page that says "try again", is done once."""

import html
import re

import pytest

from steerlab.app.console.guard import csrf_token, form_key
from steerlab.study.contract import PhaseState, Role
from steerlab.study.store.errors import StoreError

HEADERS = {"origin": "http://127.0.0.1:8765"}


def _forms(page):
    """Each form's address and hidden fields."""
    found = {}
    for action, inside in re.findall(
        r'<form method="post" action="([^"]*)"[^>]*>(.*?)</form>', page, re.DOTALL
    ):
        fields = re.findall(r'<input type="hidden" name="([^"]*)" value="([^"]*)"', inside)
        found[action] = {name: html.unescape(value) for name, value in fields}
    return found


@pytest.fixture
def send(lab):
    """Open a page and give what sends one of its forms, as often as it is called."""
    lab.sign_in()

    def opened(page, path, **filled):
        fields = _forms(lab.get(page).text)[lab.at(path)]
        assert fields["once"]

        def press(**other):
            return lab.client.post(lab.at(path), data=fields | filled | other, headers=HEADERS)

        return press

    return opened


def test_two_presses_enrol_one_participant(lab, send):
    press = send("/", "/enrol", role="training")
    first, second = press(), press()
    assert [one.id for one in lab.study.participants()] == ["P01"]
    assert first.headers["location"] == second.headers["location"] == lab.at("/participants/P01")
    send("/", "/enrol", role="training")()  # the page anew is another enrolment
    assert [one.id for one in lab.study.participants()] == ["P01", "P02"]


def test_one_page_may_enrol_both_kinds(lab, send):
    press = send("/", "/enrol")
    for role in ("training", "test", "training"):
        press(role=role)
    assert [one.role.value for one in lab.study.participants()] == ["training", "test"]


def test_what_was_done_before_the_database_failed_is_not_done_again(lab, send, monkeypatch):
    real = lab.study.enrol

    def enrol(role, **options):
        real(role, **options)
        raise StoreError("Cannot read: database is locked.")

    with monkeypatch.context() as patch:
        patch.setattr(lab.study, "enrol", enrol)
        answer = send("/", "/enrol", role="test")()
    assert answer.status_code == 503
    ((action, kept),) = _forms(answer.text).items()
    again = lab.client.post(action, data=kept, headers=HEADERS)
    assert again.headers["location"] == lab.at("/participants/P01")
    assert len(lab.study.participants()) == 1


def test_two_presses_keep_one_note_and_another_text_another_note(lab, send):
    lab.enrol()
    press = send("/participants/P01", "/participants/P01/note", text="late")
    press()
    press()
    assert [text for _, text in lab.study.notes("P01")] == ["late"]
    press(text="and lost")
    assert [text for _, text in lab.study.notes("P01")] == ["late", "and lost"]


def test_a_redo_that_comes_late_does_not_open_what_was_finished_since(lab, send):
    lab.enrol(at="calibration")
    page = "/participants/P01"
    press = send(page, f"{page}/redo")
    press()
    assert lab.study.state("P01", "practice") is PhaseState.WAITING
    lab.study.bring_to("P01", "calibration")
    assert press().status_code == 303
    assert lab.study.state("P01", "practice") is PhaseState.DONE


def test_two_presses_start_one_run_and_show_it(lab, tmp_path):
    lab.sign_in()
    (tmp_path / "hold").touch()
    lab.enrol(at="practice")
    for _ in range(2):
        answer = lab.act("/participants/P01/start", phase="practice")
        assert answer.headers["location"] == lab.at("/participants/P01")


def test_two_presses_erase_once(lab, tmp_path):
    lab.sign_in()
    (tmp_path / "hold").touch()
    lab.enrol(Role.TRAINING)
    for _ in range(2):
        answer = lab.act("/participants/P01/withdraw", outcome="erase", typed="P01")
        assert answer.status_code == 303


def test_the_key_is_the_pages_the_acts_and_the_fields():
    fields = {"once": "a", "text": "late", "csrf": csrf_token("s")}
    key = form_key("note P01", fields)
    assert key == form_key("note P01", fields | {"csrf": csrf_token("signed in again")})
    others = (
        form_key("note P02", fields),
        form_key("note P01", fields | {"text": "early"}),
        form_key("note P01", fields | {"once": "b"}),
    )
    assert len({key, *others}) == 4
    assert form_key("note P01", {"text": "late"}) is None
