"""A participant sits down to teach one condition: task, learner, mapper, device, window, record."""

from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from shlex import quote

import numpy as np

from steerlab.learning.agents.catalogue import baseline_of, make_agent
from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching import (
    BallNeverReached,
    Judging,
    RoundDiverged,
    TeachingConfig,
    TeachingLoop,
    TeachingSpec,
)
from steerlab.learning.agents.teaching_contract import TeacherInterface
from steerlab.learning.baselines.ablations import MeanEmbeddingMapper
from steerlab.learning.checkpoint import load_mapper
from steerlab.learning.mapper import LabelMapper
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows
from steerlab.sim.tasks import make_task
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.study.store.store import STUDY_FILE, StudyStore
from steerlab.study.store.teaching import read_taught
from steerlab.study.teaching.conditions import TAUGHT
from steerlab.study.teaching.contract import TeachingError, TeachRequest
from steerlab.study.teaching.human_interface import HumanInterface
from steerlab.study.teaching.pages import preparing_page
from steerlab.study.teaching.scripted_interface import ScriptedInterface
from steerlab.study.teaching.teaching_log import StudyTeachingLog
from steerlab.teleop.attempt import Recorder, SessionConfig
from steerlab.teleop.devices.contract import Device, DeviceInfo, InputKind
from steerlab.teleop.devices.open import open_device
from steerlab.teleop.markers import marked
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.seat import seated

_UNATTENDED = (InputKind.SCRIPTED, InputKind.TRACE)


def teach(request: TeachRequest) -> tuple[bool, str]:
    """Teach one condition from wherever it was left.

    Returns:
        whether it is over now, and what came of it.

    Raises:
        SteerlabError: see ``StudyTeaching``.
    """
    device = request.device
    if isinstance(device, str) and device.partition(":")[0] in _UNATTENDED:
        device = open_device(device)
    with StudyStore.open(request.folder / STUDY_FILE) as store:
        teaching = _ConditionTeaching(request, store)
        if isinstance(device, str):
            finished = teaching.attended(device)
        else:
            finished = teaching.unattended(device)
        done = len(read_taught(store.connection, request.participant, request.phase.id))
    drives = request.protocol.demonstrations + 1
    return finished, f"{'' if finished else 'stopped; '}{done} of {drives} drives taught"


class _ConditionTeaching:
    """What it takes to teach one condition; made ready once somebody is there to wait for it."""

    def __init__(self, request: TeachRequest, store: StudyStore) -> None:
        self._request, self._store = request, store
        assert request.phase.condition is not None
        self._condition = request.phase.condition
        self._mode = TAUGHT[self._condition]
        self._rounds = request.protocol.demonstrations
        self._role = store.participants()[request.participant]
        self._agent, self._mapper_sha256 = _agent(request)

    def unattended(self, device: Device) -> bool:
        """By a script."""
        request = self._request
        device.connect()
        try:
            with self._recorder(device.info, None) as recorder:
                interface = ScriptedInterface(
                    device,
                    self._marked(recorder, device.info),
                    participant=request.participant,
                    mode=self._mode,
                    rounds=self._rounds,
                    progress=request.progress,
                )
                with self._env() as env:
                    return self._teach(env, interface)
        finally:
            device.disconnect()

    def attended(self, spec: str) -> bool:
        """By a person before a window."""
        request, protocol = self._request, self._request.protocol
        display = request.window.of(protocol.display.screen())
        with seated(spec, display, autocentre=protocol.wheel.strength) as seat:
            screen, device = seat.screen, seat.device
            screen.show_page(preparing_page())
            with self._env() as env:
                screen.enter(env.task.world)  # measures how fast it can draw
                screen.show_page(preparing_page())
                with self._recorder(device.info, screen) as recorder:
                    interface = HumanInterface(
                        screen=screen,
                        device=device,
                        poll=seat.events.poll,
                        recorder=self._marked(recorder, device.info),
                        participant=request.participant,
                        mode=self._mode,
                        title=request.phase.title,
                        count=self._rounds + 1,
                        config=self._session(),
                    )
                    return self._teach(env, interface)

    @contextmanager
    def _env(self) -> Iterator[TaskEnv]:
        plan = self._request.protocol.teaching
        task = make_task(plan.task, noise=plan.noise)
        with TaskEnv(task, seed=plan.learner_seed) as env:
            warm_up(env, self._agent)
            yield env

    def _teach(self, env: TaskEnv, interface: TeacherInterface) -> bool:
        """The loop, from wherever it was left; False if it was stopped."""
        request, plan = self._request, self._request.protocol.teaching
        who = request.participant
        starts = env.screened(plan.starts, "judge").starts
        spec = TeachingSpec(
            teacher=who,
            agent=self._agent,
            config=TeachingConfig(
                rounds=self._rounds,
                evaluate_every=1,
                tries=plan.tries,
                training=PolicyTrainingConfig(steps=plan.gradient_steps, rate=plan.rate),
            ),
            judging=Judging(on_the_way=starts, at_the_end=starts),
            seed=participant_seed(plan.learner_seed, who),
        )
        log = StudyTeachingLog(
            request.folder,
            self._store,
            env,
            participant=who,
            phase=request.phase.id,
            condition=self._condition,
            mapper_sha256=self._mapper_sha256,
        )
        try:
            return TeachingLoop(spec, env, log, interface).run()
        except BallNeverReached as error:
            raise BallNeverReached(
                f"{error} All of them are kept. Run the phase again for {plan.tries} more, after "
                f"some practice; for participants yet to come a new version of the protocol may "
                f"have less teaching.noise."
            ) from error
        except RoundDiverged as error:
            raise TeachingError(
                f"Round {error.round_number} of {who} cannot be learnt from: {error} The drive is "
                f"kept and the robot is as it was before; run the phase again to drive this round "
                f"anew. If that does not help, look at the labels, and at teaching.rate."
            ) from error

    def _session(self) -> SessionConfig:
        protocol = self._request.protocol
        return SessionConfig(
            countdown_s=protocol.display.countdown_s,
            show_agent_wheel=protocol.display.show_agent_wheel,
            gates=protocol.gates,
            after=self._request.after,
        )

    def _marked(self, recorder: SessionRecorder, device: DeviceInfo) -> Recorder:
        who, markers = self._request.participant, self._request.markers
        return marked(recorder, markers, participant=who, device=device.name)

    def _recorder(self, device: DeviceInfo, screen: DriveScreen | None) -> SessionRecorder:
        from steerlab.study.recording.viewer import ViewerProcess

        request, pacing = self._request, self._session().pacing
        plan = request.protocol.teaching
        settings = {
            **request.settings,
            "condition": self._condition,
            "hands": self._mode.hands.value,
            "task": plan.task,
            "noise": f"{plan.noise:g}",
            "learner_seed": str(plan.learner_seed),
            "show_agent_wheel": str(request.protocol.display.show_agent_wheel).lower(),
        }
        info = SessionInfo(
            participant=request.participant,
            role=self._role,
            device=device,
            control_hz=pacing.control_hz,
            settings=settings,
        )
        return SessionRecorder(
            request.folder,
            info.before(screen, pacing),
            rerun=request.recordings,
            open_viewer=ViewerProcess if request.viewer else None,
            lock=request.lock,
        )


def warm_up(env: TaskEnv, agent: Agent) -> None:
    """Do once what takes seconds the first time: the person rests no longer for it.

    Imports and compiles; nothing of it stays in the learner that is taught.
    """
    env.oracle(env.driving.state)
    seen = env.look()
    idle = PolicyLearner(
        0,
        members=agent.ensemble,
        doubts=agent.doubts,
        training=PolicyTrainingConfig(steps=2, batch_size=1),
    )
    rows = TrainingRows(seen, np.zeros(1), np.ones(1))
    idle.act(seen)
    idle.train([rows, rows])


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
    assert request.mapper is not None
    mapper = load_mapper(request.mapper)
    if request.participant not in mapper.calibrated:
        raise TeachingError(
            f"{request.mapper} holds no w of {request.participant}, so their labels cannot be "
            f"mapped; calibrate them again with: steerlab study redo {quote(str(request.folder))} "
            f"{request.participant} calibration"
        )
    mappers: dict[str, LabelMapper] = {
        "mind_meld": mapper,
        "mean_embedding": MeanEmbeddingMapper(mapper),
    }
    return make_agent(learner, mappers), sha256(request.mapper.read_bytes()).hexdigest()
