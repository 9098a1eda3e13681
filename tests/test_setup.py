"""The set-up promise, as far as it can be tried without installing anything."""

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]


@pytest.fixture
def bare_copy(tmp_path):
    """What set-up needs of the repository, without an environment."""
    for name in ("tools", "requirements"):
        shutil.copytree(TOP / name, tmp_path / name)
    for name in ("Makefile", "pyproject.toml", "setup.py"):
        shutil.copy(TOP / name, tmp_path / name)
    return tmp_path


def _program(folder: Path, name: str, lines: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(f"#!/bin/bash\n{lines}\n")
    path.chmod(0o755)
    return path


def _make(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["make", "-C", str(folder), *arguments],
        capture_output=True,
        text=True,
        env=os.environ | environment,
    )


def _old_python(folder: Path) -> Path:
    version_question = 'case "$2" in *version_info*\\<*) exit 1;; *) echo 3.9;; esac'
    return _program(folder / "old", "python3", version_question)


@pytest.mark.parametrize("target", ["demo", "test", "check", "bench", "build"])
def test_an_old_python_is_refused_in_one_sentence(target, bare_copy):
    done = _make(bare_copy, target, f"PYTHON={_old_python(bare_copy)}")
    assert done.returncode == 2
    assert "needs Python 3.11 or newer" in done.stderr
    assert "is 3.9" in done.stderr
    assert not (bare_copy / ".venv").exists()


def test_a_missing_python_is_said(bare_copy):
    done = _make(bare_copy, "demo", "PYTHON=no-such-python")
    assert done.returncode == 2
    assert "No no-such-python found" in done.stderr


def test_without_permission_the_exact_command_is_said(bare_copy):
    """A Python without ensurepip, and no way to install python3-venv."""
    python = _program(
        bare_copy / "bin",
        "python3",
        'case "$2" in *ensurepip*) exit 1;; *print*) echo 3.12;; *) exit 0;; esac',
    )
    _program(bare_copy / "bin", "id", "echo 1000")
    _program(bare_copy / "bin", "sudo", "exit 1")
    _program(bare_copy / "bin", "apt-get", "echo should not run >&2; exit 1")
    path = f"{bare_copy / 'bin'}:{os.environ['PATH']}"
    done = _make(bare_copy, "demo", f"PYTHON={python}", PATH=path)
    assert done.returncode == 2
    assert "Run: sudo sh -c 'apt-get update && apt-get install -y python3.12-venv'" in done.stderr
    assert "should not run" not in done.stderr


def _pinned(name: str) -> dict[str, str]:
    """Name to what follows it on its line, of a list in ``requirements``."""
    lines = (TOP / "requirements" / f"{name}.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line[:1].isalnum()]
    assert all("==" in line for line in pins)
    return {line.split("==")[0]: line.split("==")[1] for line in pins}


def _names(wanted: list[str]) -> set[str]:
    return {re.split(r"[<>=;\[ ]", line)[0].lower() for line in wanted}


def test_every_dependency_is_pinned_with_its_hashes():
    project = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    run, dev, torch = _pinned("run"), _pinned("dev"), _pinned("torch")
    assert _names(project["dependencies"]) <= set(run) | set(torch)
    assert _names(project["optional-dependencies"]["dev"]) - {"steerlab"} <= set(dev)
    assert run.items() <= dev.items()
    for name in ("run", "dev", "uv"):
        text = (TOP / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
        packages = re.split(r"\n(?=[a-z0-9])", text.strip())
        assert all("--hash=sha256:" in package for package in packages)
        assert "://" not in text  # no place that some cannot reach


def test_nobody_gets_the_packages_of_nvidia_s_cards_from_the_lists():
    brought = ("nvidia-", "cuda-", "torch")
    assert not [name for name in {**_pinned("run"), **_pinned("dev")} if name.startswith(brought)]
    assert "triton" not in _pinned("run")


def test_scripts_are_executable():
    for name in ("tools/setup.sh", "tools/lock.sh", "tools/try-wheel.sh", ".ci/run"):
        assert os.access(TOP / name, os.X_OK)
