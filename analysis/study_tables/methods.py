"""How an analysis was made, in publishable paragraphs, and where it departs from the frozen plan."""

from collections.abc import Mapping, Sequence
from typing import Any

from steerlab.analysis.study_data.records import Plan, StudyData
from steerlab.analysis.study_tables.constructs import PLANNED_STYLES
from steerlab.analysis.study_tables.tables import Analysis

_NAMED = ("steerlab", "python", "numpy", "scipy", "torch")  # whose versions the text gives
KNOWN_OUTCOMES = {
    "H1": (
        "mean absolute error of labels against the ground truth, held-out rollouts, per person",
    ),
    "H2a": ("multiple R of w with each Mini-IPIP score",),
    "H2b": ("multiple R of w with the score",),
    "H2c": ("multiple R of w with the scores",),
    "H3a": tuple(text for text, key in PLANNED_STYLES.items() if key.startswith("amplitude")),
    "H3b": tuple(text for text, key in PLANNED_STYLES.items() if key.startswith("lag")),
    "H4": ("drives that reach the ball, of the evaluation set",),
}
KNOWN_TESTS = {
    "H1": ("paired, mapped against given",),
    **dict.fromkeys(("H2a", "H2b", "H2c", "H3a", "H3b"), ("permutation",)),
    "H4": ("mixed model with condition and order, participants as groups; Holm-corrected pairs",),
}
KNOWN_EXCLUSIONS = (
    "Attempts that were flagged for timing are left out of a sensitivity analysis, never of the "
    "main one.",
    "A participant without a finished attempt at every calibration rollout is left out.",
)


def methods_text(analysis: Analysis, versions: Mapping[str, str]) -> list[str]:
    """Paragraphs for a methods section, with versions and the plan's hash."""
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
    left = sum(exclusion.what == "person" for exclusion in data.exclusions)
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


def deviations(data: StudyData, hypotheses: Sequence[Mapping[str, Any]]) -> list[str]:
    """A sentence for each departure from the frozen plan; none if all was done as planned."""
    plan = data.plan
    if plan is None:
        return ["There is no analysis plan: every result here is exploratory."]
    sentences: list[str] = []
    if plan.sha256 is None:
        sentences.append("The analysis plan is not frozen: every result here is exploratory.")
    sentences += plan.amendments
    known = {row["id"] for row in hypotheses}
    planned = {hypothesis.id for hypothesis in plan.hypotheses}
    sentences += [
        f"{hypothesis.id} is planned ({hypothesis.text}) and this steerlab has no test for it: it was not tested."
        for hypothesis in plan.hypotheses
        if hypothesis.id not in known
    ]
    if extra := sorted(known - planned):
        sentences.append(f"{', '.join(extra)} was not planned: what is said of it is exploratory.")
    sentences += _wording(plan)
    sentences += [
        f"{row['id']} was planned and could not be tested: {row['p']['empty']}."
        for row in hypotheses
        if row["id"] in planned and row["verdict"] == "not testable"
    ]
    sentences += [
        f"The plan excludes by a rule that this steerlab does not apply by itself: “{rule}”"
        for rule in plan.exclusions
        if rule not in KNOWN_EXCLUSIONS
    ]
    if KNOWN_EXCLUSIONS[1] not in plan.exclusions:
        sentences.append(
            "Participants without a finished attempt at every calibration rollout were left out, "
            "which the plan does not say."
        )
    return sentences


def _wording(plan: Plan) -> list[str]:
    sentences: list[str] = []
    for hypothesis in plan.hypotheses:
        for what, planned, known in (
            ("outcome", hypothesis.outcome, KNOWN_OUTCOMES),
            ("test", hypothesis.test, KNOWN_TESTS),
        ):
            if hypothesis.id in known and planned not in known[hypothesis.id]:
                sentences.append(
                    f"{hypothesis.id}: the plan words its {what} as “{planned}”, which this steerlab does "
                    f"not know; compare it with what was done."
                )
    return sentences
