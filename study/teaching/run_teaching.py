"""A participant sits down to teach one condition: task, learner, mapper, device, window, record."""

from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256

from steerlab.learning.agents.catalogue import baseline_of, make_agent
from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.baselines.other_embedding import MeanEmbeddingMapper
from steerlab.learning.checkpoint import load_mapper
from steerlab.learning.mapper import LabelMapper
from steerlab.sim.tasks import make_task
from steerlab.study.recording.session_recorder import STUDY_FILE, SessionInfo, SessionRecorder
from steerlab.study.store.store import StudyStore
from steerlab.study.teaching.conditions import TAUGHT
from steerlab.study.teaching.errors import TeachingError
from steerlab.study.teaching.human_interface import HumanInterface
from steerlab.study.teaching.learning import warm_up
from steerlab.study.teaching.pages import preparing_page
from steerlab.study.teaching.request import TeachRequest
from steerlab.study.teaching.scripted_interface import ScriptedInterface
from steerlab.study.teaching.spec import TeachingSpec
from steerlab.study.teaching.teacher_interface import TeacherInterface
from steerlab.study.teaching.teaching_log import TeachingLog
from steerlab.study.teaching.teaching_loop import TeachingLoop
from steerlab.teleop.devices.contract import Device, DeviceInfo, InputKind
from steerlab.teleop.devices.open import open_device
from steerlab.teleop.latency import input_latency_ms
from steerlab.teleop.screen.drive_screen import open_screen
from steerlab.teleop.screen.resolution import Resolution
from steerlab.teleop.sdl import SdlEvents
from steerlab.teleop.session import SessionConfig

_UNATTENDED = (InputKind.SCRIPTED, InputKind.TRACE)


def teach(request: TeachRequest) -> tuple[bool, str]:
    """Teach one condition from wherever it was left.

    Returns:
        whether it is over now, and what came of it.

    Raises:
        SteerlabError: see ``StudyTeaching``.
    """
    room = _Classroom(request)
    device = request.device
    if isinstance(device, str) and device.partition(":")[0] in _UNATTENDED:
        device = open_device(device)
    with StudyStore.open(request.folder / STUDY_FILE) as store:
        register = TeachingLog(request.folder, store, request.participant, request.phase.id)
        role = store.participants()[request.participant]
        if isinstance(device, str):
            finished = room.attended(device, role, register)
        else:
            finished = room.unattended(device, role, register)
        done = len(register.taught())
    drives = room.rounds + 1
    return finished, f"{'' if finished else 'stopped; '}{done} of {drives} drives taught"


class _Classroom:
    """What a course needs; made ready once somebody is there to wait for it."""

    def __init__(self, request: TeachRequest) -> None:
        self._request = request
        assert request.phase.condition is not None
        self._taught_by = TAUGHT[request.phase.condition]
        self.rounds = request.protocol.demonstrations
        self._agent, self._mapper_sha256 = _agent(request)

    def unattended(self, device: Device, role: str, register: TeachingLog) -> bool:
        """By a script."""
        request = self._request
        device.connect()
        try:
            with self._recorder(role, device.info, None) as recorder:
                host = ScriptedInterface(
                    device, recorder, request.participant, self.rounds, request.progress
                )
                with self._stage() as stage:
                    return self._course(stage, register, host).run()
        finally:
            device.disconnect()

    def attended(self, spec: str, role: str, register: TeachingLog) -> bool:
        """By a person before a window."""
        request, protocol = self._request, self._request.protocol
        display = protocol.display
        with SdlEvents(window=True) as events:
            device = open_device(spec, events, autocentre=protocol.wheel.strength)
            device.connect()
            try:
                with open_screen(events, display.screen()) as screen:
                    screen.show_page(preparing_page())
                    with self._stage() as stage:
                        screen.enter(stage.task.world)  # measures how fast it can draw
                        screen.show_page(preparing_page())
                        with self._recorder(role, device.info, screen.resolution) as recorder:
                            host = HumanInterface(
                                screen=screen,
                                device=device,
                                poll=events.poll,
                                recorder=recorder,
                                participant=request.participant,
                                title=request.phase.title,
                                count=self.rounds + 1,
                                config=self._session(),
                            )
                            return self._course(stage, register, host).run()
            finally:
                device.disconnect()

    @contextmanager
    def _stage(self) -> Iterator[TaskEnv]:
        plan = self._request.protocol.teaching
        task = make_task(plan.task, noise=plan.noise)
        with TaskEnv(task, seed=plan.learner_seed) as stage:
            warm_up(stage, self._agent)
            yield stage

    def _course(
        self, stage: TaskEnv, register: TeachingLog, host: TeacherInterface
    ) -> TeachingLoop:
        request, plan = self._request, self._request.protocol.teaching
        assert request.phase.condition is not None
        subject = TeachingSpec(
            condition=request.phase.condition,
            taught_by=self._taught_by,
            agent=self._agent,
            plan=plan,
            rounds=self.rounds,
            seed=participant_seed(plan.learner_seed, request.participant),
            starts=stage.screened(plan.starts, "judge").starts,
            mapper_sha256=self._mapper_sha256,
        )
        return TeachingLoop(subject, stage, register, host)

    def _session(self) -> SessionConfig:
        protocol = self._request.protocol
        return SessionConfig(
            countdown_s=protocol.display.countdown_s,
            show_agent_wheel=protocol.display.show_agent_wheel,
            gates=protocol.gates,
        )

    def _recorder(
        self, role: str, device: DeviceInfo, resolution: Resolution | None
    ) -> SessionRecorder:
        from steerlab.study.recording.viewer import ViewerProcess

        request, pacing = self._request, self._session().pacing
        plan = request.protocol.teaching
        settings = {
            **request.settings,
            "condition": str(request.phase.condition),
            "hands": self._taught_by.hands.value,
            "task": plan.task,
            "noise": f"{plan.noise:g}",
            "learner_seed": str(plan.learner_seed),
            "show_agent_wheel": str(request.protocol.display.show_agent_wheel).lower(),
        }
        looked: dict[str, object] = {}
        if resolution is not None:
            settings |= {"drawn": str(resolution), "view": request.protocol.display.view}
            looked = {
                "display_hz": pacing.display_hz,
                "screen_px": resolution.window_px,
                "input_latency_ms": input_latency_ms(resolution.frame_ms, pacing),
            }
        info = SessionInfo(
            participant=request.participant,
            role=role,
            device=device,
            control_hz=pacing.control_hz,
            settings=settings,
            **looked,  # pyright: ignore[reportArgumentType]
        )
        return SessionRecorder(
            request.folder,
            info,
            rerun=request.recordings,
            open_viewer=ViewerProcess if request.viewer else None,
            lock=request.lock,
        )


def participant_seed(learner_seed: int, participant: str) -> int:
    """Of a participant's starts, noise, weights and batches, in all their conditions.

    One seed for everybody would make a study of one draw of weights.
    """
    digest = sha256(f"{learner_seed}:{participant}".encode()).digest()
    return int.from_bytes(digest[:4], "little")


def _agent(request: TeachRequest) -> tuple[Agent, str | None]:
    """The learner's parts, and the hash of what maps its labels.

    Raises:
        TeachingError: the mapper does not know the participant.
        InvalidCheckpoint: its file is missing or damaged.
    """
    assert request.phase.condition is not None
    learner = TAUGHT[request.phase.condition].learner
    baseline = baseline_of(learner)
    if baseline is None:
        return make_agent(learner, {}), None
    mapper = load_mapper(request.mapper)
    if request.participant not in mapper.calibrated:
        raise TeachingError(
            f"{request.mapper} holds no w of {request.participant}, so their labels cannot be "
            f"mapped; calibrate them again with: steerlab study redo {request.folder} "
            f"{request.participant} calibration"
        )
    mappers: dict[str, LabelMapper] = {
        "mind_meld": mapper,
        "mean_embedding": MeanEmbeddingMapper(mapper),
    }
    return make_agent(learner, mappers), sha256(request.mapper.read_bytes()).hexdigest()
