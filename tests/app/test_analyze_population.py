"""``steerlab analyze`` on a population run: its numbers are those that the run reports itself."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from steerlab.analysis.summary import SplitSummary, StyleSummary, Summary
from steerlab.app.analyze import default_out
from steerlab.app.cli import main
from steerlab.learning.checkpoint import save_mapper
from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.presets import LAB
from steerlab.learning.series import series_from_table
from steerlab.learning.splits import split_rollouts, split_study
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population
from steerlab.sim.records import labelled_table
from steerlab.sim.shards import write_shard


@pytest.fixture
def population_run(tmp_path: Path) -> Path:
    """A folder as ``simulate`` writes one, of few teachers and a network of two epochs."""
    run = tmp_path / "run"
    rollouts = load_calibration_set()[:4]
    tables = {
        split: pa.concat_tables(
            labelled_table(
                rollout, one.respond(rollout, order=order, attempt=0), participant=one.name
            )
            for one in sample_population("human", count, 0, prefix=split)
            for order, rollout in enumerate(rollouts)
        )
        for split, count in (("seen", 6), ("new", 3))
    }
    series = {split: series_from_table(table) for split, table in tables.items()}
    new = sorted({one.person for one in series["new"]})
    names = [rollout.name for rollout in rollouts]
    parts = split_study([*series["seen"], *series["new"]], split_rollouts(names), new)
    mapper = MindMeldMapper(replace(LAB, training=replace(LAB.training, epochs=2)), seed=0)
    mapper.fit(parts.train_seen)
    mapper.calibrate(parts.calibrate_new)
    for part in ("labels", "models", "report"):
        (run / part).mkdir(parents=True)
    for split, table in tables.items():
        write_shard(table, run / "labels" / f"{split}.parquet")
    save_mapper(mapper, run / "models" / "mind_meld.safetensors")
    (run / "report" / "index.html").write_text("the run's own")
    held_out = {"seen": parts.held_out_seen, "new": parts.held_out_new}
    nothing = StyleSummary(probe_r2=None, spearman_new=None)
    summary = Summary(
        seed=0,
        noise="human",
        versions={},
        seconds={},
        splits={
            split: SplitSummary.of(
                {"mind_meld": mapper_quality(mapper, several, np.random.default_rng(0))}
            )
            for split, several in held_out.items()
        },
        style={"gain": nothing, "delay": nothing},
        left_out={},
    )
    (run / "summary.json").write_text(summary.to_json())
    return run


@pytest.mark.slow
def test_a_population_run_keeps_its_own_report(population_run, capsys):
    assert main(["analyze", str(population_run), "--permutations", "199"]) == 0
    said = capsys.readouterr().out
    assert "no analysis plan" in said
    assert default_out(population_run) == population_run / "analysis"
    assert (population_run / "report" / "index.html").read_text() == "the run's own"
    tables = json.loads((population_run / "analysis" / "report" / "tables.json").read_text())
    assert tables["table1"] == {"empty": "nobody was asked a questionnaire with a scale"}
    summary = json.loads((population_run / "summary.json").read_text())
    for split in ("seen", "new"):
        found, expected = tables["label_quality"][split], summary["splits"][split]
        assert found["improvement"] == pytest.approx(expected["improvement"]["mind_meld"], abs=1e-5)
        assert found["mae_before"] == pytest.approx(expected["mae_before"], abs=1e-5)
        assert found["people_improved"] == pytest.approx(expected["people_improved"], abs=1e-5)
        assert found["labels_worsened"] == pytest.approx(expected["labels_worsened"], abs=1e-5)
        assert found["per_sample_percent"] == pytest.approx(
            expected["per_sample_percent"], rel=1e-4
        )


def test_no_network_at_all_is_a_choice(population_run, capsys):
    assert main(["analyze", str(population_run), "--seeds", "0"]) == 0
    report = default_out(population_run) / "report"
    tables = json.loads((report / "tables.json").read_text())
    assert not list(population_run.glob("models/analysis-*"))
    assert tables["exclusions"]["analysed"]
