"""The console over a real study, in a process of its own: killed, restarted, under load."""

import asyncio
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, nullcontext

import httpx
import pytest

from steerlab.app.console import texts
from steerlab.app.console.guard import csrf_token
from steerlab.study.contract import Role, Standing
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study

pytestmark = pytest.mark.slow

PHASE = "about-you"
PART = 2  # mini_ipip_5
KILLS = 50
PEOPLE = 50


@contextmanager
def _console(folder, *options, stderr=None):
    """``steerlab console``; gives its process and address, and kills it in the end."""
    command = [sys.executable, "-m", "steerlab.app.cli", "console", str(folder), "--port", "0"]
    with nullcontext() if stderr is None else stderr.open("w") as said:
        process = subprocess.Popen(
            [*command, *options], stdout=subprocess.PIPE, stderr=said, text=True
        )
    try:
        line = process.stdout.readline()
        found = re.search(r"(https?://\S+)/enter/\S+", line)
        assert found, f"the console said {line!r}"
        process.sign_in = found.group(0)
        yield process, found.group(1)
    finally:
        process.kill()
        process.wait(10)
        process.stdout.close()


def _people(folder, count):
    """New participants who have agreed; their links' tokens by id."""
    tokens = {}
    with Study.open(folder) as study:
        for _ in range(count):
            who = study.enrol(Role.TRAINING).id
            study.consent(who, given=True)
            tokens[who] = study.new_link(who)
    return tokens


@pytest.fixture
def folder(tmp_path):
    new_study(tmp_path / "study", "mind-meld")
    return tmp_path / "study"


def _answer(token, item, value):
    return {
        "url": f"/p/{token}/{PHASE}/{PART}/answer",
        "data": {"csrf": csrf_token(token), "item": item, "value": value},
    }


def _kept(folder, who):
    with Study.open(folder, read_only=True) as study:
        key = study.participant(who).next_phase.questionnaires[PART - 1]
        return dict(study.answers(who, PHASE, key))


CONSOLES = """
import os, sys
from pathlib import Path

import steerlab.app.console.server
from steerlab.app.cli import main
from steerlab.study.study import Study

with Study.open(Path(sys.argv[1]), read_only=True) as study:
    study.participants()  # what is read once is read before the forks
for _ in sys.stdin:  # each line asks for another console, which serves until it is killed
    pid = os.fork()
    if pid == 0:
        print(os.getpid(), flush=True)
        sys.exit(main(["console", sys.argv[1], "--port", "0"]))
    os.waitpid(pid, 0)
    print("dead", flush=True)
"""


def test_no_answer_that_was_acknowledged_is_lost_to_kill_9(folder):
    ((who, token),) = _people(folder, 1).items()
    expected = {}
    consoles = subprocess.Popen(
        [sys.executable, "-c", CONSOLES, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with Study.open(folder, read_only=True) as study:
        key = study.participant(who).next_phase.questionnaires[PART - 1]
        for kill in range(KILLS):
            consoles.stdin.write("go\n")
            consoles.stdin.flush()
            pid = int(consoles.stdout.readline())
            address = re.search(r"(http://\S+)/enter/", consoles.stdout.readline()).group(1)
            item, value = f"i{kill % 20 + 1:02d}", kill % 5 + 1
            with httpx.Client(base_url=address, headers={"origin": address}) as client:
                answer = client.post(**_answer(token, item, str(value)))
                os.kill(pid, signal.SIGKILL)  # at once: nothing is written after the 204
            assert answer.status_code == 204
            assert consoles.stdout.readline() == "dead\n"
            expected[item] = value
            assert study.answers(who, PHASE, key) == expected
    consoles.stdin.close()
    consoles.stdout.close()
    assert consoles.wait(20) == 0
    assert _kept(folder, who) == expected


def test_an_open_page_outlives_a_restart(folder):
    ((who, token),) = _people(folder, 1).items()
    for value in ("3", "4"):  # the same page's token, sent to two consoles
        with (
            _console(folder) as (_, address),
            httpx.Client(base_url=address, headers={"origin": address}) as client,
        ):
            assert client.post(**_answer(token, "i05", value)).status_code == 204
    assert _kept(folder, who) == {"i05": 4}


def test_a_second_console_is_refused_with_the_process_of_the_first(folder):
    with _console(folder) as (process, _):
        command = [sys.executable, "-m", "steerlab.app.cli", "console", str(folder)]
        second = subprocess.run([*command, "--port", "0"], capture_output=True, text=True)
    assert second.returncode == 2
    assert f"process {process.pid}" in second.stderr
    assert "Traceback" not in second.stderr


def test_opening_a_browser_puts_no_secret_on_a_command_line(folder, tmp_path, monkeypatch):
    """Every user of a computer sees the arguments of every program."""
    said = tmp_path / "said"
    browser = tmp_path / "browser.py"
    browser.write_text(
        f"import sys, pathlib\npathlib.Path({str(said)!r}).write_text(' '.join(sys.argv[1:]))\n"
    )
    monkeypatch.setenv("BROWSER", f"{sys.executable} {browser} %s")
    with _console(folder, "--open") as (process, address):
        deadline = time.monotonic() + 20
        while not (said.exists() and said.read_text()):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert said.read_text() == address
        code = process.sign_in.rpartition("/")[2]
        with httpx.Client(base_url=address, headers={"origin": address}) as client:
            assert 'name="code"' in client.get(said.read_text()).text
            home = client.post("/sign-in", data={"code": code}).headers["location"]
            assert client.get(home).status_code == 200


@pytest.mark.skipif(sys.platform != "linux", reason="limits and /proc are read as Linux has them")
def _answers_within(address: str, seconds: float) -> bool:
    """Once the flood is gone: its connections may still be at the door for a moment."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        with contextlib.suppress(httpx.TransportError):
            return httpx.get(address, timeout=10).status_code == 401
    return False


def test_a_flood_without_file_handles_says_little_and_ends(folder):
    import resource

    with _console(folder, stderr=folder.parent / "said") as (process, address):
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (40, most))
        port = int(address.rpartition(":")[2])
        flood = [socket.create_connection(("127.0.0.1", port), timeout=10) for _ in range(300)]
        try:
            # Who comes meanwhile is turned away or answered, but not left waiting.
            with contextlib.suppress(httpx.TransportError):
                assert httpx.get(address, timeout=10).status_code == 401
        finally:
            for connection in flood:
                connection.close()
        assert _answers_within(address, 20.0)
    lines = (folder.parent / "said").read_text().splitlines()
    assert len(lines) <= 2
    assert "Traceback" not in "".join(lines)


def test_ctrl_c_ends_it_in_a_sentence(folder):
    with _console(folder) as (process, address):
        assert httpx.get(address).status_code == 401
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        assert process.stdout.read() == "The console has ended; every answer is kept.\n"


def test_erasing_while_the_console_serves_leaves_nothing_and_thanks_the_person(folder):
    ((who, token),) = _people(folder, 1).items()
    secret = "Quokka-of-Rottnest"
    with Study.open(folder) as study:
        study.note(who, secret)
    with (
        _console(folder) as (process, address),
        httpx.Client(base_url=address, headers={"origin": address}, timeout=60) as tablet,
        httpx.Client(base_url=address, headers={"origin": address}, timeout=60) as lab,
        tablet.stream("GET", f"/p/{token}/events") as following,
    ):
        assert next(following.iter_lines()).startswith("data: about-you")
        assert tablet.post(**_answer(token, "i05", "3")).status_code == 204
        home = lab.get(process.sign_in).headers["location"]
        page = f"{home}/participants/{who}"
        (session,) = lab.cookies.values()
        fields = {"outcome": "erase", "typed": who, "csrf": csrf_token(session)}
        assert lab.post(f"{page}/withdraw", data=fields).status_code == 303
        done = texts.RUN_DONE.format(title=texts.ERASING, participant=who)
        deadline = time.monotonic() + 60
        while done not in (shown := lab.get(page).text):
            assert time.monotonic() < deadline, shown
            assert "exit code" not in shown, shown
            time.sleep(0.2)
        thanks = tablet.get(f"/p/{token}")
        assert thanks.status_code == 200
        assert texts.LEFT_ERASED in thanks.text
        assert not re.search(rf"{who}|i05|Quokka", thanks.text)
    assert not any(
        secret.encode() in path.read_bytes() for path in folder.rglob("*") if path.is_file()
    )
    with Study.open(folder, read_only=True) as study:
        assert study.participant(who).standing is Standing.WITHDRAWN_ERASED
        assert study.verify().ok


def test_fifty_people_answering_at_once_lose_nothing(folder):
    tokens = _people(folder, PEOPLE)
    expected = {
        who: {f"i{item:02d}": (place + item) % 5 + 1 for item in range(1, 21)}
        for place, who in enumerate(tokens)
    }

    async def fill(client, who):
        for item, value in expected[who].items():
            answer = await client.post(**_answer(tokens[who], item, str(value)))
            assert answer.status_code == 204
        page = await client.get(f"/p/{tokens[who]}/{PHASE}/{PART}")
        shown = re.findall(r'name="item\.(\w+)" value="(\d)" checked', page.text)
        assert dict(shown) == {item: str(value) for item, value in expected[who].items()}

    async def everybody(address):
        limits = httpx.Limits(max_connections=PEOPLE)
        async with httpx.AsyncClient(
            base_url=address, headers={"origin": address}, limits=limits, timeout=120
        ) as client:
            await asyncio.gather(*(fill(client, who) for who in tokens))

    with _console(folder) as (_, address):
        asyncio.run(everybody(address))
    assert {who: _kept(folder, who) for who in tokens} == expected
