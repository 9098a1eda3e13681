"""``steerlab power``: resumable, the same whatever the number of processes, refused in one sentence."""

import json
from pathlib import Path

import pytest

from steerlab.app import power as power_module
from steerlab.app.cli import main

SMALL = ["--people", "12", "34", "--studies", "100", "--plant", "a.b:gain:0.5"]


def run(capsys, out: Path, *more: str, code: int = 0) -> str:
    assert main(["power", "--out", str(out), *SMALL, *more]) == code
    said = capsys.readouterr()
    return said.out + said.err


def curves(out: Path) -> list[dict]:
    return json.loads((out / "summary.json").read_text())["curves"]


def test_a_small_design_from_end_to_end(tmp_path, capsys):
    said = run(capsys, tmp_path / "p", "--conditions", "mind_meld:0.8", "bc:0.3")
    assert "better than each rival (Holm)" in said
    found = {one["test"]: one for one in curves(tmp_path / "p")}
    assert found["a.b"]["power"][0] < found["a.b"]["power"][1]
    assert found["H3a: amplitude and w"]["power"][1] == 1.0
    page = (tmp_path / "p" / "report" / "index.html").read_text()
    assert "The trait behind a.b correlates 0.5 with gain" in page
    assert "not by 34" in page
    assert "nan" not in (tmp_path / "p" / "power.csv").read_text()


def test_it_goes_on_where_it_stopped(tmp_path, capsys, monkeypatch):
    out = tmp_path / "p"
    run(capsys, out, "--people", "12")
    made: list[tuple[int, int]] = []
    real = power_module.run_block

    def counted(design, people, number, taught):
        made.append((people, number))
        return real(design, people, number, taught)

    monkeypatch.setattr(power_module, "run_block", counted)
    run(capsys, out, "--people", "12", "34", "--studies", "150")
    assert made == [(12, 1), (34, 0), (34, 1)]
    whole = tmp_path / "q"
    run(capsys, whole, "--people", "12", "34", "--studies", "200")
    assert curves(whole) == curves(out)


@pytest.mark.slow
def test_results_do_not_depend_on_processes(tmp_path, capsys):
    run(capsys, tmp_path / "one")
    run(capsys, tmp_path / "two", "--jobs", "2")
    assert curves(tmp_path / "one") == curves(tmp_path / "two")


def test_stopped_by_hand_it_says_how_to_go_on(tmp_path, capsys, monkeypatch):
    def stop(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(power_module, "run_block", stop)
    assert "same command again" in run(capsys, tmp_path / "p", code=130)


def test_another_design_in_the_folder_is_refused(tmp_path, capsys):
    out = tmp_path / "p"
    run(capsys, out, "--people", "12")
    assert "noise was human and is now low" in run(capsys, out, "--noise", "low", code=2)
    run(capsys, out, "--noise", "low", "--force")
    (out / "blocks" / "n0012-0000.json").write_text("half a fi")
    assert "is damaged" in run(capsys, out, "--noise", "low", code=2)


def test_outcomes_may_come_from_a_table(tmp_path, capsys):
    table = tmp_path / "outcomes.csv"
    rows = [
        f"P{n},{name},2,{share}\n"
        for n in range(6)
        for name, share in (("mind_meld", 0.8 + n / 50), ("bc", 0.2 + n / 30))
    ]
    table.write_text("participant,condition,round,success\n" + "".join(rows))
    run(capsys, tmp_path / "p", "--taught", str(table))
    found = {one["test"]: one for one in curves(tmp_path / "p")}
    assert found["conditions differ (Friedman)"]["power"] == [1.0, 1.0]
    said = run(capsys, tmp_path / "q", "--taught", str(table), "--ours", "dagger", code=2)
    assert "--ours is 'dagger'" in said


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--plant", "nonsense"], "SCALE:STYLE:R"),
        (["--conditions", "bc:0.5", "dagger:0.5"], "must be one of bc, dagger"),
        (["--people", "3"], "4 dimensions need 7"),
        (["--jobs", "0"], "jobs is 0"),
        (["--taught", "missing.csv"], "cannot be read as a table"),
    ],
)
def test_nonsense_is_refused_in_one_sentence(tmp_path, capsys, more, said):
    message = run(capsys, tmp_path / "p", *more, code=2)
    assert said in message
    assert "Traceback" not in message
