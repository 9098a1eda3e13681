"""The study folder: its analysis plan is frozen at the first enrolment; a changed one is a new one."""

import os
import stat

import pytest

from steerlab.study.contract import Role, StudyError
from steerlab.study.study_folder import new_study, plan_sha256


def test_the_plan_is_frozen_before_the_first_participant(study):
    with pytest.raises(StudyError, match="is not frozen: nobody is enrolled yet"):
        study.analysis_plans()
    study.enrol(Role.TEST)
    (frozen,) = study.analysis_plans()
    assert frozen.plan.alpha == 0.05
    assert frozen.plan.correction == "holm"
    primary = [one.id for one in frozen.plan.hypotheses if one.primary]
    assert primary == ["H1", "H3a", "H3b", "H4"]
    assert frozen.sha256 == plan_sha256(frozen.plan)
    assert frozen.protocol_sha256 == study._opened.versions()[0].sha256
    assert (frozen.protocol_version, frozen.enrolled_before) == (1, 0)
    assert frozen.frozen_utc.endswith("Z")


def test_a_plan_that_is_changed_later_is_told_from_the_first(study, folder, change):
    study.enrol(Role.TEST)
    change(folder, ('title = "Practice drive"', 'title = "Warming up"'))
    study.amend("a better title")
    assert len(study.analysis_plans()) == 1  # the plan is the same
    study.enrol(Role.TEST)
    change(folder, ("alpha = 0.05", "alpha = 0.10"))
    study.amend("we would like it to be significant")
    first, second = study.analysis_plans()
    assert (first.plan.alpha, second.plan.alpha) == (0.05, 0.10)
    assert first.sha256 != second.sha256
    assert (second.protocol_version, second.enrolled_before) == (3, 2)
    assert second.why == "we would like it to be significant"


def test_the_file_alone_changes_no_plan(study, folder, change):
    study.enrol(Role.TEST)
    before = study.analysis_plans()
    change(folder, ("alpha = 0.05", "alpha = 0.10"))
    assert study.analysis_plans() == before


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="the modes of POSIX")
def test_a_study_is_its_owners_alone(tmp_path):
    new_study(tmp_path / "study", "mind-meld")
    assert stat.S_IMODE((tmp_path / "study").stat().st_mode) == 0o700
    for name in ("study.db", "study.toml"):
        assert stat.S_IMODE((tmp_path / "study" / name).stat().st_mode) == 0o600


def test_a_study_that_was_cut_off_while_it_was_made_is_made_by_the_same_command(tmp_path):
    new_study(tmp_path / "study", "mind-meld")
    (tmp_path / "study" / "study.db").unlink()
    new_study(tmp_path / "study", "mind-meld")
    assert (tmp_path / "study" / "study.db").exists()
    with pytest.raises(StudyError, match=r"study\.db exists already"):
        new_study(tmp_path / "study", "mind-meld")
    (tmp_path / "study" / "study.db").unlink()
    (tmp_path / "study" / "study.toml").write_text("edited", encoding="utf-8")
    with pytest.raises(StudyError, match=r"study\.toml exists already"):
        new_study(tmp_path / "study", "mind-meld")
    assert (tmp_path / "study" / "study.toml").read_text(encoding="utf-8") == "edited"
