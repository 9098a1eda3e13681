"""The console over a real study, in a process of its own: killed, restarted, under load."""

import asyncio
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import httpx
import pytest

from steerlab.teleop.console.forms import csrf_token
from steerlab.teleop.study.contract import Role
from steerlab.teleop.study.new import new_study
from steerlab.teleop.study.study import Study

pytestmark = pytest.mark.slow

PHASE = "about-you"
PART = 2  # mini_ipip_5
KILLS = 50
PEOPLE = 50


@contextmanager
def _console(folder, *options):
    """``steerlab console``; gives its process and address, and kills it in the end."""
    command = [sys.executable, "-m", "steerlab.teleop.cli", "console", str(folder), "--port", "0"]
    process = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        found = re.search(r"(https?://\S+)/enter/", line)
        assert found, f"the console said {line!r}"
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


def test_no_answer_that_was_acknowledged_is_lost_to_kill_9(folder):
    ((who, token),) = _people(folder, 1).items()
    expected = {}
    for kill in range(KILLS):
        with (
            _console(folder) as (process, address),
            httpx.Client(base_url=address, headers={"origin": address}) as client,
        ):
            item, value = f"i{kill % 20 + 1:02d}", kill % 5 + 1
            answer = client.post(**_answer(token, item, str(value)))
            os.kill(process.pid, signal.SIGKILL)  # at once: nothing is written after the 204
            assert answer.status_code == 204
            expected[item] = value
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
        command = [sys.executable, "-m", "steerlab.teleop.cli", "console", str(folder)]
        second = subprocess.run([*command, "--port", "0"], capture_output=True, text=True)
    assert second.returncode == 2
    assert f"process {process.pid}" in second.stderr
    assert "Traceback" not in second.stderr


def test_ctrl_c_ends_it_in_a_sentence(folder):
    with _console(folder) as (process, address):
        assert httpx.get(address).status_code == 401
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        assert process.stdout.read() == "The console has ended; every answer is kept.\n"


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
