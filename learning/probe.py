"""Do embeddings hold the style? Linear probes from w to people's style parameters."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.sim.arrays import FloatArray
from steerlab.sim.scripted_teacher import TeacherStyle


@dataclass(frozen=True, kw_only=True, eq=False)
class StyleProbe:
    """Ordinary least squares with an intercept, one per style parameter.

    Attributes:
        coefficients: (1 + d, parameters); the first row is the intercept.
        probe_r2: leave-one-out R² on the people it was fitted on, by parameter.
    """

    parameters: tuple[str, ...]
    coefficients: FloatArray
    probe_r2: dict[str, float]

    @classmethod
    def fit(cls, embeddings: FloatArray, styles: Mapping[str, FloatArray]) -> "StyleProbe":
        """Fit on seen people.

        Args:
            embeddings: (people, d).
            styles: by parameter, (people,) each.

        Raises:
            InvalidLabels: too few people for d dimensions, or lengths differ.
        """
        people, size = embeddings.shape
        if people < size + 3:
            raise InvalidLabels(
                f"{people} people cannot probe {size} dimensions; it takes at least {size + 3}."
            )
        parameters = tuple(styles)
        target = _columns(styles, parameters, people)
        design = _design(embeddings)
        inverse = np.linalg.pinv(design)
        coefficients = inverse @ target
        leverage = np.einsum("pd,dp->p", design, inverse)
        # A left-out person's residual follows from the full fit: r / (1 - leverage).
        left_out = (target - design @ coefficients) / (1.0 - leverage)[:, None]
        r2 = _r2(left_out, target)
        return cls(
            parameters=parameters,
            coefficients=coefficients,
            probe_r2=dict(zip(parameters, r2.tolist(), strict=True)),
        )

    def predict(self, embeddings: FloatArray) -> dict[str, FloatArray]:
        """Style parameters, (people,) each, of embeddings (people, d)."""
        predicted = _design(embeddings) @ self.coefficients
        return dict(zip(self.parameters, predicted.T, strict=True))

    def r2_new(self, embeddings: FloatArray, styles: Mapping[str, FloatArray]) -> dict[str, float]:
        """R² on people the probe was not fitted on, by parameter; negative is worse than a mean."""
        target = _columns(styles, self.parameters, len(embeddings))
        residual = target - _design(embeddings) @ self.coefficients
        return dict(zip(self.parameters, _r2(residual, target).tolist(), strict=True))

    def spearman_new(
        self, embeddings: FloatArray, styles: Mapping[str, FloatArray]
    ) -> dict[str, float]:
        """Rank correlation of predicted and true parameters on new people."""
        from scipy.stats import rankdata

        predicted = self.predict(embeddings)
        return {
            name: float(np.corrcoef(rankdata(predicted[name]), rankdata(styles[name]))[0, 1])
            for name in self.parameters
        }


def style_parameters(styles: list[TeacherStyle]) -> dict[str, FloatArray]:
    """What the probe looks for in scripted teachers: log gain and delay, (people,) each."""
    return {
        "log_gain": np.log([style.gain for style in styles]),
        "delay_s": np.array([style.delay_s for style in styles]),
    }


def _columns(
    styles: Mapping[str, FloatArray], parameters: tuple[str, ...], people: int
) -> FloatArray:
    for name in parameters:
        if len(styles[name]) != people:
            raise InvalidLabels(f"{len(styles[name])} values of {name} for {people} people.")
    return np.column_stack([styles[name] for name in parameters])


def _design(embeddings: FloatArray) -> FloatArray:
    return np.column_stack([np.ones(len(embeddings)), embeddings])


def _r2(residual: FloatArray, target: FloatArray) -> FloatArray:
    spread = np.square(target - target.mean(axis=0)).sum(axis=0)
    if not (spread > 0.0).all():
        raise InvalidLabels("A style parameter is the same for everyone; it cannot be probed.")
    return 1.0 - np.square(residual).sum(axis=0) / spread
