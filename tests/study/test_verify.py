"""``verify`` finds what was edited, what is missing, and what is not plausible."""

import pytest

from steerlab.study import verify as verification
from steerlab.study.contract import Role
from steerlab.study.store.audit import read_audit
from steerlab.study.store.connection import connect
from steerlab.study.store.records import Flag
from steerlab.study.study import Study


@pytest.fixture
def done(study, run_scripted):
    """One training participant who finished; nothing is wrong."""
    run_scripted(study, Role.TRAINING, 1)
    assert study.verify().ok
    return study


def tamper(study: Study, *statements: str) -> None:
    """What somebody with a database tool can do: drop the triggers, change rows, put them back."""
    raw = connect(study.folder / "study.db", read_only=False)
    raw.execute("PRAGMA foreign_keys = OFF")
    triggers = raw.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
    for name, _ in triggers:
        raw.execute(f"DROP TRIGGER {name}")
    for statement in statements:
        raw.execute(statement)
    for _, sql in triggers:
        raw.execute(sql)
    raw.close()


def bad(study: Study, **how) -> dict[str, str]:
    return {one.what: one.found for one in study.verify(**how).findings if not one.ok}


@pytest.mark.parametrize(
    "edit",
    [
        "UPDATE audit SET detail = 'T009 to version 1' WHERE act = 'consent given'",
        "UPDATE audit SET at_utc = '2020-01-01T00:00:00.000Z' WHERE id = 2",
        "UPDATE audit SET act = 'consent refused' WHERE act = 'consent given'",
        "DELETE FROM audit WHERE id = 3",
        "INSERT INTO audit (id, at_utc, act, detail) VALUES (999, '2030', 'x', 'y')",
        "UPDATE audit SET sha256 = NULL WHERE id = 4",
    ],
)
def test_an_edited_audit_is_found(done, edit):
    tamper(done, edit)
    assert "breaks the chain" in bad(done)["Audit"]


def test_a_shortened_audit_is_found_by_a_head_that_was_kept(done):
    head = done.verify().head
    assert head == read_audit(done._opened.store.connection.sqlite)[-1].sha256
    done.note(None, "later")
    assert "Audit" not in bad(done, expected_head=head)
    tamper(done, "DELETE FROM audit WHERE id > 5", "DELETE FROM responses")
    assert "no entry has the hash" in bad(done, expected_head=head)["Audit"]


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ("UPDATE responses SET value = '7' WHERE id = 1", "differ from what the audit sealed"),
        ("UPDATE responses SET participant = 'T002' WHERE id = 1", "differ from what the audit"),
        ("DELETE FROM responses WHERE id = 1", "1 are gone"),
        (
            "INSERT INTO responses SELECT 999, participant, phase, phase_run, questionnaire, item, "
            "'7', at_utc, nonce FROM responses WHERE id = 1",
            "differ from what the audit sealed",
        ),
    ],
)
def test_edited_answers_are_found(done, edit, said):
    value = done._opened.store.connection.read("SELECT value FROM responses WHERE id = 1")
    assert value != [("7",)]
    tamper(done, edit)
    assert said in bad(done)["Answers"]


def test_missing_answers_and_rollouts_of_finished_phases_are_found(done):
    tamper(
        done,
        "DELETE FROM responses WHERE item = 'gender'",
        "UPDATE attempts SET status = 'abandoned' WHERE rollout = 'calibration-07'",
    )
    found = [one.found for one in done.verify().findings if one.what == "T001" and not one.ok]
    assert any("lacks answers: demographics.gender" in one for one in found)
    assert any("calibration is done, but lacks calibration-07" in one for one in found)


def test_an_answer_out_of_range_is_found(done):
    tamper(done, "UPDATE responses SET value = '99' WHERE questionnaire = 'fluency'")
    assert "must be a whole number from 1 to 7" in bad(done)["T001"]


def test_who_has_not_finished_yet_is_a_notice_and_no_defect(done):
    who = done.enrol(Role.TEST).id
    assert done.verify().ok
    (told,) = [one for one in done.verify().findings if one.what == who]
    assert told.notice
    assert told.found.startswith("not finished yet: 15 of 15 phases are left, next consent")
    done.withdraw(who, erase=False)
    assert not any("not finished" in one.found for one in done.verify().findings)


def test_an_order_that_the_seed_does_not_give_is_found(done):
    done.enrol(Role.TEST)
    assert "Condition orders" not in bad(done)
    tamper(
        done,
        """UPDATE enrolments SET condition_order = '["x", "y", "z"]' WHERE participant = 'P001'""",
    )
    assert "P001 have another order" in bad(done)["Condition orders"]


def test_a_clock_that_was_set_back_is_found(done):
    tamper(done, "UPDATE phase_events SET at_utc = '2020-01-01T00:00:00.000Z' WHERE id = 3")
    assert "in the phases" in bad(done)["Clock"]


def test_different_devices_in_one_role_are_found(done):
    tamper(
        done,
        "INSERT INTO sessions SELECT 'x', participant, started_utc, 'keyboard', device_name, "
        "device_guid, profile_sha256, force_feedback, device_details, screen_px, "
        "display_hz, control_hz, input_latency_ms, settings, steerlab_version, "
        "environment FROM sessions",
    )
    assert "keyboard, scripted" in bad(done)["Devices"]
    (device, *_) = [one for one in done.findings("T001") if not one.ok]
    assert "keyboard, scripted" in device.found


def test_flagged_attempts_are_listed(done, monkeypatch):
    flags = [Flag(name="overrun_share", value=0.2, bound=0.001)]
    monkeypatch.setattr(done._opened.store, "flags", lambda attempt: flags)
    assert "could not keep time in calibration-05 (steps took too long)" in bad(done)["T001"]
    timing = [one for one in done.findings("T001") if one.what == "Timing"]
    assert [(one.ok, "calibration-05 (steps took too long)" in one.found) for one in timing] == [
        (False, True)
    ]


def test_a_changed_or_missing_network_is_found(done, run_scripted, folder):
    run_scripted(done, Role.TRAINING, 2)
    run_scripted(done, Role.TEST, 3)
    assert done.verify().ok
    (network,) = (folder / "models").glob("mind_meld-????????????.safetensors")
    content = network.read_bytes()
    network.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert "was changed" in bad(done)["Network"]
    network.unlink()
    assert "is missing" in bad(done)["Network"]


def test_a_questionnaire_that_changed_is_found(done, monkeypatch):
    frozen = done._opened.questionnaires["fluency"]
    from dataclasses import replace

    changed = {**done._opened.questionnaires, "fluency": replace(frozen, title="Other words")}
    object.__setattr__(done._opened, "questionnaires", changed)
    assert "The questionnaire 'fluency' was changed after it was frozen" in bad(done)["Protocol"]


def test_a_damaged_database_is_found(done, folder):
    query = "SELECT rootpage FROM sqlite_master WHERE name = 'responses_of'"
    ((page,),) = done._opened.store.connection.read(query)
    done.close()
    raw = bytearray((folder / "study.db").read_bytes())
    start = (page - 1) * 4096 + 8
    raw[start : start + 200] = bytes(200)
    (folder / "study.db").write_bytes(raw)
    with Study.open(folder, read_only=True) as study:
        (found,) = study.verify().findings
    assert not found.ok
    assert "Restore the study folder" in found.mend


def test_missing_recordings_are_only_a_notice(done, folder):
    (notice,) = [one for one in done.verify().findings if one.what == "Recordings"]
    assert notice.ok
    assert "2 attempts have none" in notice.found


def test_what_is_not_steerlabs_is_told_after_an_erasure(done, folder):
    (folder / "my tables").mkdir()
    assert not any("my tables" in one.found for one in done.verify().findings)
    done.withdraw("T001", erase=True)
    (found,) = [one for one in done.verify().findings if "my tables" in one.found]
    assert found.notice
    assert "may hold data of T001" in found.found
    assert (folder / "my tables").is_dir()


def test_findings_of_a_participant_before_and_after_they_sat_down(done):
    who = done.enrol(Role.TRAINING).id
    assert done.findings(who) == []
    found = {one.what: one.found for one in done.findings("T001")}
    assert found["Device"] == "scripted-human-1 (scripted)"
    assert found["Timing"] == "drives finished: 2"


def test_a_consent_text_that_nobody_wrote_is_told(done, folder, change):
    (told,) = [one for one in done.verify().findings if one.what == "Consent"]
    assert told.notice
    change(folder, ("TO BE REPLACED", "Written"), ("version = 1", "version = 2"))
    done.amend("the committee's text")
    assert not any(one.what == "Consent" for one in done.verify().findings)


def test_a_protocol_that_cannot_be_read_is_a_finding(study, folder, change):
    change(folder, ('key = "bc"', 'key = "bcc"'))
    assert "$.conditions[1].key is 'bcc'" in bad(study)["Protocol"]


def test_verify_changes_nothing(done, folder):
    with Study.open(folder, read_only=True) as reader:
        before = reader.change_count()
        assert reader.verify().ok
        assert reader.change_count() == before


def test_what_others_keep_while_it_checks_is_no_finding(done, monkeypatch):
    """The audit was read before an answer and its seal came."""
    who = done.enrol(Role.TRAINING).id
    done.consent(who, given=True)
    real = verification._answers

    def meanwhile(*arguments):
        with Study.open(done.folder) as other:
            other.save_answer(who, "about-you", "fluency", other_item(other), 3)
        return real(*arguments)

    def other_item(other):
        return other.questionnaire("fluency").items[0].id

    monkeypatch.setattr(verification, "_answers", meanwhile)
    with Study.open(done.folder, read_only=True) as reader:
        assert bad(reader) == {}
        monkeypatch.undo()
        assert bad(reader) == {}
        assert list(reader.answers(who, "about-you", "fluency").values()) == [3]
