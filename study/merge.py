"""``study merge``: one study of two that ran on computers of their own, under one protocol.

The merged study goes on from the first: it begins as a copy of it, and takes in the second's
participants. The protocols may differ in the prefixes of pseudonyms, and must, or they would clash.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, fields, replace
from itertools import permutations
from pathlib import Path

from steerlab.sim.files.output_folder import output_folder
from steerlab.sim.names import alike, both_shown
from steerlab.study.backup import (
    check_apart,
    check_copy,
    check_nobody_half_erased,
    copy_folder,
    copy_study,
    keep_private,
)
from steerlab.study.contract import Role, StudyError
from steerlab.study.derived import ErasureGuard
from steerlab.study.protocol import StudyProtocol
from steerlab.study.store.copying import copy_database
from steerlab.study.store.frozen import read_instruments, read_models
from steerlab.study.store.merging import MergedStudy, read_merged_audits, take_in
from steerlab.study.store.people import Departure, read_departures, read_enrolments
from steerlab.study.store.store import STUDY_FILE, StudyStore
from steerlab.study.study_folder import MODELS, OpenStudy
from steerlab.study.verify import Verified, verify

_MUST_BE_WHOLE = ("Database", "Audit", "Merged", "Answers", "Labels", "Protocol", "Withdrawal")
"""What ``verify`` must find in order in both: what is merged is sealed anew."""
_SECOND = "second.db"

Order = tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Merge:
    """What came of it.

    Attributes:
        taken: the second study, as the merged one's audit names it.
        participants: of the first, and of the second.
        orders: how many test participants have each condition order, in the first and the second;
            whose data were erased do not count.
        network: the study whose network is in use; it has learnt from nobody of the other.
        verified: what ``verify`` says of the merged study.
    """

    taken: MergedStudy
    participants: tuple[tuple[str, ...], tuple[str, ...]]
    orders: Mapping[Order, tuple[int, int]]
    network: Path | None
    verified: Verified


def merge(first: Path, second: Path, out: Path) -> Merge:
    """Make a new study at ``out`` that goes on from the first and holds the second as well.

    Both stay as they are; go on in the merged one alone.

    Raises:
        StudyError: they are one study, differ in what they did, have participants of the same
            name, two networks, an unfinished erasure, or damage; nothing was made.
        SteerlabError: something cannot be read or written, or somebody was erased meanwhile.
    """
    one, other = (OpenStudy.open(folder, read_only=True) for folder in (first, second))
    with one.store, other.store:
        guards = [ErasureGuard.of(folder) for folder in (first, second)]
        _check(one, other, out)
        orders, network = _orders(one, other), _network(one, other)
        people = tuple(one.store.participants()), tuple(other.store.participants())
        with (
            output_folder(out, placing=_placing(guards)) as fresh,
            guards[0].reading(),
            guards[1].reading(),
        ):
            copy_study(one, fresh)
            copy_folder(second / MODELS, fresh / MODELS)
            copy_database(other.store.connection, fresh / _SECOND)
            with StudyStore.open(fresh / STUDY_FILE) as store:
                taken = take_in(store.connection, fresh / _SECOND)
            (fresh / _SECOND).unlink()
            keep_private(fresh)
    return Merge(
        taken=taken,
        participants=people,
        orders=orders,
        network=network,
        verified=check_copy(out),
    )


@contextmanager
def _placing(guards: Sequence[ErasureGuard]) -> Iterator[None]:
    with ExitStack() as stack:
        for guard in guards:
            stack.enter_context(guard.placing())
        yield


def _check(one: OpenStudy, other: OpenStudy, out: Path) -> None:
    """Everything that can be wrong, before anything is made.

    Raises:
        StudyError: the first thing that is.
    """
    if out.is_dir() and any(out.iterdir()):
        raise StudyError(f"{out} is not empty; give the merged study a new folder with --out.")
    for study in (one, other):
        check_apart(study.folder, out)
        if not study.versions():
            raise StudyError(f"Nobody is enrolled in {study.folder}; there is nothing to merge.")
    if _audits(one) & _audits(other):
        raise StudyError(
            f"{one.folder} and {other.folder} are the same study, or one is a copy of the other; "
            "merge studies in which people were enrolled apart from each other."
        )
    for study in (one, other):
        check_nobody_half_erased(study)
    _check_protocols(one, other)
    _check_people(one, other)
    rollouts = other.store.rollouts()
    for name, rollout in one.store.rollouts().items():
        if rollouts.get(name, rollout) != rollout:
            raise StudyError(
                f"{one.folder} and {other.folder} have different drives under the name {name!r}, "
                "as different versions of steerlab make them; labels of them cannot be put together."
            )
    networks = [_in_use(study) for study in (one, other)]
    if all(networks) and networks[0] != networks[1]:
        raise StudyError(
            f"{one.folder} and {other.folder} have each a network of their own, and test "
            "participants are compared under one; merge training participants before the network "
            "is trained, and let test participants come to the merged study."
        )
    for study in (one, other):
        _check_whole(study)


def _audits(study: OpenStudy) -> set[str]:
    """The first hash of the study's audit, and of those that were merged into it."""
    return {study.store.audit()[0].sha256 or "", *read_merged_audits(study.store.connection)}


def _check_protocols(one: OpenStudy, other: OpenStudy) -> None:
    counts = [len(study.versions()) for study in (one, other)]
    if counts[0] != counts[1]:
        raise StudyError(
            f"{one.folder} has {counts[0]} versions of its protocol and {other.folder} "
            f"{counts[1]}; record the same amendments in both, with study amend, before merging."
        )
    for number in range(1, counts[0] + 1):
        plans = [_without_prefixes(study.protocol_of(number)) for study in (one, other)]
        names = [field.name for field in fields(StudyProtocol)]
        if differing := [n for n in names if getattr(plans[0], n) != getattr(plans[1], n)]:
            raise StudyError(
                f"{one.folder} and {other.folder} differ in {', '.join(differing)} of version "
                f"{number} of their protocols; only studies that differ in training_prefix and "
                "test_prefix alone can be merged."
            )
        asked = [read_instruments(study.store.connection, number) for study in (one, other)]
        if differing := [key for key in asked[0] if asked[0][key] != asked[1].get(key)]:
            raise StudyError(
                f"{one.folder} and {other.folder} asked different questionnaires under the name "
                f"{differing[0]!r} (version {number} of their protocols); answers to them cannot "
                "be put together."
            )


def _without_prefixes(protocol: StudyProtocol) -> StudyProtocol:
    return replace(protocol, training_prefix="T", test_prefix="P")


def _check_people(one: OpenStudy, other: OpenStudy) -> None:
    names, others = list(one.store.participants()), list(other.store.participants())
    if both := [name for name in names if name in others]:
        more = f" and {len(both) - 1} more" if len(both) > 1 else ""
        raise StudyError(
            f"{one.folder} and {other.folder} both have a participant {both[0]}{more}; give each "
            "computer a training_prefix and a test_prefix of its own before its first enrolment."
        )
    if pair := alike((*names, *others)):
        raise StudyError(f"Participants {both_shown(*pair)}; they cannot be in one study.")


def _check_whole(study: OpenStudy) -> None:
    for check in verify(study).findings:
        if check.what in _MUST_BE_WHOLE and not check.ok:
            raise StudyError(
                f"{study.folder} cannot be merged as it is. {check.what}: "
                f"{check.found.rstrip('.')}. {check.mend}"
            )


def _in_use(study: OpenStudy) -> str | None:
    """The hash of the network in use."""
    models = read_models(study.store.connection)
    return next((one.sha256 for one in reversed(models) if one.removed_utc is None), None)


def _network(one: OpenStudy, other: OpenStudy) -> Path | None:
    return next((study.folder for study in (one, other) if _in_use(study)), None)


def _orders(one: OpenStudy, other: OpenStudy) -> dict[Order, tuple[int, int]]:
    counts = _orders_of(one), _orders_of(other)
    keys = [condition.key for condition in one.current().conditions]
    known = dict.fromkeys((*permutations(keys), *counts[0], *counts[1]))
    return {order: (counts[0][order], counts[1][order]) for order in known}


def _orders_of(study: OpenStudy) -> Counter[Order]:
    gone = read_departures(study.store.connection)
    return Counter(
        person.condition_order
        for person in read_enrolments(study.store.connection)
        if person.role == Role.TEST and gone.get(person.participant) is not Departure.ERASED
    )
