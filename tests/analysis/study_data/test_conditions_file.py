"""Outcomes of conditions: a table, a Parquet file or a teach run's shards."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from steerlab.analysis.study_data.conditions_file import left_out_teachers, read_conditions
from steerlab.analysis.study_data.records import NotAStudy

HEAD = "participant,condition,round,success,final_distance_m,label_mae,position\n"


def table(tmp_path: Path, *rows: str, head: str = HEAD) -> Path:
    path = tmp_path / "outcomes.csv"
    path.write_text(head + "".join(f"{row}\n" for row in rows))
    return path


def test_a_csv_and_the_same_parquet(tmp_path):
    path = table(tmp_path, "P1,bc,0,0.5,12.5,,1", "P1,bc,1,1,4.5,0.3,1")
    found = read_conditions(path)
    assert [(o.metric, o.round, o.value, o.position) for o in found] == [
        ("success", 0, 0.5, 1),
        ("final_distance_m", 0, 12.5, 1),
        ("success", 1, 1.0, 1),
        ("final_distance_m", 1, 4.5, 1),
        ("label_mae", 1, 0.3, 1),
    ]
    parquet = tmp_path / "outcomes.parquet"
    pq.write_table(
        pa.table(
            {
                "participant": ["P1", "P1"],
                "condition": ["bc", "bc"],
                "round": [0, 1],
                "success": [False, True],
            }
        ),
        parquet,
    )
    assert [(o.round, o.value, o.position) for o in read_conditions(parquet)] == [
        (0, 0.0, None),
        (1, 1.0, None),
    ]


@pytest.mark.parametrize(
    ("rows", "head", "said"),
    [
        (["P1,bc,0"], "participant,condition,round\n", "one or more of success"),
        (["P1,0.5"], "participant,success\n", "lacks condition, round"),
        (["P1,bc,0,1.5,,,"], HEAD, "line 2: success is 1.5; it must be from 0 to 1"),
        (["P1,bc,0,1,,,", "P1,bc,0,1,,,"], HEAD, "line 3: 'P1' has 'bc' in round 0 twice"),
        (["P1,bc,-1,1,,,"], HEAD, "round is -1"),
        (["P1,,0,1,,,"], HEAD, "condition is empty"),
        (["P1,bc,0,often,,,"], HEAD, "success is 'often'"),
        (["P1,bc,0,1,,,", "P1,bc,1,.,,,"], HEAD, r"line 3: success is '\.'; it must be a number"),
        (["P1,bc,0,1,2.5,,", "", 'P1,bc,1,1,"1,2",,'], HEAD, "line 4: final_distance_m is '1,2'"),
        (
            ["P1,bc,0,true,,,", "P1,bc,1,x,,,"],
            HEAD,
            "line 3: success is 'x'|line 2: success is 'true'",
        ),
        (["P1,bc,0,1,,,", "P1,bc,,1,,,"], HEAD, "line 3: round is empty; it must be a whole"),
        (["P1,bc,0,1,,,", "P1,bc,1,1,,,0.5"], HEAD, "line 3: position is 0.5"),
        (["P1,bc,0,1,inf,,"], HEAD, "line 2: final_distance_m is inf; .* finite"),
        (
            ["P1,bc,0,1,,,", "P1 ,bc,1,1,,,"],
            HEAD,
            "line 3: participants 'P1' and 'P1 ' differ only",
        ),
        (["P1,bc,0,1,,,", "P1,BC,1,1,,,"], HEAD, "line 3: conditions 'bc' and 'BC' differ only"),
        (
            ["P1,bc,0,1,0.5"],
            "participant,condition,round,success,Label_MAE\n",
            "call it 'label_mae'",
        ),
        (["P1;bc;0;1"], "participant;condition;round;success\n", "by semicolons"),
    ],
)
def test_a_wrong_table_is_refused_with_its_row(tmp_path, rows, head, said):
    with pytest.raises(NotAStudy, match=said):
        read_conditions(table(tmp_path, *rows, head=head))


def test_ids_are_text_and_rounds_whole_whatever_wrote_them(tmp_path):
    path = table(tmp_path, "007,true,0.0,1,,,", "008,true,0.0,0,,,1.0")
    assert [
        (one.person, one.condition, one.round, one.position) for one in read_conditions(path)
    ] == [
        ("007", "true", 0, None),
        ("008", "true", 0, 1),
    ]


@pytest.mark.parametrize("ending", ["CSV", "PARQUET"])
def test_endings_in_capitals_and_binary_ids(tmp_path, ending):
    path = tmp_path / f"OUTCOMES.{ending}"
    if ending == "CSV":
        path.write_text("participant,condition,round,success\nP001,bc,0,1\n")
    else:
        ids = {"participant": [b"P001"], "condition": [b"bc"], "round": [0], "success": [1]}
        pq.write_table(pa.table(ids | {"when": pa.array([1], pa.timestamp("ns"))}), path)
    (one,) = read_conditions(path)
    assert (one.person, one.condition) == ("P001", "bc")


def test_undecodable_headers_and_ids_are_refused_in_words(tmp_path):
    (tmp_path / "a.csv").write_bytes("participant,condition,round,success,Größe\n".encode("cp1252"))
    with pytest.raises(NotAStudy, match=r"line 1 is not UTF-8: byte 0xf6 .*Save it as CSV UTF-8"):
        read_conditions(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_bytes("participant,condition,round,success\n".encode("utf-16"))
    with pytest.raises(NotAStudy, match="is UTF-16 text"):
        read_conditions(tmp_path / "b.csv")
    ids = {"participant": [b"\xff"], "condition": [b"bc"], "round": [0], "success": [1]}
    pq.write_table(pa.table(ids), tmp_path / "c.parquet")
    with pytest.raises(NotAStudy, match=r"row 1: participant is b'\\xff'; it must be UTF-8 text"):
        read_conditions(tmp_path / "c.parquet")


@pytest.mark.parametrize("rows", [15_000, 22_000])
def test_line_breaks_in_quotes_are_read_in_files_of_any_size(tmp_path, rows):
    head = "participant,condition,round,success,note\n"
    lines = [
        f'P{row},bc,0,1,"a note\n of two lines, with some more words in it"' for row in range(rows)
    ]
    assert len(read_conditions(table(tmp_path, *lines, head=head))) == rows


def test_what_is_no_table_is_refused(tmp_path):
    with pytest.raises(NotAStudy, match="cannot be read as a table"):
        read_conditions(tmp_path / "missing.csv")
    (tmp_path / "bad.parquet").write_text("no parquet")
    with pytest.raises(NotAStudy, match="cannot be read as a table"):
        read_conditions(tmp_path / "bad.parquet")
    with pytest.raises(NotAStudy, match=r"no teachers/\*\.json"):
        read_conditions(tmp_path)


def _round(number: int, **values: float | None) -> dict:
    return {
        "round": number,
        "outcome": "timeout",
        "labels_asked": 40,
        "teacher_seconds": 2.0,
        "switches": 0,
        "loss": None,
        "drives": 10,
        "collisions": 0.0,
        "path_m": [[0.0, 0.0], [1, 0.5]],
        **values,
    }


def _shard(teacher: str, *successes: float | None, left_out: str | None = None) -> dict:
    seeds = {
        str(seed): {
            "by_round": [
                _round(0, success=0.0, final_distance_m=30.0, label_mae=None),
                _round(1, success=one, final_distance_m=5.0, label_mae=0.25),
            ],
            "final_drives": [{"outcome": "timeout", "final_distance_m": 5, "path_m": []}],
            "frames": [],
        }
        for seed, one in enumerate(successes)
    }
    return {
        "schema": 2,
        "teacher": teacher,
        "style": {"gain": 1.5},
        "quirk": None,
        "left_out": [{"seed": 0, "learner": None, "why": left_out}] if left_out else [],
        "failed_demonstrations": {"0": 1},
        "conditions": {} if left_out else {"mind-meld": seeds},
    }


def test_shards_are_averaged_over_learner_seeds(tmp_path):
    folder = tmp_path / "teachers"
    folder.mkdir()
    for name, shard in (
        ("a.json", _shard("a", 0.4, 0.8)),
        ("b.JSON", _shard("b", None, 1.0)),  # copied by another system
        ("c.json", _shard("c", left_out="never reached the ball")),
    ):
        (folder / name).write_text(json.dumps(shard))
    found = {(o.person, o.metric, o.round): o.value for o in read_conditions(tmp_path)}
    assert found["a", "success", 1] == pytest.approx(0.6)
    assert found["b", "success", 1] == 1.0
    assert ("a", "label_mae", 0) not in found
    assert {person for person, _, _ in found} == {"a", "b"}
    (left,) = left_out_teachers(tmp_path)
    assert (left.who, left.why) == ("c", "never reached the ball")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda shard: shard.pop("schema"), r"\$\.schema is missing; give 2"),
        (lambda shard: shard.pop("conditions"), r"\$\.conditions is missing"),
        (lambda shard: shard.update(teacher=7), r"\$\.teacher is 7; it must be a text"),
        (lambda shard: shard.update(typo=7), r"\$\.typo is 7; it must be under one of the keys"),
        (
            lambda shard: shard["conditions"]["mind-meld"]["1"]["by_round"][1].update(success="1"),
            r"\$\.conditions\.mind-meld\.1\.by_round\[1\]\.success is '1'; .*a finite number",
        ),
        (
            lambda shard: shard["conditions"]["mind-meld"]["1"]["by_round"].pop(),
            r"\$\.conditions is \[\(0,\), \(0, 1\)\]; .*the same rounds throughout",
        ),
    ],
)
def test_a_shard_that_teach_did_not_write_is_refused(tmp_path, change, said):
    shard = _shard("d", 0.5, 1.0)
    change(shard)
    (tmp_path / "teachers").mkdir()
    (tmp_path / "teachers" / "d.json").write_text(json.dumps(shard))
    with pytest.raises(NotAStudy, match=r"d\.json is no shard of steerlab teach: .*" + said):
        read_conditions(tmp_path)
