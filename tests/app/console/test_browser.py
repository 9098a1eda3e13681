"""The pages in a real Chromium: by keyboard alone, audited, narrow, zoomed, offline, twice."""

import re
from collections.abc import Iterator

import pytest

from steerlab.app.console import texts
from steerlab.sim.language import ENGLISH, LANGUAGES, speak
from steerlab.study.contract import PhaseState, Role, Standing

pytestmark = pytest.mark.browser

SIZES = (  # of the window and the text; 640 by 400 is what a zoom of 200 % leaves of 1280 by 800
    (320, 640, "100%"),
    (640, 400, "100%"),
    (1280, 800, "200%"),
)
PAGES = (
    "consent",
    "consent lacking",
    "copy",
    "too young",
    "follows",
    "demographics",
    "likert",
    "missing",
    "slider",
    "read",
    "wheel",
    "thanks",
    "left",
    "expired",
    "sign in",
    "people",
    "person",
    "person waits",
    "person left",
    "link",
    "checks",
)


@pytest.fixture
def page(chromium, served) -> Iterator:
    """A page that fails the test if it asks for anything but the console, or if a script fails."""
    context = chromium.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(15_000)
    page = context.new_page()
    asked, failed = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: failed.append(str(error)))
    page.on("console", lambda said: failed.append(said.text) if _is_wrong(said) else None)
    yield page
    context.close()
    assert [url for url in asked if not url.startswith(served.address)] == []
    assert failed == []


def _is_wrong(said) -> bool:
    """Chromium also says each 4xx, and that it was offline, which tests want."""
    return said.type == "error" and not re.match(r"Failed to load resource", said.text)


def _start(served, at=None, role=Role.TRAINING):
    view = served.study.enrol(role)
    token = served.study.new_link(view.id)
    if at:
        served.study.bring_to(view.id, at)
    return view.id, f"{served.address}/p/{token}"


def _open(page, served, name):
    """Bring the browser to one of ``PAGES``."""
    if name in ("people", "person", "person waits", "person left", "link", "checks"):
        _start(served)
        _start(served, "calibration", Role.TEST)
        _start(served, "end")
        gone, _ = _start(served, "how")
        served.study.withdraw(gone, erase=False)
        served.study.note("P02", "Asked for a break.")
        page.goto(f"{served.address}/enter/{served.links[-1]}")
        if name == "link":
            page.goto(f"{served.lab}/participants/P01")
            page.get_by_role("button", name=texts.LINK_MAKE).click()
            page.get_by_label(texts.LINK_LABEL.format(id="P01")).wait_for()
        elif name.startswith("person"):
            who = {"person": "P02", "person waits": "P01", "person left": "P04"}[name]
            page.goto(f"{served.lab}/participants/{who}")
            for summary in page.locator("summary").all():
                summary.click()
        elif name == "checks":
            page.goto(f"{served.lab}/checks")
            page.get_by_text("1.2 GB free").wait_for()  # by itself
        return
    if name in ("consent lacking", "copy", "too young"):
        served.study.ask_everything()
        served.study.paragraphs = ("## What happens\n\n- You *watch*.\n- You **steer**.", "Thanks.")
    elif name == "follows":
        served.study.branch()
    at = {
        "follows": "pre",
        "demographics": "pre",
        "likert": "pre",
        "missing": "pre",
        "slider": "post",
    }
    at |= {"read": "how", "wheel": "practice", "thanks": "end"}
    who, url = _start(served, at.get(name))
    if name == "likert":
        url += "/pre/2"
    elif name == "left":
        served.study.withdraw(who, erase=True)
    elif name == "expired":
        url = f"{served.address}/p/none"
    elif name == "sign in":
        url = served.address
    page.goto(url)
    if name == "consent lacking":
        page.get_by_role("checkbox").first.check()
        page.get_by_role("button", name=texts.CONSENT_YES).click()
        page.get_by_role("alert").wait_for()
    elif name == "copy":
        _agree(page)
        page.get_by_role("heading", name=texts.COPY_TITLE).wait_for()
    elif name == "too young":
        page.get_by_label(texts.CONSENT_TOO_YOUNG.format(age=18)).check()
        page.get_by_role("button", name=texts.CONSENT_YES).click()
        page.get_by_role("heading", name=texts.TOO_YOUNG_TITLE).wait_for()
    elif name == "follows":  # as without scripts, which would have shown it at once
        page.get_by_label("Yes").check()
        page.evaluate("document.forms[0].elements.seen.value = 'played calm check'")
        page.locator("button[value=on]").click()
        page.get_by_text(texts.FOLLOWS_ONE).wait_for()
    elif name == "missing":
        page.get_by_role("button", name=texts.NEXT).click()
        page.get_by_role("alert").wait_for()


def _agree(page):
    """Tick, say and sign all that the consent page asks for, and agree."""
    for box in page.get_by_role("checkbox").all():
        box.check()
    page.get_by_label(texts.CONSENT_OF_AGE.format(age=18)).check()
    page.get_by_label(texts.CONSENT_SIGNATURE).fill("Ada Lovelace")
    page.get_by_role("button", name=texts.CONSENT_YES).click()


def _go_on(page):
    """Press the button that goes on, and wait until another page is there."""
    path = page.url
    page.locator("button[value=on]").click()
    page.wait_for_url(lambda url: url != path)


def test_the_whole_way_by_keyboard_alone(page, served, keyboard):
    who, url = _start(served)
    study = served.study
    page.goto(url)
    keyboard.press(page, texts.CONSENT_YES)
    page.wait_for_url("**/pre/1")
    for _ in range(3):
        keyboard.fill(page)
    assert page.get_by_role("heading", level=1).inner_text() == "How the drives work"
    keyboard.press(page, texts.NEXT)
    for phase, title in (("practice", "Practice drive"), ("calibration", "Twelve drives")):
        page.get_by_text(texts.WHEEL_NEXT.format(title=title)).wait_for()
        study.set_state(who, phase, PhaseState.STARTED)
        page.get_by_text(texts.WHEEL_BEGUN).wait_for()  # by another program than the console
        study.set_state(who, phase, PhaseState.DONE)  # the page moves on by itself
    page.wait_for_url("**/post/1")
    for _ in range(2):
        keyboard.fill(page)
    keyboard.press(page, texts.NEXT)
    page.get_by_text(texts.THANKS_TITLE).wait_for()
    assert study.participant(who).standing is Standing.FINISHED
    for phase in study.way:
        for key in phase.questionnaires:
            answers = study.answers(who, phase.id, key)
            assert len(answers) == len(study.questionnaire(key).items)
            if key in ("mini_ipip_5", "trust"):
                assert set(answers.values()) == {2}  # the second: Space, then one to the right


def test_the_experimenter_needs_no_mouse(page, served, keyboard):
    who, _ = _start(served, "calibration")
    study = served.study
    page.goto(f"{served.address}/enter/{served.links[-1]}")
    keyboard.tab_to(page, lambda one: one["text"] == who)
    page.keyboard.press("Enter")
    page.wait_for_url(f"**/participants/{who}")

    def summary(words):
        keyboard.tab_to(page, lambda one: one["tag"] == "SUMMARY" and one["text"] == words)
        page.keyboard.press("Enter")

    summary(texts.REDO)  # the first of those that can be: about you
    keyboard.press(page, texts.REDO_DO.format(title="About you"))
    page.get_by_text("“About you” is on the participant’s page").wait_for()
    assert study.state(who, "pre") is PhaseState.WAITING
    keyboard.tab_to(page, lambda one: one["name"] == "text")
    page.keyboard.type("Asked for a break.")
    keyboard.press(page, texts.NOTE_SAVE)
    page.locator("#notes").get_by_text("Asked for a break.").wait_for()
    summary(texts.WITHDRAW_DO)
    keyboard.tab_to(page, lambda one: one["name"] == "outcome")
    page.keyboard.press("Space")
    keyboard.tab_to(page, lambda one: one["name"] == "typed")
    page.keyboard.type(who)
    page.keyboard.press("Enter")
    page.get_by_text(texts.NEXT_LEFT).wait_for()
    assert study.participant(who).standing is Standing.WITHDRAWN_KEPT
    keyboard.press(page, texts.SIGN_OUT)
    page.get_by_role("heading", name=texts.SIGN_IN_TITLE).wait_for()


@pytest.fixture(params=LANGUAGES)
def spoken(request) -> Iterator[str]:
    """Each language in turn; the console is in this process."""
    speak(request.param)
    yield request.param
    speak(ENGLISH)


@pytest.mark.parametrize("name", PAGES)
def test_the_audit_finds_nothing_serious(page, served, spoken, name):
    from axe_playwright_python.sync_playwright import Axe

    _open(page, served, name)
    assert page.locator("html").get_attribute("lang") == spoken
    for scheme in ("light", "dark") if spoken == ENGLISH else ("light",):
        page.emulate_media(color_scheme=scheme)
        found = Axe().run(page).response
        assert "color-contrast" in {one["id"] for one in found["passes"]}
        serious = [
            (scheme, one["id"], [node["html"] for node in one["nodes"]])
            for one in found["violations"]
            if one["impact"] in ("serious", "critical")
        ]
        assert serious == []


def test_the_audit_would_see_pale_words_and_a_missing_label(page, served):
    from axe_playwright_python.sync_playwright import Axe

    _open(page, served, "demographics")
    page.evaluate(
        """() => { document.querySelector("h1").style.color = "#ccc";
                   document.querySelector("label[for='item.age.input']").remove(); }"""
    )
    found = {one["id"] for one in Axe().run(page).response["violations"]}
    assert {"color-contrast", "label"} <= found


@pytest.mark.parametrize("name", PAGES)
def test_narrow_or_enlarged_nothing_scrolls_sideways(page, served, spoken, name):
    _open(page, served, name)
    for width, height, text in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("size => { document.documentElement.style.fontSize = size; }", text)
        wide = page.evaluate(
            """() => [...document.querySelectorAll("body, body *")]
                .filter(e => !e.closest(".skip, .unseen, thead"))
                .filter(e => e.getBoundingClientRect().right > innerWidth + 0.5)
                .map(e => e.outerHTML)"""
        )
        assert (width, wide) == (width, [])
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_an_answer_is_saved_without_pressing_anything(page, served):
    who, url = _start(served, "pre")
    page.goto(f"{url}/pre/2")
    page.get_by_role("group", name="Have a vivid imagination").get_by_label("4").check()
    page.get_by_text(texts.SAVED).wait_for()
    assert served.study.answers(who, "pre", "mini_ipip_5") == {"i05": 4}
    assert "1 of 20 answered" in page.locator(".saved").inner_text()


def test_marks_go_as_soon_as_an_answer_is_given(page, served, keyboard):
    _open(page, served, "missing")
    marks = page.get_by_text(texts.PLEASE_ANSWER)
    before = marks.count()
    assert before > 1
    assert keyboard.focused(page)["name"] == "item.gender"
    page.keyboard.press("Space")
    assert marks.count() == before - 1
    marked = page.locator("fieldset.marked")
    for _ in range(marked.count()):
        marked.first.get_by_role("radio").last.check()
    assert marks.count() == 0
    assert page.get_by_role("alert").count() == 0


def test_what_cannot_be_kept_is_said_at_once(page, served):
    who, url = _start(served, "pre")
    page.goto(url)
    age = page.get_by_label("How old are you?")
    age.fill("7")
    page.get_by_text("Please enter a whole number from").wait_for()
    age.fill("70")
    page.get_by_text(texts.SAVED).wait_for()
    assert page.get_by_text("Please enter a whole number from").count() == 0
    assert served.study.answers(who, "pre", "demographics") == {"age": 70}


def test_an_outage_is_said_and_made_up_for(page, served):
    who, url = _start(served, "pre")
    page.goto(f"{url}/pre/2")
    page.context.set_offline(True)
    group = page.get_by_role("group", name="Have a vivid imagination")
    group.get_by_label("4").check()
    page.get_by_text(texts.UNSAVED).wait_for()
    group.get_by_label("5").check()
    page.context.set_offline(False)
    page.get_by_text(texts.SAVED).wait_for()
    assert served.study.answers(who, "pre", "mini_ipip_5") == {"i05": 5}


def test_back_button_and_double_click_are_harmless(page, served):
    who, url = _start(served, "how")
    page.goto(url)
    page.get_by_role("button", name=texts.NEXT).dblclick()
    page.get_by_role("heading", name=texts.WHEEL_TITLE).wait_for()
    page.go_back()
    page.get_by_role("heading", name=texts.WHEEL_TITLE).wait_for()
    assert served.study.state(who, "how") is PhaseState.DONE
    assert served.study.state(who, "practice") is PhaseState.WAITING


def test_back_after_handing_in_leads_to_what_comes_next(page, served):
    _, url = _start(served, "post")
    page.goto(url)
    for _ in range(2):
        for group in page.locator("fieldset.question").all():
            group.get_by_role("radio").first.check()
        _go_on(page)
    page.get_by_role("heading", name="What this study is about").wait_for()
    page.go_back()
    page.get_by_role("heading", name="What this study is about").wait_for()


def test_without_scripts_the_forms_work_as_well(chromium, served):
    who, url = _start(served)
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(url)
    page.locator("button[value=yes]").click()
    page.wait_for_url("**/pre/1")
    for _ in range(3):
        for group in page.locator("fieldset.question").all():
            group.get_by_role("radio").last.check()
        _go_on(page)
    assert page.get_by_role("heading", level=1).inner_text() == "How the drives work"
    assert set(served.study.answers(who, "pre", "trust").values()) == {7}
    context.close()


def test_questions_follow_at_once_and_are_counted_as_they_are_shown(page, served):
    served.study.branch()
    who, url = _start(served, "pre")
    page.goto(url)
    hours = page.get_by_label("How many hours a week?")
    assert not hours.is_visible()
    page.get_by_label("Yes").check()
    assert hours.is_visible()
    assert "1 of 4 answered" in page.locator(".saved").inner_text()
    hours.fill("3.0")
    assert page.get_by_role("group", name="Did you like the speed?").is_visible()
    numbers = [number for number in page.locator(".number").all() if number.is_visible()]
    assert [number.inner_text() for number in numbers] == ["1", "2", "3", "4", "5"]
    page.get_by_label("No", exact=True).check()
    assert not hours.is_visible()
    assert "1 of 3 answered" in page.locator(".saved").inner_text()
    for name in ("I drive calmly.", "Please choose 4 here."):
        page.get_by_role("group", name=name).get_by_label("4").check()
    page.get_by_text(texts.SAVED).wait_for()
    _go_on(page)
    assert served.study.state(who, "pre") is PhaseState.DONE
    given = served.study.answers(who, "pre", "branched")
    assert (given["played"], given["hours"]) == ("no", 3)  # kept; it does not count


def test_a_question_that_may_stay_empty_does_not_bring_the_page_again(page, served):
    served.study.branch()
    who, url = _start(served, "pre")
    page.goto(url)
    page.get_by_label("Yes").check()
    page.get_by_label("How many hours a week?").fill("3")
    for name in ("I drive calmly.", "Please choose 4 here."):
        page.get_by_role("group", name=name).get_by_label("4").check()
    _go_on(page)
    assert served.study.state(who, "pre") is PhaseState.DONE


def test_without_scripts_questions_follow_when_the_page_comes_again(chromium, served):
    served.study.branch()
    who, url = _start(served, "pre")
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(url)
    hours = page.get_by_label("How many hours a week?")
    page.get_by_label("Yes").check()
    for name in ("I drive calmly.", "Please choose 4 here."):
        page.get_by_role("group", name=name).get_by_label("4").check()
    assert not hours.is_visible()
    page.locator("button[value=on]").click()
    page.get_by_text(texts.FOLLOWS_ONE).wait_for()
    hours.fill("12")
    _go_on(page)
    assert served.study.state(who, "pre") is PhaseState.DONE
    assert served.study.answers(who, "pre", "branched")["hours"] == 12
    context.close()


def test_ticking_and_signing_by_keyboard_alone_leads_to_a_copy_to_print(page, served, keyboard):
    served.study.ask_everything()
    who, url = _start(served)
    page.goto(url)
    for name in ("tick.0", "tick.1", "age", "signature"):
        keyboard.tab_to(page, lambda one, name=name: one["name"] == name)
        page.keyboard.press("Space")
    page.keyboard.type("Ada Lovelace")
    keyboard.press(page, texts.CONSENT_YES)
    page.get_by_text(texts.COPY_NAME.format(name="Ada Lovelace")).wait_for()
    page.evaluate("window.print = () => { document.title = 'printed'; }")
    keyboard.press(page, texts.COPY_PRINT)
    assert page.title() == "printed"
    page.emulate_media(media="print")
    assert not page.get_by_role("button", name=texts.COPY_PRINT).is_visible()
    assert page.get_by_text(texts.COPY_GIVEN).is_visible()
    page.emulate_media(media="screen")
    keyboard.press(page, texts.GO_ON)
    page.wait_for_url("**/pre/1")
    assert served.study.state(who, "consent") is PhaseState.DONE


def test_the_experimenters_pages_follow_and_leave_a_half_written_note_alone(page, served):
    who, _ = _start(served, "practice")
    page.goto(f"{served.address}/enter/{served.links[-1]}")
    page.get_by_text("Start “Practice drive” and ask").wait_for()
    served.study.set_state(who, "practice", PhaseState.STARTED)
    page.get_by_text("Resume “Practice drive”").wait_for()
    page.goto(f"{served.lab}/participants/{who}")
    page.get_by_label(texts.NOTE_LABEL).fill("half a sent")
    served.study.set_state(who, "practice", PhaseState.DONE)
    page.get_by_role("button", name="Start “Twelve drives”").wait_for()
    assert page.get_by_label(texts.NOTE_LABEL).input_value() == "half a sent"


def test_a_withdrawal_elsewhere_takes_its_buttons_off_an_open_page(page, served):
    who, _ = _start(served, "practice")
    page.goto(f"{served.address}/enter/{served.links[-1]}")
    page.goto(f"{served.lab}/participants/{who}")
    page.get_by_role("button", name=texts.LINK_MAKE).wait_for()
    served.study.withdraw(who, erase=False)
    page.get_by_text(texts.NEXT_LEFT).wait_for()
    page.get_by_role("button", name=texts.LINK_MAKE).wait_for(state="detached")
    assert page.get_by_text(texts.WITHDRAW_DO).count() == 0
    assert "withdrawn, data kept" in page.locator("#standing").inner_text()


def test_an_ended_session_is_said_on_an_open_page(page, served):
    page.goto(f"{served.address}/enter/{served.links[-1]}")
    page.route("**/events", lambda route: route.fulfill(status=401))  # as without a session
    page.goto(f"{served.lab}/checks")
    page.get_by_text(texts.ENDED).wait_for()


def test_a_made_link_opens_the_participants_page(page, served):
    _open(page, served, "link")
    page.goto(page.get_by_label("Link for P01").input_value())
    assert page.get_by_role("heading", level=1).inner_text() == "Information and consent"
    page.goto(served.lab)  # the same browser still is the experimenter's
    page.get_by_role("heading", name=texts.PEOPLE).wait_for()


def test_forms_of_the_experimenters_work_in_the_browser(page, served):
    page.goto(f"{served.address}/enter/{served.links[-1]}")
    page.get_by_role("button", name=texts.ENROL_TEST).click()
    page.get_by_role("heading", name="Participant P01").wait_for()
    page.get_by_text(texts.WITHDRAW_DO).first.click()
    page.get_by_label(texts.WITHDRAW_KEEP).check()
    page.get_by_role("button", name=texts.WITHDRAW_DO).click()
    page.get_by_role("alert").wait_for()
    page.get_by_label(texts.WITHDRAW_KEEP).check()
    page.get_by_label("Type P01 to confirm").fill("P01")
    page.get_by_role("button", name=texts.WITHDRAW_DO).click()
    page.get_by_text(texts.NEXT_LEFT).wait_for()
    assert served.study.participant("P01").standing is Standing.WITHDRAWN_KEPT
