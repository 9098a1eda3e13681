"""Which build of PyTorch set-up takes, with pip, uv and the machine played by the test."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

PROGRAM = Path(__file__).parents[1] / "tools" / "install.py"


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("install", PROGRAM)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["install"] = module  # dataclasses look for it there
    spec.loader.exec_module(module)
    return module


class Machine:
    """What programs were called, and what each answers."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.requires = ["sympy", 'nvidia-cublas==13; platform_system == "Linux"']
        self.uv_reaches = True
        self.pip_works = True

    def run(self, command, **_):
        words = [str(word) for word in command]
        self.calls.append(" ".join(words[words.index("install") :]))
        if "uv" in words[0]:
            return SimpleNamespace(returncode=0 if self.uv_reaches else 2)
        if "--report" in words:
            report = {"install": [{"metadata": {"requires_dist": self.requires}}]}
            Path(words[words.index("--report") + 1]).write_text(json.dumps(report))
        return SimpleNamespace(returncode=0 if self.pip_works else 1)

    def took(self) -> list[str]:
        """The calls that install PyTorch."""
        found = [call for call in self.calls if "torch==" in call and "--dry-run" not in call]
        return ["uv" if "--torch-backend" in call else "pip" for call in found]


@pytest.fixture
def machine(monkeypatch):
    return Machine()


@pytest.fixture
def install(machine, monkeypatch):
    module = _load()
    monkeypatch.setattr(subprocess, "run", machine.run)
    monkeypatch.setattr(module, "torch_is_here", lambda: False)
    monkeypatch.setattr(module, "has_nvidia_card", lambda: False)
    monkeypatch.setattr(module, "drop_test_programs", lambda: None)
    monkeypatch.setattr(module.platform, "system", lambda: "Linux")
    monkeypatch.setattr(module.shutil, "disk_usage", lambda path: SimpleNamespace(free=500e9))
    monkeypatch.delenv("TORCH", raising=False)
    return module


def test_without_a_card_the_cpu_build_is_fetched_where_pytorch_keeps_it(install, machine, capsys):
    assert install.main(["run"]) == 0
    assert machine.took() == ["uv"]
    assert "Needed: 0.6 GB to download, 2.1 GB on disk" in capsys.readouterr().out


def test_where_pip_finds_a_cpu_build_nothing_else_is_asked(install, machine):
    machine.requires = ["sympy"]
    assert install.main(["run"]) == 0
    assert machine.took() == ["pip"]


@pytest.mark.parametrize("system", ["Darwin", "Windows"])
def test_elsewhere_pip_has_the_lean_build(install, machine, monkeypatch, system):
    monkeypatch.setattr(install.platform, "system", lambda: system)
    assert install.main(["run"]) == 0
    assert machine.took() == ["pip"]


def test_with_a_card_pip_s_build_is_taken_and_its_size_is_said(
    install, machine, monkeypatch, capsys
):
    monkeypatch.setattr(install, "has_nvidia_card", lambda: True)
    assert install.main(["dev"]) == 0
    assert machine.took() == ["pip"]
    assert "PyTorch's build for NVIDIA cards" in capsys.readouterr().out


def test_what_cannot_be_reached_is_said_before_the_large_build_is_taken(install, machine, capsys):
    machine.uv_reaches = False
    assert install.main(["run"]) == 0
    assert machine.took() == ["uv", "pip"]
    said = capsys.readouterr().out
    assert said.index("cannot be had") < said.index("Needed: 2.7 GB to download")
    assert "make TORCH=FILE" in said


def test_whoever_wants_the_cpu_build_gets_no_other(install, machine, capsys):
    machine.uv_reaches = False
    assert install.main(["run", "--torch", "cpu"]) == 2
    assert machine.took() == ["uv"]
    assert "make TORCH=FILE" in capsys.readouterr().err


def test_a_wheel_that_is_named_is_handed_to_pip(install, machine, monkeypatch):
    monkeypatch.setenv("TORCH", "'my wheels/torch==2.13.0.whl' --no-deps")
    assert install.main(["run"]) == 0
    (call,) = [call for call in machine.calls if "my wheels" in call]
    assert call.endswith("--no-compile my wheels/torch==2.13.0.whl --no-deps")
    assert machine.took() == ["pip"]


def test_a_full_disk_is_said_before_anything_is_installed(install, machine, monkeypatch, capsys):
    monkeypatch.setattr(install.shutil, "disk_usage", lambda path: SimpleNamespace(free=1.5e9))
    assert install.main(["run"]) == 2
    assert machine.calls == []
    assert "has 1.5 GB free and 2.1 GB are needed; make room" in capsys.readouterr().err


def test_a_torch_that_is_there_stays(install, machine, monkeypatch):
    monkeypatch.setattr(install, "torch_is_here", lambda: True)
    assert install.main(["dev"]) == 0
    assert machine.took() == []


def test_packages_are_checked_by_hash_and_steerlab_needs_no_download(install, machine):
    install.main(["run"])
    assert "--require-hashes --no-deps" in machine.calls[0]
    assert "--no-deps --no-build-isolation --editable" in machine.calls[-1]


def test_a_pip_that_fails_is_said(install, machine, capsys):
    machine.pip_works = False
    assert install.main(["run"]) == 2
    assert "Installing failed; see above." in capsys.readouterr().err
