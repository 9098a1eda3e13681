"""``study.toml``: read into a ``StudyProtocol``; what is wrong is named with its line."""

import tomllib
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from math import factorial
from pathlib import Path
from typing import Any

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.study.contract import PhaseKind, Role, StudyError
from steerlab.study.plans import (
    AnalysisPlan,
    ConsentText,
    DisplayPlan,
    MapperPlan,
    PracticePlan,
    WheelPlan,
)
from steerlab.study.protocol import (
    MOST_CONDITIONS,
    Condition,
    PhasePlan,
    StudyProtocol,
    check_prefix,
)
from steerlab.study.protocol_error import ProtocolError
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.questionnaire_file import all_questionnaires
from steerlab.study.surveys.toml_lines import line_of
from steerlab.study.teaching.plan import TeachPlan
from steerlab.study.toml_records import (
    check_keys,
    record_from_table,
    records_at,
    value_of,
)
from steerlab.teleop.timing_limits import GateConfig

PROTOCOL_FILE, QUESTIONNAIRES = "study.toml", "questionnaires"
FORMAT = 1
_TOP: dict[str, type] = {
    "format": int,
    "title": str,
    "seed": int,
    "training_prefix": str,
    "test_prefix": str,
    "block_size": int,
    "demonstrations": int,
}
_SECTIONS: dict[str, type] = {
    "consent": ConsentText,
    "practice": PracticePlan,
    "display": DisplayPlan,
    "wheel": WheelPlan,
    "mapper": MapperPlan,
    "teaching": TeachPlan,
    "gates": GateConfig,
    "plan": AnalysisPlan,
}
_ARRAYS: dict[str, type] = {"conditions": Condition, "phases": PhasePlan}
_NEEDED = ("format", "title", "seed", "rollouts", "consent", "phases")


def protocol_sha256(text: str) -> str:
    """What freezes a protocol: the hash of its file, to the last byte."""
    return sha256(text.encode()).hexdigest()


def read_protocol_text(folder: Path) -> str:
    """The protocol's file, as it is now.

    Raises:
        StudyError: it is missing or no UTF-8.
    """
    path = folder / PROTOCOL_FILE
    try:
        return path.read_bytes().decode()
    except FileNotFoundError:
        raise StudyError(
            f"There is no {path}; make a study with: steerlab study new {folder}"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(
            f"Cannot read {path}: {error}. It must be a readable UTF-8 file."
        ) from error


def study_questionnaires(folder: Path) -> Mapping[str, Questionnaire]:
    """All questionnaires that a study in ``folder`` may ask, by key."""
    own = folder / QUESTIONNAIRES
    return all_questionnaires(own if own.is_dir() else None)


def parse_protocol(
    text: str, file: str, questionnaires: Mapping[str, Questionnaire]
) -> StudyProtocol:
    """Read and check a protocol; ``file`` is named in errors.

    Raises:
        StudyError: what is wrong, with file, line, key, value and what is allowed.
    """
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{file} is no TOML: {error}. Mend it there.") from error
    try:
        protocol = _protocol(content)
        _check(protocol, content, questionnaires)
    except ProtocolError as error:
        raise error.at(file, line_of(text, error.key)) from None
    except StudyError as error:
        key = str(error).partition(":")[0]
        line = line_of(text, key)
        raise StudyError(f"{file}{f', line {line}' if line else ''}: {error}") from error
    return protocol


def _protocol(content: dict[str, Any]) -> StudyProtocol:
    check_keys(content, [*_TOP, "rollouts", *_SECTIONS, *_ARRAYS], "")
    for key in _NEEDED:
        if key not in content:
            raise ProtocolError(key, None, "given")
    values: dict[str, Any] = {}
    for key, kind in _TOP.items():
        if key in content:
            values[key] = value_of(kind, content[key], key)
    if values.pop("format") != FORMAT:
        raise ProtocolError("format", content["format"], f"{FORMAT}, the only one there is")
    for key, kind in _SECTIONS.items():
        if key in content:
            values[key] = record_from_table(kind, content[key], key)
    for key, kind in _ARRAYS.items():
        values[key] = records_at(kind, content.get(key, []), key)
    values["rollouts"] = _rollouts(content["rollouts"])
    values.setdefault("block_size", factorial(len(values["conditions"])))
    return StudyProtocol(**values)


def _rollouts(given: object) -> tuple[str, ...]:
    """The first so many of the calibration set, or those that are named."""
    known = _calibration_names()
    if type(given) is int:
        if not 1 <= given <= len(known):
            raise ProtocolError("rollouts", given, f"from 1 to {len(known)}, or a list of names")
        return known[:given]
    names: tuple[str, ...] = value_of(tuple[str, ...], given, "rollouts")
    for place, name in enumerate(names, start=1):
        if name not in known or name in names[: place - 1]:
            raise ProtocolError(f"rollouts[{place}]", name, f"one of {', '.join(known)}, each once")
    if not names:
        raise ProtocolError("rollouts", [], "one or more names")
    return names


@cache
def _calibration_names() -> tuple[str, ...]:
    return tuple(rollout.name for rollout in load_calibration_set())


def _check(
    protocol: StudyProtocol, content: dict[str, Any], questionnaires: Mapping[str, Questionnaire]
) -> None:
    """What no record can see alone."""
    if not protocol.title.strip():
        raise ProtocolError("title", protocol.title, "some words")
    for key, least in (("seed", 0), ("demonstrations", 1)):
        if getattr(protocol, key) < least:
            allowed = f"a whole number, at least {least}"
            raise ProtocolError(key, getattr(protocol, key), allowed)
    check_prefix("training_prefix", protocol.training_prefix)
    check_prefix("test_prefix", protocol.test_prefix)
    if protocol.training_prefix == protocol.test_prefix:
        allowed = f"another than training_prefix ({protocol.training_prefix!r}): ids would overlap"
        raise ProtocolError("test_prefix", protocol.test_prefix, allowed)
    _check_conditions(protocol)
    _check_phases(protocol)
    for number, phase in enumerate(protocol.phases, start=1):
        for name in ("questionnaires", "after"):
            for key in getattr(phase, name):
                if key not in questionnaires:
                    allowed = f"one of {', '.join(sorted(questionnaires))}, or have a file "
                    allowed += f"{QUESTIONNAIRES}/{key}.toml beside {PROTOCOL_FILE}"
                    raise ProtocolError(f"phases[{number}].{name}", key, allowed)


def _check_conditions(protocol: StudyProtocol) -> None:
    keys = [condition.key for condition in protocol.conditions]
    for place, key in enumerate(keys, start=1):
        if key in keys[: place - 1]:
            raise ProtocolError(f"conditions[{place}].key", key, "another one: it is taken")
    if len(keys) > MOST_CONDITIONS:
        raise ProtocolError("conditions", keys, f"at most {MOST_CONDITIONS}")
    orders = factorial(len(keys))
    if protocol.block_size < 1 or protocol.block_size % orders:
        allowed = f"a multiple of {orders}: so many orders have {len(keys)} conditions"
        raise ProtocolError("block_size", protocol.block_size, allowed)


def _check_phases(protocol: StudyProtocol) -> None:
    taken: set[str] = set()
    for number, phase in enumerate(protocol.phases, start=1):
        ids = {phase.id}
        if phase.kind is PhaseKind.TEACH:
            if not protocol.conditions:
                raise ProtocolError(
                    f"phases[{number}].kind", "teach", "left out, or there must be [[conditions]]"
                )
            ids = {id_ for n in range(len(protocol.conditions)) for id_ in teach_ids(phase.id, n)}
        if overlap := ids & taken:
            allowed = f"another one: {sorted(overlap)[0]!r} is taken"
            raise ProtocolError(f"phases[{number}].id", phase.id, allowed)
        taken |= ids
    for role in Role:
        _check_way(protocol, role)


def teach_ids(phase: str, index: int) -> tuple[str, str]:
    """Ids of the ``index``-th condition's teaching and of the questionnaires after it."""
    return f"{phase}-{index + 1}", f"after-{phase}-{index + 1}"


_BEFORE = {PhaseKind.CALIBRATE_W: PhaseKind.CALIBRATION, PhaseKind.TEACH: PhaseKind.CALIBRATE_W}
_ONCE = (PhaseKind.CONSENT, PhaseKind.CALIBRATION, PhaseKind.CALIBRATE_W)


def _check_way(protocol: StudyProtocol, role: Role) -> None:
    """Consent first, what needs something after it, and nothing that can only be once twice."""
    seen: list[PhaseKind] = []
    for number, phase in enumerate(protocol.phases, start=1):
        if role not in phase.roles:
            continue
        where = f"phases[{number}].kind"
        if not seen and phase.kind is not PhaseKind.CONSENT:
            allowed = f"consent: it must be the first phase of {role} participants"
            raise ProtocolError(where, phase.kind.value, allowed)
        if phase.kind in _ONCE and phase.kind in seen:
            raise ProtocolError(where, phase.kind.value, f"once among the phases of {role}")
        if phase.kind in _BEFORE and _BEFORE[phase.kind] not in seen:
            allowed = f"after a phase of kind {_BEFORE[phase.kind]}"
            raise ProtocolError(where, phase.kind.value, allowed)
        seen.append(phase.kind)
    if PhaseKind.CALIBRATION not in seen:
        allowed = f"phases with one of kind calibration for {role} participants"
        raise ProtocolError("phases", f"{len(seen)} phases for {role}", allowed)
