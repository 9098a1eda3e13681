"""The paper's choice between Pearson and Spearman: two assumption checks, then one of the two."""

from dataclasses import dataclass
from typing import Literal

from steerlab.analysis.statistics.assumptions import AssumptionCheck, score_test, shapiro_wilk
from steerlab.analysis.statistics.correlation import Correlation, pearson, spearman
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.sim.rollout import FloatArray

LABEL = "paper-compatible"
ASSUMPTION_ALPHA = 0.05


@dataclass(frozen=True, kw_only=True, slots=True)
class PaperCorrelation:
    """A correlation by the paper's rule, and why it is of its kind.

    Attributes:
        correlation: Pearson's if no check failed, else Spearman's.
        normality_x, normality_y: Shapiro-Wilk.
        constant_variance: the score test of ``y ~ x``.
        why: the checks that failed; empty if none did.
        label: that this is the paper's rule. A test chosen by the data has no exact level.
    """

    correlation: Correlation
    normality_x: AssumptionCheck | NotComputable
    normality_y: AssumptionCheck | NotComputable
    constant_variance: AssumptionCheck | NotComputable
    why: tuple[str, ...]
    label: Literal["paper-compatible"] = LABEL


def paper_correlation(
    embedding: FloatArray, construct: FloatArray, *, confidence: float = 0.95
) -> PaperCorrelation | NotComputable:
    """Correlate one embedding dimension (n,) with one construct (n,), section Results.

    The paper says that it checked normality and equal variance and used Spearman's if data did not
    pass. We check both variables, and the variance of ``construct ~ embedding``, each at 5 %; a
    check that cannot be computed has not been passed.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    checks = {
        "the embedding is not normal": shapiro_wilk(embedding),
        "the construct is not normal": shapiro_wilk(construct),
        "the variance is not constant": score_test(embedding, construct),
    }
    why = tuple(name for name, check in checks.items() if not _passed(check))
    found = (spearman if why else pearson)(embedding, construct, confidence=confidence)
    if isinstance(found, NotComputable):
        return found
    of_embedding, of_construct, variance = checks.values()
    return PaperCorrelation(
        correlation=found,
        normality_x=of_embedding,
        normality_y=of_construct,
        constant_variance=variance,
        why=why,
    )


def _passed(check: AssumptionCheck | NotComputable) -> bool:
    return isinstance(check, AssumptionCheck) and check.p >= ASSUMPTION_ALPHA
