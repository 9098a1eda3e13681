"""The console over a study in memory: a test client, and a real server for browsers."""

import importlib.util
import shutil
import sys
import threading
import warnings
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import uvicorn

from steerlab.app.console.app import make_app
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.config import ConsoleConfig
from steerlab.app.console.data_export import DataExport
from steerlab.app.console.guard import csrf_token
from steerlab.app.console.server import _bind, server_config
from steerlab.app.console.sign_in import LoginThrottle, SignIn
from steerlab.app.console.study_thread import StudyCheckJob, StudyThread
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.study.contract import Role

with warnings.catch_warnings():  # Starlette would rather have httpx2, which does the same
    warnings.simplefilter("ignore")
    from starlette.testclient import TestClient

ORIGIN = "http://127.0.0.1:8765"
FAKE_RUN = """
import signal, sys, time, pathlib
hold = pathlib.Path(sys.argv[2]) / "hold"
if (hold.parent / "deaf").exists():
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
print("run", *sys.argv[1:], flush=True)
while hold.exists():
    time.sleep(0.02)
sys.exit("No wheel is plugged in." if (hold.parent / "fail").exists() else 0)
"""


def _load(name):
    """A module beside this one; tests are no package."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


fake_study = _load("fake_study")


@pytest.fixture
def keyboard():
    """The module beside this one."""
    return _load("keyboard")


@pytest.fixture(scope="module")
def chromium():
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        pytest.skip("no Chromium; install it with: sudo apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=found, chromium_sandbox=False, args=["--disable-gpu"]
        )
        yield browser
        browser.close()


@dataclass
class Lab:
    """A console under test, and what a test needs to use it."""

    study: Any
    client: TestClient
    runs: WheelRuns
    changes: ChangeFeed
    signing: SignIn
    check_job: StudyCheckJob
    links: list[str] = field(default_factory=list)  # one-time sign-in codes, as announced
    clock: list[float] = field(default_factory=lambda: [0.0])

    def enrol(self, role=Role.TRAINING, at=None):
        """A participant and their link's token; ``at`` names the phase that is next."""
        view = self.study.enrol(role)
        token = self.study.new_link(view.id)
        if at is not None:
            self.study.bring_to(view.id, at)
        return view.id, token

    def post(self, token, path, headers=None, **fields):
        """A participant's form."""
        fields.setdefault("csrf", csrf_token(token))
        return self.client.post(
            f"/p/{token}{path}",
            data={name.replace("__", "."): value for name, value in fields.items()},
            headers={"origin": ORIGIN} if headers is None else headers,
        )

    def sign_in(self):
        answer = self.client.get(f"/enter/{self.links[-1]}")
        assert answer.status_code == 303
        return self.client.cookies[self.signing.cookie]

    def at(self, path):
        """Where one of the experimenter's pages is: ``/`` is the first."""
        return self.signing.home + path.removesuffix("/")

    def get(self, path):
        """One of the experimenter's pages."""
        return self.client.get(self.at(path))

    def act(self, path, **fields):
        """The experimenter's form."""
        secret = self.client.cookies.get(self.signing.cookie) or ""
        fields.setdefault("csrf", csrf_token(secret))
        return self.client.post(self.at(path), data=fields, headers={"origin": ORIGIN})

    def type(self, **fields):
        """The form of the sign-in page."""
        return self.client.post("/sign-in", data=fields, headers={"origin": ORIGIN})


@contextmanager
def _lab(tmp_path, address=ORIGIN, **settings):
    study = fake_study.FakeStudy()
    links, clock = [], [0.0]
    study_thread = StudyThread(lambda: nullcontext(study))
    script = tmp_path / "fake_run.py"
    script.write_text(FAKE_RUN)
    runs = WheelRuns(tmp_path, command=(sys.executable, str(script)))
    check_job = StudyCheckJob(lambda: nullcontext(study))
    changes = ChangeFeed(study_thread, runs.mark, check_job.mark)
    sign_in = SignIn(announce=links.append, clock=lambda: clock[0])
    sign_in.announce_link()
    app = make_app(
        study_thread,
        runs,
        check_job,
        sign_in,
        DataExport(tmp_path),
        origins=(ORIGIN, "http://localhost:8765"),
        address=address,
        throttle=LoginThrottle(clock=lambda: clock[0]),
        changes=changes,
        **settings,
    )
    client = TestClient(app, base_url=ORIGIN, follow_redirects=False, raise_server_exceptions=False)
    made = Lab(
        study=study,
        client=client,
        runs=runs,
        changes=changes,
        signing=sign_in,
        check_job=check_job,
        links=links,
        clock=clock,
    )
    try:
        with client:
            yield made
    finally:
        (tmp_path / "hold").unlink(missing_ok=True)
        if runs.view() is not None:
            runs._process.wait(10)
        runs.close()
        study_thread.close()


@pytest.fixture
def lab(tmp_path):
    with _lab(tmp_path) as made:
        yield made


@pytest.fixture
def kiosk(tmp_path):
    """A lab where participants start their drives."""
    with _lab(tmp_path, kiosk=True) as made:
        yield made


@pytest.fixture
def in_network(tmp_path):
    """A lab that tablets can reach."""
    with _lab(tmp_path, address="http://192.168.1.20:8765") as made:
        yield made


@contextmanager
def _serving(open_study, folder, command=(), **settings):
    """A real server on a free port; gives its address and the announced sign-in links."""
    links: list[str] = []
    listening = _bind(ConsoleConfig(port=0))
    address = f"http://127.0.0.1:{listening.getsockname()[1]}"
    study_thread = StudyThread(open_study)
    runs = WheelRuns(folder, command=command)
    check_job = StudyCheckJob(open_study)
    changes = ChangeFeed(study_thread, runs.mark, check_job.mark)
    sign_in = SignIn(announce=links.append)
    sign_in.announce_link()
    app = make_app(
        study_thread,
        runs,
        check_job,
        sign_in,
        DataExport(folder),
        origins=(address,),
        address=address,
        changes=changes,
        **settings,
    )
    server = uvicorn.Server(server_config(app, ConsoleConfig(), listening))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        yield address, links, sign_in.home
    finally:
        server.should_exit = True
        changes.close()
        thread.join(10)
        listening.close()
        if runs.view() is not None:
            runs._process.wait(10)
        runs.close()
        study_thread.close()


@pytest.fixture
def served(tmp_path):
    """A study in memory behind a real server."""
    study = fake_study.FakeStudy()
    with _serving(lambda: nullcontext(study), tmp_path) as (address, links, home):
        yield Served(study=study, address=address, links=links, lab=address + home)


@pytest.fixture
def serving():
    """``with serving(open_study, folder, command) as (address, links, home)``: a real server."""
    return _serving


@dataclass
class Served:
    """A real server over a study in memory."""

    study: Any
    address: str
    links: list[str]
    lab: str  # of the experimenter's pages
