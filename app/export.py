"""``steerlab export``: a study's data as files for other programs."""

import json
from dataclasses import asdict
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from steerlab.analysis.export.bundle import ExportConfig, write_export
from steerlab.analysis.export.spss import check_installed
from steerlab.analysis.study_data.whole_study import read_whole_study, study_id, study_state
from steerlab.app.packed_export import EXPORTS, SUMMARY, VERB, summary_of
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.output_folder import OutputError, check_output_folder, output_folder
from steerlab.sim.files.run_folder import finite_json
from steerlab.sim.progress import Progress
from steerlab.study.derived import ERASED_BEFORE, ErasureGuard
from steerlab.study.models import frozen_model
from steerlab.study.store.store import STUDY_FILE
from steerlab.study.study_folder import OpenStudy

SCHEMA = 1


def default_out(folder: Path, config: ExportConfig) -> Path:
    """``exports/FORMATS`` in the study, a folder of its own for each choice."""
    name = "+".join(config.formats)
    name += "+free-text" if config.free_text else ""
    return folder / EXPORTS / (name + ("+withdrawn" if config.with_withdrawn else ""))


def export(
    folder: Path,
    config: ExportConfig,
    out: Path | None,
    *,
    force: bool,
    progress: Progress,
) -> dict[str, Any]:
    """Write the export of the study in ``folder``; one of the same state that is there stays.

    Args:
        out: None for ``default_out``, where an earlier export of this study is replaced.
        force: replace an earlier export of this study, or another folder that is not empty.

    Returns:
        the summary.

    Raises:
        SteerlabError: there is nothing to export, no place to write, or somebody was erased
            meanwhile; what was there stays.
    """
    if not config.formats:
        raise InvalidConfig("No format is given; choose one or more with --format.")
    if "spss" in config.formats:
        check_installed()
    progress("reading", 0.0)
    place = default_out(folder, config) if out is None else out
    study = OpenStudy.open(folder, read_only=True)
    try:
        guard = ErasureGuard.of(folder)
        with guard.reading():
            made_from = _made_from(study, config)
            _check_place(place, folder, made_from["study"])
            if (there := _unchanged(place, made_from)) is not None:
                return there
            replaced = force or (out is None and summary_of(place) is not None)
            check_output_folder(place, force=replaced)
            data = read_whole_study(study, with_withdrawn=config.with_withdrawn)
    finally:
        study.store.close()
    with guard.reading(), output_folder(place, force=replaced, placing=guard.placing()) as fresh:
        fresh.chmod(0o700)  # answers and labels are nobody else's business, wherever they lie
        tables = write_export(data, config, fresh, version=made_from["steerlab"], progress=progress)
        summary = made_from | {
            "title": data.title,
            "changed_utc": data.changed_utc,
            "protocol_sha256": data.protocol_sha256,
            "participants": len(data.people),
            "counted": sum(person.why_excluded is None for person in data.people),
            "rows": {table.name: table.data.num_rows for table in tables},
            "notices": list(data.notices),
            ERASED_BEFORE: sorted(guard.erased),
            "files": _hashes(fresh),
        }
        text = finite_json(summary, SUMMARY) + "\n"
        (fresh / SUMMARY).write_text(text, encoding="utf-8")
    return summary


def _made_from(study: OpenStudy, config: ExportConfig) -> dict[str, Any]:
    """What an export depends on: equal in two exports, these are equal to the byte."""
    with study.reading():
        id_, (state, _) = study_id(study), study_state(study)
        model = frozen_model(study)
        network = model is not None and (study.folder / model.file).is_file()
        questionnaires = "".join(one.fingerprint() for one in study.questionnaires.values())
    return {
        "schema": SCHEMA,
        "verb": VERB,
        "study": id_,
        "state": state,
        "network": bool(network),
        "questionnaires": sha256(questionnaires.encode()).hexdigest(),
        "settings": json.loads(json.dumps(asdict(config))),
        "steerlab": version("steerlab"),
        "pyarrow": version("pyarrow"),
    } | ({"pyreadstat": version("pyreadstat")} if "spss" in config.formats else {})


def _check_place(place: Path, folder: Path, study: str) -> None:
    """Refuse to replace a study, or the export of another one.

    Raises:
        OutputError: which of them it is.
    """
    whole = place.resolve()
    if (whole / STUDY_FILE).exists() or folder.resolve().is_relative_to(whole):
        raise OutputError(
            f"{place} holds a study, which an export would replace; choose a new folder for --out."
        )
    there = summary_of(place)
    if there is not None and there["study"] != study:
        raise OutputError(
            f"{place} holds the export of another study, {there['study']} "
            f"({there.get('title', 'without a title')}); choose another folder for --out."
        )


def _unchanged(place: Path, made_from: dict[str, Any]) -> dict[str, Any] | None:
    """The summary of an export that is there and would be made again to the byte, else None."""
    there = summary_of(place)
    if there is None or any(there.get(key) != value for key, value in made_from.items()):
        return None
    return there if there.get("files") == _hashes(place) else None


def _hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every file but the summary, by its path."""
    return {
        path.relative_to(folder).as_posix(): sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != SUMMARY
    }
