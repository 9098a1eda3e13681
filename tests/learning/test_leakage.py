"""Nothing of a held-out rollout reaches a fitted mapper."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.learning import mapper as mapper_module
from steerlab.learning.baselines import FULL_ONLY, fit_baselines
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.splits import StudySplit, split_rollouts, split_study

SENTINEL = 1.234375  # exact in float32


@pytest.fixture(name="marked")
def _marked(study, rollouts) -> StudySplit:
    """The study, split again after every label of a held-out rollout was overwritten."""
    split = split_rollouts([rollout.name for rollout in rollouts])
    everything = (
        *study.train_seen, *study.held_out_seen, *study.calibrate_new, *study.held_out_new
    )  # fmt: skip
    series = [
        replace(one, label=np.full(one.steps, SENTINEL), truth=np.full(one.steps, -SENTINEL))
        if one.rollout in split.held_out
        else one
        for one in everything
    ]
    return split_study(series, split, sorted({one.person for one in study.held_out_new}))


def test_windows_of_held_out_rollouts_never_train_or_calibrate(marked, quick_config, monkeypatch):
    cut = []

    def spied(series, config, rows=None):
        windows = make_windows(series, config, rows)
        cut.append(windows)
        return windows

    make_windows = mapper_module.make_windows
    monkeypatch.setattr(mapper_module, "make_windows", spied)
    config = replace(quick_config, training=replace(quick_config.training, epochs=1))
    mapper = MindMeldMapper(config, seed=0)
    mapper.fit(marked.train_seen)
    mapper.calibrate(marked.calibrate_new)
    assert len(cut) >= 2
    assert not any((windows.inputs[:, :, 0] == SENTINEL).any() for windows in cut)
    mapper.map(marked.held_out_seen[0])
    assert (cut[-1].inputs[:, :, 0] == SENTINEL).any()  # the mark would be seen


def test_held_out_labels_change_no_rung(study, marked, trained):
    def silent(share: float) -> None:
        pass

    first, second = (
        fit_baselines(trained, parts, seed=0, on_step=silent, without=FULL_ONLY)
        for parts in (study, marked)
    )
    for name, baseline in first.items():
        for one in (study.held_out_seen[0], study.held_out_new[0]):
            np.testing.assert_array_equal(baseline.map(one), second[name].map(one), err_msg=name)
