"""study.toml: the template, and everything that can be wrong in one."""

import re
from pathlib import Path

import pytest

from steerlab.app.cli import main
from steerlab.learning.agents.catalogue import baseline_of
from steerlab.sim.errors import InvalidConfig
from steerlab.study.contract import PhaseKind, Role, Standing, StudyError
from steerlab.study.protocol_file import parse_protocol, study_questionnaires
from steerlab.study.store.records import AttemptStatus
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study, template_names
from steerlab.study.teaching.conditions import TAUGHT

SHORTER = (
    ("balls = 5", "balls = 1"),
    ("demonstrations = 12 ", "demonstrations = 1 "),
    ('task = "slalom" ', 'task = "easy" '),
    ("gradient_steps = 150 ", "gradient_steps = 5 "),
    ("starts = 10 ", "starts = 1 "),
)
ORDER = ("dagger", "bc", "mind_meld")


@pytest.fixture
def text(tmp_path: Path) -> str:
    new_study(tmp_path / "template", "mind-meld")
    return (tmp_path / "template" / "study.toml").read_text()


def parse(text: str):
    return parse_protocol(text, "my/study.toml", study_questionnaires(Path("nowhere")))


def test_the_template_is_the_papers_procedure(text):
    protocol = parse(text)
    assert template_names() == ["label-only", "mind-meld", "pre-post", "teach-only"]
    assert [one.key for one in protocol.conditions] == ["mind_meld", "bc", "dagger"]
    assert len(protocol.rollouts) == 12
    assert not protocol.display.show_agent_wheel
    training = protocol.phases_for(Role.TRAINING, ())
    assert [phase.kind for phase in training] == [
        PhaseKind.CONSENT,
        PhaseKind.QUESTIONNAIRES,
        PhaseKind.INSTRUCTIONS,
        PhaseKind.PRACTICE,
        PhaseKind.INSTRUCTIONS,
        PhaseKind.CALIBRATION,
        PhaseKind.DEBRIEF,
    ]
    assert training[0].text == ()  # the console asks for the newest consent text
    test = protocol.phases_for(Role.TEST, ORDER)
    taught = [(one.id, one.condition) for one in test if one.kind is PhaseKind.TEACH]
    assert taught == [("teach-1", "dagger"), ("teach-2", "bc"), ("teach-3", "mind_meld")]
    about = [(one.id, one.condition) for one in test if one.questionnaires and one.condition]
    assert about == [
        ("after-teach-1", "dagger"),
        ("after-teach-2", "bc"),
        ("after-teach-3", "mind_meld"),
    ]
    assert len({phase.id for phase in test}) == len(test)
    for phase in test:  # participants do not learn which learner they teach
        assert not any(key in phase.title for key in (*ORDER, "DAgger", "MIND MELD", "cloning"))


@pytest.mark.parametrize(
    ("before", "after", "key", "allowed"),
    [
        ('kind = "consent"', 'kimd = "consent"', "phases[0].kimd", "did you mean 'kind'?"),
        ("seed = 2021", "sede = 2021", "sede", "did you mean 'seed'?"),
        ("[wheel]", "[wheels]", "wheels", "did you mean 'wheel'?"),
        ("autocentre = 0.3", "autocenter = 0.3", "wheel.autocenter", "did you mean 'autocentre'?"),
        ("autocentre = 0.3", "autocentre = 1.3", "wheel.autocentre", "from 0 to 1"),
        ('key = "bc"', 'key = "bcc"', "conditions[1].key", "one of mind_meld, bc, dagger, oracle"),
        ('key = "bc"', 'key = "mind_meld"', "conditions[1].key", "another one"),
        ('"fluency"]', '"fluncy"]', "phases[8].after[2]", "questionnaires/fluncy.toml"),
        ('id = "calibration"', 'id = "practice"', "phases[5].id", "'practice' is taken"),
        ('id = "calibration"', 'id = "teach-1"', "phases[8].id", "'teach-1' is taken"),
        (
            '"How correcting works"',
            '"practice\u00a0DRIVE"',
            "phases[4].title",
            "looks like that of",
        ),
        ('id = "calibration"', 'id = "Calibration!"', "phases[5].id", "lower-case letters"),
        ('test_prefix = "P"', 'test_prefix = "T"', "test_prefix", "ids would overlap"),
        ('test_prefix = "P"', 'test_prefix = "p"', "test_prefix", "capital letters"),
        ("rollouts = 12 ", "rollouts = 13 ", "rollouts", "from 1 to 12"),
        ("rollouts = 12 ", "rollouts = true ", "rollouts", "a list"),
        (
            "rollouts = 12 ",
            'rollouts = ["calibration-00", "calibration-00"]',
            "rollouts[1]",
            "once",
        ),
        ("block_size = 6 ", "block_size = 4 ", "block_size", "a multiple of 6"),
        ('kind = "practice"', 'kind = "practise"', "phases[3].kind", "one of consent, questionn"),
        ('roles = ["test"]', 'roles = ["tset"]', "phases[6].roles[0]", "one of training, test"),
        ('roles = ["test"]', 'roles = ["training"]', "phases[6].roles", "have no calibrate_w"),
        ("version = 1", 'version = "1"', "consent.version", "a whole number"),
        ("format = 1", "format = 2", "format", "1, the only one"),
        ('preset = "lab"', 'preset = "labs"', "mapper.preset", "one of lab, paper"),
        ("balls = 5", "balls = 0", "practice.balls", "at least 1"),
        ("balls = 5", "minutes = 0", "practice.minutes", "above 0, and at most 240"),
        ("balls = 5", "minutes = nan", "practice.minutes", "a finite number"),
        ("seed = 2021", 'seed = 2021\nlanguage = "fr"', "language", "one of en, de"),
        ("version = 1", 'ticks = ["A", ""]\nversion = 1', "consent.ticks[1]", "some words"),
        ("version = 1", 'ticks = "A"\nversion = 1', "consent.ticks", "a list"),
        ("version = 1", "minimum_age = 0\nversion = 1", "consent.minimum_age", "from 1 to 120"),
        ("version = 1", 'signature = "yes"\nversion = 1', "consent.signature", "true or false"),
        ("alpha = 0.05", "alpha = 5", "plan.alpha", "between 0 and 1"),
        ('correction = "holm"', 'correction = "bonf"', "plan.correction", "one of holm, bh, none"),
        ("exclusions = [", 'exclusions = ["",', "plan.exclusions[0]", "some words"),
        ('id = "H2a"', 'id = "H1"', "plan.hypotheses[1].id", "it is taken"),
        ('outcome = "drives', 'outcom = "drives', "plan.hypotheses[6].outcom", "outcome"),
        ("demonstrations = 12 ", "demonstrations = 0 ", "demonstrations", "at least 1"),
        ("seed = 2021 ", "seed = -1 ", "seed", "at least 0"),
        ('view = "driver"', 'view = "top"', "display.view", "one of driver, front, chase"),
        ("show_agent_wheel = false", "show_agent_wheel = 0", "display.show_agent_wheel", "true or"),
        (
            'kind = "calibrate_w"\ntitle = "Learning how you correct"\nroles = ["test"]',
            'kind = "calibration"\ntitle = "Again"',
            "phases[6].rollouts",
            "names that no earlier calibration phase has",
        ),
        ("training = 0 ", "training = -1 ", "design.training", "0 (no aim) or more"),
        (
            'kind = "consent"',
            'kind = "practice"',
            "phases[0].kind",
            "consent: it must be the first",
        ),
    ],
)
def test_an_error_names_file_line_key_value_and_what_is_allowed(text, before, after, key, allowed):
    assert before in text
    broken = text.replace(before, after, 1)
    with pytest.raises(InvalidConfig) as refused:
        parse(broken)
    said = str(refused.value)
    place = re.match(r"my/study\.toml, line (\d+): \$\.(\S+) is (.+); it must be (.+)\.$", said)
    assert place, said
    assert place[2] == key
    assert allowed in place[4]
    line = broken.splitlines()[int(place[1]) - 1]
    assert line.strip(), said
    assert after.split(" = ")[0] in line or key.rpartition(".")[0].partition("[")[0] in line, line


@pytest.mark.parametrize(
    ("cut", "said"),
    [
        ('title = "How people correct a driving robot"\n', "$.title is missing; give a text"),
        ('id = "practice"\n', "$.phases[3].id is missing; give a text"),
        ("width = 960", "text"),
    ],
)
def test_what_is_missing_is_named(text, cut, said):
    assert cut in text
    if cut.startswith("width"):
        text, said = text.replace(cut, "width = 9", 1), r"\$\.display: A window of 9x540"
        with pytest.raises(InvalidConfig, match=r"my/study.toml, line \d+: " + said):
            parse(text)
        return
    with pytest.raises(InvalidConfig, match=re.escape(said)):
        parse(text.replace(cut, "", 1))


def test_what_is_no_toml_is_named_with_its_line(text):
    with pytest.raises(InvalidConfig, match=r"my/study\.toml is no TOML: .*line 1,"):
        parse("= oops\n" + text)


def test_a_way_without_calibration_is_refused(text):
    start = text.index('[[phases]]\nid = "calibration"')
    end = text.index('[[phases]]\nid = "calibrate-w"')
    with pytest.raises(InvalidConfig, match="calibration or teach for training participants"):
        parse(text[:start] + text[end:])


def test_who_teaches_with_a_network_has_a_w_from_all_rollouts(text):
    start = text.index('[[phases]]\nid = "calibrate-w"')
    end = text.index('[[phases]]\nid = "before-teaching"')
    with pytest.raises(InvalidConfig, match="of kind calibrate_w, which mind_meld needs"):
        parse(text[:start] + text[end:])


@pytest.mark.parametrize(
    ("kind", "rollouts", "said"),
    [
        (
            "calibration",
            '["calibration-00"]',
            "rollouts is .*calibration-01.* corrected by training",
        ),
        (
            "calibration",
            '["calibration-99"]',
            r"rollouts\[0\] is 'calibration-99'; .* one of calib",
        ),
        ("practice", '["calibration-00"]', "left out: a practice phase has none"),
    ],
)
def test_calibration_phases_share_out_the_rollouts(text, kind, rollouts, said):
    line = f'kind = "{kind}"'
    with pytest.raises(InvalidConfig, match=said):
        parse(text.replace(line, f"{line}\nrollouts = {rollouts}", 1))


def test_which_conditions_need_w_is_what_the_learners_need():
    for mode in TAUGHT.values():
        assert mode.needs_w == (baseline_of(mode.learner) is not None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("template", "role", "attempts"),
    [("label-only", "training", 12), ("teach-only", "test", 6), ("pre-post", "training", 12)],
)
def test_a_template_is_gone_through_to_its_end(tmp_path, change, template, role, attempts):
    folder = tmp_path / "study"
    new_study(folder, template)
    text = (folder / "study.toml").read_text()
    change(folder, *(pair for pair in SHORTER if pair[0] in text))
    assert main(["study", "run", str(folder), "--teacher", "scripted:human:1", "--role", role]) == 0
    with Study.open(folder, read_only=True) as study:
        (person,) = study.participants()
        assert person.standing is Standing.FINISHED
        finished = study._opened.store.attempts(AttemptStatus.FINISHED)
        assert len(finished) >= attempts
        assert study.verify().ok


@pytest.mark.slow
def test_in_pre_post_each_part_is_opened_again_for_itself(tmp_path, change, run_scripted):
    folder = tmp_path / "study"
    new_study(folder, "pre-post")
    change(folder, ("balls = 5", "balls = 1"))
    with Study.open(folder) as study:
        run_scripted(study, Role.TRAINING, 1)
        study.redo("T001", "after")
        run_scripted(study, Role.TRAINING, 1, participant="T001")
        assert study.participant("T001").standing is Standing.FINISHED
        again = [a.rollout for a in study._opened.store.attempts() if a.attempt == 1]
        assert sorted(again) == [f"calibration-{number:02d}" for number in range(6, 12)]


def test_every_second_participant_begins_with_the_other_part(tmp_path, change):
    folder = tmp_path / "study"
    new_study(folder, "pre-post")
    with Study.open(folder) as study:
        people = [study.enrol(Role.TRAINING) for _ in range(3)]
        study.withdraw(people[1].id, erase=False)
        people += [study.enrol(Role.TRAINING), study.enrol(Role.TEST)]
        firsts = [
            next(
                phase.rollouts[0] for phase, _ in study.participant(one.id).phases if phase.rollouts
            )
            for one in people
        ]
        assert study.verify().ok
    one, other = "calibration-00", "calibration-06"
    assert firsts == [one, other, one, other, one]  # the fourth has the place of who left
    new_study(tmp_path / "other", "pre-post")
    change(tmp_path / "other", ("turn_parts = true ", "turn_parts = false"))
    with Study.open(tmp_path / "other") as study:
        views = [study.enrol(Role.TRAINING) for _ in range(2)]
        assert len({tuple(phase for phase, _ in view.phases) for view in views}) == 1


def test_parts_that_nobody_has_cannot_be_turned(tmp_path, change):
    new_study(tmp_path / "study", "label-only")
    change(
        tmp_path / "study", ("network_first = false", "turn_parts = true\nnetwork_first = false")
    )
    with Study.open(tmp_path / "study") as study, pytest.raises(InvalidConfig, match="turn_parts"):
        study.enrol(Role.TRAINING)


def test_a_study_brings_its_own_questionnaires(folder, change):
    own = folder / "questionnaires"
    own.mkdir()
    shipped = Path(__file__).parents[2] / "assets" / "questionnaires" / "fluency.toml"
    (own / "ours.toml").write_text(shipped.read_text().replace('"fluency"', '"ours"', 1))
    change(folder, ('["fluency", "demographics"]', '["ours"]'))
    with Study.open(folder) as study:
        who = study.enrol(Role.TRAINING).id
        assert study.questionnaire("ours").key == "ours"
        study.consent(who, given=True)
        assert set(study.submit(who, "about-you")) == {"ours"}
    (own / "ours.toml").write_text("format = 1")
    with pytest.raises(InvalidConfig, match=r"ours\.toml"):
        Study.open(folder)


def test_making_a_study_never_overwrites(tmp_path):
    new_study(tmp_path / "a", "mind-meld")
    with pytest.raises(StudyError, match="exists already"):
        new_study(tmp_path / "a", "mind-meld")
    with pytest.raises(StudyError, match="choose one of label-only, mind-meld"):
        new_study(tmp_path / "b", "mind-melt")
    assert not (tmp_path / "b").exists()
    with pytest.raises(StudyError, match="There is no study in"):
        Study.open(tmp_path)
