"""What the command line does not take, in one sentence: the word, the cause, and what to give instead."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from typing import Any, get_args

import tyro

# Not public, so that any version may change it: hence the bounds in pyproject.toml.
from tyro._errors import (
    BadValue,
    InstantiationFailure,
    InvalidChoice,
    MissingArgs,
    MissingSubcommand,
    ParseErrorEvent,
    UnrecognizedArgs,
)

from steerlab.sim.errors import shown


def refusal_of(
    event: ParseErrorEvent, verb: Callable[..., int], words: Sequence[str]
) -> str | None:
    """The sentence for what tyro refuses; None for what it calls by a name that is not known here.

    Args:
        verb: the verb's function.
        words: what was typed after the verb.
    """
    acts = _acts(verb)
    act = next((word for word in words if not word.startswith("-")), "")
    base = event.prog.removesuffix(f" {act}") if act in acts else event.prog
    program = f"{base} {act}" if act in acts else base
    more = f"{program} --help says more."
    if isinstance(event, UnrecognizedArgs | MissingArgs | BadValue):
        options = _options(acts.get(act, verb))
        if word := next((one for one in map(_option, words) if one not in ("", *options)), ""):
            return f"{shown(word)} is no option of {program}.{_meant(word, options)} {more}"
    unknown = getattr(event, "tokens", None) or getattr(event, "unrecognized_tokens", None)
    if unknown and acts and act not in acts:
        meant = _meant(unknown[0], acts)
        return (
            f"{shown(unknown[0])} is no act of {base}.{meant} Choose from {', '.join(acts)}; {more}"
        )
    if unknown:
        return f"{shown(unknown[0])} is one word too many for {program}; {more}"
    if isinstance(event, MissingArgs):
        missing = [_invoked(one.arg) for one in event.missing_arguments]
        are = "is" if len(missing) == 1 else "are"
        return f"{' and '.join(missing)} {are} missing; {more}"
    if isinstance(event, MissingSubcommand):
        return f"An act is missing: {program} takes one of {', '.join(acts)}; {more}"
    if isinstance(event, BadValue):
        return f"{_invoked(event.argument)} has no value; {more}"
    if isinstance(event, InvalidChoice):
        name, choices = event.argument.display_name().removeprefix("--"), event.choices
        allowed = f"it must be one of {', '.join(choices)}."
        return f"{name} is {shown(event.value)}; {allowed}{_meant(event.value, choices)}"
    if isinstance(event, InstantiationFailure):
        return f"{event.message.rstrip('.')}; {more}"
    return None


def _invoked(argument: Any) -> str:
    """As the usage has it, such as ``--out DIR``; with what it may be if that is a few words."""
    choices = argument.lowered.choices
    name = argument.lowered.name_or_flags[0] if choices else argument.get_invocation_text()[1]
    return f"{name} ({', '.join(choices)})" if choices else str(name)


def _option(word: str) -> str:
    """``--fold-er`` of ``--fold_er=x``; empty for what is no option."""
    is_option = word.startswith("-") and word.lstrip("-")[:1].isalpha()
    return word.partition("=")[0].replace("_", "-") if is_option else ""


def _meant(word: str, known: Sequence[str] | Mapping[str, Any]) -> str:
    close = get_close_matches(word, known, n=1)
    return f" Did you mean {close[0]}?" if close else ""


def _acts(verb: Callable[..., int]) -> dict[str, type]:
    """What a verb such as ``study`` can do, by its word; empty for a verb that does one thing."""
    annotations = [one.annotation for one in inspect.signature(verb).parameters.values()]
    union = get_args(annotations[0])[0] if len(annotations) == 1 else None
    return {get_args(one)[1].name: get_args(one)[0] for one in get_args(union)}


def _options(takes: Callable[..., int] | type) -> list[str]:
    """The options of a verb's function, or of the dataclass of an act."""
    if isinstance(takes, type):
        annotations = {one.name: one.type for one in fields(takes)}
    else:
        signature = inspect.signature(takes)
        annotations = {name: one.annotation for name, one in signature.parameters.items()}
    options: list[str] = []
    for name, annotation in annotations.items():
        kind, *about = get_args(annotation) or (annotation,)
        if tyro.conf.Positional in about:
            continue
        renamed = next((one.name for one in about if getattr(one, "name", None)), name)
        word = renamed.replace("_", "-")
        options += [f"--{word}", f"--no-{word}"] if kind is bool else [f"--{word}"]
    return options
