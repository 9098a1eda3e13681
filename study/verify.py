"""``study verify``: is what is kept whole, unchanged, complete and plausible?"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from steerlab.sim.errors import SteerlabError
from steerlab.study.completeness import person_findings
from steerlab.study.contract import Role, StudyCheck
from steerlab.study.frozen_files import model_findings
from steerlab.study.opened import OpenStudy
from steerlab.study.orders import order_at
from steerlab.study.progress import everybody
from steerlab.study.protocol_file import protocol_sha256
from steerlab.study.recording.session_recorder import RECORDINGS
from steerlab.study.store.answers import ANSWERED, read_responses
from steerlab.study.store.audit import AuditEntry, broken_at
from steerlab.study.store.errors import StoreError
from steerlab.study.store.people import (
    Departure,
    read_departures,
    read_enrolments,
    read_phase_events,
)
from steerlab.study.store.records import AttemptStatus
from steerlab.study.teaching.findings import teaching_findings
from steerlab.study.traces import strangers, traces

PLACEHOLDER = "TO BE REPLACED"


@dataclass(frozen=True, kw_only=True)
class Verified:
    """What was found, and the audit's newest hash: kept elsewhere, it shows a rewritten audit."""

    findings: tuple[StudyCheck, ...]
    head: str

    @property
    def ok(self) -> bool:
        """Nothing is wrong or missing."""
        return all(one.ok for one in self.findings)


def verify(study: OpenStudy, *, expected_head: str | None = None) -> Verified:
    """Check all of a study; changes nothing.

    Args:
        expected_head: an earlier ``Verified.head``, which the audit must still hold.
    """
    database, readable = _database(study)
    if not readable:  # nothing that is read from it means anything
        return Verified(findings=(database,), head="")
    entries = study.store.audit()
    found = [
        database,
        *_audit(entries, expected_head),
        *_answers(study, entries),
        *_protocol(study),
        *_orders(study),
        *_clock(study, entries),
        *_people(study),
        *_inputs(study),
        *model_findings(study),
        *teaching_findings(study),
        *_left_behind(study),
    ]
    return Verified(findings=tuple(found), head=entries[-1].sha256 or "" if entries else "")


def _database(study: OpenStudy) -> tuple[StudyCheck, bool]:
    """What SQLite finds, and whether the rest can be read."""
    connection = study.store.connection
    try:
        found = "; ".join(row[0] for row in connection.read("PRAGMA integrity_check"))
        dangling = connection.read("PRAGMA foreign_key_check") if found == "ok" else []
    except StoreError as error:
        found, dangling = str(error), []
    mend = "Restore the study folder from its last copy."
    if found != "ok":
        return StudyCheck(what="Database", found=found, ok=False, mend=mend), False
    if dangling:
        found = f"{len(dangling)} rows refer to others that are not there"
        return StudyCheck(what="Database", found=found, ok=False, mend=mend), True
    return StudyCheck(what="Database", found="whole", ok=True), True


def _audit(entries: Sequence[AuditEntry], expected: str | None) -> Iterator[StudyCheck]:
    mend = "Somebody changed the database outside steerlab; compare it with the last copy."
    broken = broken_at(list(entries))
    if broken is not None:
        found = f"entry {broken.id} ({broken.act}, {broken.at_utc}) breaks the chain"
        yield StudyCheck(what="Audit", found=found, ok=False, mend=mend)
    elif any(after.id != before.id + 1 for before, after in pairwise(entries)):
        yield StudyCheck(what="Audit", found="entries are missing", ok=False, mend=mend)
    else:
        yield StudyCheck(what="Audit", found=f"{len(entries)} entries, unbroken", ok=True)
    if expected is not None and expected not in [entry.sha256 for entry in entries]:
        found = f"no entry has the hash {expected}"
        yield StudyCheck(what="Audit", found=found, ok=False, mend=mend)


def _answers(study: OpenStudy, entries: Sequence[AuditEntry]) -> Iterator[StudyCheck]:
    """Every answer is the one that the audit sealed, and none that should be there is gone."""
    seals = {
        int(entry.detail.split()[1]): entry.detail for entry in entries if entry.act == ANSWERED
    }
    responses = read_responses(study.store.connection)
    changed = [one.id for one in responses if seals.get(one.id) != one.seal]
    gone = len(seals) - len(responses)
    erased = any(
        how is not Departure.KEPT for how in read_departures(study.store.connection).values()
    )
    mend = "Somebody changed the database outside steerlab; compare it with the last copy."
    if changed:
        found = f"{len(changed)} differ from what the audit sealed, the first is row {changed[0]}"
        yield StudyCheck(what="Answers", found=found, ok=False, mend=mend)
    elif gone and not erased:
        yield StudyCheck(what="Answers", found=f"{gone} are gone", ok=False, mend=mend)
    else:
        yield StudyCheck(what="Answers", found=f"{len(responses)} as they were given", ok=True)


def _protocol(study: OpenStudy) -> Iterator[StudyCheck]:
    versions = study.versions()
    for one in versions:
        if protocol_sha256(one.text) != one.sha256:
            found = f"version {one.version} is not what its hash says"
            mend = "Compare the database with its last copy."
            yield StudyCheck(what="Protocol", found=found, ok=False, mend=mend)
    try:
        study.check_unchanged()
    except SteerlabError as error:
        mend = "Put the file back, or record the change with study amend."
        yield StudyCheck(what="Protocol", found=str(error), ok=False, mend=mend)
    else:
        found = f"version {versions[-1].version}, as frozen" if versions else "not frozen yet"
        yield StudyCheck(what="Protocol", found=found, ok=True)
        if any(PLACEHOLDER in paragraph for paragraph in study.current().consent.text):
            found = f"the consent text is still the template's: it says {PLACEHOLDER}"
            mend = "Put in the text that your ethics committee approved, with the next version."
            yield StudyCheck(what="Consent", found=found, ok=True, mend=mend, notice=True)


def _orders(study: OpenStudy) -> Iterator[StudyCheck]:
    """Every order is the one that the seed gives at that place."""
    places: Counter[str] = Counter()
    wrong: list[str] = []
    for one in read_enrolments(study.store.connection):
        if one.role != Role.TEST:
            continue
        protocol = study.protocol_of(one.protocol_version)
        keys = [condition.key for condition in protocol.conditions]
        index, size = places[one.allocation], protocol.block_size
        places[one.allocation] += 1
        if one.condition_order != order_at(keys, seed=protocol.seed, block_size=size, index=index):
            wrong.append(one.participant)
    if wrong:
        found = f"{', '.join(wrong)} have another order than the protocol's seed gives"
        mend = "Compare the database with its last copy."
        yield StudyCheck(what="Condition orders", found=found, ok=False, mend=mend)
    elif places:
        yield StudyCheck(what="Condition orders", found="as the seed gives them", ok=True)


def _clock(study: OpenStudy, entries: Sequence[AuditEntry]) -> Iterator[StudyCheck]:
    """Times only grow in what is only appended to."""
    acts = read_phase_events(study.store.connection)
    answers = read_responses(study.store.connection)
    for what, times in (
        ("the audit", [entry.at_utc for entry in entries]),
        ("the phases", [act.at_utc for act in acts]),
        ("the answers", [one.at_utc for one in answers]),
    ):
        for before, after in pairwise(times):
            if after < before:
                found = f"in {what}, {after} was written after {before}"
                mend = "The computer's clock was set back; note when, and switch on time service."
                yield StudyCheck(what="Clock", found=found, ok=False, mend=mend)
                return
    yield StudyCheck(what="Clock", found="never ran backwards", ok=True)


def _people(study: OpenStudy) -> Iterator[StudyCheck]:
    finished = study.store.attempts(AttemptStatus.FINISHED)
    for place in everybody(study):
        yield from person_findings(study, place, finished)


def _inputs(study: OpenStudy) -> Iterator[StudyCheck]:
    """Labels of different devices are not pooled unseen."""
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
            found = f"{role} participants steered with {', '.join(kinds)}"
            mend = "Analyse them apart, or leave those out that the protocol did not mean."
            yield StudyCheck(what="Devices", found=found, ok=False, mend=mend)


def _left_behind(study: OpenStudy) -> Iterator[StudyCheck]:
    for participant, how in read_departures(study.store.connection).items():
        left = [] if how is Departure.KEPT else traces(study.folder, participant)
        if how is Departure.ERASING or left:
            found = f"the erasure of {participant} is not finished"
            mend = f"Say again: steerlab study withdraw {study.folder} {participant} --erase"
            yield StudyCheck(what="Withdrawal", found=found, ok=False, mend=mend)
        if how is Departure.ERASED and (others := [path.name for path in strangers(study.folder)]):
            found = f"{', '.join(others)}: not steerlab's; may hold data of {participant}, erased"
            mend = "Look, and delete what holds any."
            yield StudyCheck(what="Withdrawal", found=found, ok=True, mend=mend, notice=True)
    if running := study.store.attempts(AttemptStatus.RUNNING):
        found = f"{len(running)} were cut off, or are under way; they are redone on resuming"
        yield StudyCheck(what="Attempts", found=found, ok=True, notice=True)
    missing = [
        attempt
        for attempt in study.store.attempts(AttemptStatus.FINISHED)
        if not _recorded(study, *attempt.key)
    ]
    if missing:
        found = f"{len(missing)} attempts have none; steerlab replay makes them from the database"
        yield StudyCheck(what="Recordings", found=found, ok=True, notice=True)


def _recorded(study: OpenStudy, participant: str, rollout: str, attempt: int) -> bool:
    from steerlab.study.recording.rebuild import recording_file

    return (study.folder / RECORDINGS / recording_file(participant, rollout, attempt)).exists()
