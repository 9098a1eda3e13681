"""Where an analysis departs from the plan that was frozen before it, in sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

from steerlab.analysis.study_data.records import Plan, StudyData
from steerlab.analysis.study_tables.constructs import PLANNED_STYLES

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


def deviations(data: StudyData, hypotheses: Sequence[Mapping[str, Any]]) -> list[str]:
    """A sentence for each; none if all was done as planned."""
    plan = data.plan
    if plan is None:
        return ["There is no analysis plan: every result here is exploratory."]
    found: list[str] = []
    if plan.sha256 is None:
        found.append("The analysis plan is not frozen: every result here is exploratory.")
    found += plan.amendments
    known = {row["id"] for row in hypotheses}
    planned = {one.id for one in plan.hypotheses}
    found += [
        f"{one.id} is planned ({one.text}) and this steerlab has no test for it: it was not tested."
        for one in plan.hypotheses
        if one.id not in known
    ]
    if extra := sorted(known - planned):
        found.append(f"{', '.join(extra)} was not planned: what is said of it is exploratory.")
    found += _wording(plan)
    found += [
        f"{row['id']} was planned and could not be tested: {row['p']['empty']}."
        for row in hypotheses
        if row["id"] in planned and row["verdict"] == "not testable"
    ]
    found += [
        f"The plan excludes by a rule that this steerlab does not apply by itself: “{rule}”"
        for rule in plan.exclusions
        if rule not in KNOWN_EXCLUSIONS
    ]
    if KNOWN_EXCLUSIONS[1] not in plan.exclusions:
        found.append(
            "Participants without a finished attempt at every calibration rollout were left out, "
            "which the plan does not say."
        )
    return found


def _wording(plan: Plan) -> list[str]:
    found: list[str] = []
    for one in plan.hypotheses:
        for what, planned, known in (
            ("outcome", one.outcome, KNOWN_OUTCOMES),
            ("test", one.test, KNOWN_TESTS),
        ):
            if one.id in known and planned not in known[one.id]:
                found.append(
                    f"{one.id}: the plan words its {what} as “{planned}”, which this steerlab does "
                    f"not know; compare it with what was done."
                )
    return found
