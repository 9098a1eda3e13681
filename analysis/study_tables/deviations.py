"""Where an analysis departs from the frozen plan, in sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

from steerlab.analysis.study_data.records import Plan, StudyData
from steerlab.analysis.study_tables.constructs import PLANNED_STYLES
from steerlab.study.attention import EXCLUDED

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
    "PrePost": (
        "mean absolute error of labels against the ground truth, after less before, per person",
    ),
}
KNOWN_TESTS = {
    "H1": ("paired, mapped against given",),
    **dict.fromkeys(("H2a", "H2b", "H2c", "H3a", "H3b"), ("permutation",)),
    "H4": ("mixed model with condition and order, participants as groups; Holm-corrected pairs",),
    "PrePost": ("paired, before against after",),
}
KNOWN_EXCLUSIONS = (
    "Attempts that were flagged for timing are left out of a sensitivity analysis, never of the "
    "main one.",
    "A participant without a finished attempt at every calibration rollout is left out.",
    EXCLUDED,
)


def deviations(
    data: StudyData, hypotheses: Sequence[Mapping[str, Any]], *, reasons: bool = True
) -> list[str]:
    """A sentence for each departure from the frozen plan; none if all was done as planned.

    Args:
        reasons: say why a hypothesis could not be tested; the page does so once, in another place.
    """
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
        sentences.append(f"{_listed(extra)} not planned: what is said of that is exploratory.")
    sentences += _wording(plan)
    kept = [row for row in hypotheses if row["id"] in planned]
    untested = not_testable(kept)
    if reasons:
        sentences += [
            f"{_listed(ids)} planned and could not be tested: {why}."
            for why, ids in untested.items()
        ]
    elif untested:
        ids = [id_ for several in untested.values() for id_ in several]
        sentences.append(f"{_listed(sorted(ids))} planned and could not be tested, as said above.")
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


def not_testable(hypotheses: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Why hypotheses could not be tested, each reason once, with their ids."""
    reasons: dict[str, list[str]] = {}
    for row in hypotheses:
        if row["verdict"] == "not testable":
            reasons.setdefault(row["why"], []).append(row["id"])
    return reasons


def _listed(ids: Sequence[str]) -> str:
    return f"{', '.join(ids)} {'was' if len(ids) == 1 else 'were'}"


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
