"""A whole training participant: pages by keyboard in Chromium, drives at a wheel in a window."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from steerlab.app.console import texts
from steerlab.study.contract import Role, Standing
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study

pytestmark = [pytest.mark.browser, pytest.mark.display, pytest.mark.slow]

PERSON = Path(__file__).parents[2] / "teleop" / "virtual_person.py"
ASKED = 'questionnaires = ["fluency", "demographics"]'
CHANGES = (
    (r'questionnaires = \[\n  "demographics"[^\]]*\]', ASKED),
    (r"rollouts = 12 ", 'rollouts = ["calibration-05"] '),  # the shortest
    (r"balls = 5", "balls = 1"),
    (r"pedals = true", "pedals = false"),
    (r"countdown_s = 3.0", "countdown_s = 0.5"),
    (r"width = 960\nheight = 540", "width = 640\nheight = 360"),
    (r"full_screen = true ", "full_screen = false "),
    (r"(lateness_p99|lateness_max|input_age_p99)_ms = [\d.]+", r"\1_ms = 60000.0"),
    (r"(dropped|overrun)_share = [\d.]+", r"\1_share = 1.0"),  # whatever else this computer does
)


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "study"
    new_study(folder, "mind-meld")
    text = (folder / "study.toml").read_text()
    for before, after in CHANGES:
        text, count = re.subn(before, after, text)
        assert count, before
    (folder / "study.toml").write_text(text)
    return folder


def test_from_enrolment_to_thanks(
    chromium, serving, keyboard, folder, tmp_path, x_display, monkeypatch
):
    monkeypatch.setenv("DISPLAY", x_display)
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
    person = (sys.executable, str(PERSON), str(tmp_path), json.dumps({}), "--", "study")
    with serving(lambda: Study.open(folder), folder, person) as (address, links, _):
        lab, tablet = (chromium.new_context().new_page() for _ in range(2))
        for page in (lab, tablet):
            page.set_default_timeout(90_000)
        lab.goto(f"{address}/enter/{links[-1]}")
        keyboard.press(lab, texts.ENROL_TRAINING)
        lab.get_by_role("heading", name="Participant T001").wait_for()
        keyboard.press(lab, texts.LINK_MAKE)
        link = lab.get_by_label("Link for T001")
        tablet.goto(link.input_value())
        keyboard.press(tablet, texts.CONSENT_YES)
        tablet.wait_for_url("**/about-you/1")
        for _ in range(2):
            keyboard.fill(tablet)
        for title, after in (
            ("Practice drive", "How correcting works"),
            ("Correcting the robot", "Thank you"),
        ):
            keyboard.press(tablet, texts.NEXT)
            tablet.get_by_text(texts.WHEEL_NEXT.format(title=title)).wait_for()
            lab.get_by_role("button", name=texts.START.format(title=title)).wait_for()
            keyboard.press(lab, texts.START.format(title=title))
            tablet.get_by_text(texts.WHEEL_RUNNING).wait_for()
            if title == "Correcting the robot":
                lab.get_by_text("0 of 1 rollouts").wait_for()  # by itself
            tablet.get_by_role("heading", name=after).wait_for()  # by itself
            lab.get_by_text(texts.RUN_DONE.format(title=title, participant="T001")).wait_for()
        assert "Logitech G920 (wheel)" in lab.locator("#health").inner_text()
        assert "drives finished: 1" in lab.locator("#health").inner_text()
        keyboard.press(tablet, texts.NEXT)
        tablet.get_by_text(texts.THANKS_TEXT).wait_for()
        lab.get_by_text(texts.NEXT_FINISHED).wait_for()
        keyboard.press(lab, texts.CHECKS)
        lab.get_by_text("Nothing is wrong in").wait_for()
        for page in (lab, tablet):
            page.context.close()
    with Study.open(folder, read_only=True) as study:
        assert study.participant("T001").standing is Standing.FINISHED
        assert study.verify().ok
        assert set(study.answers("T001", "about-you", "fluency").values()) == {2}
        assert study.answers("T001", "about-you", "demographics")["age"] == 34
        acts = {one.detail: one.act for one in study._opened.store.audit()}
        assert acts["T001 practice"] == acts["T001 calibration"] == "phase done"
        (session,) = study._opened.store.sessions().values()
        assert (session.input_kind, session.settings["phase"]) == ("wheel", "calibration")
        assert session.screen_px == (640, 360)
        labels = np.asarray(study._opened.store.read_labels()["teacher_label"])
        assert len(labels) == 150
        assert labels.max() > 1.2 > -1.2 > labels.min()  # 0.6 of the way to either side


def test_in_a_kiosk_the_participant_needs_nobody_from_the_link_to_the_thanks(
    chromium, serving, keyboard, folder, tmp_path, x_display, monkeypatch
):
    monkeypatch.setenv("DISPLAY", x_display)
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
    person = (sys.executable, str(PERSON), str(tmp_path), json.dumps({}), "--", "study")
    with Study.open(folder) as study:
        token = study.new_link(study.enrol(Role.TRAINING).id)
    with serving(lambda: Study.open(folder), folder, person, kiosk=True) as (address, _, _):
        page = chromium.new_context().new_page()
        page.set_default_timeout(90_000)
        page.goto(f"{address}/p/{token}")
        keyboard.press(page, texts.CONSENT_YES)
        page.wait_for_url("**/about-you/1")
        for _ in range(2):
            keyboard.fill(page)
        for after in ("How correcting works", "Thank you"):
            keyboard.press(page, texts.NEXT)
            page.get_by_text(texts.WHEEL_BEGINS).wait_for()
            keyboard.press(page, texts.WHEEL_READY)
            page.get_by_text(texts.WHEEL_RUNNING).wait_for()
            page.get_by_role("heading", name=after).wait_for()  # by itself
        keyboard.press(page, texts.NEXT)
        page.get_by_text(texts.THANKS_TEXT).wait_for()
        page.context.close()
    with Study.open(folder, read_only=True) as study:
        assert study.participant("T001").standing is Standing.FINISHED
        assert study.verify().ok
