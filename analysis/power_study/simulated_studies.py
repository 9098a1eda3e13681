"""Many simulated studies at once, at the level of styles, w, scores and outcomes.

What is simulated, and what is assumed:

- Styles: log gain and delay of each person, standard normal and independent, as populations draw
  them.
- w: both styles with error, the other dimensions with neither. With R² of ``Holding`` the error's
  variance is (1 - R²) / R² after twelve rollouts, and ``error_factor`` times that after fewer.
- Style metrics: both styles with such errors, independent of those of w.
- Scores: the trait (its planted correlations with the styles) with the error that its reliability
  leaves, normal.
- Outcomes: drives that reach the ball are binomial; their log odds are the condition's, plus the
  person's, plus the person's under that condition.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import expit, logit
from scipy.stats import chi2, f, rankdata

from steerlab.analysis.power_study.design import PowerDesign
from steerlab.analysis.statistics.corrections import holm
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import all_pairs, wilcoxon
from steerlab.analysis.study_tables.hypotheses import RIVALS
from steerlab.sim.arrays import BoolArray, FloatArray

H3A, H3B = "H3a: amplitude and w", "H3b: lag and w"
DIFFER, BETTER = "conditions differ (Friedman)", "better than each rival (Holm)"
HOLM = ", Holm"
NULL, ANY_NULL = "a scale without any effect", "any scale without an effect, Holm"
BLOCK = 100
"""Studies of a block: less than a second, so that little is lost when a run is stopped."""


def simulate_correlations(
    design: PowerDesign, people: int, studies: int, rng: np.random.Generator
) -> dict[str, FloatArray]:
    """p-values of multiple R, (studies,) by test; family members without an effect are last."""
    gain, delay = rng.standard_normal((2, studies, people))
    hold = design.holding
    w = rng.standard_normal((studies, people, design.dimensions))

    def missed(r2: float) -> float:
        return float(np.sqrt((1.0 / r2 - 1.0) * design.error_factor))

    w[..., 0] = gain + missed(hold.w_gain) * w[..., 0]
    w[..., 1] = delay + missed(hold.w_delay) * w[..., 1]

    def noise() -> FloatArray:
        return rng.standard_normal((studies, people))

    p_values = {
        H3A: multiple_p(w, gain + missed(hold.metric_gain) * noise()),
        H3B: multiple_p(w, delay + missed(hold.metric_delay) * noise()),
    }
    for scale in design.scales:
        effects = [effect for effect in design.effects if effect.scale == scale]
        trait = sum(
            (effect.r * (gain if effect.style == "gain" else delay) for effect in effects), 0.0
        )
        trait = trait + np.sqrt(max(0.0, 1.0 - sum(effect.r**2 for effect in effects))) * noise()
        score = np.sqrt(design.reliability) * trait + np.sqrt(1.0 - design.reliability) * noise()
        p_values[scale] = multiple_p(w, score)
    for number in range(design.family - len(p_values)):
        p_values[f"{NULL} {number + 1}"] = multiple_p(w, noise())
    return p_values


def multiple_p(w: FloatArray, score: FloatArray) -> FloatArray:
    """The F test's p of each study's multiple R: w (studies, n, d), score (studies, n).

    For normal scores it is the permutation test's up to that one's Monte-Carlo error.
    """
    n, size = w.shape[1:]
    basis = np.linalg.qr(w - w.mean(axis=1, keepdims=True))[0]
    centred = score - score.mean(axis=1, keepdims=True)
    explained = np.square(np.einsum("snd,sn->sd", basis, centred)).sum(axis=1)
    r2 = np.clip(explained / np.square(centred).sum(axis=1), 0.0, 1.0 - 1e-15)
    within = n - size - 1
    return np.asarray(f.sf(r2 / (1.0 - r2) * within / size, size, within))


def reject_correlations(p: Mapping[str, FloatArray], alpha: float) -> dict[str, BoolArray]:
    """Rejections by test, uncorrected and after Holm over the family."""
    table = np.stack(list(p.values()), axis=1)
    corrected = np.apply_along_axis(holm, 1, table)
    rejected: dict[str, BoolArray] = {}
    nulls = [column for column, name in enumerate(p) if name.startswith(NULL)]
    for column, name in enumerate(p):
        if column in nulls:
            continue
        rejected[name] = table[:, column] < alpha
        rejected[f"{name}{HOLM}"] = corrected[:, column] < alpha
    if nulls:  # one stands for all, and their family for the error of any kind
        rejected[NULL] = table[:, nulls[0]] < alpha
        rejected[ANY_NULL] = np.asarray((corrected[:, nulls] < alpha).any(axis=1))
    return rejected


def simulate_outcomes(
    design: PowerDesign, people: int, studies: int, rng: np.random.Generator
) -> FloatArray:
    """Shares of drives that reach the ball, (studies, people, conditions)."""
    means = logit(np.array([condition.success for condition in design.conditions]))
    person = design.person_sd * rng.standard_normal((studies, people, 1))
    both = design.interaction_sd * rng.standard_normal((studies, people, len(means)))
    return rng.binomial(design.starts, expit(means + person + both)) / design.starts


def resample_outcomes(
    table: FloatArray, people: int, studies: int, rng: np.random.Generator
) -> FloatArray:
    """Studies of people drawn with replacement from ``table`` (teachers, conditions)."""
    return table[rng.integers(len(table), size=(studies, people))]


def rivals_of(names: Sequence[str], ours: str) -> list[str]:
    """BC and DAgger as far as they are there, H4's rivals; else all others but the oracle."""
    others = [name for name in names if name != ours]
    known = [name for name in others if name in RIVALS]
    return known or [name for name in others if name != "oracle"]


def reject_outcomes(
    outcomes: FloatArray, names: tuple[str, ...], ours: str, alpha: float
) -> dict[str, BoolArray]:
    """Whether conditions differ, and whether ``ours`` is better than each rival.

    The pairs are those of the analysis: Wilcoxon's test of all of them, Holm over all of them.
    """
    rivals = rivals_of(names, ours)
    better = np.zeros(len(outcomes), dtype=bool)
    for row, table in enumerate(outcomes):
        wins: set[str] = set()
        for pair in all_pairs(table, names, wilcoxon):
            if isinstance(pair.test, NotComputable) or isinstance(pair.p_holm, NotComputable):
                continue
            if pair.p_holm < alpha and ours in (pair.first, pair.second):
                above = (pair.test.shift > 0.0) == (pair.first == ours)
                wins |= {pair.second if pair.first == ours else pair.first} if above else set()
        better[row] = set(rivals) <= wins
    return {DIFFER: friedman_p(outcomes) < alpha, BETTER: better}


def friedman_p(outcomes: FloatArray) -> FloatArray:
    """Friedman's p of each study: (studies, people, conditions) -> (studies,).

    Where nobody ranks one condition above another, nothing is rejected.
    """
    people, conditions = outcomes.shape[1:]
    ranks = rankdata(outcomes, axis=2) - (conditions + 1) / 2.0
    within = np.square(ranks).sum(axis=(1, 2))
    between = np.square(ranks.sum(axis=1)).sum(axis=1)
    w = np.divide(between, within * people, out=np.zeros(len(outcomes)), where=within > 0.0)
    return np.asarray(chi2.sf(w * people * (conditions - 1), conditions - 1))


def run_block(
    design: PowerDesign, people: int, number: int, taught: tuple[tuple[str, ...], FloatArray] | None
) -> dict[str, int]:
    """How many of ``BLOCK`` studies of ``people`` reject, by test.

    The same design, size and number give the same counts, whatever else is run.

    Args:
        taught: conditions and outcomes (teachers, conditions) to draw people from, in place of the
            outcome model.
    """
    rng = np.random.default_rng([design.seed, people, number])
    rejected = reject_correlations(simulate_correlations(design, people, BLOCK, rng), design.alpha)
    if taught is not None:
        names, table = taught
        outcomes = resample_outcomes(table, people, BLOCK, rng)
        rejected |= reject_outcomes(outcomes, names, design.ours, design.alpha)
    elif design.conditions:
        outcomes = simulate_outcomes(design, people, BLOCK, rng)
        names = tuple(condition.name for condition in design.conditions)
        rejected |= reject_outcomes(outcomes, names, design.ours, design.alpha)
    return {test: int(studies.sum()) for test, studies in rejected.items()}


def add_up(blocks: list[Mapping[str, Any]]) -> dict[str, int]:
    """Rejections of several blocks of one size."""
    total: dict[str, int] = {}
    for block in blocks:
        for test, count in block.items():
            total[test] = total.get(test, 0) + int(count)
    return total
