"""Running at the wheel: what is next, resuming, locks, redoing, and the hook for learners."""

import os
import re
import shutil
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from steerlab.app.cli import main
from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.folder_lock import RUN_LOCK, LockedOut, locked
from steerlab.sim.rollout import Outcome
from steerlab.study import runner, scripted
from steerlab.study.contract import PhaseKind, PhaseState, Role, Standing, StudyError
from steerlab.study.models import frozen_model
from steerlab.study.practice_record import Practised, practised
from steerlab.study.progress import progress_of
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.scripted_practice import practise_scripted
from steerlab.study.store.frozen import read_embeddings
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import StudyStore
from steerlab.study.study import Study
from steerlab.study.teaching.contract import TeachingResult
from steerlab.teleop.practice import PracticeConfig, PracticeResult


def fill_pages_until(study: Study, who: str, phase: str) -> None:
    script = ScriptedParticipant(kind="human", seed=1)
    while (at := study.participant(who).next_phase).id != phase:
        script.fill(study._opened, progress_of(study._opened, who), at)


def states(study: Study, who: str) -> dict[str, PhaseState]:
    return {phase.id: state for phase, state in study.participant(who).phases}


def test_a_run_stops_where_the_browser_goes_on(study, monkeypatch):
    who = study.enrol(Role.TRAINING).id
    device = RunConfig(device="wheel", recordings=False)
    report = study.run(who, device)
    assert (report.lines, report.waiting.id) == ((), "consent")
    fill_pages_until(study, who, "practice")
    drives = []

    def drive(spec, config, screen, *, autocentre, markers):
        drives.append((spec, config.balls, config.seed, screen.width, autocentre))
        return PracticeResult(balls=3, crashes=1, driven_s=61.5, stopped=len(drives) == 1)

    monkeypatch.setattr(runner, "practise", drive)
    report = study.run(who, device)
    assert report.lines == (
        "Practice drive: stopped; 3 balls reached, 1 blocks hit, 61.5 s driven",
    )
    assert states(study, who)["practice"] is PhaseState.STARTED
    report = study.run(who, device)
    assert report.waiting.id == "before-calibration"
    assert states(study, who)["practice"] is PhaseState.DONE
    assert drives == [("wheel", 1, 2021, 960, 0.3)] * 2
    reached = practised(progress_of(study._opened, who), "practice")
    assert reached == Practised(balls=6, blocks_hit=2, driven_s=123.0)  # both sittings
    study.redo(who, "practice")
    assert practised(progress_of(study._opened, who), "practice").balls == 0


def test_only_the_next_phase_can_be_run(study):
    who = study.enrol(Role.TRAINING).id
    with pytest.raises(StudyError, match="T001 is at 'consent', so 'calibration' cannot be run"):
        study.run(who, RunConfig(device="wheel", phase="calibration"))
    with pytest.raises(StudyError, match="has no phase 'teach-1'"):
        study.run(who, RunConfig(device="wheel", phase="teach-1"))
    fill_pages_until(study, who, "practice")
    report = study.run(who, RunConfig(device="scripted:human:2", phase="practice"))
    (line,) = report.lines
    assert re.fullmatch(r"Practice drive: 1 balls reached, 0 blocks hit, \d+\.\d s driven", line)
    assert report.waiting.id == "before-calibration"


def test_scripts_practise_in_the_worlds_of_people_and_give_up_in_a_sentence():
    for pedals in (True, False):
        result = practise_scripted(PracticeConfig(balls=4, pedals=pedals, seed=0))
        assert (result.balls, result.crashes) == (4, 1)  # the fourth world has a block ahead
        assert not result.stopped
        assert result.driven_s > 10.0
    with pytest.raises(SteerlabError, match="reached 0 of 1 balls"):
        practise_scripted(PracticeConfig(balls=1, time_limit_s=0.5))


def test_a_trace_has_no_practice_in_it(study, tmp_path):
    who = study.enrol(Role.TRAINING).id
    fill_pages_until(study, who, "practice")
    report = study.run(who, RunConfig(device=f"trace:{tmp_path / 'x'}", phase="practice"))
    assert report.lines == (
        "Practice drive: skipped: a recorded trace has no practice drive in it",
    )


def test_a_session_says_under_which_protocol_it_was(study, run_scripted):
    who, _ = run_scripted(study, Role.TRAINING, 1)
    (session,) = study._opened.store.sessions().values()
    assert session.settings == {
        "phase": "calibration",
        "protocol_version": "1",
        "protocol_sha256": study._opened.versions()[0].sha256,
        "show_agent_wheel": "false",
    }
    assert study.participant(who).standing is Standing.FINISHED


def test_redoing_calibration_makes_new_attempts_count_and_w_anew(study, run_scripted):
    for seed in (1, 2):
        run_scripted(study, Role.TRAINING, seed)
    who, _ = run_scripted(study, Role.TEST, 3)
    connection = study._opened.store.connection
    before = read_embeddings(connection)[who]
    study.redo(who, "calibration")
    assert states(study, who)["calibration"] is PhaseState.WAITING
    assert states(study, who)["calibrate-w"] is PhaseState.WAITING
    assert states(study, who)["debrief"] is PhaseState.DONE
    assert study.participant(who).standing is Standing.RUNNING
    run_scripted(study, Role.TEST, 3, participant=who)
    mine = [a for a in study._opened.store.attempts() if a.participant == who]
    assert [a.attempt for a in mine] == [0, 0, 1, 1]
    after = read_embeddings(connection)[who]
    assert after.inputs != before.inputs  # other attempts, other noise
    assert after.model_sha256 == before.model_sha256
    assert np.isfinite(after.w).all()
    with pytest.raises(StudyError, match="has learnt from T001's labels"):
        study.redo("T001", "calibration")
    study.redo("T001", "about-you")


def test_w_waits_until_enough_people_have_finished(study, run_scripted):
    run_scripted(study, Role.TRAINING, 1)
    with pytest.raises(StudyError, match=r"1 training participants have finished.* asks for 2"):
        run_scripted(study, Role.TEST, 3)
    assert study.participant("P001").next_phase.id == "calibrate-w"
    run_scripted(study, Role.TRAINING, 2)
    _, report = run_scripted(study, Role.TEST, 3, participant="P001")
    assert report.lines[0].startswith("Learning how you correct: w from network")
    assert frozen_model(study._opened).people == ("T001", "T002")
    with pytest.raises(StudyError, match="is frozen since"):
        study.train(lambda what, share: None)


def test_a_w_is_the_same_for_the_same_labels(study, run_scripted, tmp_path):
    for seed in (1, 2):
        run_scripted(study, Role.TRAINING, seed)
    for _ in range(2):
        run_scripted(study, Role.TEST, 5)
    first, second = read_embeddings(study._opened.store.connection).values()
    np.testing.assert_allclose(first.w, second.w, rtol=0, atol=1e-6)
    assert first.covariance.shape == (len(first.w), len(first.w))


class Learner:
    def __init__(self):
        self.asked = []

    def teach(self, request):
        self.asked.append((request.phase.id, request.phase.condition, request.mapper is not None))
        return TeachingResult(finished=len(self.asked) > 1, detail=f"call {len(self.asked)}")


def test_what_can_be_taught_is_taught_and_the_rest_is_skipped_on_record(study, run_scripted):
    for seed in (1, 2):
        run_scripted(study, Role.TRAINING, seed)
    learner = Learner()
    teachings = {"dagger": learner, "mind_meld": learner}
    who, report = run_scripted(study, Role.TEST, 3, teachings=teachings)
    assert report.waiting.kind is PhaseKind.TEACH  # the first call was stopped
    _, report = run_scripted(study, Role.TEST, 3, participant=who, teachings=teachings)
    assert report.waiting is None
    view = study.participant(who)
    by_condition = {
        phase.condition: (phase.id, state)
        for phase, state in view.phases
        if phase.kind is PhaseKind.TEACH
    }
    assert by_condition["bc"][1] is PhaseState.SKIPPED
    assert by_condition["dagger"][1] is by_condition["mind_meld"][1] is PhaseState.DONE
    after = {
        phase.condition: state
        for phase, state in view.phases
        if phase.kind is PhaseKind.QUESTIONNAIRES and phase.condition
    }
    assert after == {
        "bc": PhaseState.SKIPPED,
        "dagger": PhaseState.DONE,
        "mind_meld": PhaseState.DONE,
    }
    order = [condition for _, condition, _ in learner.asked]
    assert list(dict.fromkeys(order)) == [one for one in view.order if one != "bc"]
    assert {mapped: condition == "mind_meld" for _, condition, mapped in learner.asked} == {
        True: True,
        False: False,
    }
    said = [one.found for one in study.verify().findings if one.what == who]
    assert any("teaching with bc is not available in this version" in one for one in said)
    study.redo(who, by_condition["bc"][0])  # a later version may have it
    assert study.participant(who).next_phase.condition == "bc"


def test_scripts_answer_about_a_condition_by_what_they_saw_of_it(
    trained, run_scripted, monkeypatch, tmp_path
):
    """The same person, but for how often the robots reached the ball."""
    shutil.copytree(trained, tmp_path / "other")
    felt = {}
    for folder, outcome in (
        (trained, Outcome.BALL_REACHED),
        (tmp_path / "other", Outcome.BLOCK_HIT),
    ):
        rounds = [SimpleNamespace(outcome=outcome)] * 2
        monkeypatch.setattr(scripted, "read_taught", lambda *_, rounds=rounds: rounds)
        learner = Learner()
        learner.asked.append(())  # so that no call is stopped
        teachings = dict.fromkeys(("bc", "dagger", "mind_meld"), learner)
        with Study.open(folder) as study:
            who, _ = run_scripted(study, Role.TEST, 3, teachings=teachings)
            felt[outcome] = [
                sum(study.answers(who, f"after-teach-{n}", "fluency").values()) for n in (1, 2, 3)
            ]
            about_you = study.answers(who, "about-you", "fluency")
        felt.setdefault("before", about_you)
        assert felt["before"] == about_you
    assert sum(felt[Outcome.BALL_REACHED]) > sum(felt[Outcome.BLOCK_HIT])


HOLDER = """
import sys
from pathlib import Path
from steerlab.sim.files.folder_lock import RUN_LOCK, locked

with locked(Path(sys.argv[1]), RUN_LOCK, "runs"):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_run_is_refused_with_the_pid_of_the_first_and_a_dead_one_is_taken_over(
    study, folder, capsys
):
    who = study.enrol(Role.TRAINING).id
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert holder.stdout.readline() == "held\n"
    config = RunConfig(device="scripted:human:1")
    with pytest.raises(LockedOut, match=f"process {holder.pid}") as refused:
        study.run(who, config)
    assert refused.value.pid == holder.pid
    for act in (
        ["run", str(folder), "--participant", who, "--device", "scripted:human:1"],
        ["resume", str(folder), who],
        ["withdraw", str(folder), who, "--erase"],
        ["train", str(folder)],
    ):
        assert main(["study", *act]) == 2
        assert f"process {holder.pid}" in " ".join(capsys.readouterr().err.split())
    os.kill(holder.pid, signal.SIGKILL)
    holder.wait()
    holder.stdin.close()
    holder.stdout.close()
    assert study.run(who, config).waiting.id == "consent"


KILLED = """
import os, signal, sys
from pathlib import Path
from steerlab.study.recording.writer import AttemptWriter
from steerlab.study import models, pages, runner
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.study import Study

folder, who, where = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
count = 0

def die_at(number, call):
    def wrapped(*arguments, **named):
        global count
        count += 1
        if count == number:
            os.kill(os.getpid(), signal.SIGKILL)
        return call(*arguments, **named)
    return wrapped

what, number = where.split(":")
if what == "phase":  # as a phase begins or ends
    runner.insert_phase_event = die_at(int(number), runner.insert_phase_event)
elif what == "answer":
    pages.insert_response = die_at(int(number), pages.insert_response)
elif what == "step":
    AttemptWriter._keep_step = die_at(int(number), AttemptWriter._keep_step)
elif what == "network":  # trained, its file not yet in the database
    models.insert_model = die_at(1, models.insert_model)
elif what == "w":
    models.insert_embedding = die_at(1, models.insert_embedding)
script = ScriptedParticipant(kind="human", seed=3)
with Study.open(folder) as study:
    study.run(who, RunConfig(device=script.device, pages=script, recordings=False))
print("survived")
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "where",
    ["answer:2", "phase:1", "phase:2", "phase:3", "step:200", "network:1", "w:1", "phase:5"],
)
def test_a_run_that_was_killed_goes_on_where_it_was(trained, run_scripted, where):
    """Afterwards everything is as if nothing had happened, but for the attempt that was cut off."""
    folder = trained
    with Study.open(folder) as study:
        who = study.enrol(Role.TEST).id
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(folder), who, where], capture_output=True, text=True
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    with Study.open(folder) as again:
        before = states(again, who)
        kept = again.answers(who, "about-you", "fluency")
        run_scripted(again, Role.TEST, 3, participant=who)
        after = states(again, who)
        for phase, state in before.items():  # nothing that was done is done again
            if state is PhaseState.DONE:
                acts = [
                    one.detail
                    for one in again._opened.store.audit()
                    if one.act == "phase done" and one.detail == f"{who} {phase}"
                ]
                assert len(acts) == 1
        assert set(after.values()) == {PhaseState.DONE, PhaseState.SKIPPED}
        assert kept.items() <= again.answers(who, "about-you", "fluency").items()
        script = ScriptedParticipant(kind="human", seed=3)
        from steerlab.study.scripted_answers import AnswerModel, ScriptedRespondent

        respondent = ScriptedRespondent(who, script.teacher.style, 3, AnswerModel())
        for key in ("fluency", "demographics"):
            asked = again.questionnaire(key)
            assert again.answers(who, "about-you", key) == respondent.answers(
                asked, phase="about-you"
            )
        assert again.verify().ok
    with StudyStore.open(folder / "study.db", read_only=True) as store:
        mine = [a for a in store.attempts() if a.participant == who]
        finished = [a.rollout for a in mine if a.status is AttemptStatus.FINISHED]
        assert sorted(finished) == ["calibration-05", "calibration-07"]
        cut = [a for a in mine if a.status is not AttemptStatus.FINISHED]
        assert len(cut) == (where.startswith("step"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--role", "test"], "mapper.minimum_people"),
        (["--phase", "calibration"], "begins with 'consent'"),
        (["--phase", "nonsense"], "begins with 'consent'"),
        (["--plant", "mini_ipip_5.extraversion:gain:0.5"], "mini_ipip_5"),
    ],
)
def test_nobody_is_enrolled_for_a_run_that_is_refused(folder, arguments, said, capsys):
    command = ["study", "run", str(folder), "--teacher", "scripted:human:1", *arguments]
    assert main(command) == 2
    assert said in capsys.readouterr().err
    with locked(folder, RUN_LOCK, "runs"):
        assert main(command[:5]) == 2
    with Study.open(folder, read_only=True) as study:
        assert study.participants() == []


def test_a_note_is_text(study):
    study.note(None, "asked for a break\r\nand\u00a0tea\t\U0001f469\u200d\U0001f52c")
    for bad in ("a\x1b[2Jb", "a\x00b", "a\u202eb", "a\x7fb", "\udce9"):
        with pytest.raises(StudyError, match="nobody can read"):
            study.note(None, bad)
        with pytest.raises(StudyError):
            study.amend(bad)
    assert [text for _, text in study.notes(None)] == [
        "asked for a break\nand\u00a0tea\t\U0001f469\u200d\U0001f52c"
    ]
