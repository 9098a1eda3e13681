"""The analysis plan as it was frozen, for whoever analyses: what was planned before, what after."""

import json
from dataclasses import asdict, dataclass
from hashlib import sha256

from steerlab.study.contract import StudyError
from steerlab.study.opened import OpenStudy
from steerlab.study.plans import AnalysisPlan


@dataclass(frozen=True, kw_only=True, slots=True)
class FrozenPlan:
    """A version of the plan, and since when it has been frozen.

    Attributes:
        sha256: of the plan's content alone (``plan_sha256``): equal in versions of the protocol
            that changed something else.
        protocol_version, protocol_sha256: the first version of the protocol that had this plan.
        frozen_utc: when that version was frozen.
        enrolled_before: participants enrolled by then; 0 is a plan made before anything was seen.
        why: the reason given for that version.
    """

    plan: AnalysisPlan
    sha256: str
    protocol_version: int
    protocol_sha256: str
    frozen_utc: str
    enrolled_before: int
    why: str


def plan_sha256(plan: AnalysisPlan) -> str:
    """Hash of what a plan says, whatever its file looks like."""
    text = json.dumps(asdict(plan), sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()


def frozen_plans(study: OpenStudy) -> list[FrozenPlan]:
    """Each plan that was ever in force, oldest first; a plan that was changed is a new one.

    The first is the one that was there before the first participant. More than one means that the
    plan was changed while the study ran: a report says so.

    Raises:
        StudyError: nothing is frozen yet, or a frozen version cannot be read.
    """
    query = "SELECT count(*) FROM enrolments WHERE protocol_version < ?"
    found: list[FrozenPlan] = []
    for version in study.versions():
        plan = study.protocol_of(version.version).plan
        digest = plan_sha256(plan)
        if found and found[-1].sha256 == digest:
            continue
        found.append(
            FrozenPlan(
                plan=plan,
                sha256=digest,
                protocol_version=version.version,
                protocol_sha256=version.sha256,
                frozen_utc=version.frozen_utc,
                enrolled_before=study.store.connection.read(query, version.version)[0][0],
                why=version.why,
            )
        )
    if not found:
        raise StudyError(
            f"The analysis plan of {study.folder} is not frozen: nobody is enrolled yet. Enrolling "
            f"the first participant freezes it."
        )
    return found
