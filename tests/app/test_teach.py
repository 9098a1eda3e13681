"""``steerlab teach`` end to end, as small as it goes: what it writes, repeats, resumes and refuses."""

import json
import os
import pickle
import shutil
import subprocess
import sys
from base64 import b64decode
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import torch
from PIL import Image

from steerlab.analysis.study_data.conditions_file import left_out_teachers, read_conditions
from steerlab.app import teach_units
from steerlab.app.cli import main
from steerlab.app.teach import teach
from steerlab.app.teach_config import TeachConfig
from steerlab.app.teach_people import _label, check_window, prepare, sample_teachers
from steerlab.app.teach_shards import (
    keep_policies,
    missing,
    read_shard,
    why_left_out,
)
from steerlab.app.teach_units import _keep
from steerlab.learning.agents import BallNeverReached, TaskEnv
from steerlab.learning.checkpoint import save_mapper
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.policy import PolicyConfig, PolicyNetwork, pool_frame
from steerlab.learning.policy_training import TrainingDiverged
from steerlab.learning.presets import LAB
from steerlab.learning.windows import WindowConfig
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.run_folder import write_json
from steerlab.sim.populations import sample_population
from steerlab.sim.tasks import draw_task_start

CONFIG = TeachConfig(
    learners=("dagger", "mapped:person_gain", "hg-dagger"),
    teachers=2,
    rounds=1,
    task="easy",
    learner_seeds=1,
    seed=101,
    training_teachers=3,
    starts=2,
    starts_on_the_way=1,
    training_steps=5,
)


def _silent(what: str, share: float) -> None:
    pass


def _run(config, out, **options):
    return teach(config, out, command="steerlab teach", progress=_silent, **options)


@pytest.fixture(scope="module")
def mapper(tmp_path_factory):
    """A MIND MELD model of no worth, so that no test trains one."""
    fast = replace(LAB, training=replace(LAB.training, epochs=1, least_per_epoch=100))
    made = MindMeldMapper(fast, seed=0)
    made.fit(_label(load_calibration_set()[:2], sample_population("low", 3, 0, prefix="x")))
    path = tmp_path_factory.mktemp("model") / "mind_meld.safetensors"
    save_mapper(made, path)
    return path


@pytest.fixture(scope="module")
def out(tmp_path_factory, mapper):
    folder = tmp_path_factory.mktemp("teach") / "out"
    _run(CONFIG, folder, mapper=mapper)
    return folder


pytestmark = [pytest.mark.render, pytest.mark.slow]


def test_everything_promised_is_there(out):
    summary = json.loads((out / "summary.json").read_text())
    assert list(summary["conditions"]) == list(CONFIG.learners)
    assert (out / "report" / "index.html").read_text().startswith("<!doctype html>")
    for teacher in sample_teachers(CONFIG):
        assert (out / "teachers" / f"{teacher.name}.json").is_file()
    assert (out / "policies" / "test-000" / "dagger-0.safetensors").is_file()


def test_hg_dagger_asks_less_than_dagger(out):
    found = json.loads((out / "summary.json").read_text())["conditions"]
    assert found["hg-dagger"]["labels_asked"] <= found["dagger"]["labels_asked"]


def test_a_recording_for_each_teacher(out):
    names = {path.name for path in (out / "recordings").iterdir()}
    assert names == {f"{teacher.name}.rrd" for teacher in sample_teachers(CONFIG)}
    assert "recordings/test-000.rrd" in (out / "report" / "index.html").read_text()


def test_what_the_page_shows_is_what_the_policy_saw(out):
    shard = read_shard(out / "teachers" / "test-000.json")
    frames = shard["conditions"]["dagger"]["0"]["frames"]
    with Image.open(BytesIO(b64decode(frames[0]))) as image:
        first = pool_frame(np.asarray(image))
    start = draw_task_start(CONFIG.make_task(), "teach", 0, CONFIG.rounds)
    with TaskEnv(CONFIG.make_task(), seed=CONFIG.seed) as env:
        env.driving.reset(start=start.pose)
        assert (env.look().image[0] == first).all()


def test_fewer_learners_and_teachers_need_no_new_driving(out, mapper, tmp_path, monkeypatch):
    def never(self, unit, progress):
        raise AssertionError("nothing was missing")

    monkeypatch.setattr(teach_units.UnitRunner, "run", never)
    whole = json.loads((out / "summary.json").read_text())
    shutil.copytree(out, tmp_path / "out")
    part = _run(replace(CONFIG, learners=("hg-dagger", "dagger")), tmp_path / "out", mapper=mapper)
    assert list(part["conditions"]) == ["hg-dagger", "dagger"]
    assert part["conditions"]["dagger"] == whole["conditions"]["dagger"]
    alone = _run(replace(CONFIG, learners=("dagger",), teachers=1), tmp_path / "out", mapper=mapper)
    assert alone["teachers"] == 1


def test_learner_seeds_are_added_and_fewer_are_read_from_more(out, mapper, tmp_path, monkeypatch):
    shutil.copytree(out, tmp_path / "out")
    one = replace(CONFIG, teachers=1, learners=("dagger",))
    first = read_shard(tmp_path / "out" / "teachers" / "test-000.json")["conditions"]["dagger"]
    real, seeds = teach_units.teach_offline, []

    def noted(*arguments, **options):
        seeds.append(options["seed"])
        return real(*arguments, **options)

    monkeypatch.setattr(teach_units, "teach_offline", noted)
    more = _run(replace(one, learner_seeds=2), tmp_path / "out", mapper=mapper)
    assert seeds == [1]
    kept = read_shard(tmp_path / "out" / "teachers" / "test-000.json")["conditions"]["dagger"]
    assert kept["0"] == first["0"]
    assert kept["1"]["by_round"] != first["0"]["by_round"]
    assert more["run"]["learner_seeds"] == 2
    fewer = _run(one, tmp_path / "out", mapper=mapper)
    assert seeds == [1]
    assert fewer["conditions"] == _run(one, out, mapper=mapper)["conditions"]


@pytest.mark.parametrize(
    ("learners", "seeds", "why"),
    [
        (("bc",), 1, None),
        (("bc",), 2, "no ball"),
        (("bc", "eil"), 1, "no number"),
    ],
)
def test_who_is_left_out_depends_on_what_is_asked_of_them(learners, seeds, why):
    shard = {
        "left_out": [
            {"seed": 1, "learner": None, "why": "no ball"},
            {"seed": 0, "learner": "eil", "why": "no number"},
        ],
        "conditions": {},
    }
    assert why_left_out(shard, learners, seeds) == why
    assert missing(shard, learners, seeds) == ([] if why else [("bc", 0)])


def test_an_interrupted_run_keeps_what_is_done_and_goes_on(out, tmp_path, monkeypatch):
    real, taught = teach_units.teach_offline, []

    def stopped(env, agent, *arguments, **options):
        if len(taught) == 1:
            raise KeyboardInterrupt
        taught.append(agent.name)
        return real(env, agent, *arguments, **options)

    folder = tmp_path / "out"
    alone = replace(CONFIG, teachers=1, learners=("dagger", "hg-dagger"))
    with monkeypatch.context() as patch:
        patch.setattr(teach_units, "teach_offline", stopped)
        with pytest.raises(KeyboardInterrupt):
            _run(alone, folder)
    kept = folder / "teachers" / "test-000.json"
    assert list(read_shard(kept)["conditions"]) == ["dagger"]
    assert [path.name for path in kept.parent.iterdir()] == ["test-000.json"]
    _run(alone, folder)
    whole = read_shard(out / "teachers" / "test-000.json")["conditions"]
    for name, taught in read_shard(kept)["conditions"].items():
        assert taught == whole[name]  # bit for bit


def test_another_run_in_the_folder_is_refused_and_says_what_differs(out, mapper):
    with pytest.raises(OutputError, match="rounds was 1 and is now 2"):
        _run(replace(CONFIG, rounds=2), out, mapper=mapper)


def test_so_is_one_of_an_earlier_version(out, mapper, tmp_path):
    shutil.copytree(out, tmp_path / "out")
    run = tmp_path / "out" / "teach.json"
    run.write_text(json.dumps(json.loads(run.read_text()) | {"learner_seeds": 3}))
    with pytest.raises(OutputError, match="learner_seeds was 3 and is now None"):
        _run(CONFIG, tmp_path / "out", mapper=mapper)


def test_whoever_is_lost_is_not_asked_again_for_every_learner(tmp_path, monkeypatch):
    asked = []

    def lost(env, teacher, config, *, seed):
        asked.append(teacher.name)
        raise BallNeverReached(f"{teacher.name} did not reach the ball")

    monkeypatch.setattr(teach_units, "demonstrate_offline", lost)
    with pytest.raises(ValueError, match="No teacher could be judged"):
        _run(replace(CONFIG, learners=("bc", "dagger"), learner_seeds=3), tmp_path / "out")
    assert asked == ["test-000", "test-001"]


def test_what_a_run_keeps_is_read_by_whoever_analyses_it(out):
    found = {(one.person, one.condition) for one in read_conditions(out)}
    teachers = [path.stem for path in (out / "teachers").iterdir()]
    assert found == {(who, name) for who in teachers for name in CONFIG.learners}
    assert left_out_teachers(out) == ()


def test_units_that_were_under_way_say_it_once(tmp_path):
    (tmp_path / "teachers").mkdir()
    teacher = sample_teachers(CONFIG)[0]
    for learner in ("bc", "dagger"):
        unit = teach_units.Unit(teacher=teacher, learner=learner, seed=0)
        lost = {"failed_demonstrations": None, "result": None, "left_out": "no ball"}
        _keep(teach_units.TaughtUnit(unit=unit, **lost), tmp_path)
    shard = read_shard(tmp_path / "teachers" / f"{teacher.name}.json")
    assert shard["left_out"] == [{"seed": 0, "learner": None, "why": "no ball"}]


def _lost(env, teacher, config, *, seed):
    raise BallNeverReached(f"{teacher.name} did not reach the ball")


def test_whoever_never_reaches_the_ball_is_left_out(out, mapper, tmp_path, monkeypatch):
    shutil.copytree(out, tmp_path / "out")
    (tmp_path / "out" / "teachers" / "test-000.json").unlink()
    monkeypatch.setattr(teach_units, "demonstrate_offline", _lost)
    summary = _run(CONFIG, tmp_path / "out", mapper=mapper)
    assert summary["teachers"] == 1
    assert "did not reach the ball" in summary["left_out"]["test-000"]


def test_if_nobody_reaches_the_ball_the_command_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(teach_units, "demonstrate_offline", _lost)
    arguments = ["--learners", "dagger", "--teachers", "2", "--rounds", "1", "--task", "easy"]
    assert main(["teach", *arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "test-000 did not reach the ball; test-001 did not reach the ball" in error
    assert "Traceback" not in error


def test_a_loss_that_is_no_number_leaves_the_others_as_they_are(out, mapper, tmp_path, monkeypatch):
    shutil.copytree(out, tmp_path / "out")
    path = tmp_path / "out" / "teachers" / "test-001.json"
    shard = read_shard(path)
    del shard["conditions"]["hg-dagger"]
    write_json(shard, path)

    def diverged(*arguments, **options):
        raise TrainingDiverged("The policy's loss is nan at step 3")

    monkeypatch.setattr(teach_units, "teach_offline", diverged)
    summary = _run(CONFIG, tmp_path / "out", mapper=mapper)
    assert "hg-dagger, learner seed 0: The policy's loss is nan" in summary["left_out"]["test-001"]
    assert summary["teachers"] == 1
    assert list(read_shard(path)["conditions"]) == ["dagger", "mapped:person_gain"]  # nothing lost


def test_a_damaged_shard_is_named(tmp_path):
    (tmp_path / "x.json").write_text("{")
    with pytest.raises(OutputError, match=r"x\.json is damaged"):
        read_shard(tmp_path / "x.json")


def test_a_full_disk_keeps_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "x.json"
    write_json({"a": 1}, path)

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        write_json({"a": 2}, path)
    assert json.loads(path.read_text()) == {"a": 1}
    assert [one.name for one in tmp_path.iterdir()] == ["x.json"]


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 64 kB; only root may make one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    command = [str(mount), "-t", "tmpfs", "-o", "size=64k", "steerlab-test", str(folder)]
    if mount is None or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("no small file system can be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_disk_that_is_really_full_is_said_to_be_so(small_disk):
    write_json({"a": 1}, small_disk / "x.json")
    with pytest.raises(OutputError, match="No space left"):
        write_json(["long"] * 40_000, small_disk / "x.json")
    assert json.loads((small_disk / "x.json").read_text()) == {"a": 1}
    network = PolicyNetwork(PolicyConfig(), torch.Generator().manual_seed(0))  # 128 kB
    with pytest.raises(OutputError, match="dagger-0"):
        keep_policies([network], small_disk / "policies", "dagger")
    assert list((small_disk / "policies").iterdir()) == []


def test_a_mapper_of_another_window_is_refused(tmp_path):
    for window in (WindowConfig(rate_hz=20.0), WindowConfig(look_ahead_s=0.0)):
        other = MindMeldMapper(replace(LAB, window=window), seed=0)
        with pytest.raises(InvalidConfig, match="was trained on a window"):
            check_window(other, tmp_path)
    check_window(MindMeldMapper(LAB, seed=0), tmp_path)


def test_the_command_refuses_such_a_mapper_and_leaves_no_folder(
    mapper, tmp_path, monkeypatch, capsys
):
    other = replace(LAB, window=WindowConfig(rate_hz=20.0))
    monkeypatch.setattr("steerlab.app.teach_people.LAB", other)
    out = tmp_path / "out"
    for path, why in ((mapper, "was trained on a window"), (tmp_path / "none", "none")):
        arguments = ["--learners", "mind-meld", "--mapper", str(path), "--out", str(out)]
        assert main(["teach", *arguments]) == 2
        assert why in capsys.readouterr().err
        assert not out.exists()


@pytest.mark.parametrize(
    ("population", "family", "sparse"),
    [
        ("sparse", "scripted", True),
        ("human", "sparse", True),
        ("people", "scripted", False),
    ],
)
def test_sparse_teachers_are_a_population_and_a_family(population, family, sparse):
    teachers = sample_teachers(replace(CONFIG, population=population, family=family))
    assert len(teachers) == CONFIG.teachers
    assert [one.style.tolerance > 0.0 for one in teachers] == [sparse, sparse]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"learners": ("dager",)}, "No learner 'dager'; choose from bc, dagger"),
        ({"learners": ("bc", "bc")}, "name each once"),
        ({"task": "maze"}, "No task 'maze'"),
        ({"family": "odd"}, "scripted, asymmetric"),
        ({"teachers": 0}, "teachers is 0"),
        ({"family": "fatigue"}, "add --population human"),
        ({"family": "sparse"}, "add --population human"),
        ({"population": "narrow"}, "wide, paper"),
        ({"starts_on_the_way": 5}, "starts-on-the-way 5"),
    ],
)
def test_bad_settings_name_value_and_choices(changes, message):
    with pytest.raises(InvalidConfig, match=message):
        replace(CONFIG, **changes)


def test_the_command_refuses_an_unknown_learner_in_one_sentence(tmp_path, capsys):
    assert main(["teach", "--learners", "dager", "--out", str(tmp_path / "x")]) == 2
    error = capsys.readouterr().err
    assert "No learner 'dager'" in error
    assert "mind-meld" in error
    assert not (tmp_path / "x").exists()


_WATCHED = """
import os, sys
class Watch:
    def find_spec(name, path=None, target=None):
        if name == "mujoco":
            print("drawing threads:", os.environ.get("LP_NUM_THREADS"))
sys.meta_path.insert(0, Watch)
from steerlab.app.cli import main
sys.exit(main(["teach", "--learners", "dager", "--out", sys.argv[1]]))
"""


def test_the_driver_is_told_of_threads_before_mujoco_opens_it(tmp_path):
    environment = {key: value for key, value in os.environ.items() if key != "LP_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", _WATCHED, str(tmp_path / "x")],
        env=environment, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert done.stdout.split("\n")[0] == "drawing threads: 0"


def test_stopping_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    def stopped(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("steerlab.app.teach.teach", stopped)
    assert main(["teach", "--learners", "bc", "--out", str(tmp_path / "x")]) == 130
    assert "same command again" in capsys.readouterr().err


def test_processes_share_the_work_and_change_nothing(out, tmp_path):
    _run(replace(CONFIG, learners=("dagger",)), tmp_path / "out", jobs=2)
    for teacher in sample_teachers(CONFIG):
        path = f"teachers/{teacher.name}.json"
        one, two = read_shard(out / path), read_shard(tmp_path / "out" / path)
        assert one["conditions"]["dagger"] == two["conditions"]["dagger"]


@pytest.mark.slow
def test_every_mapper_can_be_sent_to_another_process(tmp_path):
    """Also one that was trained just now, and told its progress to somebody here."""
    mapped = ("person_gain_lag", "person_ridge", "eb_nonlinear", "sim_pretrained")
    learners = ("mind-meld", "mind-meld-mean", *(f"mapped:{name}" for name in mapped))
    prepared = prepare(replace(CONFIG, learners=learners), tmp_path, _silent)
    assert set(prepared.mappers) == {"mind_meld", "mean_embedding", *mapped}
    teacher = prepared.teachers[0]
    (series,) = _label(load_calibration_set()[:1], [teacher])
    sent = pickle.loads(pickle.dumps(prepared.mappers))
    for name, mapper in prepared.mappers.items():
        np.testing.assert_array_equal(sent[name].map(series), mapper.map(series), name)
