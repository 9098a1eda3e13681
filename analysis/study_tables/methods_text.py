"""A methods paragraph that can be published as it is, with versions and the plan's hash."""

from collections.abc import Mapping

from steerlab.analysis.study_data.records import StudyData
from steerlab.analysis.study_tables.tables import Analysis

_NAMED = ("steerlab", "python", "numpy", "scipy", "torch")


def methods_text(analysis: Analysis, versions: Mapping[str, str]) -> list[str]:
    """Paragraphs."""
    data, config = analysis.data, analysis.config
    used = ", ".join(f"{name} {versions[name]}" for name in _NAMED if name in versions)
    return [
        f"{_who(data)} {_plan(data)} Analyses were made with {used}; random numbers of "
        f"permutations and resamples come from seed {config.seed}.",
        "Over- and under-correction is the signed amplitude metric of Eq. 3 of Schrum, Hedlund and "
        "Gombolay along an exact dynamic time warping path"
        f"{' (fastdtw with radius 10 beside it)' if config.fastdtw else ''}; a true label of 0 "
        "counts any input as over-correction. Delay is the mean lag along that path, and the "
        "median lag along the path between both signals scaled to mean 0 and variance 1. "
        "Known device latencies were subtracted. Cronbach’s alpha has Feldt’s interval; scales "
        "with a missing answer have no score, and nothing was imputed.",
        "The association of an embedding with one quantity is multiple R, which does not depend on "
        f"how the embedding is turned, with a p-value from {config.permutations} permutations and "
        "an interval from the noncentral F distribution. Table 2’s family was corrected by Holm and "
        "by Benjamini and Hochberg. The paper’s own rule (Pearson or Spearman after Shapiro-Wilk "
        "and the non-constant variance score test) is reported per dimension and labelled "
        "paper-compatible. Women and men were compared by a permutation Hotelling T² and by "
        "Welch’s t of each dimension. Label errors were compared on rollouts that the network was "
        "not trained on, by Wilcoxon’s signed ranks over people; the improvement is the share of "
        "the summed absolute error removed, with a percentile bootstrap over people. Conditions "
        "were compared by Friedman’s test, repeated-measures ANOVA with Greenhouse and Geisser’s "
        "correction and a mixed model with a random intercept per person; pairs by Wilcoxon’s test "
        "with Holm’s correction; success as yes or no by Cochran’s Q and McNemar’s exact test. "
        "Intervals are 95 %.",
    ]


def _who(data: StudyData) -> str:
    training, test = (len(data.of_role(role)) for role in ("training", "test"))
    what = "scripted participants" if data.simulated else "participants"
    left = len([one for one in data.exclusions if one.what == "person"])
    return (
        f"Of {data.enrolled} {what}, {training} training and {test} test participants were "
        f"analysed; {left} were left out for the reasons listed."
    )


def _plan(data: StudyData) -> str:
    plan = data.plan
    if plan is None:
        return "There was no analysis plan."
    if plan.sha256 is None:
        return "The analysis plan was not frozen."
    return (
        f"The analysis plan was frozen with version {plan.version} of the protocol on "
        f"{plan.frozen_utc} (SHA-256 {plan.sha256}; of the protocol {plan.protocol_sha256})."
    )
