"""``benchmarks.people`` on a made-up copy of the data's form: who counts, and what is held out."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks import people
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.splits import drive_names

HEADER = "# \n# time,realtime,ref,inp,dis,state...\n"
SECONDS = 5
CHEAP = ("person_ridge", "eb_nonlinear")


def _trial(path: Path, drive: int, side: int, *, task: str, gain: float, noise: float) -> None:
    t_s = np.arange(SECONDS * 60) / 60.0
    rng = np.random.default_rng(drive)
    hertz, phases = rng.uniform(0.1, 0.6, 3), rng.uniform(0.0, 6.0, 3)
    wave = side * (0.2 * np.sin(2.0 * np.pi * np.outer(t_s, hertz) + phases)).sum(axis=1)
    reference, disturbance = (wave, 0.0 * t_s) if task == "preview" else (0.0 * t_s, wave)
    truth = np.gradient(wave, t_s) if task == "preview" else -wave
    own = np.random.default_rng([drive, side + 1, len(path.parent.name), len(path.name)])
    given = gain * np.roll(truth, 15) + noise * own.standard_normal(len(t_s))
    rows = np.column_stack([t_s, 1e9 + t_s, reference, given, disturbance, 0.0 * t_s])
    path.parent.mkdir(exist_ok=True)
    with path.open("w") as sink:
        sink.write(HEADER)
        np.savetxt(sink, rows, delimiter=",", fmt="%.17g")


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    for number, name in enumerate(("ab", "cd", "ef", "gh", "ij", "wild", "stopped")):
        for task, code in people.TASKS.items():
            for drive in range(people.DRIVES):
                for image in people.IMAGES:
                    if (name, task, drive, image) == ("stopped", "preview", 3, "-1"):
                        continue
                    trial = f"2001-1234_x-{number}_fo_{code}_s49_p{drive}a{drive % 2}_{image}.csv"
                    _trial(
                        folder / name / trial,
                        drive,
                        int(image),
                        task=task,
                        gain=0.7 + 0.1 * number,
                        noise=3.0 if name == "wild" else 0.05,
                    )
    for other in (
        "2001-1235_x_fo_r-zer_d-sos+A_s49_p0a1_+1_rst1.csv",
        "2001-1235_x_so_r-zer_d-sos+A_s49_p0a1_+1.csv",
        "2001-1235_x_fo_r-sos+E_d-sos+O_s49_p0a0_+1.csv",
        "notes.csv",
    ):
        (folder / "ab" / other).write_text("not to be read")
    return folder


@pytest.mark.parametrize("task", people.TASKS)
def test_people_with_all_trials_count_and_drives_have_two_images(data, task):
    series = people.read_series(data, task)
    assert sorted({one.person for one in series}) == ["ab", "cd", "ef", "gh", "ij", "wild"]
    assert len(series) == 6 * people.DRIVES * len(people.IMAGES)
    assert max(np.abs([one.label, one.truth]).max() for one in series) == 2.5
    drives = drive_names(series)
    assert {drives[f"p{drive}-1"] for drive in range(5)} == {f"p{drive}+1" for drive in range(5)}
    kept, said = people.without_wildest(series, 1)
    assert said[0].startswith("wild (mean error ")
    assert {one.person for one in kept} == {"ab", "cd", "ef", "gh", "ij"}
    assert max(np.abs([one.label, one.truth]).max() for one in kept) == 2.5
    with pytest.raises(InvalidLabels, match="--drop 5 leaves 1 people"):
        people.without_wildest(series, 5)


def test_five_seeds_hold_out_everything_of_everyone_as_new_once(data):
    series = people.read_series(data, "rejection")
    new: list[tuple[str, str]] = []
    for seed in range(people.DRIVES):
        seen: list[str] = []
        for fold in people.folds(series, seed):
            learned = {one.rollout[:2] for one in (*fold.train_seen, *fold.calibrate_new)}
            scored = {one.rollout[:2] for one in (*fold.held_out_seen, *fold.held_out_new)}
            assert len(scored) == 1
            assert not learned & scored
            assert not {o.person for o in fold.train_seen} & {o.person for o in fold.calibrate_new}
            new += [(one.person, one.rollout) for one in fold.held_out_new]
            seen += scored
        assert len(set(seen)) == people.DRIVES
    assert sorted(new) == sorted((one.person, one.rollout) for one in series)


@pytest.mark.parametrize("task", people.TASKS)
def test_the_table_is_printed(data, task, capsys):
    arguments = ["--data", str(data), "--task", task, "--drop", "1", "--seeds", "0", "1"]
    assert people.main([*arguments, "--mappers", *CHEAP]) == 0
    out = capsys.readouterr().out
    assert out.startswith(
        f"{task}: 5 people, 50 trials\n  left out, having the largest mean error:"
    )
    assert "mirror images are not exact" not in out
    lines = [line.split() for line in out.splitlines() if line.split()[0] in CHEAP]
    assert [line[0] for line in lines] == list(CHEAP)
    for line in lines:
        assert float(line[1]) > 50.0  # a delay and a gain are what these undo
        assert len(line) == 13  # name, two figures with intervals, and two seeds of each


def test_pooled_sums_are_those_of_the_mapper(data):
    """One seed and split by hand: the sums of the folds' own errors."""
    series = people.read_series(data, "rejection")
    pooled = people.measured(series, ("person_ridge",), [0])["person_ridge"]
    for split in people.SPLITS:
        before = after = 0.0
        for fold in people.folds(series, 0):
            (mapper,) = people.fitted(fold, ("person_ridge",), 0).values()
            for one in getattr(fold, f"held_out_{split}"):
                before += np.abs(one.label - one.truth).sum()
                after += np.abs(mapper.map(one) - one.truth).sum()
        assert pooled[split].improvement == pytest.approx(1.0 - after / before)
        assert pooled[split].by_seed == pytest.approx((1.0 - after / before,))


def test_what_is_no_such_folder_is_said(data, tmp_path, capsys):
    assert people.main(["--data", str(tmp_path)]) == 2
    assert "has 0 people with 10 first-order trials" in capsys.readouterr().err
    for name in ("ab", "cd"):
        (tmp_path / name).mkdir()
        for trial in (data / name).glob("*_fo_*1.csv"):
            (tmp_path / name / trial.name).write_text("# time,x\n0,1\n")
    assert people.main(["--data", str(tmp_path)]) == 2
    assert "has the columns time,x, without ref, inp, dis" in capsys.readouterr().err
