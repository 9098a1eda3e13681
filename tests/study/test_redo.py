"""Some drives of a calibration are done again, and the others still count."""

import pytest

from steerlab.study.contract import PhaseState, Role, StudyError
from steerlab.study.progress import finished_rollouts
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.store.frozen import read_embeddings
from steerlab.study.study import Study
from steerlab.teleop.timing_limits import TimingViolation

LATE = TimingViolation(name="lateness_p99_ms", value=9.0, limit=2.0)


@pytest.fixture
def tested(trained, run_scripted):
    """A study with a test participant who has calibrated."""
    with Study.open(trained) as study:
        who, _ = run_scripted(study, Role.TEST, 3, phase="consent")
        for phase in ("about-you", "before-practice", "practice", "before-calibration"):
            run_scripted(study, Role.TEST, 3, participant=who, phase=phase)
        for phase in ("calibration", "calibrate-w"):
            run_scripted(study, Role.TEST, 3, participant=who, phase=phase)
        yield study, who


def _counting(study, who):
    """Attempt numbers that count, by rollout."""
    found = finished_rollouts(study._opened, study._progress.of(who))
    return {rollout: attempt.attempt for rollout, attempt in found.items()}


def test_one_drive_is_done_again_and_the_other_stays(tested, run_scripted):
    study, who = tested
    before = read_embeddings(study._opened.store.connection)[who]
    study.redo(who, "calibration", rollouts=["calibration-07"])
    states = {phase.id: state for phase, state in study.participant(who).phases}
    assert states["calibration"] is states["calibrate-w"] is PhaseState.WAITING
    assert _counting(study, who) == {"calibration-05": 0}
    _, report = run_scripted(study, Role.TEST, 3, participant=who, phase="calibration")
    assert report.lines == ("Correcting the robot: 2 of 2 rollouts corrected",)
    assert _counting(study, who) == {"calibration-05": 0, "calibration-07": 1}
    run_scripted(study, Role.TEST, 3, participant=who, phase="calibrate-w")
    after = read_embeddings(study._opened.store.connection)[who]
    assert after.inputs != before.inputs
    assert study.verify().ok


def test_a_whole_redo_after_one_of_a_drive_opens_all(tested):
    study, who = tested
    study.redo(who, "calibration", rollouts=["calibration-07"])
    script = ScriptedParticipant(kind="human", seed=3)
    config = RunConfig(device=script.device, pages=script, recordings=False, phase="calibration")
    study.run(who, config)
    study.redo(who, "calibration")
    assert _counting(study, who) == {}


@pytest.mark.parametrize(
    ("phase", "said"),
    [("calibration", "it has calibration-05, calibration-07"), ("practice", "no")],
)
def test_an_unknown_rollout_opens_nothing(tested, phase, said):
    study, who = tested
    with pytest.raises(StudyError, match=f"has no rollout 'calibration-99'; .*{said}"):
        study.redo(who, phase, rollouts=["calibration-99"])
    assert study.participant(who).next_phase.id == "before-teaching"


def test_drives_say_in_words_what_was_flagged(tested, monkeypatch):
    study, who = tested
    flagged = {"calibration-07": [LATE]}
    store = study._opened.store
    monkeypatch.setattr(
        type(store), "flags", lambda self, attempt: flagged.get(attempt.rollout, [])
    )
    drives = study.drives(who, "calibration")
    assert drives == {"calibration-05": "", "calibration-07": "the computer was late"}
    (timing,) = [one for one in study.findings(who) if one.what == "Timing"]
    assert not timing.ok
    assert "calibration-07 (the computer was late)" in timing.found
    assert "lateness" not in timing.found
    study.redo(who, "calibration", rollouts=["calibration-07"])
    (timing,) = [one for one in study.findings(who) if one.what == "Timing"]
    assert timing.ok  # the flagged drive does not count any more
    assert timing.found == "drives finished: 1"


def test_erasing_a_training_participant_says_first_what_it_touches(tested):
    study, who = tested
    reach = study.erasing_reaches("T001")
    assert reach.network.startswith("models/mind_meld-")
    assert (reach.embeddings, reach.taught) == ((who,), ())
    assert (reach.left, reach.needed) == (1, 2)
    assert study.erasing_reaches(who).network == ""
    count = study.change_count()
    study.erasing_reaches("T001")
    assert study.change_count() == count
