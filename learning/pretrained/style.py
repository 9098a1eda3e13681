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
    FEATURES,
    RATE_HZ,
    GridSeries,
    at_stop,
    label_features,
    shifted,
    whole_window,
)
from steerlab.sim.arrays import BoolArray, FloatArray

DELAYS_S = np.arange(-8, 13) * 0.1  # of the forward model's taps
DEAD_ZONE_DELAYS_S = (0.0, 0.2, 0.4)
INVERSE_FEATURES = FEATURES + 1
FORWARD_FEATURES = len(DELAYS_S) + len(DEAD_ZONE_DELAYS_S) + 2
INVERSE_EVEN = (BIAS, FEATURES)  # features that keep their sign when left and right are exchanged
FORWARD_EVEN = (FORWARD_FEATURES - 2, FORWARD_FEATURES - 1)
COMPONENTS = 10  # principal components kept of either model
_LAGS = (1, 2, 4, 8, 16, 32)  # samples at which labels and truths are compared with themselves
_RESTS = (0.03, 0.1, 0.3)  # units of the truth: a wheel within them is at rest
_SUMS = 8 + 2 * len(_LAGS) + len(_RESTS)
STYLE_SIZE = 2 * COMPONENTS + 4 + 10 + 2 * len(_LAGS) + len(_RESTS) + 3
SIGNED = tuple(range(2 * COMPONENTS, 2 * COMPONENTS + 4))
"""Entries of w that change sign when left and right are exchanged: biases and one-sidedness."""
HOW_MANY = 2 * COMPONENTS + 9
"""The entry of w that says how many labels there were, which is nobody's style."""

_LEAST_GAIN = 0.1  # below it a response has no delay
_LEAST_UNIT = 1e-6
_AT_STOP = FEATURES - 2  # its column in ``label_features``
_MOST_SAMPLES = 2500.0  # of pre-training; more labels say no more
LARGEST = 4.0  # standard deviations; what lies further out was never trained on


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StyleMoments:
    """The sums over rollouts that w is computed from; rollouts of a person add up.

    Attributes:
        inverse, forward: of each rollout.
        sums: (rollouts, _SUMS): samples, samples at the stop, label², squared second difference of
            the label, truth², |truth|, truths at the stop, labels that stay; squared changes of
            label and of truth at ``_LAGS``; labels within ``_RESTS``.
        unit: (rollouts,) what labels and truths were divided by: the size of the person's truths.
    """

    inverse: Moments
    forward: Moments
    sums: FloatArray
    unit: FloatArray

    def __getitem__(self, rollouts: slice | list[int]) -> "StyleMoments":
        """The chosen rollouts."""
        return StyleMoments(
            inverse=self.inverse[rollouts],
            forward=self.forward[rollouts],
            sums=self.sums[rollouts],
            unit=self.unit[rollouts],
        )

    def __add__(self, other: "StyleMoments") -> "StyleMoments":
        """Moments of the same people with the labels of ``other`` added."""
        return StyleMoments(
            inverse=self.inverse + other.inverse,
            forward=self.forward + other.forward,
            sums=self.sums + other.sums,
            unit=self.unit,
        )

    def summed(self, people: int) -> "StyleMoments":
        """Sums over equally many rollouts of each person, which must lie side by side."""
        return StyleMoments(
            inverse=self.inverse.summed(people),
            forward=self.forward.summed(people),
            sums=self.sums.reshape(people, -1, _SUMS).sum(axis=1),
            unit=self.unit.reshape(people, -1)[:, 0],
        )

    def grouped(self, weights: FloatArray) -> "StyleMoments":
        """Sums over rollouts: weights (people, rollouts)."""
        return StyleMoments(
            inverse=self.inverse.grouped(weights),
            forward=self.forward.grouped(weights),
            sums=weights @ self.sums,
            unit=np.full(len(weights), self.unit[0]),
        )


def style_moments(
    label: FloatArray, truth: FloatArray, valid: BoolArray, unit: FloatArray
) -> StyleMoments:
    """Moments of rollouts of one length, at ``RATE_HZ``, bridged.

    Args:
        label, truth, valid: (rollouts, samples).
        unit: (rollouts,) the size of the truths of each rollout's person; see ``truth_unit``.
    """
    rows = valid & whole_window(valid)
    rows = np.where(rows.any(axis=-1, keepdims=True), rows, valid)
    stopped, truth_stopped = at_stop(label), at_stop(truth)
    x = inverse_features(label, unit)
    label, truth = label / unit[:, None], truth / unit[:, None]
    free = rows & ~stopped  # a label at the stop says "at least": no linear model holds
    z = forward_features(truth)
    roughness = np.diff(label, 2, axis=-1, prepend=label[..., :1], append=label[..., -1:])
    terms = [np.ones_like(label), stopped, label**2, roughness**2, truth**2, np.abs(truth)]
    terms += [truth_stopped, np.abs(label - shifted(label, -1)) < 1e-3]
    for values in (label, truth):
        terms += [np.square(values - shifted(values, -lag)) for lag in _LAGS]
    terms += [np.abs(label) < rest for rest in _RESTS]
    return StyleMoments(
        inverse=_moments(x, truth, rows),
        forward=_moments(z, label, free),
        sums=np.stack([(term * rows).sum(axis=-1) for term in terms], axis=-1),
        unit=unit,
    )


def study_prior(people: StyleMoments, temper: float = 0.1) -> Prior:
    """What a study's people have in common, for the inverse model of another one of them.

    Raises:
        InvalidLabels: fewer than two people, or someone without a row.
    """
    return _symmetric(fit_prior(people.inverse, temper=temper), INVERSE_EVEN)


def truth_unit(truth: FloatArray, valid: BoolArray) -> float:
    """Root mean square of one person's valid truths, all samples; 1 if they are all 0."""
    size = float(np.sqrt(np.square(truth[valid]).mean())) if valid.any() else 0.0
    return size if size > _LEAST_UNIT else 1.0


def inverse_features(label: FloatArray, unit: FloatArray) -> FloatArray:
    """``label_features`` in units of the truth, and |label|: (rollouts, samples, features)."""
    own = unit[:, None]
    x = label_features(label / own)
    x[..., _AT_STOP] = np.sign(label) * at_stop(label)
    wide = (shifted(label, -1) + label + shifted(label, 1)) / (3.0 * own)
    return np.concatenate([x, np.abs(wide)[..., None]], axis=-1)


def unit_of(grids: Sequence[GridSeries]) -> FloatArray:
    """The unit of one person from all their rollouts, (1,)."""
    truth = np.concatenate([grid.truth for grid in grids])
    return np.array([truth_unit(truth, np.concatenate([grid.valid for grid in grids]))])


def forward_features(truth: FloatArray) -> FloatArray:
    """Truth at each delay, a dead zone's shape at three, |truth| and 1: (..., samples, features)."""
    smooth = 0.25 * (shifted(truth, -1) + 2.0 * truth + shifted(truth, 1))
    columns = [shifted(smooth, -round(delay_s * RATE_HZ)) for delay_s in DELAYS_S]
    kink = np.tanh(smooth / 0.2)
    columns += [shifted(kink, -round(delay_s * RATE_HZ)) for delay_s in DEAD_ZONE_DELAYS_S]
    late = np.abs(shifted(smooth, -round(0.2 * RATE_HZ)))
    return np.stack([*columns, late, np.ones_like(truth)], axis=-1)


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
        inverse = _symmetric(fit_prior(moments.inverse, temper=temper), INVERSE_EVEN)
        forward = _symmetric(fit_prior(moments.forward, temper=temper), FORWARD_EVEN)
        raw = cls(
            inverse=inverse,
            forward=forward,
            inverse_axes=_axes(inverse.covariance, INVERSE_EVEN),
            forward_axes=_axes(forward.covariance, FORWARD_EVEN),
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
        sums = np.maximum(moments.sums, 1e-3)
        samples, stops, label, rough, truth, size, truth_stops, stays = sums[:, :8].T
        label_changes, truth_changes = np.split(sums[:, 8 : 8 + 2 * len(_LAGS)], 2, axis=1)
        rests = sums[:, 8 + 2 * len(_LAGS) :]
        raw = np.column_stack(
            [
                (inverse.mean - self.inverse.mean) @ self.inverse_axes,
                (forward.mean - self.forward.mean) @ self.forward_axes,
                inverse.mean[:, list(INVERSE_EVEN)],
                forward.mean[:, list(FORWARD_EVEN)],
                *_response(forward.mean),
                np.log(inverse.noise),
                np.log(forward.noise),
                np.log(np.minimum(samples, _MOST_SAMPLES)),
                np.sqrt(stops / samples),
                np.log(label / truth + 1e-3),
                np.log(rough / label + 1e-4),
                np.log(moments.unit),
                np.log(label_changes / label[:, None] + 1e-3),
                np.log(truth_changes / truth[:, None] + 1e-3),
                np.sqrt(rests / samples[:, None]),
                np.sqrt(stays / samples),
                np.sqrt(truth_stops / samples),
                size / np.sqrt(samples * truth),
            ]
        )
        standard = (raw - self.offset) / self.scale
        return inverse.mean, np.clip(standard, -LARGEST, LARGEST)


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
        unit=np.concatenate([part.unit for part in moments]),
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


def _symmetric(prior: Prior, even: tuple[int, int]) -> Prior:
    """The prior with even features of mean 0, since people lean to either side equally often."""
    mean, covariance = prior.mean.copy(), prior.covariance.copy()
    among = covariance[np.ix_(even, even)]
    mean[list(even)] = 0.0
    covariance[list(even)] = covariance[:, list(even)] = 0.0
    covariance[np.ix_(even, even)] = among
    return Prior(
        mean=mean,
        covariance=covariance,
        noise=prior.noise,
        noise_rows=prior.noise_rows,
        temper=prior.temper,
    )


def _axes(covariance: FloatArray, even: tuple[int, int]) -> FloatArray:
    """Leading principal axes without the even features, scaled to unit prior variance."""
    others = covariance.copy()
    others[list(even)] = others[:, list(even)] = 0.0
    variances, axes = np.linalg.eigh(others)
    order = np.argsort(variances)[::-1][:COMPONENTS]
    axes = axes[:, order] * np.where(axes[:, order].sum(axis=0) < 0.0, -1.0, 1.0)
    return axes / np.sqrt(variances[order])
