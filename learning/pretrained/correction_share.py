"""How much of the network's correction counts: less of it on people unlike the simulated ones.

The closed form, whose prior is the study's own, holds for whoever is in the study; the network knows
simulated teachers. The share of its correction that serves the training people best is measured on
their rollouts, each mapped with what their other rollouts say.
"""

import numpy as np

from steerlab.learning.pretrained.fine_tuning import StudyBatch
from steerlab.learning.pretrained.model import (
    PretrainedModel,
    ResidualNetwork,
    closed_form,
    map_labels,
)
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import BoolArray
from steerlab.sim.vehicle import WHEEL_LIMIT

SHARES = tuple(tenths / 10 for tenths in range(11))
_LEAST_GAIN = 0.005  # relative to all of it: less is luck


def best_share(
    model: PretrainedModel, network: ResidualNetwork, batch: StudyBatch, rows: BoolArray
) -> float:
    """One of ``SHARES``; 1 unless another lowers the mean error on ``rows``, (rollouts,), clearly."""
    known, valid = batch.known[rows], batch.valid[rows]
    label, truth = batch.label[rows], batch.truth[rows][valid]
    motion = None if batch.motion is None else batch.motion[rows]
    with torch_threads(1):
        whole, _ = map_labels(
            network, model.style_readout, known, label, batch.present[rows], motion
        )
    closed = known.unit[:, None] * closed_form(label, known.unit, known.coefficients)[:, 0]
    none, all_of_it = closed[valid], whole[valid]
    errors = {
        share: float(
            np.abs(
                np.clip(none + share * (all_of_it - none), -WHEEL_LIMIT, WHEEL_LIMIT) - truth
            ).sum()
        )
        for share in SHARES
    }
    best = min(errors, key=lambda share: errors[share])
    return best if errors[best] < (1.0 - _LEAST_GAIN) * errors[1.0] else 1.0
