"""Running a participant's phases at the wheel, from the last checkpoint on."""

from dataclasses import dataclass, field
from shlex import quote
from time import perf_counter_ns
from typing import Protocol

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.files.folder_lock import RUN_LOCK, FolderLock, locked
from steerlab.sim.language import speak
from steerlab.sim.progress import Progress
from steerlab.study.calibration_session import (
    CalibrationSession,
    CalibrationSessionConfig,
    practise,
)
from steerlab.study.contract import PAGES, Phase, PhaseKind, PhaseState, Role, StudyError
from steerlab.study.enrolment import enrol
from steerlab.study.practice_record import Practised
from steerlab.study.progress import ParticipantProgress, finished_rollouts, progress_of
from steerlab.study.protocol import StudyProtocol
from steerlab.study.scripted_practice import practise_scripted
from steerlab.study.store.people import PhaseAct, insert_phase_event
from steerlab.study.study_folder import OpenStudy
from steerlab.study.teaching.conditions import TAUGHT
from steerlab.study.teaching.contract import UNAVAILABLE, Teachings, TeachRequest
from steerlab.teleop.attempt import SessionConfig
from steerlab.teleop.devices.contract import Device, InputKind
from steerlab.teleop.markers import Markers
from steerlab.teleop.practice import PracticeConfig
from steerlab.teleop.screen.config import WindowChoice
from steerlab.teleop.session import SessionEnd


class PageFiller(Protocol):
    """Does a participant's pages: a scripted participant has one, people have the browser."""

    def check(self, protocol: StudyProtocol, study: OpenStudy) -> None:
        """Refuse, before anybody is enrolled, what no page of this protocol can be filled with."""
        ...

    def fill(self, study: OpenStudy, progress: ParticipantProgress, phase: Phase) -> None:
        """Finish the page."""
        ...


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """How a run goes.

    Attributes:
        device: a specification, or a script's device itself.
        phase: only this one; None goes on as far as there is something to do at the wheel.
        window: what was chosen for this computer.
        pages: fills pages; None leaves them to the browser.
        teachings: who can do teaching phases, by condition.
        markers: told of each phase, attempt and step; None for nobody.
    """

    device: str | Device
    phase: str | None = None
    viewer: bool = False
    recordings: bool = True
    window: WindowChoice = field(default_factory=WindowChoice)
    pages: PageFiller | None = None
    teachings: Teachings = field(default_factory=dict)
    markers: Markers | None = None
    progress: Progress = lambda what, share: None


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """What a run did.

    Attributes:
        lines: one about each phase.
        waiting: the page that the browser is to do now, or what was stopped; None at the end.
    """

    lines: tuple[str, ...]
    waiting: Phase | None


def run(study: OpenStudy, participant: str, config: RunConfig) -> RunReport:
    """Do what is next for a participant, phase by phase; stopping and crashes lose no phase.

    Raises:
        StudyError: the participant is elsewhere, the protocol was changed, or no network can be
            trained.
        LockedOut: another run is under way in this study.
        SteerlabError: device, display or disk; what is finished stays.
    """
    study.check_unchanged()
    with locked(study.folder, RUN_LOCK, "runs", about=participant) as lock:
        return _run(study, participant, config, lock)


def run_new(study: OpenStudy, role: Role, config: RunConfig) -> tuple[str, RunReport]:
    """Enrol a participant and do their phases; nobody is enrolled for a run that is refused.

    Returns:
        their pseudonym, and what was done.

    Raises:
        StudyError: the protocol was changed, the phase is not the first, an effect cannot be
            planted, or the network that they need cannot be trained yet.
        LockedOut: another run is under way in this study.
        SteerlabError: device, display or disk; what is finished stays.
    """
    study.check_unchanged()
    with locked(study.folder, RUN_LOCK, "runs") as lock:
        _check_new(study, role, config)
        participant = enrol(study, role)
        return participant, _run(study, participant, config, lock)


def _check_new(study: OpenStudy, role: Role, config: RunConfig) -> None:
    protocol = study.current()
    order = tuple(condition.key for condition in protocol.conditions)
    phases = protocol.phases_for(role, order)
    if config.phase is not None and config.phase != phases[0].id:
        raise StudyError(
            f"A new participant begins with {phases[0].id!r}, so {config.phase!r} cannot be run; "
            "give --participant, or leave --phase out."
        )
    if config.pages is not None:
        config.pages.check(protocol, study)
    if config.phase is None and any(phase.kind is PhaseKind.CALIBRATE_W for phase in phases):
        from steerlab.study.models import check_people, frozen_model  # torch: seconds to import

        if frozen_model(study) is None:
            check_people(study)


def _run(study: OpenStudy, participant: str, config: RunConfig, lock: FolderLock) -> RunReport:
    lines: list[str] = []
    while True:
        place = progress_of(study, participant)
        phase = place.view.next_phase
        if config.phase is not None and (lines or phase is None or phase.id != config.phase):
            if lines:
                return RunReport(lines=tuple(lines), waiting=phase)
            place.phase(config.phase)
            at = f"at {phase.id!r}" if phase else str(place.view.standing)
            raise StudyError(
                f"{participant} is {at}, so {config.phase!r} cannot be run now. To do a "
                f"finished phase again: steerlab study redo {quote(str(study.folder))} "
                f"{participant} {config.phase}"
            )
        if phase is None or (phase.kind in PAGES and config.pages is None):
            return RunReport(lines=tuple(lines), waiting=phase)
        done, line = _Phase(study, place, phase, config, lock).run_marked()
        lines.append(f"{phase.title}: {line}")
        if not done:
            return RunReport(lines=tuple(lines), waiting=phase)


@dataclass(frozen=True)
class _Phase:
    """One phase of one participant."""

    study: OpenStudy
    place: ParticipantProgress
    phase: Phase
    config: RunConfig
    lock: FolderLock

    def run_marked(self) -> tuple[bool, str]:
        """Whether it is over now, and what came of it; its begin and end are marked."""
        speak(self.place.protocol.language)
        self._mark("phase_begin")
        how = "failed"
        try:
            done, line = self._run()
            how = "done" if done else "stopped"
        finally:
            self._mark("phase_end", how=how)
        return done, line

    def _mark(self, what: str, **details: str) -> None:
        if self.config.markers is not None:
            who, phase = self.place.view.id, self.phase
            about = {"participant": who, "phase": phase.id, "kind": phase.kind.value}
            self.config.markers.mark(what, perf_counter_ns(), **about, **details)

    def _run(self) -> tuple[bool, str]:
        if self.phase.kind in PAGES:
            assert self.config.pages is not None
            self.config.pages.fill(self.study, self.place, self.phase)
            return True, "answered"
        match self.phase.kind:
            case PhaseKind.PRACTICE:
                return self._practice()
            case PhaseKind.CALIBRATION:
                return self._calibration()
            case PhaseKind.CALIBRATE_W:
                return self._calibrate_w()
            case _:
                return self._teach()

    def _practice(self) -> tuple[bool, str]:
        device, protocol = self.config.device, self.place.protocol
        kind = device.partition(":")[0] if isinstance(device, str) else device.info.kind
        if kind == InputKind.TRACE:
            return self._skip("a recorded trace has no practice drive in it")
        self._start()
        config = PracticeConfig(
            balls=protocol.practice.balls,
            driven_s=None if (minutes := protocol.practice.minutes) is None else 60.0 * minutes,
            pedals=protocol.practice.pedals,
            seed=protocol.seed,
            time_limit_s=protocol.practice.time_limit_s,
            countdown_s=protocol.display.countdown_s,
            after=self._after(),
        )
        if isinstance(device, str) and kind != InputKind.SCRIPTED:
            screen = self.config.window.of(protocol.display.screen())
            autocentre = protocol.wheel.strength
            result = practise(
                device, config, screen, autocentre=autocentre, markers=self.config.markers
            )
        else:
            result = practise_scripted(config)
        reached = Practised.of(result)
        if result.stopped:  # what this sitting reached; the next one begins anew
            self._record(self.phase, PhaseAct.STARTED, reached.detail)
            return False, f"stopped; {reached}"
        self._record(self.phase, PhaseAct.DONE, reached.detail)
        return True, str(reached)

    def _calibration(self) -> tuple[bool, str]:
        self._start()
        protocol, view = self.place.protocol, self.place.view
        finished = finished_rollouts(self.study, self.place)
        by_name = {rollout.name: rollout for rollout in load_calibration_set()}
        session = CalibrationSession(
            folder=self.study.folder,
            participant=view.id,
            role=view.role.value,
            left=[by_name[name] for name in self.phase.rollouts if name not in finished],
            total=len(self.phase.rollouts),
            config=CalibrationSessionConfig(
                viewer=self.config.viewer,
                recordings=self.config.recordings,
                pictures=False,  # a participant would wait for them; replay draws them
                autocentre=protocol.wheel.strength,
                screen=self.config.window.of(protocol.display.screen()),
                session=SessionConfig(
                    countdown_s=protocol.display.countdown_s,
                    show_agent_wheel=protocol.display.show_agent_wheel,
                    gates=protocol.gates,
                    after=self._after(),
                ),
                settings=self._settings(),
                markers=self.config.markers,
            ),
            lock=self.lock,
        )
        corrected = session.correct(self.config.device, self.config.progress)
        said = f"{corrected.done} of {corrected.total} rollouts corrected"
        if corrected.end is SessionEnd.STOPPED and corrected.done < corrected.total:
            return False, f"stopped; {said}"
        return self._end(PhaseAct.DONE, said)

    def _calibrate_w(self) -> tuple[bool, str]:
        self._start()  # first: the console begins by itself what has not begun
        from steerlab.study.models import calibrate_participant  # torch: seconds to import

        found = calibrate_participant(self.study, self.place.view.id, self.config.progress)
        said = f"w from network {found.model_sha256[:12]}"
        if found.outside:
            said += "; they correct unlike the training participants"
        return self._end(PhaseAct.DONE, said)

    def _teach(self) -> tuple[bool, str]:
        phase, view = self.phase, self.place.view
        assert phase.condition is not None
        teaching = self.config.teachings.get(phase.condition)
        if teaching is None:
            return self._skip(f"teaching with {phase.condition} is {UNAVAILABLE}")
        from steerlab.study.models import frozen_model, person_file

        model = frozen_model(self.study) if TAUGHT[phase.condition].needs_w else None
        if model is None and TAUGHT[phase.condition].needs_w:
            raise StudyError(f"The network of {view.id} was removed; train it again first.")
        self._start()
        taught = teaching.teach(
            TeachRequest(
                folder=self.study.folder,
                participant=view.id,
                phase=phase,
                protocol=self.place.protocol,
                mapper=None if model is None else person_file(self.study, model, view.id),
                device=self.config.device,
                lock=self.lock,
                progress=self.config.progress,
                viewer=self.config.viewer,
                recordings=self.config.recordings,
                window=self.config.window,
                settings=self._settings(),
                markers=self.config.markers,
                after=self._after(),
            )
        )
        if not taught.finished:
            return False, taught.detail
        return self._end(PhaseAct.DONE, taught.detail)

    def _after(self) -> str:
        """The title of what comes next for the participant; empty if nothing does."""
        left = [one for one, state in self.place.view.phases if not state.over]
        return next((one.title for one in left if one.id != self.phase.id), "")

    def _settings(self) -> dict[str, str]:
        """Kept with the session at the wheel."""
        version = self.place.view.protocol_version
        sha256 = self.study.versions()[version - 1].sha256
        return {"phase": self.phase.id, "protocol_version": str(version), "protocol_sha256": sha256}

    def _start(self) -> None:
        if self.place.state(self.phase.id) is PhaseState.WAITING:
            self._record(self.phase, PhaseAct.STARTED, "")

    def _end(self, act: PhaseAct, detail: str) -> tuple[bool, str]:
        self._record(self.phase, act, detail)
        return True, detail

    def _skip(self, why: str) -> tuple[bool, str]:
        """Skip a phase, and the questionnaires about what was not taught in it."""
        about = [
            one
            for one, _ in self.place.view.phases
            if self.phase.condition is not None and one.condition == self.phase.condition
        ]
        connection, who = self.study.store.connection, self.place.view.id
        with connection.transaction(f"skip {self.phase.id!r} of {who!r}", durable=True):
            for one in about or [self.phase]:
                insert_phase_event(connection, who, one.id, PhaseAct.SKIPPED, why)
        return True, f"skipped: {why}"

    def _record(self, phase: Phase, act: PhaseAct, detail: str) -> None:
        connection, who = self.study.store.connection, self.place.view.id
        with connection.transaction(f"keep that {phase.id!r} is {act}", durable=True):
            insert_phase_event(connection, who, phase.id, act, detail)
