"""A study made by the program: three finished, one who taught robots, and three who do not count."""

import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from steerlab.analysis.export.bundle import FORMATS, ExportConfig, write_export
from steerlab.analysis.export.tables import ExportTable
from steerlab.analysis.study_data.whole_study import WholeStudy, read_whole_study
from steerlab.study.contract import Role
from steerlab.study.study import Study
from steerlab.study.study_folder import OpenStudy
from steerlab.study.teaching.contract import all_teachings
from tests.study.conftest import _run_scripted, edit, make_small

OWN_WORDS = "ask Zoë Quimby at 555-0188"
NOTE = "her name is Zoë Quimby"


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """T001 and T002 finished, P001 taught; T003 only answered, T004 declined, P002 is enrolled."""
    made = make_small(tmp_path_factory.mktemp("exported") / "study")
    edit(made, ("starts = 1 ", "starts = 3 "))
    with Study.open(made) as study:
        for seed in (1, 2):
            _run_scripted(study, Role.TRAINING, seed)
        _run_scripted(study, Role.TEST, 7, teachings=all_teachings())
        _answer_by_hand(study, study.enrol(Role.TRAINING).id)
        study.consent(study.enrol(Role.TRAINING).id, given=False)
        study.note(study.enrol(Role.TEST).id, NOTE)
    return made


def _answer_by_hand(study: Study, who: str) -> None:
    """The page about oneself, with words of one's own, and without an age."""
    study.consent(who, given=True)
    given = {
        "fluency": {"f1": 2, "f2": 7, "f3": 1},
        "demographics": {
            "gender": "self_described",
            "gender_own_words": OWN_WORDS,
            "handedness": "left",
            "driving_licence": "no",
            "vision": "corrected",
        },
    }
    for key, answers in given.items():
        for item, value in answers.items():
            study.save_answer(who, "about-you", key, item, value)
    assert not study.submit(who, "about-you")


@pytest.fixture(scope="session")
def whole(folder: Path) -> WholeStudy:
    study = OpenStudy.open(folder, read_only=True)
    try:
        return read_whole_study(study, with_withdrawn=False)
    finally:
        study.store.close()


@pytest.fixture(scope="session")
def exported(whole: WholeStudy, tmp_path_factory) -> tuple[Path, dict[str, ExportTable]]:
    """An export in every format, and its tables by name."""
    out = tmp_path_factory.mktemp("out")
    return out, export_to(out, whole)


def export_to(out: Path, whole: WholeStudy, **settings) -> dict[str, ExportTable]:
    config = ExportConfig(formats=FORMATS, **settings)
    tables = write_export(whole, config, out, version="0.0", progress=lambda what, share: None)
    return {table.name: table for table in tables}


@pytest.fixture
def query(folder: Path) -> Callable[..., list]:
    """``query(sql, ...)``: what the database has, read past the program."""

    def ask(sql: str, *values: object) -> list:
        with sqlite3.connect(f"file:{folder / 'study.db'}?mode=ro", uri=True) as connection:
            return connection.execute(sql, values).fetchall()

    return ask
