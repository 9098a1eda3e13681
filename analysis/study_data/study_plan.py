"""The frozen analysis plan of a study, and how it came to be."""

from steerlab.analysis.study_data.records import Plan, PlannedHypothesis
from steerlab.study.analysis_plan import FrozenPlan, frozen_plans
from steerlab.study.opened import OpenStudy
from steerlab.study.plans import AnalysisPlan


def plan_of(study: OpenStudy) -> Plan:
    """The newest frozen plan, or the file's while nothing is frozen."""
    versions = study.versions()
    if not versions:
        return _plan(study.current().plan, None, ())
    plans = frozen_plans(study)
    by_version = {one.protocol_version: one for one in plans}
    amendments = tuple(
        _changed(by_version[one.version])
        if one.version in by_version
        else f"Version {one.version} of the protocol, with the same plan, was recorded on "
        f"{one.frozen_utc}: {one.why}"
        for one in versions[1:]
    )
    return _plan(plans[-1].plan, plans[-1], amendments)


def _changed(frozen: FrozenPlan) -> str:
    return (
        f"The analysis plan was changed with version {frozen.protocol_version} of the protocol on "
        f"{frozen.frozen_utc}, when {frozen.enrolled_before} participants were enrolled: "
        f"{frozen.why}"
    )


def _plan(plan: AnalysisPlan, frozen: FrozenPlan | None, amendments: tuple[str, ...]) -> Plan:
    return Plan(
        alpha=plan.alpha,
        correction=plan.correction,
        hypotheses=tuple(
            PlannedHypothesis(
                id=one.id, text=one.text, outcome=one.outcome, test=one.test, primary=one.primary
            )
            for one in plan.hypotheses
        ),
        exclusions=plan.exclusions,
        version=None if frozen is None else frozen.protocol_version,
        sha256=None if frozen is None else frozen.sha256,
        protocol_sha256=None if frozen is None else frozen.protocol_sha256,
        frozen_utc=None if frozen is None else frozen.frozen_utc,
        amendments=amendments,
    )
