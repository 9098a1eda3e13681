"""``steerlab study``: a human study from its protocol to its last participant, act by act."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from steerlab.app.commands.arguments import Lsl, Monitor, Sound, TextOrNone, Texts, Windowed
from steerlab.app.commands.printing import print_check, print_json, progress_bar
from steerlab.app.commands.study_copies import Backup, Merge
from steerlab.sim.progress import Progress

if TYPE_CHECKING:
    from steerlab.study.contract import ParticipantView
    from steerlab.study.runner import RunConfig, RunReport
    from steerlab.study.study import Study
    from steerlab.teleop.markers import Markers

Folder = Annotated[
    tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR", help="The study's folder.")
]
Person = Annotated[
    tyro.conf.Positional[str], tyro.conf.arg(metavar="PARTICIPANT", help="Their pseudonym.")
]
RoleName = Annotated[
    Literal["training", "test"],
    tyro.conf.arg(help="Training participants teach the network; test participants use it."),
]
AsJson = Annotated[bool, tyro.conf.arg(name="json", help="Print as JSON.")]


@dataclass(frozen=True, kw_only=True)
class New:
    """Make a study: a protocol to edit, and an empty database."""

    folder: Folder
    template: Annotated[str, tyro.conf.arg(help="The protocol to start from.")] = "mind-meld"

    def do(self) -> int:
        """Write study.toml and study.db."""
        from shlex import quote

        from steerlab.study.study_folder import new_study

        new_study(self.folder, self.template)
        print(f"Made {self.folder}. Edit {self.folder / 'study.toml'}, then enrol:")
        print(f"  steerlab study enrol {quote(str(self.folder))} --role training")
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
            blind = study.design().blind
        if self.as_json:
            print_json(_plain(view, blind=blind))
        else:
            order = f"; order {', '.join(view.order)}" if view.order and not blind else ""
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
            views, blind = study.participants(), study.design().blind
        if self.as_json:
            print_json([_plain(view, blind=blind) for view in views])
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


def _plain(view: "ParticipantView", *, blind: bool) -> dict[str, object]:
    """As JSON; the order is null where the experimenter is not to know it."""
    return {
        "id": view.id,
        "role": view.role.value,
        "standing": view.standing.value,
        "order": None if blind else list(view.order),
        "phases": {phase.id: state.value for phase, state in view.phases},
        "next": view.next_phase.id if view.next_phase else None,
        "progress": view.progress,
        "protocol_version": view.protocol_version,
    }


@dataclass(frozen=True, kw_only=True)
class Run:
    """Do a participant's next phases at the wheel, or a whole scripted participant headless.

    With --teacher and without --participant a new participant is enrolled and goes through all
    phases. Whatever was cut off goes on where it was.
    """

    folder: Folder
    participant: Annotated[TextOrNone, tyro.conf.arg(help="Who sits at the wheel.")] = None
    phase: Annotated[TextOrNone, tyro.conf.arg(help="Only this phase.")] = None
    device: Annotated[
        str, tyro.conf.arg(help="wheel, wheel:NAME, gamepad, keyboard, mouse or trace:FILE.")
    ] = "wheel"
    monitor: Monitor = ""
    windowed: Windowed = False
    sound: Sound = True
    viewer: Annotated[bool, tyro.conf.arg(help="Show the drives live in Rerun as well.")] = False
    recordings: Annotated[bool, tyro.conf.arg(help="Write Rerun recordings.")] = True
    lsl: Lsl = False
    teacher: Annotated[
        TextOrNone, tyro.conf.arg(help="scripted:KIND:SEED, such as scripted:human:3.")
    ] = None
    role: Annotated[
        Literal["training", "test"], tyro.conf.arg(help="Of a new scripted participant.")
    ] = "training"
    plant: Annotated[
        Texts,
        tyro.conf.arg(
            metavar="SCALE:STYLE:R",
            help="Plant a correlation, such as mini_ipip_5.extraversion:gain:0.5.",
        ),
    ] = ()

    def do(self) -> int:
        """Run."""
        from steerlab.sim.errors import InvalidConfig
        from steerlab.study.contract import Role

        if self.participant is None and self.teacher is None:
            raise InvalidConfig("Who runs? Give --participant, or --teacher for a scripted one.")
        if self.plant and self.teacher is None:
            raise InvalidConfig("--plant is for scripted participants; give --teacher as well.")
        from steerlab.study.recording.lsl import lsl_markers, study_source

        with (
            open_study(self.folder) as study,
            lsl_markers(study_source(self.folder) if self.lsl else None) as markers,
            progress_bar() as progress,
        ):
            config = self._config(progress, markers)
            if self.participant is None:
                participant, report = study.run_new(Role(self.role), config)
            else:
                participant, report = self.participant, study.run(self.participant, config)
        return _print_run(participant, report)

    def _config(self, progress: Progress, markers: "Markers | None") -> "RunConfig":
        from steerlab.study.runner import RunConfig
        from steerlab.study.scripted import ScriptedParticipant
        from steerlab.study.teaching.contract import all_teachings
        from steerlab.teleop.screen.config import WindowChoice

        scripted = None
        if self.teacher is not None:
            scripted = ScriptedParticipant.parse(self.teacher, self.plant)
        return RunConfig(
            device=self.device if scripted is None else scripted.device,
            phase=self.phase,
            viewer=self.viewer,
            recordings=self.recordings,
            window=WindowChoice(
                monitor=self.monitor, windowed=self.windowed, silent=not self.sound
            ),
            pages=scripted,
            teachings=all_teachings(),
            markers=markers,
            progress=progress,
        )


@dataclass(frozen=True, kw_only=True)
class Resume:
    """Go on with a participant at the wheel, from the last checkpoint."""

    folder: Folder
    participant: Person
    device: Annotated[str, tyro.conf.arg(help="As for run.")] = "wheel"
    lsl: Lsl = False

    def do(self) -> int:
        """Run."""
        who, device = self.participant, self.device
        return Run(folder=self.folder, participant=who, device=device, lsl=self.lsl).do()


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train the network on the finished training participants, and freeze it.

    Happens by itself when the first test participant needs it. After an erasure that left too few
    people, it also finds anew each w that came from the network that was removed.
    """

    folder: Folder

    def do(self) -> int:
        """Train."""
        with open_study(self.folder) as study, progress_bar() as progress:
            model = study.train(progress)
        print(f"{model.file}, of {', '.join(model.people)}; sha256 {model.sha256}")
        return 0


@dataclass(frozen=True, kw_only=True)
class Verify:
    """Check that what is kept is whole, unchanged and complete; exit code 1 if it is not.

    Who has not finished yet, and what was left out on record, is a note and no defect.
    """

    folder: Folder
    expect_head: Annotated[
        TextOrNone, tyro.conf.arg(help="A head printed earlier; the audit must still hold it.")
    ] = None
    as_json: AsJson = False

    def do(self) -> int:
        """Check."""
        with open_study(self.folder, read_only=True) as study:
            verified = study.verify(expected_head=self.expect_head)
        if self.as_json:
            print_json(
                {"head": verified.head, "findings": [asdict(check) for check in verified.findings]}
            )
        else:
            for check in verified.findings:
                print_check(check)
            print(f"Head of the audit (keep it elsewhere): {verified.head}")
        return 0 if verified.ok else 1


def _print_run(participant: str, report: "RunReport") -> int:
    for line in report.lines:
        print(f"{participant}  {line}")
    waiting = report.waiting
    if waiting is None:
        print(f"{participant} has nothing left to do.")
        return 0
    print(f"{participant} is at {waiting.id} ({waiting.title}), a {waiting.kind} phase.")
    return 0


_Act = Annotated[
    Annotated[New, tyro.conf.subcommand("new")]
    | Annotated[Enrol, tyro.conf.subcommand("enrol")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Resume, tyro.conf.subcommand("resume")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Status, tyro.conf.subcommand("status")]
    | Annotated[Withdraw, tyro.conf.subcommand("withdraw")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
    | Annotated[Backup, tyro.conf.subcommand("backup")]
    | Annotated[Merge, tyro.conf.subcommand("merge")]
    | Annotated[Redo, tyro.conf.subcommand("redo")]
    | Annotated[Note, tyro.conf.subcommand("note")]
    | Annotated[Amend, tyro.conf.subcommand("amend")],
    tyro.conf.arg(name=""),
]


def study(act: _Act) -> int:
    """A human study: protocol, participants, phases, checks, withdrawal.

    Example: steerlab study new my-study --template mind-meld
    """
    return act.do()


def open_study(folder: Path, *, read_only: bool = False) -> "Study":
    """The study in ``folder``; its modules are imported only when it is opened."""
    from steerlab.study.study import Study

    return Study.open(folder, read_only=read_only)
