"""The console's parts on their own: settings, runs, next steps, throttle, forms, changes."""

import asyncio
import os
import re
import socket
import string
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from importlib.resources import files

import pytest

from steerlab.app.console import texts
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.config import ConsoleConfig
from steerlab.app.console.next_steps import NextAction, next_step, step_of
from steerlab.app.console.priority import give_way
from steerlab.app.console.server import _address_option, _bind
from steerlab.app.console.sign_in import MOST_ADDRESSES, LoginThrottle, SignIn
from steerlab.app.console.study_thread import StudyThread
from steerlab.app.console.wheel_run import LAST_LINES, RunView, WheelRuns
from steerlab.sim.errors import InvalidConfig
from steerlab.study.contract import Phase, PhaseKind, PhaseState, Role, StudyError

PRACTICE = Phase(id="practice", kind=PhaseKind.PRACTICE, title="Practice drive")
ENOUGH = "correct horse battery"


@pytest.fixture
def protected(tmp_path):
    """Everything that a network address needs."""
    for name in ("password", "cert.pem", "key.pem"):
        (tmp_path / name).write_text(ENOUGH + "\n")
        (tmp_path / name).chmod(0o600)
    return {
        "allow_network": True,
        "password_file": tmp_path / "password",
        "tls_cert": tmp_path / "cert.pem",
        "tls_key": tmp_path / "key.pem",
    }


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "localhost", "LocalHost"])
def test_this_machine_alone_needs_nothing(host):
    config = ConsoleConfig(host=host)
    assert config.address(8765) in config.origins(8765)


@pytest.mark.parametrize("host", ["192.168.1.20", "lab-pc.local", "fe80::1"])
@pytest.mark.parametrize("lacking", ["allow_network", "password_file", "tls"])
def test_a_network_address_needs_every_protection(protected, host, lacking):
    assert ConsoleConfig(host=host, **protected).address(8765).startswith("https://")
    for name in list(protected):
        if name.startswith(lacking):
            del protected[name]
    with pytest.raises(InvalidConfig, match=f"that also needs --{lacking.replace('_', '-')}"):
        ConsoleConfig(host=host, **protected)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "*"])
def test_every_address_at_once_is_refused_even_so(protected, host):
    with pytest.raises(InvalidConfig, match="name the one"):
        ConsoleConfig(host=host, **protected)


def test_tls_files_go_together(tmp_path):
    with pytest.raises(InvalidConfig, match="stands alone"):
        ConsoleConfig(tls_cert=tmp_path / "cert.pem")


@pytest.mark.parametrize("port", [-1, 65536])
def test_a_port_is_a_port(port):
    with pytest.raises(InvalidConfig, match=str(port)):
        ConsoleConfig(port=port)


def test_a_password_is_read_from_a_private_file_and_long_enough(protected):
    config = ConsoleConfig(host="192.168.1.20", **protected)
    assert config.password() == ENOUGH
    protected["password_file"].chmod(0o644)
    with pytest.raises(InvalidConfig, match="chmod 600"):
        config.password()
    protected["password_file"].chmod(0o600)
    protected["password_file"].write_text("short\n")
    with pytest.raises(InvalidConfig, match="has 5 characters"):
        config.password()
    protected["password_file"].unlink()
    with pytest.raises(InvalidConfig, match="Cannot read"):
        config.password()


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o622])
def test_a_tls_key_that_others_may_use_is_refused(protected, mode):
    config = ConsoleConfig(host="192.168.1.20", **protected)
    protected["tls_cert"].chmod(0o644)  # a certificate is no secret
    config.check_tls_key()
    protected["tls_key"].chmod(mode)
    with pytest.raises(InvalidConfig, match=r"Others may read .*key\.pem; run: chmod 600"):
        config.check_tls_key()


def test_a_certificate_with_its_key_in_one_file_is_a_secret_too(protected):
    protected["tls_cert"].write_text("-----BEGIN PRIVATE KEY-----\n")
    protected["tls_cert"].chmod(0o644)
    with pytest.raises(InvalidConfig, match=r"Others may read .*cert\.pem"):
        ConsoleConfig(host="192.168.1.20", **protected).check_tls_key()


@pytest.mark.parametrize("missing", ["tls_key", "tls_cert"])
def test_a_missing_tls_file_is_named(protected, missing):
    protected[missing].unlink()
    config = ConsoleConfig(host="192.168.1.20", **protected)
    with pytest.raises(InvalidConfig, match=rf"Cannot read .*{protected[missing].name}"):
        config.check_tls_key()


def test_where_a_mode_says_nothing_of_who_may_read_a_warning_says_so(
    protected, caplog, monkeypatch
):
    """As on Windows, where every file has the same."""
    monkeypatch.delattr(os, "geteuid")
    protected["password_file"].chmod(0o666)
    assert ConsoleConfig(host="192.168.1.20", **protected).password() == ENOUGH
    assert f"who else may read {protected['password_file']} is not checked" in caplog.text


def test_two_programs_never_listen_at_one_address(monkeypatch):
    """On Windows it takes another option than elsewhere, where that one does not exist."""
    config = ConsoleConfig(port=0)
    with _bind(config) as listening:
        port = listening.getsockname()[1]
        with pytest.raises(InvalidConfig, match="Is another console open"):
            _bind(replace(config, port=port))
    assert _address_option() == socket.SO_REUSEADDR
    monkeypatch.setattr(socket, "SO_EXCLUSIVEADDRUSE", -5, raising=False)
    assert _address_option() == -5


def test_the_usual_port_is_left_out_of_the_origin(protected):
    config = ConsoleConfig(host="lab-pc.local", port=443, **protected)
    assert config.origins(443) == ("https://lab-pc.local",)


def test_a_password_lets_in_where_one_is_set():
    sign_in = SignIn(announce=lambda token: None, password=ENOUGH)
    assert sign_in.by_password("wrong") is None
    assert sign_in.by_code("") is None
    session = sign_in.by_password(ENOUGH)
    assert sign_in.session(session.secret) is session


@pytest.mark.parametrize("name", ["--help", "", "a b", "../x", "-p", "é"])
def test_a_run_never_takes_a_name_that_could_be_an_option(tmp_path, name):
    runs = WheelRuns(tmp_path, command=(sys.executable, "-c", "pass"))
    for participant, phase in ((name, PRACTICE), ("P01", replace(PRACTICE, id=name))):
        with pytest.raises(StudyError, match="cannot be an id"):
            runs.start(participant, phase)
    assert runs.view() is None


def test_only_the_last_lines_of_a_run_are_shown(tmp_path):
    code = "for number in range(5000): print('line', number)"
    runs = WheelRuns(tmp_path, command=(sys.executable, "-c", code))
    runs.start("P01", PRACTICE)
    runs._process.wait(20)
    lines = runs.view().last_lines
    assert len(lines) == LAST_LINES
    assert lines[-1] == "line 4999"
    runs.close()


def test_a_run_outlives_the_console(tmp_path):
    runs = WheelRuns(tmp_path, command=(sys.executable, "-c", "input('never')"))
    runs.start("P01", PRACTICE)
    runs.close()
    assert runs._process.wait(20) == 1  # of having no input, not of a broken pipe


def test_a_run_that_cannot_be_started_says_why(tmp_path):
    runs = WheelRuns(tmp_path, command=(str(tmp_path / "none"),))
    with pytest.raises(StudyError, match=r"“Practice drive” cannot be started: .*none"):
        runs.start("P01", PRACTICE)
    assert runs.view() is None
    runs.close()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the drive would be lowered with it")
def test_a_run_has_a_better_priority_than_the_console(tmp_path):
    def console():  # on a thread of its own: lowered priority cannot be raised again
        usual = os.getpriority(os.PRIO_PROCESS, 0)
        runs = WheelRuns(tmp_path, command=(sys.executable, "-c", "import time; time.sleep(20)"))
        give_way()
        study_thread = StudyThread(lambda: nullcontext(None), give_way)
        of_study = asyncio.run(study_thread.do(lambda _: os.getpriority(os.PRIO_PROCESS, 0)))
        study_thread.close()
        runs.start("P01", PRACTICE)
        of_run = os.getpriority(os.PRIO_PROCESS, runs.view().pid)
        runs._process.kill()
        runs._process.wait(10)
        runs.close()
        return usual, of_run, os.getpriority(os.PRIO_PROCESS, 0), of_study

    with ThreadPoolExecutor(1) as thread:
        usual, of_run, of_console, of_study = thread.submit(console).result()
    assert of_run == usual
    assert of_console > of_run
    assert of_study > of_run


class _Runs:
    """What ``next_step`` asks of the wheel."""

    to_erase = ()

    def __init__(self, run):
        self._run = run

    def view(self):
        return self._run

    def tried(self, participant, phase):
        run = self._run
        return run is not None and (run.participant, run.phase) == (participant, phase)


def _run(participant, phase, code=None):
    return RunView(
        participant=participant,
        phase=phase,
        title=phase,
        pid=7,
        since="10:00",
        code=code,
        last_lines=(),
    )


@pytest.mark.parametrize(
    ("at", "state", "run", "act", "text"),
    [
        ("pre", PhaseState.STARTED, None, NextAction.NONE, "is on the participant’s page"),
        (
            "practice",
            PhaseState.WAITING,
            None,
            NextAction.START,
            "ask the participant to the wheel",
        ),
        ("practice", PhaseState.STARTED, None, NextAction.RESUME, "was begun and is not finished"),
        ("practice", PhaseState.STARTED, _run("P01", "practice"), NextAction.NONE, "is running"),
        (
            "practice",
            PhaseState.STARTED,
            _run("P01", "practice", 1),
            NextAction.RESUME,
            "has stopped before its end",
        ),
        (
            "practice",
            PhaseState.WAITING,
            _run("P09", "practice"),
            NextAction.NONE,
            "P09 is at the wheel",
        ),
    ],
)
def test_what_to_do_next(lab, at, state, run, act, text):
    who, _ = lab.enrol(at=at)
    lab.study.set_state(who, at, state)
    step = next_step(lab.study.participant(who), _Runs(run))
    assert step.act is act
    assert text in step.text
    assert (step.phase is None) == (act is NextAction.NONE)


def test_a_skipped_phase_is_over(lab):
    who, _ = lab.enrol(at="calibration")
    assert step_of(lab.study.participant(who)) == (5, 7)
    lab.study.set_state(who, "calibration", PhaseState.SKIPPED)
    assert step_of(lab.study.participant(who)) == (6, 7)
    assert next_step(lab.study.participant(who), _Runs(None)).text == texts.NEXT_PAGE.format(
        title="How it was"
    )


def test_what_the_computer_does_alone_is_said_so(lab):
    lab.study.way = (Phase(id="w", kind=PhaseKind.CALIBRATE_W, title="Style"),)
    step = next_step(lab.study.enrol(Role.TEST), _Runs(None))
    assert step.act is NextAction.NONE
    assert "by itself" in step.text


def test_the_longest_unseen_address_is_forgotten_first():
    now = [0.0]
    throttle = LoginThrottle(clock=lambda: now[0])
    for _ in range(20):
        throttle.wrong("old")
    assert throttle.wait_s("old") == 60
    for number in range(MOST_ADDRESSES):
        throttle.wrong(f"address {number}")
    assert throttle.wait_s("old") == 0


def test_a_study_that_cannot_be_opened_says_so_and_leaves_no_thread():
    def refuse():
        raise StudyError("The study is of a newer version.")

    with pytest.raises(StudyError, match="newer version"):
        StudyThread(refuse)


def test_streams_say_what_changed_and_end_with_the_console(lab):
    async def listen():
        study_thread = StudyThread(lambda: nullcontext(lab.study))
        changes = ChangeFeed(study_thread, lab.runs.mark)

        async def key():
            return changes.version

        await changes.look()
        stream = changes.response(key).body_iterator
        said = [await anext(stream)]
        lab.study.note(None, "hello")
        await changes.look()
        said.append(await anext(stream))
        changes.close()
        said += [chunk async for chunk in stream]
        study_thread.close()
        return said

    said = asyncio.run(listen())
    before = lab.study.changes - 1
    assert said == [f"data: {before}/none\n\n", f"data: {before + 1}/none\n\n"]


def test_a_stream_needs_a_valid_link(lab):
    assert lab.client.get("/p/guess/events").status_code == 404


def test_every_word_of_the_texts_is_used_and_no_template_holds_its_own():
    folder = files("steerlab.app.console")
    sources = [
        path.read_text()
        for part in (folder, folder / "templates")
        for path in part.iterdir()
        if path.name.endswith((".py", ".j2")) and path.name != "texts.py"
    ]
    names = [name for name in vars(texts) if name.isupper()]
    unused = [
        name
        for name in names
        if not any(re.search(rf"\b(?:t|texts)\.{name}\b", source) for source in sources)
    ]
    assert unused == []
    for path in (folder / "templates").iterdir():
        bare = re.sub(r"\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}|<[^>]*>", " ", path.read_text(), flags=re.S)
        letters = set(bare) & set(string.ascii_letters)
        assert not letters, f"{path.name} says something of its own: {bare.split()}"
