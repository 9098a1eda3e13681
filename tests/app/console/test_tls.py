"""The console reached from another machine: its network address, TLS and a password."""

import re
import shutil
import socket
import ssl
import subprocess
import sys
from contextlib import contextmanager, suppress

import httpx
import pytest

from steerlab.app.console.connections import HEADERS_S
from steerlab.study.study_folder import new_study

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="not installed: openssl"),
]
PASSWORD = "correct horse battery"


def _own_address() -> str:
    """One that other machines reach this one by, if it has any; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
        probe.connect(("192.0.2.1", 9))
        return probe.getsockname()[0]
    return "127.0.0.1"


@pytest.fixture
def protected(tmp_path):
    """Address and options of a console that may be reached from elsewhere."""
    host = _own_address()
    for name in ("cert", "other"):
        subprocess.run(
            [
                *[
                    "openssl",
                    "req",
                    "-x509",
                    "-newkey",
                    "ec",
                    "-pkeyopt",
                    "ec_paramgen_curve:P-256",
                    "-nodes",
                ],
                *("-days", "1", "-subj", "/CN=steerlab", "-addext", f"subjectAltName=IP:{host}"),
                *("-keyout", tmp_path / f"{name}.key", "-out", tmp_path / f"{name}.pem"),
            ],
            check=True,
            capture_output=True,
        )
    password = tmp_path / "password"
    password.write_text(PASSWORD + "\n")
    password.chmod(0o600)
    new_study(tmp_path / "study", "mind-meld")
    return {
        "--host": host,
        "--password-file": password,
        "--tls-cert": tmp_path / "cert.pem",
        "--tls-key": tmp_path / "cert.key",
    }


@contextmanager
def _console(folder, options):
    command = [sys.executable, "-m", "steerlab.app.cli", "console", str(folder / "study")]
    given = [str(word) for pair in options.items() for word in pair]
    process = subprocess.Popen(
        [*command, "--port", "0", "--allow-network", *given],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_a_tablet_signs_in_over_tls_with_the_password_alone(protected, tmp_path):
    with _console(tmp_path, protected) as process:
        line = process.stdout.readline()
        address = re.search(r"(https://\S+)/enter/", line).group(1)
        assert address.startswith(f"https://{protected['--host']}:")
        trust = ssl.create_default_context(cafile=str(protected["--tls-cert"]))
        with httpx.Client(base_url=address, verify=trust, headers={"origin": address}) as client:
            assert client.get("/").status_code == 401
            assert client.post("/sign-in", data={"password": "wrong"}).status_code == 401
            answer = client.post("/sign-in", data={"password": PASSWORD})
            assert answer.status_code == 303
            assert "secure" in answer.headers["set-cookie"].lower()
            assert client.get(answer.headers["location"]).status_code == 200
            assert client.get("/").headers["strict-transport-security"] == "max-age=2592000"
            assert client.get("/", headers={"host": "127.0.0.1"}).status_code == 421
        with pytest.raises(httpx.HTTPError):  # in the clear nothing is said
            httpx.get(address.replace("https:", "http:"))


@pytest.mark.parametrize("lacking", ["--password-file", "--tls-cert"])
def test_without_any_of_it_no_other_machine_is_served(protected, tmp_path, lacking):
    if protected["--host"] == "127.0.0.1":
        pytest.skip("this computer has no network address")
    del protected[lacking]
    with _console(tmp_path, protected) as process:
        assert process.wait(30) == 2
        said = process.stderr.read()
        assert lacking in said
        assert "Traceback" not in said


def test_a_key_that_others_may_read_is_told_in_a_sentence(protected, tmp_path):
    protected["--tls-key"].chmod(0o644)
    with _console(tmp_path, protected) as process:
        assert process.wait(30) == 2
        said = " ".join(process.stderr.read().split())
        assert "Others may read" in said
        assert "Traceback" not in said


def test_a_client_that_never_agrees_on_tls_is_let_go(protected, tmp_path):
    with _console(tmp_path, protected) as process:
        host, port = re.search(r"https://(\S+):(\d+)/enter/", process.stdout.readline()).groups()
        with socket.create_connection((host, int(port)), timeout=3 * HEADERS_S) as silent:
            silent.sendall(b"\x16\x03\x01")
            assert silent.recv(100) == b""


def test_a_key_that_does_not_fit_is_told_in_a_sentence(protected, tmp_path):
    with _console(tmp_path, protected | {"--tls-key": tmp_path / "other.key"}) as process:
        assert process.wait(30) == 2
        said = process.stderr.read()
        assert "name a PEM certificate and its key" in " ".join(said.split())
        assert "Traceback" not in said
