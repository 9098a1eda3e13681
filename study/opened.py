"""An open study: its folder, its database, and the protocol as it was frozen."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from steerlab.study.contract import StudyError
from steerlab.study.protocol import StudyProtocol
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
from steerlab.study.store.store import StudyStore
from steerlab.study.surveys.questionnaire import Questionnaire

DATABASE = "study.db"


@dataclass(frozen=True)
class OpenStudy:
    """What every part of the engine works on; it stays in the thread that opened it."""

    folder: Path
    store: StudyStore
    questionnaires: Mapping[str, Questionnaire]
    _parsed: dict[int, StudyProtocol] = field(default_factory=dict)

    @classmethod
    def open(cls, folder: Path, *, read_only: bool = False) -> "OpenStudy":
        """Open a study's folder.

        Raises:
            StudyError: it holds no study.
            StoreError: its database is damaged, locked or of another version of steerlab.
            InvalidConfig: a questionnaire of its own is wrong.
        """
        if not (folder / DATABASE).is_file():
            raise StudyError(
                f"There is no study in {folder}; make one with: steerlab study new {folder}"
            )
        questionnaires = study_questionnaires(folder)
        return cls(folder, StudyStore.open(folder / DATABASE, read_only=read_only), questionnaires)

    def versions(self) -> list[FrozenProtocol]:
        """The protocol's frozen versions, oldest first; none before the first enrolment."""
        return read_protocols(self.store.connection)

    def protocol_of(self, version: int) -> StudyProtocol:
        """A frozen version.

        Raises:
            StudyError: there is none of that number, or this steerlab cannot read it.
        """
        if version not in self._parsed:
            found = next((one for one in self.versions() if one.version == version), None)
            if found is None:
                raise StudyError(f"{self.folder} has no version {version} of its protocol.")
            name = f"version {version} of {PROTOCOL_FILE}"
            self._parsed[version] = parse_protocol(found.text, name, self.questionnaires)
        return self._parsed[version]

    def current(self) -> StudyProtocol:
        """The newest frozen version, or the file while nothing is frozen."""
        versions = self.versions()
        if versions:
            return self.protocol_of(versions[-1].version)
        return self.draft()

    def draft(self) -> StudyProtocol:
        """The file as it is now.

        Raises:
            StudyError: it is wrong.
        """
        return self._parse(read_protocol_text(self.folder))

    def check_unchanged(self) -> None:
        """Refuse a protocol or a questionnaire that is not as it was frozen.

        Raises:
            StudyError: with both hashes and the first line that differs.
        """
        versions = self.versions()
        if not versions:
            self.current()
            return
        frozen, text = versions[-1], read_protocol_text(self.folder)
        mend = f'Put it back, or record the change with: steerlab study amend {self.folder} --why "..."'
        now = protocol_sha256(text)
        if now != frozen.sha256:
            raise StudyError(
                f"{self.folder / PROTOCOL_FILE} was changed after it was frozen: its sha256 is "
                f"{now}, that of version {frozen.version} is {frozen.sha256}. "
                f"{first_difference(frozen.text, text)} {mend}"
            )
        for key, kept in read_instruments(self.store.connection, frozen.version).items():
            found = self.questionnaires.get(key)
            if found is None or found.fingerprint() != kept.sha256:
                what = "is missing" if found is None else f"is {found.fingerprint()} now"
                raise StudyError(
                    f"The questionnaire {key!r} was changed after it was frozen: it was version "
                    f"{kept.version}, sha256 {kept.sha256}, and {what}. {mend}"
                )

    def freeze(self, why: str) -> int:
        """Keep the file as the next version; inside a transaction.

        Returns:
            its number.

        Raises:
            StudyError: the file is wrong.
        """
        text = read_protocol_text(self.folder)
        protocol = self._parse(text)
        return insert_protocol(
            self.store.connection,
            sha256=protocol_sha256(text),
            text=text,
            why=why,
            instruments=[
                Instrument(key=key, version=one.version, sha256=one.fingerprint())
                for key, one in ((key, self.questionnaires[key]) for key in protocol.questionnaires)
            ],
        )

    def _parse(self, text: str) -> StudyProtocol:
        return parse_protocol(text, str(self.folder / PROTOCOL_FILE), self.questionnaires)


def first_difference(before: str, after: str) -> str:
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
