"""Every place in which a study asks a questionnaire, and what somebody answered there, or why not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import product

from steerlab.analysis.study_data.study import allowed_answers
from steerlab.study.contract import PhaseKind, PhaseState, Standing
from steerlab.study.item_orders import item_order
from steerlab.study.progress import ParticipantProgress, answers_of
from steerlab.study.protocol import StudyProtocol, teach_ids
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.answer_format import Value


class Missing(StrEnum):
    """Why there is no answer to an item."""

    NOT_ANSWERED = "not answered"  # the page was handed in without one
    NOT_SHOWN = "not shown"  # it is not on the person's way, was skipped, or hidden by an answer
    NOT_REACHED = "not reached"  # its page is not handed in, or is open again


@dataclass(frozen=True, kw_only=True, slots=True, order=True)
class Asking:
    """Where a questionnaire is asked: in a phase of its own, or after a condition of ``phase``."""

    phase: str
    condition: str | None
    questionnaire: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Answered:
    """What one person answered to one questionnaire in one place.

    Attributes:
        state: why there are no answers at all; None if the page was handed in.
        given: by item, as far as they still may be given.
        shown: the items that were shown, in the order in which they were; empty before the page.
    """

    state: Missing | None
    given: Mapping[str, Value]
    shown: tuple[str, ...] = ()

    def why_missing(self, item: str) -> Missing | None:
        """Why there is no answer to an item; None if there is one."""
        if item in self.given:
            return None
        if self.state is not None:
            return self.state
        return Missing.NOT_ANSWERED if item in self.shown else Missing.NOT_SHOWN


def teach_phases(protocol: StudyProtocol) -> list[str]:
    """Ids of the planned teaching phases."""
    return [plan.id for plan in protocol.phases if plan.kind is PhaseKind.TEACH]


def asked_places(protocols: Sequence[StudyProtocol]) -> tuple[Asking, ...]:
    """Every place in which a version of the protocol asks anything, in the order of the phases."""
    asked: dict[Asking, None] = {}
    for protocol in protocols:
        conditions = [condition.key for condition in protocol.conditions]
        for plan in protocol.phases:
            places = [(None, key) for key in plan.questionnaires]
            places += list(product(conditions, plan.after))
            for condition, key in places:
                asked[Asking(phase=plan.id, condition=condition, questionnaire=key)] = None
    return tuple(asked)


def answers_everywhere(
    study: OpenStudy,
    person: ParticipantProgress,
    asked: Sequence[Asking],
    notices: list[str],
) -> dict[Asking, Answered]:
    """What a person answered everywhere; nothing of who did not consent."""
    unseen = Answered(state=Missing.NOT_SHOWN, given={})
    answers = dict.fromkeys(asked, unseen)
    if person.view.standing is Standing.DECLINED:
        return answers
    plans = {
        after: plan
        for plan in teach_phases(person.protocol)
        for index in range(len(person.view.order))
        for after in (teach_ids(plan, index)[1],)
    }
    for phase, state in person.view.phases:
        if phase.kind is not PhaseKind.QUESTIONNAIRES or state is PhaseState.SKIPPED:
            continue
        done = state is PhaseState.DONE
        given = answers_of(study, person, phase.id) if done else {}
        for key in phase.questionnaires:
            place = Asking(
                phase=plans.get(phase.id, phase.id), condition=phase.condition, questionnaire=key
            )
            questionnaire = study.questionnaires[key]
            kept = allowed_answers(study, person, key, given.get(key, {}), notices)
            shown = {item.id for item in questionnaire.shown(kept)} if done else ()
            answers[place] = Answered(
                state=None if done else Missing.NOT_REACHED,
                given=kept,
                shown=tuple(
                    item for item in item_order(person, phase.id, questionnaire) if item in shown
                ),
            )
    return answers
