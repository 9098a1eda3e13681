"""How wrong a mapped label is likely to be, told from the training people's own errors.

The network states an absolute error for each label, learned from simulated teachers on drives of
its own; on truths unlike those it states too little. So its statement is compared with what
happened, on rollouts of the training people that neither calibrated them nor trained the network,
and what is found there is taken for everyone. Quantiles give intervals without a claim about a
shape (split conformal prediction: Lei et al., JASA 2018). All of it holds for labels exchangeable
with the training people's, on average over drives; a single drive can be harder than it looks.
"""

from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.pretrained.fine_tuning import StudyBatch
from steerlab.learning.pretrained.model import PretrainedModel, ResidualNetwork, map_labels
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig

_SHARES = np.linspace(0.0, 1.0, 1001)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ErrorScale:
    """Actual absolute errors compared with the stated ones.

    Attributes:
        factor: mean actual error over mean stated error.
        quantiles: (1001,) of actual over stated error, at equally spaced shares from 0 to 1.
    """

    factor: float
    quantiles: FloatArray

    @classmethod
    def from_errors(cls, actual: FloatArray, stated: FloatArray) -> "ErrorScale":
        """From the absolute errors of many labels, (labels,) both; stated ones are positive.

        Raises:
            InvalidLabels: there is no label.
        """
        if not len(actual):
            raise InvalidLabels("No label to measure errors on; give valid labels with a truth.")
        return cls(
            factor=float(actual.sum() / stated.sum()),
            quantiles=np.quantile(actual / stated, _SHARES),
        )

    def half_width(self, share: float) -> float:
        """Half the width of the interval that holds ``share`` of the labels, in stated errors.

        Raises:
            InvalidConfig: ``share`` is not between 0 and 1.
        """
        if not 0.0 < share < 1.0:
            raise InvalidConfig(f"share is {share}; an interval holds between 0 and 1 of labels.")
        return float(np.interp(share, _SHARES, self.quantiles))


def measure_error_scale(
    model: PretrainedModel,
    network: ResidualNetwork,
    batch: StudyBatch,
    rows: BoolArray,
    correction_share: float = 1.0,
) -> ErrorScale:
    """Measure on the ``rows`` of ``batch``, (rollouts,), which ``network`` was not trained on.

    Raises:
        InvalidLabels: there is no valid label among them.
    """
    with torch_threads(1):
        mapped, stated = map_labels(
            network,
            model.style_readout,
            batch.known[rows],
            batch.label[rows],
            batch.present[rows],
            None if batch.motion is None else batch.motion[rows],
            correction_share,
        )
    valid = batch.valid[rows]
    return ErrorScale.from_errors(np.abs(mapped - batch.truth[rows])[valid], stated[valid])
