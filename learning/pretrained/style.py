"""A person's style ``w`` from calibration labels, in closed form: no gradient, no iteration count.

Two Gaussian linear models, each with a prior over people: the *inverse* one predicts truth from
labels (``empirical_bayes/``) and also gives the prediction that the network corrects; the
*forward* one predicts labels from truth. Truth has no noise, so the forward model is where gain,
delay and lag can be read without the shrinkage that noise in a regressor brings.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.empirical_bayes.gaussian import Moments, Prior, fit_prior, posterior
from steerlab.learning.empirical_bayes.grid import (
    BIAS,
    RATE_HZ,
    GridSeries,
    at_stop,
    label_features,
    shifted,
    whole_window,
)
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import BoolArray, FloatArray

DELAYS_S = np.arange(-8, 13) * 0.1  # of the forward model's taps
DEAD_ZONE_DELAYS_S = (0.0, 0.2, 0.4)
FORWARD_FEATURES = len(DELAYS_S) + len(DEAD_ZONE_DELAYS_S) + 1
FORWARD_BIAS = FORWARD_FEATURES - 1
COMPONENTS = 10  # principal components kept of either model
STYLE_SIZE = 2 * COMPONENTS + 2 + 9
SIGNED = (2 * COMPONENTS, 2 * COMPONENTS + 1)
"""The entries of w that change sign when left and right are exchanged: the two biases."""

_SUMS = 5
_LEAST_GAIN = 0.1  # below it a response has no delay
_LARGEST = 4.0  # standard deviations; what lies further out was never trained on


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StyleMoments:
    """The sums over rollouts that w is computed from; rollouts of a person add up.

    Attributes:
        inverse, forward: of each rollout.
        sums: (rollouts, 5): samples, samples at the stop, label², squared second difference of
            the label, truth².
    """

    inverse: Moments
    forward: Moments
    sums: FloatArray

    def __getitem__(self, rollouts: slice | list[int]) -> "StyleMoments":
        """The chosen rollouts."""
        return StyleMoments(
            inverse=self.inverse[rollouts],
            forward=self.forward[rollouts],
            sums=self.sums[rollouts],
        )

    def __add__(self, other: "StyleMoments") -> "StyleMoments":
        """Moments of the same people with the labels of ``other`` added."""
        return StyleMoments(
            inverse=self.inverse + other.inverse,
            forward=self.forward + other.forward,
            sums=self.sums + other.sums,
        )

    def summed(self, people: int) -> "StyleMoments":
        """Sums over equally many rollouts of each person, which must lie side by side."""
        return StyleMoments(
            inverse=self.inverse.summed(people),
            forward=self.forward.summed(people),
            sums=self.sums.reshape(people, -1, _SUMS).sum(axis=1),
        )

    def grouped(self, weights: FloatArray) -> "StyleMoments":
        """Sums over rollouts: weights (people, rollouts)."""
        return StyleMoments(
            inverse=self.inverse.grouped(weights),
            forward=self.forward.grouped(weights),
            sums=weights @ self.sums,
        )


def style_moments(label: FloatArray, truth: FloatArray, valid: BoolArray) -> StyleMoments:
    """Moments of rollouts of one length: all (rollouts, samples), at ``RATE_HZ``, bridged."""
    rows = valid & whole_window(valid)
    rows = np.where(rows.any(axis=-1, keepdims=True), rows, valid)
    x = label_features(label)
    free = rows & ~at_stop(label)  # a label at the stop says "at least": no linear model holds
    z = forward_features(truth)
    roughness = np.diff(label, 2, axis=-1, prepend=label[..., :1], append=label[..., -1:])
    terms = np.stack(
        [np.ones_like(label), at_stop(label), label**2, roughness**2, truth**2], axis=-1
    )
    return StyleMoments(
        inverse=_moments(x, truth, rows),
        forward=_moments(z, label, free),
        sums=np.einsum("rsk,rs->rk", terms, rows.astype(np.float64)),
    )


def person_moments(series: Sequence[LabelSeries]) -> tuple[tuple[str, ...], StyleMoments]:
    """People in order of appearance, and the sums of each over their rollouts.

    Raises:
        InvalidLabels: no series, or someone without a valid label.
    """
    if not series:
        raise InvalidLabels("No label series given; calibration needs at least one.")
    people: dict[str, StyleMoments] = {}
    for drive in series:
        grid = GridSeries.from_series(drive)
        sums = style_moments(grid.label[None], grid.truth[None], grid.valid[None])
        people[drive.person] = people[drive.person] + sums if drive.person in people else sums
    for person, sums in people.items():
        if not sums.inverse.rows.any():
            raise InvalidLabels(f"{person!r} has no valid label to calibrate on; label a rollout.")
    return tuple(people), concatenate(list(people.values()))


def forward_features(truth: FloatArray) -> FloatArray:
    """Truth at each delay, a dead zone's shape at three, and 1: (..., samples, features)."""
    smooth = 0.25 * (shifted(truth, -1) + 2.0 * truth + shifted(truth, 1))
    columns = [shifted(smooth, -round(delay_s * RATE_HZ)) for delay_s in DELAYS_S]
    kink = np.tanh(smooth / 0.2)
    columns += [shifted(kink, -round(delay_s * RATE_HZ)) for delay_s in DEAD_ZONE_DELAYS_S]
    return np.stack([*columns, np.ones_like(truth)], axis=-1)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StyleEncoder:
    """From moments to (coefficients of the inverse model, w).

    Attributes:
        inverse, forward: priors over people.
        inverse_axes, forward_axes: (features, COMPONENTS) leading axes of either prior.
        offset, scale: (STYLE_SIZE,) standardisation of w.
    """

    inverse: Prior
    forward: Prior
    inverse_axes: FloatArray
    forward_axes: FloatArray
    offset: FloatArray
    scale: FloatArray

    @classmethod
    def fit(cls, moments: StyleMoments, temper: float = 0.1) -> "StyleEncoder":
        """Priors by EM over the people of ``moments``, axes from their posteriors."""
        inverse = _symmetric(fit_prior(moments.inverse, temper=temper), BIAS)
        forward = _symmetric(fit_prior(moments.forward, temper=temper), FORWARD_BIAS)
        raw = cls(
            inverse=inverse,
            forward=forward,
            inverse_axes=_axes(inverse.covariance, BIAS),
            forward_axes=_axes(forward.covariance, FORWARD_BIAS),
            offset=np.zeros(STYLE_SIZE),
            scale=np.ones(STYLE_SIZE),
        )
        _, style = raw(moments)
        offset, scale = style.mean(axis=0), style.std(axis=0) + 1e-9
        offset[list(SIGNED)] = 0.0
        return cls(
            inverse=inverse,
            forward=forward,
            inverse_axes=raw.inverse_axes,
            forward_axes=raw.forward_axes,
            offset=offset,
            scale=scale,
        )

    def __call__(self, moments: StyleMoments) -> tuple[FloatArray, FloatArray]:
        """Inverse coefficients (people, features) and w (people, STYLE_SIZE)."""
        inverse = posterior(moments.inverse, self.inverse)
        forward = posterior(moments.forward, self.forward)
        samples, stops, label, rough, truth = np.maximum(moments.sums, 1e-3).T
        raw = np.column_stack(
            [
                (inverse.mean - self.inverse.mean) @ self.inverse_axes,
                (forward.mean - self.forward.mean) @ self.forward_axes,
                inverse.mean[:, BIAS],
                forward.mean[:, FORWARD_BIAS],
                *_response(forward.mean),
                np.log(inverse.noise),
                np.log(forward.noise),
                np.log(samples),
                np.sqrt(stops / samples),
                np.log(label / truth + 1e-3),
                np.log(rough / label + 1e-4),
            ]
        )
        standard = (raw - self.offset) / self.scale
        return inverse.mean, np.clip(standard, -_LARGEST, _LARGEST)


def mirrored_style(style: FloatArray) -> FloatArray:
    """Styles of the same people with left and right exchanged."""
    signs = np.ones(STYLE_SIZE)
    signs[list(SIGNED)] = -1.0
    return style * signs


def concatenate(moments: Sequence[StyleMoments]) -> StyleMoments:
    """Moments of all rollouts of ``moments``, in order."""
    return StyleMoments(
        inverse=Moments.concatenate([part.inverse for part in moments]),
        forward=Moments.concatenate([part.forward for part in moments]),
        sums=np.concatenate([part.sums for part in moments]),
    )


def _moments(x: FloatArray, y: FloatArray, rows: BoolArray) -> Moments:
    kept = x * rows[..., None]
    return Moments(
        xx=kept.transpose(0, 2, 1) @ kept,
        xy=np.einsum("rsf,rs->rf", kept, np.where(rows, y, 0.0)),
        yy=np.square(np.where(rows, y, 0.0)).sum(axis=-1),
        rows=rows.sum(axis=-1).astype(np.float64),
    )


def _response(coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log gain, mean delay and its spread in s, of the forward model's taps; (people,) each.

    No linear function of the coefficients gives a delay: it is a ratio of two.
    """
    taps = coefficients[:, : len(DELAYS_S)]
    gain = np.maximum(taps.sum(axis=1), _LEAST_GAIN)
    delay_s = np.clip(taps @ DELAYS_S / gain, DELAYS_S[0], DELAYS_S[-1])
    offset_s = DELAYS_S - delay_s[:, None]
    variance = np.clip((taps * offset_s**2).sum(axis=1) / gain, 0.0, 1.0)
    return np.log(gain), delay_s, np.sqrt(variance)


def _symmetric(prior: Prior, bias: int) -> Prior:
    """The prior with a mean bias of 0, since people lean to either side equally often."""
    mean, covariance = prior.mean.copy(), prior.covariance.copy()
    variance = covariance[bias, bias]
    mean[bias] = 0.0
    covariance[bias] = covariance[:, bias] = 0.0
    covariance[bias, bias] = variance
    return Prior(
        mean=mean,
        covariance=covariance,
        noise=prior.noise,
        noise_rows=prior.noise_rows,
        temper=prior.temper,
    )


def _axes(covariance: FloatArray, bias: int) -> FloatArray:
    """Leading principal axes without the bias, scaled to unit prior variance."""
    others = covariance.copy()
    others[bias] = others[:, bias] = 0.0
    variances, axes = np.linalg.eigh(others)
    order = np.argsort(variances)[::-1][:COMPONENTS]
    axes = axes[:, order] * np.where(axes[:, order].sum(axis=0) < 0.0, -1.0, 1.0)
    return axes / np.sqrt(variances[order])
