"""Acts of ``study`` that take their time: run, resume, train, verify."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from steerlab.app.verbs.common import print_json, progress_bar
from steerlab.app.verbs.quick_types import TextOrNone, Texts
from steerlab.app.verbs.study_common import AsJson, Folder, Person, open_study

if TYPE_CHECKING:
    from steerlab.study.contract import StudyCheck
    from steerlab.study.runner import RunConfig, RunReport


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
    viewer: Annotated[bool, tyro.conf.arg(help="Show the drives live in Rerun as well.")] = False
    recordings: Annotated[bool, tyro.conf.arg(help="Write Rerun recordings.")] = True
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
        with open_study(self.folder) as study, progress_bar() as progress:
            config = self._config(progress)
            participant = self.participant or study.enrol(Role(self.role)).id
            report = study.run(participant, config)
        return _say_run(participant, report)

    def _config(self, progress: Callable[[str, float], None]) -> "RunConfig":
        from steerlab.study.runner import RunConfig
        from steerlab.study.scripted import ScriptedParticipant
        from steerlab.study.teaching.study_teaching import all_teachings

        scripted = None
        if self.teacher is not None:
            scripted = ScriptedParticipant.parse(self.teacher, self.plant)
        return RunConfig(
            device=self.device if scripted is None else scripted.device,
            phase=self.phase,
            viewer=self.viewer,
            recordings=self.recordings,
            pages=scripted,
            teachings=all_teachings(),
            progress=progress,
        )


@dataclass(frozen=True, kw_only=True)
class Resume:
    """Go on with a participant at the wheel, from the last checkpoint."""

    folder: Folder
    participant: Person
    device: Annotated[str, tyro.conf.arg(help="As for run.")] = "wheel"

    def do(self) -> int:
        """Run."""
        return Run(folder=self.folder, participant=self.participant, device=self.device).do()


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
                {"head": verified.head, "findings": [asdict(one) for one in verified.findings]}
            )
        else:
            for one in verified.findings:
                _say_finding(one)
            print(f"Head of the audit (keep it elsewhere): {verified.head}")
        return 0 if verified.ok else 1


def _say_run(participant: str, report: "RunReport") -> int:
    for line in report.lines:
        print(f"{participant}  {line}")
    waiting = report.waiting
    if waiting is None:
        print(f"{participant} has nothing left to do.")
        return 0
    print(f"{participant} is at {waiting.id} ({waiting.title}), a {waiting.kind} phase.")
    return 0


def _say_finding(finding: "StudyCheck") -> None:
    verdict = "BAD " if not finding.ok else "note" if finding.notice else "ok  "
    print(f"{verdict} {finding.what}: {finding.found}")
    if finding.mend:
        print(f"       mend: {finding.mend}")
