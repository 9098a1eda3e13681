"""Reading ``study.toml`` into a ``StudyProtocol``; errors name the line that is wrong."""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from hashlib import sha256
from math import factorial
from pathlib import Path
from shlex import quote
from typing import Any

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import InvalidValue, check_words
from steerlab.sim.files.structured import (
    one_of,
    structured,
    toml_values,
    utf8_text,
    versioned,
    within_file,
)
from steerlab.sim.names import appearance
from steerlab.study.contract import PhaseKind, Role, StudyError
from steerlab.study.protocol import MOST_CONDITIONS, PhasePlan, StudyProtocol, teach_ids
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.questionnaire_file import all_questionnaires
from steerlab.study.teaching.conditions import TAUGHT

PROTOCOL_FILE, QUESTIONNAIRES = "study.toml", "questionnaires"
FORMAT = 1
_PREFIX = re.compile(r"[A-Z]{1,4}")
_ONCE = (PhaseKind.CONSENT, PhaseKind.CALIBRATE_W)


def protocol_sha256(text: str) -> str:
    """The hash that identifies a frozen protocol: of its file's whole text."""
    return sha256(text.encode()).hexdigest()


def read_protocol_text(folder: Path) -> str:
    """The text of the protocol's file, as it is now.

    Raises:
        SteerlabError: it is missing or not UTF-8.
    """
    path = folder / PROTOCOL_FILE
    if not path.exists():
        raise StudyError(
            f"There is no {path}; make a study with: steerlab study new {quote(str(folder))}"
        )
    return utf8_text(path)


def study_questionnaires(folder: Path) -> Mapping[str, Questionnaire]:
    """All questionnaires that a study in ``folder`` may ask, by key."""
    added = folder / QUESTIONNAIRES
    return all_questionnaires(added if added.is_dir() else None)


def parse_protocol(
    text: str, file: str, questionnaires: Mapping[str, Questionnaire]
) -> StudyProtocol:
    """Read and check a protocol; ``file`` is named in errors.

    Raises:
        InvalidConfig: what is wrong, with file, line, key, value and what is allowed.
    """
    content = toml_values(text, file)
    with within_file(file, text):
        values = versioned(StudyProtocol, content, "format", FORMAT)
        protocol = structured(StudyProtocol, _complete(values))
        _check(protocol, questionnaires)
    return protocol


def _complete(values: dict[str, Any]) -> dict[str, Any]:
    """The file's values with defaults put in, and a number of rollouts turned into names."""
    conditions = values.get("conditions", [])
    orders = factorial(len(conditions)) if isinstance(conditions, list) else 1
    given = {"conditions": conditions, "block_size": orders} | values
    if type(count := values.get("rollouts")) is int:
        known = _calibration_names()
        if not 1 <= count <= len(known):
            raise InvalidValue("rollouts", count, f"from 1 to {len(known)}, or a list of names")
        given["rollouts"] = known[:count]
    return given


@cache
def _calibration_names() -> tuple[str, ...]:
    return tuple(rollout.name for rollout in load_calibration_set())


def _check(protocol: StudyProtocol, questionnaires: Mapping[str, Questionnaire]) -> None:
    """Check what concerns several records at once."""
    check_words("title", protocol.title)
    for key, least in (("seed", 0), ("demonstrations", 1)):
        if getattr(protocol, key) < least:
            allowed = f"a whole number, at least {least}"
            raise InvalidValue(key, getattr(protocol, key), allowed)
    for key in ("training_prefix", "test_prefix"):
        if not _PREFIX.fullmatch(prefix := getattr(protocol, key)):
            raise InvalidValue(key, prefix, "one to four capital letters")
    if protocol.training_prefix == protocol.test_prefix:
        allowed = f"another than training_prefix ({protocol.training_prefix!r}): ids would overlap"
        raise InvalidValue("test_prefix", protocol.test_prefix, allowed)
    _check_rollouts(protocol)
    _check_conditions(protocol)
    _check_phases(protocol)
    for number, phase in enumerate(protocol.phases):
        for name in ("questionnaires", "after"):
            for index, key in enumerate(getattr(phase, name)):
                if key not in questionnaires:
                    allowed = f"one of {one_of(sorted(questionnaires), key)}, or have a file "
                    allowed += f"{QUESTIONNAIRES}/{key}.toml beside {PROTOCOL_FILE}"
                    raise InvalidValue(f"phases[{number}].{name}[{index}]", key, allowed)
                if (spoken := questionnaires[key].language) != protocol.language:
                    other = f"{key}_{protocol.language}"
                    if other not in questionnaires:
                        other = (
                            f"{QUESTIONNAIRES}/{other}.toml with language = {protocol.language!r}"
                        )
                    allowed = (
                        f"a questionnaire in the protocol's language ({protocol.language!r}); it is "
                        f"in {spoken!r}: ask a translation under another key, such as "
                        f"{other}, or set the protocol's language to {spoken!r}"
                    )
                    raise InvalidValue(f"phases[{number}].{name}[{index}]", key, allowed)


def _check_rollouts(protocol: StudyProtocol) -> None:
    known, names = _calibration_names(), protocol.rollouts
    if not names:
        raise InvalidValue("rollouts", [], "one or more names")
    for index, name in enumerate(names):
        if name not in known or name in names[:index]:
            raise InvalidValue(f"rollouts[{index}]", name, f"one of {', '.join(known)}, each once")


def _check_conditions(protocol: StudyProtocol) -> None:
    keys = [condition.key for condition in protocol.conditions]
    for index, key in enumerate(keys):
        if key in keys[:index]:
            raise InvalidValue(f"conditions[{index}].key", key, "another one: it is taken")
    if len(keys) > MOST_CONDITIONS:
        raise InvalidValue("conditions", keys, f"at most {MOST_CONDITIONS}")
    orders = factorial(len(keys))
    if protocol.block_size < 1 or protocol.block_size % orders:
        allowed = f"a multiple of {orders}: {len(keys)} conditions have so many orders"
        raise InvalidValue("block_size", protocol.block_size, allowed)


def _check_phases(protocol: StudyProtocol) -> None:
    taken: set[str] = set()
    for number, phase in enumerate(protocol.phases):
        ids = {phase.id}
        if phase.kind is PhaseKind.TEACH:
            if not protocol.conditions:
                raise InvalidValue(
                    f"phases[{number}].kind", "teach", "left out, or there must be [[conditions]]"
                )
            ids = {id_ for n in range(len(protocol.conditions)) for id_ in teach_ids(phase.id, n)}
        if overlap := ids & taken:
            allowed = f"another one: {sorted(overlap)[0]!r} is taken"
            raise InvalidValue(f"phases[{number}].id", phase.id, allowed)
        taken |= ids
    for role in Role:
        _check_sequence(protocol, role)


def _check_sequence(protocol: StudyProtocol, role: Role) -> None:
    """Consent comes first, each phase after what it needs, and some kinds only once.

    Every rollout of the protocol is corrected in one calibration phase, if there is any.
    """
    seen: list[PhaseKind] = []
    corrected: list[str] = []
    mapped = [one.key for one in protocol.conditions if TAUGHT[one.key].needs_w]
    titles: dict[str, str] = {}
    for number, phase in enumerate(protocol.phases):
        if role not in phase.roles:
            continue
        title = titles.setdefault(appearance(phase.title), phase.id)
        if title != phase.id:
            allowed = f"another one: it looks like that of {title!r}, and people read both"
            raise InvalidValue(f"phases[{number}].title", phase.title, allowed)
        where = f"phases[{number}].kind"
        if not seen and phase.kind is not PhaseKind.CONSENT:
            allowed = f"consent: it must be the first phase of {role} participants"
            raise InvalidValue(where, phase.kind.value, allowed)
        if phase.kind in _ONCE and phase.kind in seen:
            raise InvalidValue(where, phase.kind.value, f"once among the phases of {role}")
        if phase.kind is PhaseKind.TEACH and mapped and PhaseKind.CALIBRATE_W not in seen:
            allowed = f"after a phase of kind calibrate_w, which {', '.join(mapped)} needs"
            raise InvalidValue(where, phase.kind.value, allowed)
        if phase.kind is PhaseKind.CALIBRATION:
            if PhaseKind.CALIBRATE_W in seen:
                raise InvalidValue(where, phase.kind.value, "before the phase of kind calibrate_w")
            corrected += _corrected_in(phase, protocol, corrected, f"phases[{number}].rollouts")
        if phase.kind is PhaseKind.CALIBRATE_W and not corrected:
            raise InvalidValue(where, phase.kind.value, "after a phase of kind calibration")
        seen.append(phase.kind)
    if protocol.design.turn_parts and seen and len(protocol.parts_for(role)) < 2:
        allowed = f"false: {role} participants have fewer than two parts of the rollouts"
        raise InvalidValue("design.turn_parts", True, allowed)
    if not {PhaseKind.CALIBRATION, PhaseKind.TEACH} & set(seen):
        allowed = f"phases with one of kind calibration or teach for {role} participants"
        if seen or not protocol.phases:  # a role without any phase takes no part
            raise InvalidValue("phases", f"{len(seen)} phases for {role}", allowed)
    if corrected and (left := [name for name in protocol.rollouts if name not in corrected]):
        allowed = f"left out, or corrected by {role} participants in some phase of kind calibration"
        raise InvalidValue("rollouts", left, allowed)


def _corrected_in(
    phase: PhasePlan, protocol: StudyProtocol, before: Sequence[str], path: str
) -> tuple[str, ...]:
    """The rollouts of a calibration phase: some of the protocol's, and none twice."""
    names = phase.rollouts or protocol.rollouts
    for index, name in enumerate(names):
        if name not in protocol.rollouts:
            allowed = f"one of {', '.join(protocol.rollouts)}"
            raise InvalidValue(f"{path}[{index}]", name, allowed)
        if name in before:
            allowed = "names that no earlier calibration phase has"
            raise InvalidValue(path, name, allowed)
    return names
