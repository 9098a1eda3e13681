"""A participant's way: the protocol's phases, with teaching laid out in their order."""

from steerlab.study.contract import Phase, PhaseKind, Role
from steerlab.study.protocol import PhasePlan, StudyProtocol
from steerlab.study.protocol_file import teach_ids

PAGES = (
    PhaseKind.CONSENT,
    PhaseKind.QUESTIONNAIRES,
    PhaseKind.INSTRUCTIONS,
    PhaseKind.DEBRIEF,
)
"""Kinds that are done in the browser."""


def phases_for(protocol: StudyProtocol, role: Role, order: tuple[str, ...]) -> tuple[Phase, ...]:
    """All phases of a participant.

    Args:
        order: condition keys; the titles that participants see do not give them away.
    """
    found: list[Phase] = []
    for plan in protocol.phases:
        if role not in plan.roles:
            continue
        if plan.kind is PhaseKind.TEACH:
            found += _taught(plan, order)
            continue
        found.append(
            Phase(
                id=plan.id,
                kind=plan.kind,
                title=plan.title,
                questionnaires=plan.questionnaires,
                text=plan.text,
            )
        )
    return tuple(found)


def _taught(plan: PhasePlan, order: tuple[str, ...]) -> list[Phase]:
    found: list[Phase] = []
    for index, condition in enumerate(order):
        teach, after = teach_ids(plan.id, index)
        title = f"{plan.title} {index + 1} of {len(order)}"
        found.append(Phase(id=teach, kind=PhaseKind.TEACH, title=title, condition=condition))
        if plan.after:
            found.append(
                Phase(
                    id=after,
                    kind=PhaseKind.QUESTIONNAIRES,
                    title=f"After {title[0].lower()}{title[1:]}",
                    condition=condition,
                    questionnaires=plan.after,
                )
            )
    return found
