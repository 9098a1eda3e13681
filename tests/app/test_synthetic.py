"""``steerlab synthetic`` end to end, small: what it writes, says and refuses."""

import json
import os

import pytest

from steerlab.app import synthetic as synthetic_module
from steerlab.app.cli import main
from steerlab.learning.mind_meld import NetworkConfig
from steerlab.learning.presets import MapperConfig
from steerlab.learning.synthetic.experiment import run_synthetic
from steerlab.learning.training import TrainingConfig
from steerlab.learning.windows import WindowConfig

QUICK = MapperConfig(
    window=WindowConfig(half_width_s=0.3),
    network=NetworkConfig(embedding_size=2),
    training=TrainingConfig(epochs=2, batch_size=256),
)


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(
        synthetic_module,
        "run_synthetic",
        lambda config, progress: run_synthetic(config, progress, QUICK),
    )


def test_everything_promised_is_there_and_the_page_needs_nothing_else(quick, tmp_path, capsys):
    out = tmp_path / "out"
    small = ["--people", "8", "--new-people", "3", "--seed", "4"]
    assert main(["synthetic", "--out", str(out), *small]) == 0
    said = capsys.readouterr().out
    assert "61 %" in said
    assert "55 %" in said
    found = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert found == {"models/mind_meld.safetensors", "report/index.html", "summary.json"}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["verb"] == "synthetic"
    assert summary["paper_percent"] == {"calibration": 61, "unseen": 55}
    assert {name: split["people"] for name, split in summary["splits"].items()} == {
        "calibration": 8,
        "unseen": 8,
        "new": 3,
    }
    page = (out / "report" / "index.html").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert "<script" not in page
    assert page.count("<img") == 1
    assert "synthetic --people 8 --new-people 3 --seed 4 --out out" in page
    again = tmp_path / "again"
    assert main(["synthetic", "--out", str(again), *small, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    for volatile in ("seconds", "versions"):
        printed.pop(volatile), summary.pop(volatile)
    assert printed == summary


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--people", "3"), "people is 3; it must be a whole number from 6"),
        (("--new-people", "0"), "new-people is 0"),
        (("--seed", "-1"), "seed is -1"),
    ],
)
def test_bad_settings_leave_nothing(options, said, tmp_path, capsys):
    assert main(["synthetic", "--out", str(tmp_path / "out"), *options]) == 2
    assert said in capsys.readouterr().err
    assert os.listdir(tmp_path) == []
