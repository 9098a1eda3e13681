"""What is done in the browser: consent, answers, and finishing a page; durable on return."""

from collections.abc import Mapping, Sequence

from steerlab.study.consent import NO_ENTRIES, ConsentEntries, ConsentRecord, ConsentText
from steerlab.study.contract import PAGES, Phase, PhaseKind, PhaseState, Standing, StudyError
from steerlab.study.item_orders import orders_to_record
from steerlab.study.progress import ParticipantProgress, given_answers, progress_of
from steerlab.study.store.answers import insert_response
from steerlab.study.store.people import (
    PhaseAct,
    insert_consent,
    insert_phase_event,
    read_decision,
)
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.answer_format import Value
from steerlab.study.surveys.questionnaire import UnknownItem


def consent_text(study: OpenStudy, participant: str) -> ConsentText:
    """The text that the participant has decided on; before that the newest.

    The newest counts whichever version of the protocol they were enrolled under: a wording that
    the committee has replaced is shown to nobody any more.
    """
    decision = read_decision(study.store.connection, participant)
    if decision is not None:
        for version in study.versions():
            text = study.protocol_of(version.version).consent
            if text.sha256 == decision.sha256:
                return text
    return study.current().consent


def consent_record(study: OpenStudy, progress: ParticipantProgress) -> ConsentRecord | None:
    """A participant's decision; None before there is one, and when it is erased."""
    decision = read_decision(study.store.connection, progress.view.id)
    phase = progress.of_kind(PhaseKind.CONSENT)
    if decision is None or phase is None:
        return None
    kept = next((act.detail for act in progress.acts.get(phase.id, ()) if act.detail), "")
    return ConsentRecord(
        text=consent_text(study, progress.view.id),
        given=decision.given,
        at_utc=decision.at_utc,
        entries=ConsentEntries.read(kept),
    )


def consent(
    study: OpenStudy,
    participant: str,
    *,
    given: bool,
    shown: int | None = None,
    entries: ConsentEntries = NO_ENTRIES,
) -> None:
    """Keep the decision on the consent text; the same decision twice changes nothing.

    Whoever says to be too young has said no.

    Args:
        shown: version of the text that the decision was made on; None for the newest.
        entries: what was entered beside it; a yes needs all that the text asks for.

    Raises:
        StudyError: another text is valid by now, the opposite decision was made before, the
            participant has left, or a yes lacks something.
    """
    connection = study.store.connection
    with connection.transaction(f"keep the consent of {participant!r}", durable=True):
        progress = progress_of(study, participant)
        text = consent_text(study, participant)
        if text.minimum_age is not None and entries.of_age is False:
            given = False
        before = read_decision(connection, participant)
        if before is not None and before.given is given:
            return
        if before is not None:
            remedy = "withdraw them instead" if before.given else "enrol them anew"
            raise StudyError(
                f"{participant} {'gave' if before.given else 'refused'} consent before; {remedy}."
            )
        phase = _next(progress, None)
        if phase.kind is not PhaseKind.CONSENT:
            raise StudyError(f"{participant} is at {phase.id!r}, which asks for no consent.")
        if shown not in (None, text.version):
            raise StudyError(
                f"{participant} decided on version {shown} of the information, and version "
                f"{text.version} is valid now; show them that one."
            )
        if given and (lacking := text.lacking(entries)):
            raise StudyError(
                f"{participant} cannot agree yet: the consent page lacks {', '.join(lacking)}."
            )
        insert_consent(
            connection, participant, given=given, version=text.version, sha256=text.sha256
        )
        act = PhaseAct.DONE if given else PhaseAct.STARTED
        insert_phase_event(connection, participant, phase.id, act, text.kept(entries))


def save_answer(
    study: OpenStudy,
    participant: str,
    phase: str,
    questionnaire: str,
    item: str,
    value: Value | None,
) -> None:
    """Keep one answer; None takes it back. The same answer again changes nothing.

    An answer to an item that is hidden is kept, and counts while the item is shown: a page saves
    answers one by one, not always in the order in which they depend on each other.

    Raises:
        StudyError: the participant is not at that phase, or it has no such item.
        InvalidAnswer: the item does not allow the answer.
    """
    connection = study.store.connection
    with connection.transaction(f"keep an answer of {participant!r}", durable=True):
        progress = progress_of(study, participant)
        page = progress.phase(phase)
        if progress.state(phase) is PhaseState.DONE:
            raise StudyError(f"{page.title!r} is finished, so its answers stay as they are.")
        _next(progress, phase)
        if questionnaire not in page.questionnaires:
            known = ", ".join(page.questionnaires) or "nothing"
            raise StudyError(f"{phase!r} does not ask {questionnaire!r}; it asks {known}.")
        asked = study.questionnaires[questionnaire]
        try:
            asked.item(item)
            value = None if value is None else asked.check(item, value)
        except UnknownItem as error:
            raise StudyError(str(error)) from error
        before = given_answers(study, progress, phase).get(questionnaire, {}).get(item)
        if (before, type(before)) == (value, type(value)):
            return
        if progress.state(phase) is PhaseState.WAITING:
            orders = _orders(study, progress, page)
            insert_phase_event(connection, participant, phase, PhaseAct.STARTED, orders)
        insert_response(
            connection,
            participant=participant,
            phase=phase,
            phase_run=progress.phase_run(phase),
            questionnaire=questionnaire,
            item=item,
            value=value,
        )


def submit(study: OpenStudy, participant: str, phase: str) -> Mapping[str, Sequence[str]]:
    """Finish a page; twice changes nothing.

    Returns:
        required items without an answer, by questionnaire; empty when the page is finished.

    Raises:
        StudyError: the participant is not at that page, and it is not finished already.
    """
    connection = study.store.connection
    with connection.transaction(f"finish {phase!r} of {participant!r}", durable=True):
        progress = progress_of(study, participant)
        page = progress.phase(phase)
        kind = page.kind
        if progress.state(phase) is PhaseState.DONE:
            return {}
        _next(progress, phase)
        if kind not in PAGES or kind is PhaseKind.CONSENT:
            raise StudyError(f"{phase!r} is a {kind} phase; it is not finished by a page.")
        if missing := missing_answers(study, progress, phase):
            return missing
        # Where nothing was answered, nothing began: the last act says what was shown.
        unsaid = progress.state(phase) is PhaseState.WAITING
        orders = _orders(study, progress, page) if unsaid else ""
        insert_phase_event(connection, participant, phase, PhaseAct.DONE, orders)
    return {}


def missing_answers(
    study: OpenStudy, progress: ParticipantProgress, phase: str
) -> dict[str, list[str]]:
    """Required items of a phase that are shown and have no answer, by questionnaire."""
    given = given_answers(study, progress, phase)
    missing = {
        key: study.questionnaires[key].missing(given.get(key, {}))
        for key in progress.phase(phase).questionnaires
    }
    return {key: items for key, items in missing.items() if items}


def _orders(study: OpenStudy, progress: ParticipantProgress, page: Phase) -> str:
    asked = [study.questionnaires[key] for key in page.questionnaires]
    return orders_to_record(progress, page.id, asked)


def _next(progress: ParticipantProgress, phase: str | None) -> Phase:
    """The phase the participant is at, which must be ``phase`` unless that is None."""
    view = progress.view
    next_phase = view.next_phase
    if next_phase is None:
        gone = view.standing is not Standing.FINISHED
        why = f"has left the study ({view.standing})" if gone else "has finished the study"
        raise StudyError(f"{view.id} {why}; nothing more is recorded.")
    if phase is not None and next_phase.id != phase:
        raise StudyError(f"{view.id} is at {next_phase.id!r}, not at {phase!r}; do that first.")
    return next_phase
