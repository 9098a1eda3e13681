"""A study's folder: made from a template, or opened with its database and its frozen protocol."""

import json
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from importlib import resources
from pathlib import Path
from shlex import quote

from steerlab.sim.files.folder_lock import RUN_LOCK, locked
from steerlab.sim.files.reading import reading
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.structured import utf8_text
from steerlab.sim.files.whole_file import rename_durably, workspace
from steerlab.study.contract import StudyError
from steerlab.study.protocol import AnalysisPlan, StudyProtocol
from steerlab.study.protocol_file import (
    PROTOCOL_FILE,
    parse_protocol,
    protocol_sha256,
    read_protocol_text,
    study_questionnaires,
)
from steerlab.study.store.frozen import (
    FrozenProtocol,
    Instrument,
    insert_protocol,
    read_instruments,
    read_protocols,
)
from steerlab.study.store.store import STUDY_FILE, StudyStore
from steerlab.study.surveys.questionnaire import Questionnaire

MODELS = "models"
"""The subfolder of the networks and of the robots' policies."""


def template_names() -> list[str]:
    """The shipped protocols."""
    folder = resources.files("steerlab.assets") / "study_templates"
    names = (file.name for file in folder.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def new_study(folder: Path, template: str) -> None:
    """Write ``study.toml`` and an empty ``study.db`` into a folder, which is made if need be.

    Raises:
        StudyError: there is no such template, the folder holds a study, or it cannot be written.
        LockedOut: another program is making a study there.
    """
    if template not in template_names():
        raise StudyError(f"No template {template!r}; choose one of {', '.join(template_names())}.")
    source = resources.files("steerlab.assets") / "study_templates" / f"{template}.toml"
    text = source.read_text(encoding="utf-8")
    _refuse_what_is_there(folder, text)
    parse_protocol(text, source.name, study_questionnaires(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o700)  # answers and labels are nobody else's business
        with (
            locked(folder, RUN_LOCK, "makes a study in"),
            workspace(folder / "new") as room,
        ):
            _refuse_what_is_there(folder, text)  # of another program meanwhile
            (room / PROTOCOL_FILE).write_text(text, encoding="utf-8")
            StudyStore.create(room / STUDY_FILE).close()
            for name in (PROTOCOL_FILE, STUDY_FILE):
                (room / name).chmod(0o600)
                rename_durably(room / name, folder / name)
    except OSError as error:
        raise StudyError(
            f"Cannot write into {folder}: {refusal(error, 'choose another folder')}."
        ) from error


def _refuse_what_is_there(folder: Path, text: str) -> None:
    protocol = folder / PROTOCOL_FILE
    begun = protocol.is_file() and utf8_text(protocol) == text  # by a call that was cut off
    for path in (folder / STUDY_FILE, *(() if begun else (protocol,))):
        if path.exists():
            raise StudyError(f"{path} exists already; choose another folder.")


@dataclass(frozen=True, kw_only=True, slots=True)
class FrozenPlan:
    """A version of the analysis plan, and since when it has been frozen.

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
    """Hash of what a plan says, however its file is laid out."""
    text = json.dumps(asdict(plan), sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class OpenStudy:
    """An open study, which the other modules work on; it stays in the thread that opened it."""

    folder: Path
    store: StudyStore
    questionnaires: Mapping[str, Questionnaire]
    _parsed: dict[int, StudyProtocol] = field(default_factory=dict)

    @contextmanager
    def reading(self) -> Generator[None]:
        """Read in this block what was kept when it began, whatever others keep meanwhile.

        Raises:
            StudyError: whatever a damaged database makes of the block.
        """
        again = f"steerlab study verify {quote(str(self.folder))}"
        remedy = f"See {again}, or restore the folder's last copy."
        with (
            reading(self.folder / STUDY_FILE, "a study", StudyError, remedy),
            self.store.connection.snapshot(),
        ):
            yield

    @classmethod
    def open(cls, folder: Path, *, read_only: bool = False) -> "OpenStudy":
        """Open a study's folder.

        Raises:
            StudyError: it holds no study.
            StoreError: its database is damaged, locked or of another version of steerlab.
            InvalidConfig: a questionnaire in the folder is wrong.
        """
        if not (folder / STUDY_FILE).is_file():
            raise StudyError(
                f"There is no study in {folder}; make one with: steerlab study new "
                f"{quote(str(folder))}"
            )
        questionnaires = study_questionnaires(folder)
        return cls(
            folder, StudyStore.open(folder / STUDY_FILE, read_only=read_only), questionnaires
        )

    def versions(self) -> list[FrozenProtocol]:
        """The protocol's frozen versions, oldest first; none before the first enrolment."""
        return read_protocols(self.store.connection)

    def protocol_of(self, version: int) -> StudyProtocol:
        """The protocol as that version froze it.

        Raises:
            StudyError: there is no version of that number, or this steerlab cannot read it.
        """
        if version not in self._parsed:
            texts = {frozen.version: frozen.text for frozen in self.versions()}
            if version not in texts:
                raise StudyError(f"{self.folder} has no version {version} of its protocol.")
            name = f"version {version} of {PROTOCOL_FILE}"
            self._parsed[version] = parse_protocol(texts[version], name, self.questionnaires)
        return self._parsed[version]

    def current(self) -> StudyProtocol:
        """The newest frozen version, or the file while nothing is frozen."""
        versions = self.versions()
        return self.protocol_of(versions[-1].version) if versions else self.draft()

    def draft(self) -> StudyProtocol:
        """The protocol as the file has it now.

        Raises:
            StudyError: the file is wrong.
        """
        return self._parse(read_protocol_text(self.folder))

    def analysis_plans(self) -> list[FrozenPlan]:
        """Each analysis plan that was ever in force, oldest first.

        The first was there before the first participant. More than one means that the plan was
        changed while the study ran: a report says so.

        Raises:
            StudyError: nothing is frozen yet, or a frozen version cannot be read.
        """
        query = "SELECT count(*) FROM enrolments WHERE protocol_version < ?"
        plans: list[FrozenPlan] = []
        for version in self.versions():
            plan = self.protocol_of(version.version).plan
            digest = plan_sha256(plan)
            if plans and plans[-1].sha256 == digest:
                continue
            plans.append(
                FrozenPlan(
                    plan=plan,
                    sha256=digest,
                    protocol_version=version.version,
                    protocol_sha256=version.sha256,
                    frozen_utc=version.frozen_utc,
                    enrolled_before=self.store.connection.read(query, version.version)[0][0],
                    why=version.why,
                )
            )
        if not plans:
            raise StudyError(
                f"The analysis plan of {self.folder} is not frozen: nobody is enrolled yet. "
                f"Enrolling the first participant freezes it."
            )
        return plans

    def check_unchanged(self) -> None:
        """Refuse a protocol or a questionnaire that is not as it was frozen.

        Raises:
            StudyError: with both hashes and the first line that differs.
        """
        versions = self.versions()
        if not versions:
            self.draft()
            return
        frozen, text = versions[-1], read_protocol_text(self.folder)
        amend = f'steerlab study amend {quote(str(self.folder))} --why "..."'
        remedy = f"Put it back, or record the change with: {amend}"
        now = protocol_sha256(text)
        if now != frozen.sha256:
            raise StudyError(
                f"{self.folder / PROTOCOL_FILE} was changed after it was frozen: its sha256 is "
                f"{now}, that of version {frozen.version} is {frozen.sha256}. "
                f"{_first_difference(frozen.text, text)} {remedy}"
            )
        for key, kept in read_instruments(self.store.connection, frozen.version).items():
            questionnaire = self.questionnaires.get(key)
            digest = None if questionnaire is None else questionnaire.fingerprint()
            if digest != kept.sha256:
                what = "is missing" if digest is None else f"is {digest} now"
                raise StudyError(
                    f"The questionnaire {key!r} was changed after it was frozen: it was version "
                    f"{kept.version}, sha256 {kept.sha256}, and {what}. {remedy}"
                )

    def freeze(self, why: str) -> int:
        """Keep the file as the protocol's next version; inside a transaction.

        Returns:
            its number.

        Raises:
            StudyError: the file is wrong.
        """
        text = read_protocol_text(self.folder)
        asked = [self.questionnaires[key] for key in self._parse(text).questionnaires]
        return insert_protocol(
            self.store.connection,
            sha256=protocol_sha256(text),
            text=text,
            why=why,
            instruments=[
                Instrument(key=each.key, version=each.version, sha256=each.fingerprint())
                for each in asked
            ],
        )

    def _parse(self, text: str) -> StudyProtocol:
        return parse_protocol(text, str(self.folder / PROTOCOL_FILE), self.questionnaires)


def _first_difference(before: str, after: str) -> str:
    """The first line that differs, as it was and as it is."""
    old, new = before.splitlines(), after.splitlines()
    for number in range(max(len(old), len(new))):
        was = old[number] if number < len(old) else None
        now = new[number] if number < len(new) else None
        if was != now:
            return (
                f"The first difference is line {number + 1}: "
                f"{'there was none' if was is None else f'it was {was!r}'}, "
                f"{'there is none now' if now is None else f'it is {now!r}'}."
            )
    return "Only the ends of lines differ."
