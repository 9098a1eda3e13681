"""What is done in the browser: consent, answers, and finishing a page; durable on return."""

from collections.abc import Mapping, Sequence
from hashlib import sha256

from steerlab.study.contract import PAGES, Phase, PhaseKind, PhaseState, Standing, StudyError
from steerlab.study.progress import ParticipantProgress, answers_of, progress_of
from steerlab.study.protocol import ConsentText
from steerlab.study.store.answers import insert_response
from steerlab.study.store.people import (
    PhaseAct,
    insert_consent,
    insert_phase_event,
    read_consented_sha256,
    read_consents,
)
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.answer_format import Value
from steerlab.study.surveys.questionnaire import UnknownItem


def consent_sha256(text: ConsentText) -> str:
    """Hash of the paragraphs that were shown."""
    return sha256("\n\n".join(text.text).encode()).hexdigest()


def consent_text(study: OpenStudy, participant: str) -> ConsentText:
    """The text that the participant has decided on; before that the newest.

    The newest counts whichever version of the protocol they were enrolled under: a wording that
    the committee has replaced is shown to nobody any more.
    """
    decided = read_consented_sha256(study.store.connection, participant)
    for version in study.versions():
        text = study.protocol_of(version.version).consent
        if consent_sha256(text) == decided:
            return text
    return study.current().consent


def consent(study: OpenStudy, participant: str, *, given: bool, shown: int | None = None) -> None:
    """Keep the decision on the consent text; the same decision twice changes nothing.

    Args:
        shown: version of the text that the decision was made on; None for the newest.

    Raises:
        StudyError: another text is valid by now, the opposite decision was made before, or the
            participant has left.
    """
    connection = study.store.connection
    with connection.transaction(f"keep the consent of {participant!r}", durable=True):
        progress = progress_of(study, participant)
        before = read_consents(connection).get(participant)
        if before is given:
            return
        if before is not None:
            remedy = "withdraw them instead" if before else "enrol them anew"
            raise StudyError(
                f"{participant} {'gave' if before else 'refused'} consent before; {remedy}."
            )
        phase = _next(progress, None)
        if phase.kind is not PhaseKind.CONSENT:
            raise StudyError(f"{participant} is at {phase.id!r}, which asks for no consent.")
        text = consent_text(study, participant)
        if shown not in (None, text.version):
            raise StudyError(
                f"{participant} decided on version {shown} of the information, and version "
                f"{text.version} is valid now; show them that one."
            )
        insert_consent(
            connection, participant, given=given, version=text.version, sha256=consent_sha256(text)
        )
        act = PhaseAct.DONE if given else PhaseAct.STARTED
        insert_phase_event(connection, participant, phase.id, act)


def save_answer(
    study: OpenStudy,
    participant: str,
    phase: str,
    questionnaire: str,
    item: str,
    value: Value | None,
) -> None:
    """Keep one answer; None takes it back. The same answer again changes nothing.

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
        before = answers_of(study, progress, phase).get(questionnaire, {}).get(item)
        if (before, type(before)) == (value, type(value)):
            return
        if progress.state(phase) is PhaseState.WAITING:
            insert_phase_event(connection, participant, phase, PhaseAct.STARTED)
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
        kind = progress.phase(phase).kind
        if progress.state(phase) is PhaseState.DONE:
            return {}
        _next(progress, phase)
        if kind not in PAGES or kind is PhaseKind.CONSENT:
            raise StudyError(f"{phase!r} is a {kind} phase; it is not finished by a page.")
        if missing := missing_answers(study, progress, phase):
            return missing
        insert_phase_event(connection, participant, phase, PhaseAct.DONE)
    return {}


def missing_answers(
    study: OpenStudy, progress: ParticipantProgress, phase: str
) -> dict[str, list[str]]:
    """Required items of a phase without an answer, by questionnaire."""
    given = answers_of(study, progress, phase)
    missing = {
        key: study.questionnaires[key].missing(given.get(key, {}))
        for key in progress.phase(phase).questionnaires
    }
    return {key: items for key, items in missing.items() if items}


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
