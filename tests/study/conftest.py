"""A small study: two short rollouts, two questionnaires, a network of two epochs."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from steerlab.study.contract import Role
from steerlab.study.runner import RunConfig, RunReport
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study

ROLLOUTS = '["calibration-05", "calibration-07"]'  # the shortest


def edit(folder: Path, *changes: tuple[str, str]) -> None:
    """Change ``study.toml``; what is to be changed must be there."""
    path = folder / "study.toml"
    text = path.read_text()
    for before, after in changes:
        assert before in text, before
        text = text.replace(before, after, 1)
    path.write_text(text)


SHORT = (
    ("rollouts = 12 ", f"rollouts = {ROLLOUTS} "),
    ("minimum_people = 8 ", "minimum_people = 2 "),
    ('preset = "lab"', 'preset = "lab"\nepochs = 2'),
    ("balls = 5", "balls = 1"),
    ("demonstrations = 12 ", "demonstrations = 1 "),
    ('task = "slalom" ', 'task = "easy" '),
    ("gradient_steps = 150 ", "gradient_steps = 5 "),
    ("starts = 10 ", "starts = 1 "),
    ("network_first = true ", "network_first = false "),
)


def make_small(folder: Path) -> Path:
    new_study(folder, "mind-meld")
    text = (folder / "study.toml").read_text()
    asked = text[text.index('questionnaires = [\n  "demographics"') :]
    asked = asked[: asked.index("]") + 1]
    edit(folder, (asked, 'questionnaires = ["fluency", "demographics"]'), *SHORT)
    return folder


def _run_scripted(
    study: Study, role: Role | str, seed: int, *, participant: str | None = None, **more
) -> tuple[str, RunReport]:
    who = participant or study.enrol(Role(role)).id
    script = ScriptedParticipant(kind="human", seed=seed)
    config = RunConfig(device=script.device, pages=script, recordings=False, **more)
    return who, study.run(who, config)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_small(tmp_path / "study")


@pytest.fixture(scope="session")
def trained_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = make_small(tmp_path_factory.mktemp("trained") / "study")
    with Study.open(folder) as study:
        for seed in (1, 2):
            _run_scripted(study, Role.TRAINING, seed)
    return folder


@pytest.fixture
def trained(trained_once: Path, tmp_path: Path) -> Path:
    """A copy of a study in which two training participants have finished."""
    return Path(shutil.copytree(trained_once, tmp_path / "trained"))


@pytest.fixture
def study(folder: Path):
    with Study.open(folder) as opened:
        yield opened


@pytest.fixture
def run_scripted() -> Callable[..., tuple[str, RunReport]]:
    """``run_scripted(study, role, seed)``: enrol a scripted participant and do all phases."""
    return _run_scripted


@pytest.fixture
def change() -> Callable[..., None]:
    """``change(folder, (before, after), ...)`` in ``study.toml``."""
    return edit


@pytest.fixture
def shorten() -> Callable[[Path], None]:
    """``shorten(folder)``: all questionnaires, and little at the wheel."""
    return lambda folder: edit(folder, *SHORT)


@pytest.fixture
def at_about_you(study: Study) -> str:
    """A training participant who has consented, and is at the page ``about-you``."""
    who = study.enrol(Role.TRAINING).id
    study.consent(who, given=True)
    return who
