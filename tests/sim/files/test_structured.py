"""Plain values become records as they are, or are refused with their path."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.errors import InvalidConfig, InvalidValue
from steerlab.sim.files.structured import (
    json_values,
    structured,
    toml_values,
    utf8_text,
    versioned,
    within_file,
)


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True, kw_only=True, slots=True)
class Part:
    size: float
    colour: Colour = Colour.RED

    def __post_init__(self) -> None:
        if self.size < 0.0:
            raise InvalidValue("size", self.size, "0 or more")
        if self.size > 100.0:
            raise InvalidConfig("That is too large; give less.")


@dataclass(frozen=True, kw_only=True)
class Whole:
    parts: tuple[Part, ...]
    pair: tuple[int, float] = (0, 1.0)
    way: Literal["a", "b"] = "a"
    count: int | None = None
    on: bool = False
    shares: Mapping[Colour, float] = field(default_factory=dict)
    words: Mapping[int, str] = field(default_factory=dict)
    system: str = field(default="", metadata={"key": "os"})


TEXT = """\
format = 3
parts = [{ size = 1 }]
pair = [2, 0.5]
count = 4
on = true
os = "linux"

[shares]
blue = 1

[words]
-1 = "no"
"""


def test_a_file_becomes_a_record():
    values = versioned(Whole, toml_values(TEXT, "x.toml"), "format", 3)
    whole = structured(Whole, values)
    assert whole == Whole(
        parts=(Part(size=1.0),),
        pair=(2, 0.5),
        count=4,
        on=True,
        shares={Colour.BLUE: 1.0},
        words={-1: "no"},
        system="linux",
    )
    assert type(whole.parts[0].size) is float
    assert type(next(iter(whole.shares))) is Colour
    assert structured(Whole, values | {"parts": [Part(size=1)]}) == whole  # records may be ready
    assert structured(Whole, {"parts": [], "count": None}).count is None  # as JSON can say


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"parts": 3}, "$.parts is 3; it must be a list: a table of keys and values each."),
        ({"parts": [{"size": 1}, 3]}, "$.parts[1] is 3; it must be a table of keys and values."),
        ({"parts": [{}]}, "$.parts[0].size is missing; give a finite number."),
        ({"parts": [{"size": "3"}]}, "$.parts[0].size is '3'; it must be a finite number."),
        ({"parts": [{"size": True}]}, "$.parts[0].size is True; it must be a finite number."),
        ({"parts": [{"size": -1}]}, "$.parts[0].size is -1.0; it must be 0 or more."),
        ({"parts": [{"size": 101}]}, "$.parts[0]: That is too large; give less."),
        (
            {"parts": [{"size": 1, "colour": "rad"}]},
            "$.parts[0].colour is 'rad'; it must be one of red, blue (did you mean 'red'?).",
        ),
        (
            {"parts": [{"sise": 1}]},  # also lacks the size; what was meant explains both
            "$.parts[0].sise is 1; it must be under one of the keys size, colour "
            "(did you mean 'size'?).",
        ),
        ({"pair": [1]}, "$.pair is [1]; it must be a list of 2: a whole number each."),
        ({"pair": [1.0, 1]}, "$.pair[0] is 1.0; it must be a whole number."),
        ({"pair": [1, float("nan")]}, "$.pair[1] is nan; it must be a finite number."),
        ({"pair": [1, float("-inf")]}, "$.pair[1] is -inf; it must be a finite number."),
        ({"pair": "12"}, "$.pair is '12'; it must be a list of 2: a whole number each."),
        ({"way": "A"}, "$.way is 'A'; it must be one of a, b."),
        ({"way": ["a"]}, "$.way is ['a']; it must be one of a, b."),
        ({"count": "4"}, "$.count is '4'; it must be a whole number."),
        ({"count": True}, "$.count is True; it must be a whole number."),
        ({"on": 1}, "$.on is 1; it must be true or false."),
        ({"on": None}, "$.on is None; it must be true or false."),
        ({"os": 1}, "$.os is 1; it must be a text."),
        ({"shares": {"blue": "1"}}, "$.shares.blue is '1'; it must be a finite number."),
        (
            {"shares": {"bleu": 1}},
            "$.shares.bleu is 1; it must be under a key that is one of red, blue "
            "(did you mean 'blue'?).",
        ),
        (
            {"words": {"a b": "x"}},
            "$.words['a b'] is 'x'; it must be under a key that is a whole number.",
        ),
        ({"words": {"7": 7}}, "$.words.7 is 7; it must be a text."),
    ],
)
def test_what_is_wrong_is_named_with_its_path(change, said):
    with pytest.raises(InvalidValue) as refused, within_file(""):
        structured(Whole, {"parts": []} | change)
    assert str(refused.value) == said


@pytest.mark.parametrize("huge", [10**400, 16**5000], ids=["400", "6000"])
def test_numbers_too_long_are_refused_in_a_sentence(huge):
    with pytest.raises(InvalidValue, match=r"^pair\[1\] is .* a finite number\.$") as refused:
        structured(Whole, {"parts": [], "pair": [1, huge]})
    assert len(str(refused.value)) < 150


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("format = 3", "format = 4", "line 1: $.format is 4; it must be 3, the only one"),
        ("format = 3", "", "$.format is missing; give 3"),
        ("format = 3", "format = true", "line 1: $.format is True"),
        ("size = 1", "size = -1", "line 2: $.parts[0].size is -1.0"),
        ("[shares]", "[shears]", "line 8: $.shears is {'blue': 1}; it must be under one of"),
        ("[shares]", "[shears]", "(did you mean 'shares'?)"),
        ("blue = 1", "blue = nan", "line 9: $.shares.blue is nan"),
        ('-1 = "no"', "-1 = 5", "line 12: $.words.-1 is 5; it must be a text"),
    ],
)
def test_in_toml_also_with_its_line(old, new, said):
    text = TEXT.replace(old, new, 1)
    with pytest.raises(InvalidValue) as refused, within_file("my/x.toml", text):
        structured(Whole, versioned(Whole, toml_values(text, "my/x.toml"), "format", 3))
    assert str(refused.value).startswith("my/x.toml")
    assert said in str(refused.value)


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["parts", "size", "pair", "words", "1", "x"]), inner)
    ),
)


@given(PLAIN)
def test_whatever_it_is_it_is_read_or_refused(values):
    with suppress(InvalidValue):  # anything else is a crash
        assert isinstance(structured(Whole, values), Whole)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "Expecting value"),
        ("[" * 100_000, "recursion"),
        ("9" * 5000, "digits"),
        ('{"a": {"b": 1, "b": 2}}', "the key 'b' is there twice"),
    ],
    ids=["empty", "deep", "long", "twice"],
)
def test_what_is_no_json_is_refused(text, why):
    with pytest.raises(InvalidConfig, match=rf"x\.json is no JSON: .*{why}"):
        json_values(text, "x.json")


def test_a_byte_order_mark_means_nothing_and_stays_in_the_text(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.encode())
    text = utf8_text(path)
    assert text.encode() == path.read_bytes()  # hashes are of the file's bytes
    assert toml_values(text, "x.toml") == toml_values(TEXT, "x.toml")
    assert json_values('\ufeff{"a": 1}', "x.json") == {"a": 1}
    with pytest.raises(InvalidValue) as refused, within_file("x.toml", '\ufefffirst = "x"'):
        raise InvalidValue("first", "x", "a whole number")
    assert refused.value.line == 1


def test_a_text_keeps_its_line_ends_and_must_be_utf8(tmp_path):
    path = tmp_path / "x"
    path.write_bytes("ä\r\n".encode())
    assert utf8_text(path) == "ä\r\n"
    path.write_bytes(b"\xff")
    with pytest.raises(InvalidConfig, match=r"is not UTF-8.*Save it as UTF-8"):
        utf8_text(path)
    with pytest.raises(InvalidConfig, match="cannot be read: No such file"):
        utf8_text(tmp_path / "y")
