import re
import time
from dataclasses import replace
from datetime import datetime

import pytest

from steerlab.app.console import texts
from steerlab.study.contract import Phase, PhaseKind, PhaseState, Role, Standing, StudyError
from steerlab.study.design import DesignPlan
from steerlab.study.erasing_reach import Reach


def texts_of_time(at_utc):
    """As clocks here show it, with the zone."""
    here = datetime.fromisoformat(at_utc).astimezone()
    return f"{here:%Y-%m-%d, %H:%M} (UTC{here.isoformat()[-6:]})"


def _eventually(holds):
    """A process of its own needs a moment; fails after ten seconds."""
    for _ in range(500):
        if holds():
            return
        time.sleep(0.02)
    raise AssertionError("it never came to hold")


@pytest.fixture
def signed_in(lab):
    lab.sign_in()
    return lab


def _page(lab, path="/"):
    answer = lab.client.get(path) if path.startswith(lab.at("/")) else lab.get(path)
    assert answer.status_code == 200
    return answer.text


def test_the_list_shows_everyone_and_what_to_do_next(signed_in):
    signed_in.enrol()
    signed_in.enrol(Role.TEST, at="practice")
    page = _page(signed_in)
    assert re.findall(r'href="/lab/[\w-]+/participants/(\w+)"', page) == ["P01", "P02"]
    assert texts.NEXT_LINK in page
    assert texts.NEXT_START.format(title="Practice drive") in page
    assert "Step 4 of 7" in page


def test_who_has_finished_or_left_comes_after_who_is_under_way(signed_in):
    for at in ("end", "pre", "pre", "practice"):
        signed_in.enrol(at=at)
    signed_in.study.leave("P02", Standing.WITHDRAWN_ERASED)
    signed_in.study.leave("P03", Standing.ERASING)  # is to be said again
    page = _page(signed_in)
    assert re.findall(r'href="/lab/[\w-]+/participants/(\w+)"', page) == [
        "P03",
        "P04",
        "P01",
        "P02",
    ]
    assert page.index(texts.ENROL_TEST) < page.index(texts.OVER_TITLE.format(count=2))
    for who in ("P03", "P04"):
        signed_in.study.leave(who, Standing.WITHDRAWN_KEPT)
    assert texts.NOBODY_IN in _page(signed_in)


def test_nobody_enrolled_says_what_the_first_enrolment_does(signed_in):
    assert texts.NOBODY in _page(signed_in)


@pytest.mark.parametrize("role", Role)
def test_enrolling_leads_to_the_new_participant(signed_in, role):
    answer = signed_in.act("/enrol", role=role.value)
    assert answer.headers["location"] == signed_in.at("/participants/P01")
    assert signed_in.study.participant("P01").role is role


def test_an_unknown_role_enrols_nobody(signed_in):
    answer = signed_in.act("/enrol", role="boss")
    assert answer.status_code == 409
    assert "training or test" in answer.text
    assert signed_in.study.participants() == []


def test_a_link_is_shown_once_and_works(signed_in):
    who, old = signed_in.enrol()
    shown_at = signed_in.act(f"/participants/{who}/link").headers["location"]
    link = re.search(r'value="(http://[^"]+/p/[^"]+)"', _page(signed_in, shown_at)).group(1)
    assert "/p/" not in _page(signed_in, shown_at)
    assert signed_in.client.get(link).status_code == 200
    assert signed_in.client.get(f"/p/{old}").status_code == 404


def test_another_open_page_does_not_use_the_link_up(signed_in):
    who, _ = signed_in.enrol()
    shown_at = signed_in.act(f"/participants/{who}/link").headers["location"]
    assert "/p/" not in _page(signed_in, f"/participants/{who}")
    assert "/p/" in _page(signed_in, shown_at)


def test_the_order_of_conditions_is_shown_of_test_participants(signed_in):
    signed_in.enrol(Role.TEST)
    assert "bc → dagger → mind-meld" in _page(signed_in, "/participants/P01")


def test_the_list_shows_recruiting_orders_and_drop_outs(signed_in):
    study = signed_in.study
    study.design_plan = DesignPlan(test=18)
    for at in ("end", "practice", "pre"):
        signed_in.enrol(Role.TEST, at=at)
    study.leave("P02", Standing.WITHDRAWN_KEPT)
    page = _page(signed_in)
    assert "Test: 2 of 18 taking part, 1 of them finished; 1 left." in page
    assert "Training:" not in page  # nobody is wanted, and nobody came
    assert "P02 (test): withdrawn, data kept, before the end of “Practice drive”" in page
    assert re.search(r">bc → .*</th>", page)


def test_a_blind_experimenter_sees_no_order(signed_in):
    signed_in.study.design_plan = DesignPlan(blind=True)
    who, _ = signed_in.enrol(Role.TEST)
    for path in ("/", f"/participants/{who}"):
        page = _page(signed_in, path)
        assert "→" not in page
        assert "dagger" not in page.lower()
    assert texts.DESIGN_BLIND in _page(signed_in)


def test_a_wheel_phase_runs_in_a_process_and_only_one_at_a_time(signed_in, tmp_path):
    (tmp_path / "hold").touch()
    signed_in.enrol(at="practice")
    signed_in.enrol(at="calibration")
    answer = signed_in.act("/participants/P01/start", phase="practice")
    assert answer.headers["location"] == signed_in.at("/participants/P01")
    run = signed_in.runs.view()
    assert run.goes_on
    page = _page(signed_in, "/participants/P01")
    assert f"process {run.pid}" in page
    assert texts.NEXT_RUNNING.format(title="Practice drive") in page
    assert texts.NEXT_OTHER_RUNS.format(participant="P01") in _page(signed_in)
    second = signed_in.act("/participants/P02/start", phase="calibration")
    assert second.status_code == 409
    assert f"process {run.pid}" in second.text
    assert signed_in.runs.view().pid == run.pid


def test_the_process_gets_the_studys_own_names(signed_in, tmp_path):
    signed_in.enrol(at="practice")
    signed_in.act("/participants/P01/start", phase="practice")
    _eventually(lambda: not signed_in.runs.view().goes_on)
    run = signed_in.runs.view()
    assert run.code == 0
    assert run.last_lines == (
        f"run run {tmp_path} --participant P01 --phase practice --device wheel",
    )
    stopped = texts.RUN_STOPPED.format(title="Practice drive", participant="P01")
    assert stopped in _page(signed_in)  # the phase is not over
    signed_in.study.set_state("P01", "practice", PhaseState.DONE)
    assert texts.RUN_DONE.format(title="Practice drive", participant="P01") in _page(signed_in)


def test_who_stopped_midway_is_said_to_have_stopped_and_where(signed_in):
    signed_in.enrol(at="calibration")
    signed_in.act("/participants/P01/start", phase="calibration")
    _eventually(lambda: not signed_in.runs.view().goes_on)
    signed_in.study.set_state("P01", "calibration", PhaseState.STARTED)
    view = signed_in.study.views["P01"]
    signed_in.study.views["P01"] = replace(view, progress="3 of 12 rollouts")
    page = _page(signed_in, "/participants/P01")
    assert "“Twelve drives” of P01 stopped after 3 of 12 rollouts." in page
    assert texts.NEXT_STOPPED.format(title="Twelve drives") in page
    assert texts.NEEDS_YOU in page
    assert texts.NEEDS_YOU in _page(signed_in)


def test_what_the_computer_does_is_not_said_to_be_at_the_wheel(signed_in, tmp_path):
    signed_in.study.way = (Phase(id="w", kind=PhaseKind.CALIBRATE_W, title="Style"),)
    (tmp_path / "hold").touch()
    signed_in.enrol(Role.TEST)
    signed_in.act("/participants/P01/start", phase="w")
    assert texts.NEXT_COMPUTING.format(title="Style") in _page(signed_in)


def test_a_run_that_fails_shows_its_last_lines_and_can_be_resumed(signed_in, tmp_path):
    (tmp_path / "fail").touch()
    signed_in.enrol(at="practice")
    signed_in.act("/participants/P01/start", phase="practice")
    _eventually(lambda: not signed_in.runs.view().goes_on)
    signed_in.study.set_state("P01", "practice", PhaseState.STARTED)
    page = _page(signed_in, "/participants/P01")
    assert "exit code 1" in page
    assert "No wheel is plugged in." in page
    assert texts.RESUME.format(title="Practice drive") in page


@pytest.mark.parametrize("phase", ["calibration", "pre", "how", "", "--help", "x; rm -rf /"])
def test_only_the_wheel_phase_that_is_next_can_be_started(signed_in, phase):
    signed_in.enrol(at="practice")
    assert signed_in.act("/participants/P01/start", phase=phase).status_code == 409
    assert signed_in.runs.view() is None


def test_a_page_phase_is_not_started_at_the_wheel(signed_in):
    signed_in.enrol(at="how")
    assert signed_in.act("/participants/P01/start", phase="how").status_code == 409
    assert signed_in.runs.view() is None


def test_redo_opens_a_finished_phase_again(signed_in):
    signed_in.enrol(at="calibration")
    assert 'value="practice"' in _page(signed_in, "/participants/P01")
    signed_in.act("/participants/P01/redo", phase="practice")
    assert signed_in.study.participant("P01").next_phase.id == "practice"


def test_redo_of_no_phase_of_theirs_is_refused(signed_in):
    signed_in.enrol(at="calibration")
    assert signed_in.act("/participants/P01/redo", phase="nothing").status_code == 409


def test_redo_and_withdrawal_wait_for_the_drive_to_end(signed_in, tmp_path):
    (tmp_path / "hold").touch()
    signed_in.enrol(at="calibration")
    signed_in.act("/participants/P01/start", phase="calibration")
    for path, fields in (
        ("redo", {"phase": "practice"}),
        ("withdraw", {"outcome": "erase", "typed": "P01"}),
    ):
        answer = signed_in.act(f"/participants/P01/{path}", **fields)
        assert answer.status_code == 409
        assert "is running" in answer.text
    assert signed_in.study.participant("P01").standing is Standing.RUNNING


def test_notes_are_kept_and_shown_as_text(signed_in):
    signed_in.enrol()
    signed_in.act("/participants/P01/note", text=" wheel slipped <b>twice</b> ")
    signed_in.act("/participants/P01/note", text="  ")
    assert [text for _, text in signed_in.study.notes("P01")] == ["wheel slipped <b>twice</b>"]
    page = _page(signed_in, "/participants/P01")
    assert "wheel slipped &lt;b&gt;twice&lt;/b&gt;" in page
    at = texts_of_time("2026-03-02T10:15:04.123Z")
    assert f'<time datetime="2026-03-02T10:15:04.123Z">{at}</time>' in page


def test_a_note_that_is_too_long_is_refused(signed_in):
    signed_in.enrol()
    assert signed_in.act("/participants/P01/note", text="a" * 5001).status_code == 409
    assert signed_in.study.notes("P01") == []


@pytest.mark.parametrize("outcome", ["keep", "erase"])
def test_withdrawal_needs_an_outcome_and_the_typed_id(signed_in, outcome):
    signed_in.enrol(at="calibration")
    for fields in ({"typed": "P01"}, {"outcome": outcome}, {"outcome": outcome, "typed": "p01"}):
        answer = signed_in.act("/participants/P01/withdraw", **fields)
        assert answer.status_code == 422
        assert 'role="alert"' in answer.text
    assert signed_in.study.participant("P01").standing is Standing.RUNNING
    assert signed_in.runs.view() is None


def test_withdrawal_that_keeps_the_data_is_done_at_once(signed_in):
    signed_in.enrol(at="calibration")
    signed_in.act("/participants/P01/withdraw", outcome="keep", typed="P01")
    assert signed_in.study.participant("P01").standing is Standing.WITHDRAWN_KEPT
    page = _page(signed_in, "/participants/P01")
    assert texts.NEXT_LEFT in page
    assert re.findall(r'name="outcome" value="(\w+)"', page) == ["erase"]  # who left may ask later


@pytest.mark.parametrize("standing", [Standing.WITHDRAWN_KEPT, Standing.ERASING, Standing.DECLINED])
def test_who_has_left_may_have_their_data_erased_later(signed_in, standing, tmp_path):
    (tmp_path / "hold").touch()
    signed_in.enrol(at="calibration")
    signed_in.study.leave("P01", standing)
    signed_in.act("/participants/P01/withdraw", outcome="erase", typed="P01")
    assert signed_in.runs.view().goes_on
    if standing is Standing.ERASING:
        assert texts.NEXT_ERASING in _page(signed_in)
    (tmp_path / "hold").unlink()
    _eventually(lambda: not signed_in.runs.view().goes_on)
    assert signed_in.runs.view().last_lines == (f"run withdraw {tmp_path} P01 --erase",)
    if standing is Standing.ERASING:  # it was cut off, so it has to be said again
        assert texts.NEXT_ERASE in _page(signed_in)
        assert 'class="waits"' in _page(signed_in)
    signed_in.study.leave("P01", Standing.WITHDRAWN_ERASED)
    assert "/withdraw" not in _page(signed_in, "/participants/P01")


def test_withdrawing_while_somebody_else_drives_is_done_at_once(signed_in, tmp_path):
    (tmp_path / "hold").touch()
    signed_in.enrol(at="calibration")
    signed_in.enrol(at="calibration")
    signed_in.act("/participants/P01/start", phase="calibration")
    assert texts.WITHDRAW_LATER.format(participant="P01") in _page(signed_in, "/participants/P02")
    signed_in.act("/participants/P02/withdraw", outcome="erase", typed="P02")
    assert signed_in.study.participant("P02").standing is Standing.WITHDRAWN_KEPT
    assert texts.NEXT_ERASE_LATER in _page(signed_in, "/participants/P02")
    assert signed_in.runs.view().participant == "P01"
    (tmp_path / "hold").unlink()
    _eventually(lambda: signed_in.runs.view().participant == "P02")
    _eventually(lambda: not signed_in.runs.view().goes_on)
    assert signed_in.runs.view().last_lines == (f"run withdraw {tmp_path} P02 --erase",)


def test_what_erasing_touches_is_said_with_numbers(signed_in):
    signed_in.enrol(at="calibration")
    assert texts.REACH_NONE in _page(signed_in, "/participants/P01")
    reach = Reach(network="n", embeddings=("P05", "P07"), taught=("P07",), left=8, needed=8)
    signed_in.study.reach = reach
    page = _page(signed_in, "/participants/P01")
    assert "needs 8 training participants, and 8 are left: it is trained anew" in page
    assert texts.REACH_TESTS.format(count=2, who="P05, P07") in page
    assert texts.REACH_TAUGHT.format(count=1, who="P07") in page
    signed_in.study.reach = replace(reach, left=7)
    assert texts.REACH_TOO_FEW in _page(signed_in, "/participants/P01")


@pytest.mark.parametrize("deaf", [False, True])
def test_a_drive_is_stopped_in_order_and_at_once_when_asked_again(signed_in, tmp_path, deaf):
    (tmp_path / "hold").touch()
    if deaf:
        (tmp_path / "deaf").touch()
    signed_in.enrol(at="practice")
    signed_in.act("/participants/P01/start", phase="practice")
    _eventually(lambda: signed_in.runs.view().last_lines)  # it has begun
    stop = texts.RUN_STOP.format(title="Practice drive")
    assert stop in _page(signed_in)
    signed_in.act("/participants/P01/stop", phase="calibration")  # not what runs
    assert not signed_in.runs.view().stopping
    signed_in.act("/participants/P01/stop", phase="practice")
    if deaf:
        page = _page(signed_in, "/participants/P01")
        assert texts.RUN_STOPPING in page
        assert texts.RUN_STOP_NOW.format(title="Practice drive") in page
        signed_in.act("/participants/P01/stop", phase="practice")
    _eventually(lambda: not signed_in.runs.view().goes_on)
    signed_in.study.set_state("P01", "practice", PhaseState.STARTED)
    page = _page(signed_in, "/participants/P01")
    assert texts.RUN_STOPPED.format(title="Practice drive", participant="P01") in page
    assert "exit code" not in page  # it was asked for
    assert texts.RESUME.format(title="Practice drive") in page


def test_erasing_is_not_stopped(signed_in, tmp_path):
    (tmp_path / "hold").touch()
    signed_in.enrol(at="calibration")
    signed_in.act("/participants/P01/withdraw", outcome="erase", typed="P01")
    signed_in.act("/participants/P01/stop", phase="")
    assert signed_in.runs.view().goes_on
    assert not signed_in.runs.view().stopping


def test_what_the_computer_does_alone_begins_by_itself_and_once(signed_in, tmp_path):
    (tmp_path / "fail").touch()
    signed_in.study.way = (
        Phase(id="w", kind=PhaseKind.CALIBRATE_W, title="Style"),
        Phase(id="post", kind=PhaseKind.DEBRIEF, title="Thanks"),
    )
    _, token = signed_in.enrol(Role.TEST)
    _eventually(lambda: signed_in.runs.view() is not None and not signed_in.runs.view().goes_on)
    pid = signed_in.runs.view().pid
    signed_in.study.note("P01", "anything that changes the study")
    time.sleep(1.0)  # two looks
    assert signed_in.runs.view().pid == pid  # it failed, and is not tried again
    page = _page(signed_in, "/participants/P01")
    assert texts.NEXT_STOPPED.format(title="Style") in page
    assert texts.RESUME.format(title="Style") in page
    assert texts.STOPPED_TITLE in signed_in.client.get(f"/p/{token}").text
    (tmp_path / "fail").unlink()
    signed_in.act("/participants/P01/start", phase="w")
    _eventually(lambda: signed_in.runs.view().pid != pid and not signed_in.runs.view().goes_on)
    signed_in.study.set_state("P01", "w", PhaseState.DONE)
    _eventually(lambda: not signed_in.runs.tried("P01", "w"))
    pid = signed_in.runs.view().pid
    signed_in.study.set_state("P01", "w", PhaseState.WAITING)  # redone
    _eventually(lambda: signed_in.runs.view().pid != pid)


def test_the_computers_own_step_waits_for_the_wheel(signed_in, tmp_path):
    (tmp_path / "hold").touch()
    signed_in.enrol(at="practice")
    signed_in.act("/participants/P01/start", phase="practice")
    signed_in.study.way = (Phase(id="w", kind=PhaseKind.CALIBRATE_W, title="Style"),)
    signed_in.enrol(Role.TEST)
    time.sleep(1.0)  # two looks
    assert signed_in.runs.view().participant == "P01"
    assert texts.NEXT_BY_ITSELF.format(title="Style") in _page(signed_in, "/participants/P02")
    (tmp_path / "hold").unlink()
    _eventually(lambda: signed_in.runs.view().participant == "P02")


def test_some_drives_of_a_calibration_are_redone(signed_in):
    study = signed_in.study
    drives = ("one", "two", "three")
    study.way = tuple(
        replace(phase, rollouts=drives) if phase.id == "calibration" else phase
        for phase in study.way
    )
    study.flags = {"one": "", "two": "the computer was late", "three": ""}
    signed_in.enrol(at="post")
    page = _page(signed_in, "/participants/P01")
    assert "two: the computer was late" in page
    assert re.findall(r'name="rollout.(\w+)" value="yes" checked', page) == ["two"]
    path = "/participants/P01/redo"
    assert signed_in.act(path, phase="calibration").status_code == 409
    assert study.redone == []
    signed_in.act(path, phase="calibration", **{"rollout.two": "yes", "rollout.nothing": "yes"})
    signed_in.act(path, phase="calibration", **{"rollout.two": "yes", "all": "yes"})
    assert study.redone == [("P01", "calibration", ("two",)), ("P01", "calibration", ())]


def _short(page):
    return re.search(r"(https?://[^/]+)(/go/[a-z0-9-]+)", page).groups()


def test_a_short_link_hands_over_once(signed_in):
    who, _ = signed_in.enrol()
    shown_at = signed_in.act(f"/participants/{who}/link").headers["location"]
    page = _page(signed_in, shown_at)
    link = re.search(r'value="http://[^"]+(/p/[^"]+)"', page).group(1)
    _, short = _short(page)
    assert "<svg" not in page  # only this computer reaches the address
    for _ in range(2):  # as a camera does that shows what is there
        assert signed_in.client.get(short).status_code == 200
    code = short.removeprefix("/go/")
    typed = code.upper().replace("-", " ")
    go = {"headers": {"origin": "http://127.0.0.1:8765"}}
    answer = signed_in.client.post("/go", data={"code": typed}, **go)
    assert answer.headers["location"] == link
    answer = signed_in.client.post("/go", data={"code": code}, **go)
    assert (answer.status_code, texts.SHORT_WRONG in answer.text) == (401, True)


def test_guessing_short_links_is_slowed_down(signed_in):
    who, _ = signed_in.enrol()
    shown_at = signed_in.act(f"/participants/{who}/link").headers["location"]
    code = _short(_page(signed_in, shown_at))[1].removeprefix("/go/")
    go = {"headers": {"origin": "http://127.0.0.1:8765"}}
    for _ in range(20):
        assert signed_in.client.post("/go", data={"code": "guess"}, **go).status_code == 401
    assert signed_in.client.post("/go", data={"code": code}, **go).status_code == 429
    signed_in.clock[0] += 61.0
    assert signed_in.client.post("/go", data={"code": code}, **go).status_code == 303


def test_a_newer_link_ends_the_older_short_one(signed_in):
    who, _ = signed_in.enrol()
    codes = []
    for _ in range(2):
        shown_at = signed_in.act(f"/participants/{who}/link").headers["location"]
        codes.append(_short(_page(signed_in, shown_at))[1].removeprefix("/go/"))
    go = {"headers": {"origin": "http://127.0.0.1:8765"}}
    answers = [signed_in.client.post("/go", data={"code": code}, **go) for code in codes]
    assert [answer.status_code for answer in answers] == [401, 303]


def test_a_tablet_in_the_network_gets_a_qr_code(in_network):
    in_network.sign_in()
    who, _ = in_network.enrol()
    shown_at = in_network.act(f"/participants/{who}/link").headers["location"]
    page = _page(in_network, shown_at)
    assert _short(page)[0] == "http://192.168.1.20:8765"
    assert page.count("<svg") == 1


def test_erasing_is_done_by_a_process_of_its_own(signed_in, tmp_path):
    signed_in.enrol(at="calibration")
    signed_in.act("/participants/P01/withdraw", outcome="erase", typed="P01")
    _eventually(lambda: not signed_in.runs.view().goes_on)
    assert signed_in.runs.view().last_lines == (f"run withdraw {tmp_path} P01 --erase",)
    assert texts.ERASING in _page(signed_in)


def test_checks_name_what_is_wrong_first_and_how_to_mend_it(signed_in):
    _page(signed_in, "/checks")
    _eventually(lambda: texts.CHECKS_BUSY not in _page(signed_in, "/checks"))
    page = _page(signed_in, "/checks")
    assert texts.CHECKS_BAD_ONE.format(count=3) in page
    places = [page.index(one) for one in ("1.2 GB free", "not finished yet", "chain of 214")]
    assert places == sorted(places)
    assert page.count(f">{texts.NEEDS_YOU}<") == page.count(f">{texts.TO_KNOW}<") == 1
    assert "Free 2 GB" in page


def test_checks_are_done_again_when_asked(signed_in):
    _page(signed_in, "/checks")
    _eventually(lambda: "1.2 GB free" in _page(signed_in, "/checks"))
    signed_in.study.found = []
    assert "1.2 GB free" in _page(signed_in, "/checks")
    assert signed_in.act("/checks").headers["location"] == signed_in.at("/checks")
    _eventually(lambda: texts.CHECKS_WELL.format(count=0) in _page(signed_in, "/checks"))


def test_checks_that_cannot_be_done_say_why(signed_in):
    def fail(participant):
        raise StudyError("The database is damaged.")

    signed_in.study.findings = fail
    _page(signed_in, "/checks")
    _eventually(lambda: "The database is damaged." in _page(signed_in, "/checks"))


def test_an_unknown_participant_is_a_clear_refusal(signed_in):
    answer = signed_in.get("/participants/P77")
    assert answer.status_code == 409
    assert "P77" in answer.text


@pytest.mark.parametrize("path", ["/nothing", "/participants/P01/link/x", "/p"])
def test_an_unknown_page_is_a_clear_404(signed_in, path):
    answer = signed_in.get(path)
    assert answer.status_code == 404
    assert texts.NOT_FOUND_TITLE in answer.text


def test_signing_out_ends_the_session(signed_in):
    cookie = signed_in.client.cookies[signed_in.signing.cookie]
    assert signed_in.act("/sign-out").status_code == 303
    signed_in.client.cookies.set(signed_in.signing.cookie, cookie)
    assert signed_in.get("/").status_code == 401
