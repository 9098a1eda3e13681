"""Whether the audits of studies that were merged into this one are kept as they were."""

from collections.abc import Iterator, Mapping, Sequence

from steerlab.study.contract import StudyCheck
from steerlab.study.store.audit import AuditEntry, broken_at
from steerlab.study.store.merging import MergedStudy, merged_studies

_TAMPERED = "Somebody changed the database outside steerlab; compare it with the last copy."


def merged_findings(
    entries: Sequence[AuditEntry], kept: Mapping[str, Sequence[AuditEntry]]
) -> Iterator[StudyCheck]:
    """Each study that the audit says was taken in has its own, whole, with the head it had then.

    Args:
        entries: of the study's own audit.
        kept: from ``read_merged_audits``.

    Raises:
        StoreError: somebody else wrote into an audit.
    """
    audits = (entries, *kept.values())  # what was merged may have been merged of others before
    said = [merged for audit in audits for merged in merged_studies(audit)]
    problems = [problem for merged in said if (problem := _problem(merged, kept))]
    if extra := set(kept) - {merged.study for merged in said}:
        problems.append(f"the audit knows nothing of study {min(extra)[:12]}")
    for problem in problems:
        yield StudyCheck(what="Merged", found=problem, ok=False, mend=_TAMPERED)
    if said and not problems:
        found = f"{len(said)} studies were taken in, their own audits are kept unbroken"
        yield StudyCheck(what="Merged", found=found, ok=True)


def _problem(merged: MergedStudy, kept: Mapping[str, Sequence[AuditEntry]]) -> str | None:
    audit, name = list(kept.get(merged.study, ())), f"study {merged.study[:12]}"
    if len(audit) != merged.entries:
        return f"the audit of {name} has {len(audit)} of {merged.entries} entries"
    broken = broken_at(audit)
    if broken is not None:
        return f"entry {broken.id} of the audit of {name} breaks its chain"
    if not audit or audit[0].sha256 != merged.study or audit[-1].sha256 != merged.head:
        return f"the audit of {name} is another than the one that was merged"
    return None
