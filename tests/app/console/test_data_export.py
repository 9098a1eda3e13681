"""The button "Export data": a .zip of the study, for who signed in, and a sentence where there is none."""

import asyncio
import io
import shutil
import zipfile
from pathlib import Path

import pytest

from steerlab.app.console import texts
from steerlab.app.console.data_export import DataExport
from steerlab.study.contract import Role, StudyError
from steerlab.study.study import Study
from tests.study.conftest import _run_scripted, make_small


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder = make_small(tmp_path_factory.mktemp("console") / "study")
    with Study.open(folder) as study:
        _run_scripted(study, Role.TRAINING, 1)
    return folder


@pytest.fixture
def folder(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "study"))


def test_the_page_offers_every_format(lab):
    lab.sign_in()
    page = lab.get("/").text
    assert texts.EXPORT_DO in page
    for format in texts.EXPORT_FORMATS:
        assert f'value="{format}"' in page


def test_nothing_leaves_without_signing_in_or_by_a_form_of_others(lab):
    assert lab.act("/export", format="csv").status_code == 401
    lab.sign_in()
    assert lab.act("/export", format="csv", csrf="wrong").status_code == 403
    assert lab.get("/export").status_code == 405


def test_a_format_there_is_none_of_and_a_study_that_is_none_are_said(lab):
    lab.sign_in()
    answer = lab.act("/export", format="xlsx")
    assert answer.status_code == 409
    assert "choose one of csv, spss, parquet, psych-ds" in answer.text
    answer = lab.act("/export", format="csv")  # the study in memory has no folder
    assert answer.status_code == 409
    assert "There is no study in" in answer.text
    assert "Traceback" not in answer.text


@pytest.mark.slow
def test_the_same_state_is_packed_to_the_same_bytes_and_kept_in_the_study(folder):
    async def twice():
        exports = DataExport(folder)
        return await asyncio.gather(exports.packed("csv"), exports.packed("csv"))

    first, second = asyncio.run(twice())
    assert first == second
    with zipfile.ZipFile(io.BytesIO(first.content)) as archive:
        names = {name.partition("/")[2] for name in archive.namelist()}
    assert {"codebook.csv", "csv/participants.csv", "load.R", "README.txt"} <= names
    kept = folder / "exports" / "csv" / "csv" / "participants.csv"
    assert kept.is_file()
    with pytest.raises(StudyError, match="The format is 'xlsx'"):
        asyncio.run(DataExport(folder).packed("xlsx"))


@pytest.mark.browser
@pytest.mark.slow
def test_the_experimenter_downloads_a_zip(chromium, serving, folder, tmp_path):
    with serving(lambda: Study.open(folder), folder) as (address, links, _):
        page = chromium.new_context(accept_downloads=True).new_page()
        page.set_default_timeout(60_000)
        page.goto(f"{address}/enter/{links[-1]}")
        page.get_by_label(texts.EXPORT_FORMATS["spss"]).check()
        with page.expect_download() as downloading:
            page.get_by_role("button", name=texts.EXPORT_DO).click()
        downloading.value.save_as(tmp_path / "got.zip")
        assert downloading.value.suggested_filename.endswith("-spss.zip")
        assert page.get_by_role("heading", name=texts.PEOPLE).is_visible()  # still there
        page.context.close()
    with zipfile.ZipFile(tmp_path / "got.zip") as archive:
        assert any(name.endswith("/spss/participants.sav") for name in archive.namelist())
