"""Acts of ``study`` on protocol and participants: new, enrol, amend, status, note, redo, withdraw."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from steerlab.app.verbs.common import print_json, progress_bar
from steerlab.app.verbs.quick_types import TextOrNone
from steerlab.app.verbs.study_common import AsJson, Folder, Person, RoleName, open_study

if TYPE_CHECKING:
    from steerlab.study.contract import ParticipantView


@dataclass(frozen=True, kw_only=True)
class New:
    """Make a study: a protocol to edit, and an empty database."""

    folder: Folder
    template: Annotated[str, tyro.conf.arg(help="The protocol to start from.")] = "mind-meld"

    def do(self) -> int:
        """Write study.toml and study.db."""
        from steerlab.study.new import new_study

        new_study(self.folder, self.template)
        print(f"Made {self.folder}. Edit {self.folder / 'study.toml'}, then enrol:")
        print(f"  steerlab study enrol {self.folder} --role training")
        return 0


@dataclass(frozen=True, kw_only=True)
class Enrol:
    """Enrol the next participant; pseudonym and condition order are the program's choice."""

    folder: Folder
    role: RoleName
    as_json: AsJson = False

    def do(self) -> int:
        """Enrol."""
        from steerlab.study.contract import Role

        with open_study(self.folder) as study:
            view = study.enrol(Role(self.role))
        if self.as_json:
            print_json(_plain(view))
        else:
            order = f"; order {', '.join(view.order)}" if view.order else ""
            print(f"{view.id}, {view.role}{order}")
        return 0


@dataclass(frozen=True, kw_only=True)
class Amend:
    """Record a changed protocol as a new version; who is enrolled keeps the old one."""

    folder: Folder
    why: Annotated[str, tyro.conf.arg(help="The reason, kept with the version.")]

    def do(self) -> int:
        """Record it."""
        from steerlab.study.contract import Standing

        with open_study(self.folder) as study:
            version = study.amend(self.why)
            views = study.participants()
        print(f"Version {version} of the protocol is frozen.")
        if waiting := [view.id for view in views if view.standing is Standing.ENROLLED]:
            print(
                f"Enrolled before and not begun: {', '.join(waiting)}. They are shown the new "
                "consent text, and go the old way; to let them go the new one, withdraw them and "
                "enrol them anew."
            )
        return 0


@dataclass(frozen=True, kw_only=True)
class Status:
    """Where everyone stands, and what is next."""

    folder: Folder
    as_json: AsJson = False

    def do(self) -> int:
        """Print."""
        with open_study(self.folder, read_only=True) as study:
            views = study.participants()
        if self.as_json:
            print_json([_plain(view) for view in views])
            return 0
        for view in views:
            phase = view.next_phase
            at = f"; next {phase.id} ({phase.title})" if phase else ""
            progress = f", {view.progress}" if view.progress else ""
            print(f"{view.id}  {view.role}  {view.standing}{at}{progress}")
        if not views:
            print("Nobody is enrolled yet.")
        return 0


@dataclass(frozen=True, kw_only=True)
class Note:
    """Keep a remark, about a participant or about the study."""

    folder: Folder
    text: Annotated[str, tyro.conf.arg(help="Never a name.")]
    participant: Annotated[TextOrNone, tyro.conf.arg(help="Whom it is about.")] = None

    def do(self) -> int:
        """Keep it."""
        with open_study(self.folder) as study:
            study.note(self.participant, self.text)
        return 0


@dataclass(frozen=True, kw_only=True)
class Redo:
    """Open a finished phase again; what was recorded stays and no longer counts."""

    folder: Folder
    participant: Person
    phase: Annotated[
        tyro.conf.Positional[str], tyro.conf.arg(metavar="PHASE", help="As in the protocol.")
    ]

    def do(self) -> int:
        """Open it."""
        with open_study(self.folder) as study:
            study.redo(self.participant, self.phase)
        print(f"{self.participant} does {self.phase} again.")
        return 0


@dataclass(frozen=True, kw_only=True)
class Withdraw:
    """Let a participant leave, with their data kept or erased."""

    folder: Folder
    participant: Person
    keep: Annotated[bool, tyro.conf.arg(help="What was recorded stays.")] = False
    erase: Annotated[bool, tyro.conf.arg(help="Everything but a tombstone goes.")] = False

    def do(self) -> int:
        """Withdraw."""
        from steerlab.sim.errors import InvalidConfig

        if self.keep == self.erase:
            raise InvalidConfig("Give either --keep or --erase: what is to become of the data?")
        with open_study(self.folder) as study, progress_bar() as progress:
            study.withdraw(self.participant, erase=self.erase, progress=progress)
        print(f"{self.participant} has left; their data are {'erased' if self.erase else 'kept'}.")
        return 0


def _plain(view: "ParticipantView") -> dict[str, object]:
    return {
        "id": view.id,
        "role": view.role.value,
        "standing": view.standing.value,
        "order": list(view.order),
        "phases": {phase.id: state.value for phase, state in view.phases},
        "next": view.next_phase.id if view.next_phase else None,
        "progress": view.progress,
        "protocol_version": view.protocol_version,
    }
