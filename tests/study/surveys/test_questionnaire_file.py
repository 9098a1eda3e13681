"""Questionnaire files: read as they are meant, or refused with line, key, value and mend."""

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.errors import InvalidConfig, InvalidValue, SteerlabError
from steerlab.sim.files.toml_lines import line_of
from steerlab.study.surveys.answer_format import Likert
from steerlab.study.surveys.questionnaire_file import (
    all_questionnaires,
    load_questionnaire,
    questionnaire_from_toml,
    shipped_questionnaires,
)

GOOD = '''format = 1
key = "mine"
title = "Mine"
version = 3
unvalidated = true
instructions = """
Two lines,
[[items]]
id = "not an item"
"""
citation = "Ours [sic]."  # [[
licence_note = "Ours."

[defaults]
kind = "likert"
low = -1
high = 1

[defaults.anchors]
-1 = "no"
1 = "yes"

[[items]]
id = "one"
text = "One"

[[items]]
id = "two"
text = "Two"
low = 0
anchors = { 0 = "none", 1 = "some" }

[[items]]
id = "three"
text = "Three"
kind = "choice"
options = [
  { value = "x", text = "X" },
  { value = "y", text = "Y" },
]

[[items]]
id = "four"
text = "Four"
required = false
[items.anchors]
-1 = "never"
1 = "ever"

[[scales]]
key = "all"
title = "All"
items = ["one", "four"]
reversed = ["four"]
'''


def _line(text: str, start: str, nth: int = 1) -> int:
    lines = [n for n, line in enumerate(text.splitlines(), 1) if line.startswith(start)]
    return lines[nth - 1]


def test_a_file_reads_as_meant():
    found = questionnaire_from_toml(GOOD, "mine.toml")
    assert found.instructions == 'Two lines,\n[[items]]\nid = "not an item"'
    assert found.unvalidated
    assert found.version == 3
    assert found.item("one").format == Likert(low=-1, high=1, anchors=((-1, "no"), (1, "yes")))
    assert found.item("two").format == Likert(low=0, high=1, anchors=((0, "none"), (1, "some")))
    assert found.item("three").kind == "choice"  # takes no low or high from the defaults
    assert found.item("four").format.points == ((-1, "never"), (0, ""), (1, "ever"))
    assert not found.item("four").required
    assert found.scale("all").reversed == ("four",)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("version = 3", "version = 0", 4, "version is 0; it must be a whole number from 1"),
        ("version = 3", "version = true", 4, "version is True; it must be a whole number"),
        (
            "version = 3",
            "verison = 3",
            4,
            r"verison is 3; .* keys format, key, .*defaults \(did you mean \'version\'",
        ),
        ("version = 3\n", "", None, r"\$\.version is missing; give a whole number"),
        ("format = 1", "format = 2", 1, "format is 2; it must be 1"),
        ('kind = "likert"', 'kind = "lickert"', 15, "defaults.kind is 'lickert'; .*likert, slider"),
        ("high = 1", "high = -1", 17, "defaults.high is -1; it must be above low"),
        ('-1 = "no"', '-1 = ""', 20, r"defaults\.anchors\.-1 is ''; it must be some words"),
        ('1 = "yes"', "1 = 7", 21, r"defaults\.anchors\.1 is 7; it must be a text"),
        (
            '1 = "yes"',
            'yes = "yes"',
            21,
            r"\$\.defaults\.anchors\.yes is 'yes'; .*key that is a whole number",
        ),
        ('text = "One"', 'text = ""', 25, r"items\[0\]\.text is ''; it must be some words"),
        ('text = "One"', "text = 1", 25, r"items\[0\]\.text is 1; it must be a text"),
        ('text = "One"\n', "", 23, r"items\[0\]\.text is missing; give a text"),
        ('id = "two"', 'id = "one"', 28, r"items\[1\]\.id is 'one'; .*taken"),
        ("low = 0", 'low = "0"', 30, r"items\[1\]\.low is '0'; it must be a whole number"),
        ("low = 0", "low = 0\nstep = 5", 31, r"items\[1\]\.step is 5; .* id, text, kind, requ"),
        ("0 = ", "7 = ", 31, r"items\[1\]\.anchors is .*both ends"),
        ('{ value = "y"', '{ valeu = "y"', 37, r"items\[2\]\.options\[1\]\.valeu is 'y'"),
        ('{ value = "y"', '{ value = "x"', 37, r"items\[2\]\.options is \['x', 'x'\]"),
        ('1 = "ever"', '2 = "ever"', 46, r"items\[3\]\.anchors is "),
        ('kind = "choice"', 'kind = "number"', 37, r"items\[2\]\.options is .*one of the keys"),
        (
            'items = ["one", "four"]',
            'items = ["one", "four", "five"]',
            53,
            r"scales\[0\]\.items is 'five'; it must be one of one, two",
        ),
        (
            'items = ["one", "four"]',
            'items = ["one", 4]',
            53,
            r"scales\[0\]\.items\[1\] is 4; .*a text",
        ),
        ('reversed = ["four"]', 'reversed = ["two"]', 54, r"scales\[0\]\.reversed is \['two'\]"),
        ('reversed = ["four"]', 'how = "max"', 54, r"scales\[0\]\.how is 'max'; .*sum, mean"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(old, new, line, message):
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    with pytest.raises(InvalidValue, match=message) as caught:
        questionnaire_from_toml(text, "mine.toml")
    assert caught.value.line == line
    assert str(caught.value).startswith("mine.toml" + (f", line {line}: " if line else ": "))


@pytest.mark.parametrize("text", ["key = ", "a = 1\na = 2", "[" * 5000, "a = " + "9" * 5000])
def test_no_toml_at_all_is_refused(text):
    with pytest.raises(InvalidConfig, match=r"mine\.toml is no TOML"):
        questionnaire_from_toml(text, "mine.toml")


@given(st.data())
@settings(max_examples=150)
def test_a_damaged_file_is_refused_or_read_never_more(data):
    lines = GOOD.splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(lines) - 1))
        lines[at] = data.draw(st.sampled_from(["", lines[at][::-1], *lines, "low = 0.5", "x = []"]))
    with suppress(SteerlabError):
        questionnaire_from_toml("\n".join(lines), "mine.toml")


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("title", ('title = "Mine"', 1)),
        ("items[1].low", ("low = 0", 1)),
        ("items[2].options[1].text", ("options", 1)),
        ("items[3].anchors.1", ('1 = "ever"', 1)),
        ("items[3].nothing", ("[[items]]", 5)),  # the first stands in the instructions
        ("scales[0].items", ("items = ", 1)),
    ],
)
def test_the_line_of_a_key(key, line):
    assert line_of(GOOD, f"$.{key}") == _line(GOOD, *line)


def test_a_key_that_is_nowhere_has_no_line():
    assert line_of(GOOD, "$.nothing.at.all") is None


def test_a_study_brings_its_own(tmp_path: Path):
    (tmp_path / "mine.toml").write_text(GOOD, encoding="utf-8")
    assert load_questionnaire("mine", tmp_path).version == 3
    assert load_questionnaire("trust", tmp_path) == shipped_questionnaires()["trust"]
    assert set(all_questionnaires(tmp_path)) == {*shipped_questionnaires(), "mine"}


def test_a_file_from_another_system_may_end_in_capitals(tmp_path: Path):
    (tmp_path / "mine.TOML").write_text(GOOD, encoding="utf-8")
    assert set(all_questionnaires(tmp_path)) == {*shipped_questionnaires(), "mine"}
    (tmp_path / "mine.toml").write_text(GOOD, encoding="utf-8")
    if len(list(tmp_path.iterdir())) == 2:  # where capitals make another name
        with pytest.raises(InvalidConfig, match="two files of the key mine"):
            all_questionnaires(tmp_path)


def test_a_study_replaces_no_shipped_instrument(tmp_path: Path):
    text = GOOD.replace('key = "mine"', 'key = "trust"')
    (tmp_path / "trust.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidConfig, match="such as trust_ours"):
        load_questionnaire("mini_ipip_5", tmp_path)
    (tmp_path / "trust.toml").rename(tmp_path / "other.toml")
    with pytest.raises(InvalidValue, match=r"other\.toml, line 2: \$\.key is 'trust'; .*'other'"):
        load_questionnaire("trust", tmp_path)


@pytest.mark.parametrize("key", ["mine", "../trust", "/etc/passwd", "", "Trust", "trust.toml"])
def test_a_key_that_is_none_is_answered_with_those_there_are(key, tmp_path: Path):
    with pytest.raises(InvalidConfig, match=r"choose one of demographics, demographics_de, .*"):
        load_questionnaire(key, tmp_path)


def test_a_folder_or_file_that_cannot_be_read(tmp_path: Path):
    with pytest.raises(InvalidConfig, match="is no folder"):
        all_questionnaires(tmp_path / "none")
    (tmp_path / "mine.toml").write_bytes(b"title = '\xff'")
    with pytest.raises(InvalidConfig, match="Save it as UTF-8"):
        all_questionnaires(tmp_path)
    (tmp_path / "mine.toml").unlink()
    (tmp_path / "mine.toml").mkdir()
    with pytest.raises(InvalidConfig, match="cannot be read"):
        all_questionnaires(tmp_path)


def test_the_shipped_cannot_be_changed_by_a_caller():
    shipped_questionnaires().clear()
    assert "trust" in shipped_questionnaires()
