"""``steerlab fit`` on a tracking table, end to end: the shipped example, and what it refuses."""

import csv
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from steerlab.analysis.summary import Summary
from steerlab.app import fit as fit_module
from steerlab.app.cli import main
from steerlab.learning import training_budget
from steerlab.learning.presets import MapperConfig
from steerlab.learning.training import TrainingConfig
from steerlab.learning.windows import WindowConfig

EXAMPLE = Path(__file__).parents[2] / "docs" / "example-tracking.csv"
QUICK = MapperConfig(
    window=WindowConfig(half_width_s=0.5), training=TrainingConfig(epochs=20, share_per_epoch=0.5)
)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(fit_module, "preset", lambda name: QUICK)
    monkeypatch.setattr(training_budget, "LEAST_TRAINING_STEPS", 20)


def _fit(table: Path, out: Path, *options: str) -> int:
    return main(["fit", str(table), "--out", str(out), "--ladder", "quick", *options])


def test_the_shipped_example_is_fitted(tmp_path):
    out = tmp_path / "out"
    assert _fit(EXAMPLE, out, "--folds", "2") == 0
    summary = Summary.from_json((out / "summary.json").read_text())
    assert summary.splits["seen"].improvement["eb_nonlinear"] > 0.3
    assert summary.splits["new"].improvement["person_ridge"] > 0.3
    mapped = pq.read_table(out / "mapped.parquet").to_pydict()
    with EXAMPLE.open() as source:
        rows = list(csv.DictReader(source))
    rows.sort(key=lambda row: (row["person"], row["rollout"], float(row["t_s"])))
    assert mapped["step"] == [round(10.0 * float(row["t_s"])) for row in rows]
    np.testing.assert_allclose(mapped["label"], [float(row["input"]) for row in rows])
    for row, truth in zip(rows, mapped["truth"], strict=True):
        if row["rollout"].startswith("pushed"):
            assert truth == pytest.approx(-float(row["disturbance"]))
    page = (out / "report" / "index.html").read_text()
    assert "the label is the input" in page
    assert "mirror image (the negative at every step)" in page
    folds = dict(zip(mapped["rollout"], mapped["fold"], strict=True))
    assert folds["pushed-1"] == folds["pushed-1-mirrored"]


def test_a_gain_scales_the_references_rate(tmp_path):
    truths = []
    for gain in ("1", "2"):
        assert _fit(EXAMPLE, tmp_path / gain, "--folds", "2", "--gain", gain) == 0
        mapped = pq.read_table(tmp_path / gain / "mapped.parquet").to_pydict()
        chased = np.array([name.startswith("chase") for name in mapped["rollout"]])
        truths.append(np.array(mapped["truth"]))
    np.testing.assert_allclose(truths[1][chased], truths[0][chased] / 2.0)
    np.testing.assert_array_equal(truths[1][~chased], truths[0][~chased])
    assert "--gain 2.0" in (tmp_path / "2" / "report" / "index.html").read_text()


@pytest.mark.parametrize(
    ("gain", "said"),
    [("0", "gain is 0"), ("nan", "gain is nan"), ("inf", "gain is inf"), ("-1", "gain is -1")],
)
def test_a_gain_that_no_cursor_has_is_refused(gain, said, tmp_path, capsys):
    assert _fit(EXAMPLE, tmp_path / "out", f"--gain={gain}") == 2
    error = capsys.readouterr().err
    assert error.startswith("steerlab: ")
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
