"""What is kept is sealed in the audit: an edit that gets round the triggers shows."""

import sqlite3

import pytest

from steerlab.study.contract import Role
from steerlab.study.study import Study


def _edit(folder, sql):
    connection = sqlite3.connect(folder / "study.db", isolation_level=None)
    try:
        names = connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'")
        triggers = names.fetchall()
        for name, _ in triggers:
            connection.execute(f'DROP TRIGGER "{name}"')
        assert connection.execute(sql).rowcount > 0
        for _, text in triggers:
            connection.execute(text)
    finally:
        connection.close()


def _checks(folder, what):
    with Study.open(folder, read_only=True) as study:
        return [check for check in study.verify().findings if check.what == what]


def _labels(folder):
    return _checks(folder, "Labels")


@pytest.fixture
def calibrated(trained, run_scripted):
    with Study.open(trained) as study:
        run_scripted(study, Role.TEST, 3)
    return trained


def test_all_is_as_it_was_kept(calibrated):
    (check,) = _labels(calibrated)
    assert check.ok
    assert check.found.endswith("as they were kept")


@pytest.mark.parametrize(
    ("sql", "what"),
    [
        ("UPDATE steps SET teacher_label = teacher_label * 1.01", "attempt"),
        ("UPDATE steps SET oracle_label = 0.0 WHERE step = 3", "attempt"),
        ("DELETE FROM timings WHERE step = 0", "attempt"),
        ("UPDATE attempts SET order_index = order_index + 100", "attempt"),
        ("UPDATE models SET inputs = 'other'", "network 1"),
        ("UPDATE embeddings SET w = '[0.0, 0.0, 0.0, 0.0]'", "w 1"),
    ],
)
def test_an_edit_behind_the_triggers_shows(calibrated, sql, what):
    if "timings" in sql:  # scripts leave none
        sql = sql.replace("DELETE FROM timings", "DELETE FROM steps").replace("= 0", "= 1")
    _edit(calibrated, sql)
    (check,) = _labels(calibrated)
    assert not check.ok
    assert f"differ from what the audit sealed, the first is {what}" in check.found


def test_attempts_that_are_gone_show_unless_their_owner_was_erased(calibrated):
    with Study.open(calibrated) as study:
        study.withdraw("T001", erase=True)
    assert _labels(calibrated)[0].ok
    for table in ("steps", "attempts"):
        _edit(calibrated, f"DELETE FROM {table} WHERE participant = 'T002'")
    (check,) = _labels(calibrated)
    assert not check.ok
    assert "are gone, the first is attempt T002" in check.found


@pytest.mark.parametrize(
    ("table", "what", "said"),
    [
        ("embeddings", "Labels", "1 are gone, the first is w 2"),
        ("responses", "Answers", "1 are gone"),
    ],
)
def test_after_an_erasure_what_others_lose_still_shows(calibrated, run_scripted, table, what, said):
    with Study.open(calibrated) as study:
        run_scripted(study, Role.TEST, 4)
        study.withdraw("P001", erase=True)
    assert all(check.ok for what in ("Labels", "Answers") for check in _checks(calibrated, what))
    _edit(calibrated, f"DELETE FROM {table} WHERE id = (SELECT max(id) FROM {table})")
    (check,) = _checks(calibrated, what)
    assert not check.ok
    assert said in check.found


def test_a_number_that_an_erasure_freed_counts_for_who_gets_it_next(calibrated, run_scripted):
    with Study.open(calibrated) as study:
        study.withdraw("P001", erase=True)  # had the last w and the last answers
        run_scripted(study, Role.TEST, 4)
    assert all(check.ok for what in ("Labels", "Answers") for check in _checks(calibrated, what))
    _edit(calibrated, "DELETE FROM embeddings")
    assert "1 are gone, the first is w 1" in _labels(calibrated)[0].found


def test_an_audit_that_is_not_steerlabs_is_one_finding_each(calibrated):
    _edit(calibrated, "UPDATE audit SET detail = 'x y' WHERE act = 'sealed'")
    (check,) = _labels(calibrated)
    assert not check.ok
    assert "(sealed) says 'x y', which is not as steerlab writes it" in check.found
