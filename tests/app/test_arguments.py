"""What the command line takes for a number and for a path, for every option of every verb."""

import inspect
import os
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import get_args, get_origin, get_type_hints

import pytest
from tyro.conf import Positional
from tyro.constructors import PrimitiveConstructorSpec

from steerlab.app.cli import VERBS, main, verb_function
from steerlab.app.commands import study as study_command
from steerlab.app.commands.arguments import BadArgument, expanded
from steerlab.app.commands.printing import command_line

NO_NUMBERS = ("nan", "inf", "-inf", "-1", "1e23", str(10**23), "9" * 5000, "", "x")
OWN_RULES = [("console", "port")]  # refused by ``ConsoleConfig``
ACTS = [act for act in vars(study_command).values() if hasattr(act, "do")]


def _parts(hint: object) -> list[object]:
    """A type, what it is a choice of, and what is noted beside it."""
    parts = [part for one in get_args(hint) for part in _parts(one)] if get_origin(hint) else []
    return [hint, *getattr(hint, "__metadata__", ()), *parts]


def _is_number(hint: object) -> bool:
    parts = _parts(hint)
    specs = [part for part in parts if isinstance(part, PrimitiveConstructorSpec)]
    return int in parts or float in parts or any("INT" in spec.metavar for spec in specs)


def _numbers() -> list[tuple[str, str]]:
    return [
        (verb, name.replace("_", "-"))
        for verb in VERBS
        for name, hint in get_type_hints(verb_function(verb), include_extras=True).items()
        if name != "return" and _is_number(hint)
    ]


def _needed(verb: str) -> list[str]:
    """What the verb cannot do without."""
    words: list[str] = []
    function = verb_function(verb)
    hints = get_type_hints(function, include_extras=True)
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.default is inspect.Parameter.empty:
            positional = any(part in _parts(hints[name]) for part in get_args(Positional[Path])[1:])
            words += ["nowhere"] if positional else [f"--{name}", "nowhere"]
    return words


def test_these_are_all_the_numbers():
    assert len(_numbers()) > 40
    assert {verb for verb, _ in _numbers()} == {*VERBS} - {"wheel", "study", "export"}
    for act in ACTS:
        hints = get_type_hints(act, include_extras=True)
        assert not any(_is_number(hints[field.name]) for field in fields(act))


@pytest.mark.parametrize(("verb", "option"), _numbers())
def test_what_is_no_number_of_use_is_refused_in_a_sentence(
    verb, option, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for value in NO_NUMBERS:
        try:
            code = main([verb, *_needed(verb), f"--{option}={value}"])
        except SystemExit as stop:
            code = stop.code
        said = capsys.readouterr().err
        assert code == 2
        if (verb, option) not in OWN_RULES:
            assert said.startswith(f"steerlab: {option} is ")
            assert said.count("\n") == 1
        assert "Traceback" not in said
        assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["drive", "--size", "9" * 5000 + "x540"], "size is"),
        (["drive", "--device", "scripted:human:" + "9" * 5000], "at most 10 digits"),
        (["teach", "--out", "o", "--task", "generated-" + "9" * 5000], "No task"),
        (["power", "--out", "o", "--plant", "mini_ipip_5.neuroticism:gain:nan"], "nan"),
        (["power", "--out", "o", "--conditions", "a:nan", "b:0.5", "--ours", "a"], "nan"),
    ],
)
def test_numbers_within_texts_are_looked_at_too(arguments, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert said in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


def test_a_home_is_meant_by_its_sign(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["study", "new", "~/of mine"]) == 0
    assert (tmp_path / "of mine" / "study.toml").is_file()
    assert f"steerlab study enrol '{tmp_path}/of mine' --role" in capsys.readouterr().out
    assert main(["study", "status", "~/none of mine"]) == 2
    assert f"steerlab study new '{tmp_path}/none of mine'" in capsys.readouterr().err


@pytest.mark.parametrize("word", ["", "~no-such-user/x"])
def test_a_path_that_is_none(word, capsys):
    assert main(["study", "status", word]) == 2
    assert "Traceback" not in capsys.readouterr().err
    with pytest.raises(BadArgument):
        expanded(word)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems allow no such name")
@pytest.mark.parametrize(
    ("name", "environment"),
    [
        (b"caf\xe9", {}),
        ("é".encode(), {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}),
    ],
)
def test_a_name_that_libraries_would_write_otherwise_is_refused_at_once(
    name, environment, tmp_path
):
    """pyarrow would fail on it, after all the training."""
    done = subprocess.run(
        [sys.executable, "-m", "steerlab.app.cli", "demo", "--out", name],
        env=os.environ | environment, cwd=tmp_path, capture_output=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2
    assert b"LC_ALL=C.UTF-8" in done.stderr
    assert os.listdir(tmp_path) == []


def test_a_command_to_copy_is_quoted_word_by_word():
    given = {"people": (12, 20), "ours": "a b", "alpha": 0.05}
    line = command_line("power", given, Path("my out"), "its \udce9")
    assert (
        line
        == "steerlab power 'its \ufffd' --people 12 20 --ours 'a b' --alpha 0.05 --out 'my out'"
    )
