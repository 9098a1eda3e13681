"""A study in which a test participant is about to teach, in a world of a few metres."""

import shutil
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from steerlab.sim.files.folder_lock import RUN_LOCK, locked
from steerlab.sim.geometry import Pose2D
from steerlab.sim.tasks import Task, make_task
from steerlab.sim.world import WorldSpec
from steerlab.study.contract import Phase, PhaseKind, Role
from steerlab.study.models import frozen_model, person_file
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.store.store import StudyStore
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study
from steerlab.study.teaching import run_teaching
from steerlab.study.teaching.contract import StudyTeaching, TeachingResult, TeachRequest

CHANGES = (
    ("rollouts = 12 ", 'rollouts = ["calibration-05", "calibration-07"] '),  # the shortest
    ("minimum_people = 8 ", "minimum_people = 2 "),
    ('preset = "lab"', 'preset = "lab"\nepochs = 2'),
    ("demonstrations = 12 ", "demonstrations = 2 "),
    ("gradient_steps = 150", "gradient_steps = 6"),
    ("starts = 10 ", "starts = 2 "),
    ("tries = 10 ", "tries = 2 "),
    ("noise = 0.5 ", "noise = 0.2 "),
    ("countdown_s = 3.0", "countdown_s = 0.6"),
    ("after = [", "# after = ["),
)


def short_task(name: str, *, noise: float) -> Task:
    """A few seconds' drive to a ball straight ahead."""
    world = WorldSpec(name="short", ball_xy_m=(-22.0, 0.0), start=Pose2D(-40.0, 0.0, 0.0))
    task = make_task(name, noise=noise)
    driving = replace(task.driving, time_limit_s=6.0, start_jitter_m=0.2, start_jitter_rad=0.02)
    return replace(task, world=world, driving=driving)


def make_school(folder: Path) -> Path:
    """Two training participants have finished, and P001 is about to teach."""
    new_study(folder, "mind-meld")
    path = folder / "study.toml"
    text = path.read_text()
    asked = text[text.index('questionnaires = [\n  "demographics"') :]
    asked = asked[: asked.index("]") + 1]
    for before, after in ((asked, 'questionnaires = ["fluency"]'), *CHANGES):
        assert before in text, before
        text = text.replace(before, after, 1)
    path.write_text(text)
    with Study.open(folder) as study:
        for seed, role in ((1, Role.TRAINING), (2, Role.TRAINING), (3, Role.TEST)):
            script = ScriptedParticipant(kind="human", seed=seed)
            who = study.enrol(role).id
            while (phase := study.participant(who).next_phase) is not None:
                if phase.kind is PhaseKind.TEACH:
                    break
                config = RunConfig(
                    device=script.device, pages=script, recordings=False, phase=phase.id
                )
                study.run(who, config)
    return folder


@pytest.fixture(scope="session")
def school_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_school(tmp_path_factory.mktemp("school") / "study")


@pytest.fixture
def folder(school_once: Path, tmp_path: Path) -> Path:
    """A copy of its own."""
    return Path(shutil.copytree(school_once, tmp_path / "study"))


@pytest.fixture
def short_world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_teaching, "make_task", short_task)


@pytest.fixture
def script() -> ScriptedParticipant:
    """P001."""
    return ScriptedParticipant(kind="human", seed=3)


@pytest.fixture
def store(folder: Path):
    with StudyStore.open(folder / "study.db") as store:
        yield store


@pytest.fixture
def teach(folder: Path, script: ScriptedParticipant) -> Callable[..., TeachingResult]:
    """``teach(condition, device=, rounds=, participant=)``: P001 teaches it as phase teach-1."""

    def teach(
        condition: str, *, rounds: int = 1, participant: str = "P001", **more
    ) -> TeachingResult:
        with asked(folder, script, condition, rounds, participant, **more) as request:
            return StudyTeaching().teach(request)

    return teach


@contextmanager
def asked(folder, script, condition, rounds, participant, *, device=None, plan=None):
    with Study.open(folder, read_only=True) as study:
        opened = study._opened
        protocol = opened.current()
        mapper = person_file(opened, frozen_model(opened), participant)
    protocol = replace(protocol, demonstrations=rounds)
    if plan:
        protocol = replace(protocol, teaching=replace(protocol.teaching, **plan))
    phase = Phase(id="teach-1", kind=PhaseKind.TEACH, title="Teaching", condition=condition)
    with locked(folder, RUN_LOCK, "tests") as lock:
        yield TeachRequest(
            folder=folder,
            participant=participant,
            phase=phase,
            protocol=protocol,
            mapper=mapper,
            device=device or script.device,
            lock=lock,
            progress=lambda what, share: None,
            recordings=False,
        )
