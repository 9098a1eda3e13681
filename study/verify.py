"""``study verify``: is what is kept whole, unchanged, complete and plausible?"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from itertools import pairwise
from operator import itemgetter
from shlex import quote

from steerlab.sim.errors import SteerlabError
from steerlab.study.completeness import person_findings
from steerlab.study.contract import PhaseKind, PhaseState, Role, StudyCheck
from steerlab.study.derived import left_of
from steerlab.study.design import has_left
from steerlab.study.enrolment import order_at
from steerlab.study.merged_audits import merged_findings
from steerlab.study.progress import ParticipantProgress, everybody
from steerlab.study.protocol_file import protocol_sha256
from steerlab.study.recording.session_recorder import RECORDINGS
from steerlab.study.store.answers import read_responses
from steerlab.study.store.audit import AuditEntry, broken_at
from steerlab.study.store.errors import StoreError
from steerlab.study.store.frozen import read_embeddings, read_models
from steerlab.study.store.head import REMEDY, missing_head
from steerlab.study.store.merging import read_merged_audits
from steerlab.study.store.people import (
    Departure,
    read_departures,
    read_enrolments,
    read_phase_events,
)
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.seals import ANSWER, broken_seals, sealed_rows
from steerlab.study.store.teaching import TaughtRound, read_taught, read_tried
from steerlab.study.study_folder import OpenStudy
from steerlab.study.withdrawal import traces, unknown_files

PLACEHOLDER = "TO BE REPLACED"
_RESTORE = "Restore the study folder from its last copy."
_TAMPERED = "Somebody changed the database outside steerlab; compare it with the last copy."


@dataclass(frozen=True, kw_only=True)
class Verified:
    """The checks, and the audit's newest hash: kept elsewhere, it exposes a rewritten audit."""

    findings: tuple[StudyCheck, ...]
    head: str

    @property
    def ok(self) -> bool:
        """Nothing is wrong or missing."""
        return all(check.ok for check in self.findings)


def verify(study: OpenStudy, *, expected_head: str | None = None) -> Verified:
    """Check all of a study as it is now, also while others go on; changes nothing, needs no torch.

    Args:
        expected_head: an earlier ``Verified.head``, which the audit must still hold.
    """
    with study.store.connection.snapshot():
        return _verify(study, expected_head)


def _verify(study: OpenStudy, expected_head: str | None) -> Verified:
    database, readable = _database(study)
    if not readable:  # nothing that is read from it means anything
        return Verified(findings=(database,), head="")
    entries = cache(study.store.audit)
    everyone = cache(lambda: everybody(study))
    checks = [database]
    for what, check in (
        ("Audit", lambda: _audit(study, entries(), expected_head)),
        ("Answers", lambda: _answers(study, entries())),
        ("Labels", lambda: _seals(study, entries())),
        ("Protocol", lambda: _protocol(study)),
        ("Orders", lambda: _orders(study)),
        ("Clock", lambda: _clock(study, entries())),
        ("People", lambda: _people(study, everyone())),
        ("Devices", lambda: _devices(study)),
        ("Network", lambda: _network(study)),
        ("Embeddings", lambda: _embeddings(study, everyone())),
        ("Teaching", lambda: _teaching(study, everyone())),
        ("Withdrawal", lambda: _withdrawals(study)),
        ("Attempts", lambda: _attempts(study)),
    ):
        try:
            with study.reading():
                checks += check()
        except SteerlabError as error:  # damage to one part must not hide the others
            found = f"cannot be checked: {error}"
            checks.append(StudyCheck(what=what, found=found, ok=False, mend=_RESTORE))
    try:
        head = entries()[-1].sha256 or "" if entries() else ""
    except SteerlabError:  # said above
        head = ""
    return Verified(findings=tuple(checks), head=head)


def _database(study: OpenStudy) -> tuple[StudyCheck, bool]:
    """SQLite's check of the file, and whether the rest can be read."""
    connection = study.store.connection
    try:
        result = "; ".join(row[0] for row in connection.read("PRAGMA integrity_check"))
        dangling = connection.read("PRAGMA foreign_key_check") if result == "ok" else []
    except StoreError as error:
        result, dangling = str(error), []
    remedy = _RESTORE
    if result != "ok":
        return StudyCheck(what="Database", found=result, ok=False, mend=remedy), False
    if older := missing_head(connection.path, connection.sqlite):
        return StudyCheck(what="Database", found=older, ok=False, mend=f"{REMEDY}."), True
    if dangling:
        result = f"{len(dangling)} rows refer to others that are not there"
        return StudyCheck(what="Database", found=result, ok=False, mend=remedy), True
    return StudyCheck(what="Database", found="whole", ok=True), True


def _audit(
    study: OpenStudy, entries: Sequence[AuditEntry], expected: str | None
) -> Iterator[StudyCheck]:
    broken = broken_at(list(entries))
    if broken is not None:
        result = f"entry {broken.id} ({broken.act}, {broken.at_utc}) breaks the chain"
        yield StudyCheck(what="Audit", found=result, ok=False, mend=_TAMPERED)
    elif any(after.id != before.id + 1 for before, after in pairwise(entries)):
        yield StudyCheck(what="Audit", found="entries are missing", ok=False, mend=_TAMPERED)
    else:
        yield StudyCheck(what="Audit", found=f"{len(entries)} entries, unbroken", ok=True)
    merged = read_merged_audits(study.store.connection)
    yield from merged_findings(entries, merged)
    held = (entry.sha256 for audit in (entries, *merged.values()) for entry in audit)
    if expected is not None and expected not in held:
        result = f"no entry has the hash {expected}"
        yield StudyCheck(what="Audit", found=result, ok=False, mend=_TAMPERED)


def _answers(study: OpenStudy, entries: Sequence[AuditEntry]) -> Iterator[StudyCheck]:
    """Every answer is the one that the audit sealed, and none is missing."""
    sealed = sealed_rows(entries)
    responses = read_responses(study.store.connection)
    changed = [one.id for one in responses if sealed.get(one.row) != one.digest]
    gone = sum(row[0] == ANSWER for row in sealed) - len(responses)
    if changed:
        result = f"{len(changed)} differ from what the audit sealed, the first is row {changed[0]}"
        yield StudyCheck(what="Answers", found=result, ok=False, mend=_TAMPERED)
    elif gone:
        yield StudyCheck(what="Answers", found=f"{gone} are gone", ok=False, mend=_TAMPERED)
    else:
        yield StudyCheck(what="Answers", found=f"{len(responses)} as they were given", ok=True)


def _seals(study: OpenStudy, entries: Sequence[AuditEntry]) -> Iterator[StudyCheck]:
    """Attempts with their labels, networks, w and taught rounds are what the audit sealed."""
    changed, gone, whole = broken_seals(study.store.connection, sealed_rows(entries))
    if changed:
        result = f"{len(changed)} differ from what the audit sealed, the first is {changed[0]}"
        yield StudyCheck(what="Labels", found=result, ok=False, mend=_TAMPERED)
    elif gone:
        result = f"{len(gone)} are gone, the first is {gone[0]}"
        yield StudyCheck(what="Labels", found=result, ok=False, mend=_TAMPERED)
    else:
        result = f"{whole} attempts, networks, w and rounds as they were kept"
        yield StudyCheck(what="Labels", found=result, ok=True)


def _protocol(study: OpenStudy) -> Iterator[StudyCheck]:
    versions = study.versions()
    for frozen in versions:
        if protocol_sha256(frozen.text) != frozen.sha256:
            result = f"version {frozen.version} is not what its hash says"
            remedy = "Compare the database with its last copy."
            yield StudyCheck(what="Protocol", found=result, ok=False, mend=remedy)
    try:
        study.check_unchanged()
    except SteerlabError as error:
        remedy = "Put the file back, or record the change with study amend."
        yield StudyCheck(what="Protocol", found=str(error), ok=False, mend=remedy)
        return
    result = f"version {versions[-1].version}, as frozen" if versions else "not frozen yet"
    yield StudyCheck(what="Protocol", found=result, ok=True)
    if any(PLACEHOLDER in paragraph for paragraph in study.current().consent.text):
        result = f"the consent text is still the template's: it says {PLACEHOLDER}"
        remedy = "Put in the text that your ethics committee approved, with the next version."
        yield StudyCheck(what="Consent", found=result, ok=True, mend=remedy, notice=True)


def _orders(study: OpenStudy) -> Iterator[StudyCheck]:
    """Every condition order is the one that the protocol's seed gives, and its place is one's own."""
    wrong: list[str] = []
    holders: defaultdict[tuple[str, int | None], list[str]] = defaultdict(list)
    stay = {one.view.id for one in everybody(study) if not has_left(one.view.standing)}
    for person in read_enrolments(study.store.connection):
        protocol = study.protocol_of(person.protocol_version)
        keys = [condition.key for condition in protocol.conditions]
        size, place = protocol.block_size, person.place
        if person.role == Role.TEST and (
            place is None
            or person.condition_order
            != order_at(keys, seed=protocol.seed, block_size=size, index=place)
        ):
            wrong.append(person.participant)
        if place is not None and person.participant in stay:
            holders[person.allocation, place].append(person.participant)
    shared = [" and ".join(people) for people in holders.values() if len(people) > 1]
    if shared:
        result = f"{', '.join(shared)} share a place in the blocks"
        remedy = "Compare the database with its last copy."
        yield StudyCheck(what="Condition orders", found=result, ok=False, mend=remedy)
    elif wrong:
        result = f"{', '.join(wrong)} have another order than the protocol's seed gives"
        remedy = "Compare the database with its last copy."
        yield StudyCheck(what="Condition orders", found=result, ok=False, mend=remedy)
    elif holders:
        yield StudyCheck(what="Condition orders", found="as the seed gives them", ok=True)


def _clock(study: OpenStudy, entries: Sequence[AuditEntry]) -> Iterator[StudyCheck]:
    """In what is only appended to, times only grow; people may come from several computers."""
    acts = read_phase_events(study.store.connection)
    answers = read_responses(study.store.connection)
    for what, times in (
        ("the audit", [("", entry.at_utc) for entry in entries]),
        ("the phases", [(act.participant, act.at_utc) for act in acts]),
        ("the answers", [(answer.participant, answer.at_utc) for answer in answers]),
    ):
        for (who, before), (next_, after) in pairwise(sorted(times, key=itemgetter(0))):
            if who == next_ and after < before:
                result = f"in {what}, {after} was written after {before}"
                remedy = "The computer's clock was set back; note when, and switch on time service."
                yield StudyCheck(what="Clock", found=result, ok=False, mend=remedy)
                return
    yield StudyCheck(what="Clock", found="never ran backwards", ok=True)


def _people(study: OpenStudy, everyone: Sequence[ParticipantProgress]) -> Iterator[StudyCheck]:
    finished = study.store.attempts(AttemptStatus.FINISHED)
    for progress in everyone:
        yield from person_findings(study, progress, finished)


def _devices(study: OpenStudy) -> Iterator[StudyCheck]:
    """Labels given with different devices must not be pooled unnoticed."""
    roles = study.store.participants()
    for role in Role:
        kinds = sorted(
            {
                session.input_kind
                for session in study.store.sessions().values()
                if roles[session.participant] == role
            }
        )
        if len(kinds) > 1:
            result = f"{role} participants steered with {', '.join(kinds)}"
            remedy = "Analyse them apart, or leave those out that the protocol did not mean."
            yield StudyCheck(what="Devices", found=result, ok=False, mend=remedy)


def _network(study: OpenStudy) -> Iterator[StudyCheck]:
    """The network's file is what was frozen."""
    remedy = "Restore it from the last copy of the study."
    for model in read_models(study.store.connection):
        if model.removed_utc is not None:
            continue
        path = study.folder / model.file
        if not path.is_file():
            yield StudyCheck(what="Network", found=f"{path} is missing", ok=False, mend=remedy)
        elif sha256(path.read_bytes()).hexdigest() != model.sha256:
            yield StudyCheck(what="Network", found=f"{path} was changed", ok=False, mend=remedy)
        else:
            result = f"{model.file} of {len(model.people)} people, as frozen"
            yield StudyCheck(what="Network", found=result, ok=True)


def _embeddings(study: OpenStudy, everyone: Sequence[ParticipantProgress]) -> Iterator[StudyCheck]:
    """Every w that should be there is, and comes from the network in use."""
    models = read_models(study.store.connection)
    in_use = {model.sha256 for model in models if model.removed_utc is None}
    embeddings = read_embeddings(study.store.connection)
    for progress in everyone:
        participant, phase = progress.view.id, progress.of_kind(PhaseKind.CALIBRATE_W)
        if phase is None or progress.state(phase.id) is not PhaseState.DONE:
            continue
        embedding = embeddings.get(participant)
        if embedding is None:
            result = f"{participant} has no w, though {phase.id} is done"
            remedy = f"Open the phase again: steerlab study redo DIR {participant} {phase.id}"
            yield StudyCheck(what="Network", found=result, ok=False, mend=remedy)
            continue
        if embedding.model_sha256 not in in_use:
            result = f"w of {participant} comes from a network that was removed"
            remedy = "Once enough training participants have finished: steerlab study train DIR"
            yield StudyCheck(what="Network", found=result, ok=False, mend=remedy)
        if embedding.outside:
            result = f"{participant} corrects unlike the training participants"
            remedy = "Look at their labels before trusting the mapped ones."
            yield StudyCheck(what="Network", found=result, ok=True, mend=remedy, notice=True)


def _teaching(study: OpenStudy, everyone: Sequence[ParticipantProgress]) -> Iterator[StudyCheck]:
    """Rounds, trials and policies of every teaching phase that is marked as done."""
    intact = 0
    for progress in everyone:
        participant = progress.view.id
        if progress.view.standing.erased:
            continue
        for phase, state in progress.view.phases:
            if phase.kind is not PhaseKind.TEACH or state is not PhaseState.DONE:
                continue
            rounds = read_taught(study.store.connection, participant, phase.id)
            wrong = _missing_rounds(study, progress, phase.id, rounds)
            wrong = wrong or _changed_policy(study, rounds)
            if wrong:
                result = f"{phase.id}: {wrong}"
                remedy = (
                    f"Restore the study from its last copy, or redo {phase.id} of {participant}."
                )
                yield StudyCheck(what=participant, found=result, ok=False, mend=remedy)
            else:
                intact += len(rounds)
    if intact:
        result = f"{intact} rounds, their policies as they were kept"
        yield StudyCheck(what="Teaching", found=result, ok=True)


def _missing_rounds(
    study: OpenStudy, progress: ParticipantProgress, phase: str, rounds: Sequence[TaughtRound]
) -> str | None:
    """What a teaching phase that is done lacks; None if nothing."""
    wanted = progress.protocol.demonstrations + 1
    if len(rounds) != wanted:
        return f"it is done, but has {len(rounds)} of {wanted} rounds"
    tried = read_tried(study.store.connection, progress.view.id, phase)
    untried = {taught.round for taught in rounds} - tried
    return f"the policies of rounds {sorted(untried)} were never tried" if untried else None


def _changed_policy(study: OpenStudy, rounds: Sequence[TaughtRound]) -> str | None:
    """A policy's file that is not what was kept; None if all are."""
    for taught in rounds:
        for name, digest in taught.policies.items():
            path = study.folder / name
            if not path.is_file():
                return f"{path} is missing"
            if sha256(path.read_bytes()).hexdigest() != digest:
                return f"{path} was changed"
    return None


def _withdrawals(study: OpenStudy) -> Iterator[StudyCheck]:
    """Whatever is left of people whose data were erased."""
    for participant, how in read_departures(study.store.connection).items():
        left = [] if how is Departure.KEPT else traces(study.folder, participant)
        if how is Departure.ERASED:
            left += left_of(study.folder, participant)
        if how is Departure.ERASING or left:
            where = f": {', '.join(sorted({path.name for path in left}))}" if left else ""
            result = f"the erasure of {participant} is not finished{where}"
            remedy = (
                f"Run again: steerlab study withdraw {quote(str(study.folder))} {participant} "
                "--erase"
            )
            yield StudyCheck(what="Withdrawal", found=result, ok=False, mend=remedy)
        unknown = [path.name for path in unknown_files(study.folder)]
        if how is Departure.ERASED and unknown:
            result = f"{', '.join(unknown)}: not steerlab's; may hold data of {participant}, erased"
            remedy = "Look, and delete what holds any."
            yield StudyCheck(what="Withdrawal", found=result, ok=True, mend=remedy, notice=True)


def _attempts(study: OpenStudy) -> Iterator[StudyCheck]:
    """Attempts that were cut off, and those without a Rerun recording."""
    from steerlab.study.recording.rebuild import recording_file

    if running := study.store.attempts(AttemptStatus.RUNNING):
        result = f"{len(running)} were cut off, or are under way; they are redone on resuming"
        yield StudyCheck(what="Attempts", found=result, ok=True, notice=True)
    folder = study.folder / RECORDINGS
    finished = study.store.attempts(AttemptStatus.FINISHED)
    missing = [a for a in finished if not (folder / recording_file(*a.key)).exists()]
    if missing:
        result = f"{len(missing)} attempts have none; steerlab replay makes them from the database"
        yield StudyCheck(what="Recordings", found=result, ok=True, notice=True)
