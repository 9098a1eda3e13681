"""``steerlab analyze``: every table, figure and hypothesis of a study, as one folder."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from steerlab.analysis.study_data.conditions_file import left_out_teachers, read_conditions
from steerlab.analysis.study_data.population import is_population_run, read_population
from steerlab.analysis.study_data.records import ConditionValue, Exclusion, NotAStudy, StudyData
from steerlab.analysis.study_data.study import read_study
from steerlab.analysis.study_tables.csv_files import csv_files
from steerlab.analysis.study_tables.deviations import deviations
from steerlab.analysis.study_tables.report import AnalysisReport, render_analysis
from steerlab.analysis.study_tables.tables import AnalysisConfig, analyse
from steerlab.sim.files.output_folder import check_output_folder, output_folder
from steerlab.sim.files.provenance import versions
from steerlab.sim.files.run_folder import finite_json
from steerlab.sim.names import alike, both_shown
from steerlab.sim.progress import Progress
from steerlab.study.derived import ERASED_BEFORE, ErasureGuard
from steerlab.study.store.store import STUDY_FILE

REPORT, PAGE, TABLES, SUMMARY = "report", "index.html", "tables.json", "summary.json"
SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class AnalyzeConfig:
    """Settings of ``steerlab analyze``.

    Attributes:
        networks: how many are trained (or taken from the run) without the held-out rollouts.
        conditions: a table or a ``steerlab teach`` run with the outcomes of conditions.
    """

    analysis: AnalysisConfig = field(default_factory=AnalysisConfig)
    networks: int = 1
    conditions: Path | None = None


def default_out(folder: Path) -> Path:
    """The parent of ``report/``: the study; of a population run, which has a report, ``analysis``."""
    return folder / "analysis" if is_population_run(folder) else folder


def analyze(
    folder: Path,
    config: AnalyzeConfig,
    out: Path,
    *,
    force: bool,
    command: str,
    progress: Progress,
) -> dict[str, Any]:
    """Analyse ``folder`` and write ``out/report/``: page, ``tables.json``, CSVs, ``summary.json``.

    An earlier analysis there is replaced.

    Returns:
        the summary.

    Raises:
        SteerlabError: nothing to analyse, or no place to write; what was there stays.
    """
    started = perf_counter()
    progress("reading", 0.0)
    _check_kind(folder)
    report = out / REPORT
    replace_it = force or (report / TABLES).is_file()
    check_output_folder(report, force=replace_it)
    guard = ErasureGuard.of(folder) if (folder / STUDY_FILE).is_file() else None
    with nullcontext() if guard is None else guard.reading():
        data = _read(folder, config, progress)
    read_s = perf_counter() - started
    progress("computing the tables", 0.0)
    analysis = analyse(data, config.analysis)
    tables_s = perf_counter() - started - read_s
    progress("writing the report", 0.0)
    files = csv_files(analysis.tables)
    seconds = {"read_and_train": read_s, "tables": tables_s}
    installed = versions()
    page = render_analysis(
        AnalysisReport(
            analysis=analysis,
            versions=installed,
            seconds=seconds,
            command=command,
            files=tuple(files),
        )
    )
    summary = _summary(
        data, analysis.tables, installed, seconds | {"all": perf_counter() - started}
    )
    summary[ERASED_BEFORE] = sorted(guard.erased) if guard is not None else []
    placing = None if guard is None else guard.placing()
    with (
        nullcontext() if guard is None else guard.reading(),
        output_folder(report, force=replace_it, placing=placing) as fresh,
    ):
        (fresh / PAGE).write_text(page, encoding="utf-8")
        (fresh / TABLES).write_text(analysis.to_json(), encoding="utf-8")
        text = finite_json(summary, SUMMARY) + "\n"
        (fresh / SUMMARY).write_text(text, encoding="utf-8")
        for name, csv in files.items():
            (fresh / name).write_text(csv, encoding="utf-8")
    progress("writing the report", 1.0)
    return summary


def _check_kind(folder: Path) -> None:
    if not ((folder / STUDY_FILE).is_file() or is_population_run(folder)):
        raise NotAStudy(
            f"{folder} is no study and no population run: it has neither {STUDY_FILE} nor "
            f"labels/seen.parquet. Give a folder made by steerlab study new or steerlab simulate; "
            f"outcomes of steerlab teach are given beside one of them, with --conditions."
        )


def _read(folder: Path, config: AnalyzeConfig, progress: Progress) -> StudyData:
    if (folder / STUDY_FILE).is_file():
        data = read_study(folder, networks=config.networks, progress=progress)
    else:
        data = read_population(folder, networks=config.networks, progress=progress)
    if config.conditions is None:
        return data
    data = with_conditions(data, read_conditions(config.conditions))
    return replace(
        data,
        exclusions=(*data.exclusions, *left_out_teachers(config.conditions)),
        notices=(
            *data.notices,
            f"Outcomes of conditions were read from {config.conditions.name}, which is not part of "
            f"what is on record here.",
        ),
    )


def with_conditions(data: StudyData, values: Sequence[ConditionValue]) -> StudyData:
    """``data`` with outcomes of conditions; of a study, only those of people who count."""
    people = {person.id: None for person in data.people} | {one.person: None for one in values}
    conditions = dict.fromkeys(one.condition for one in (*data.conditions, *values))
    for what, names in (("Participants", people), ("Conditions", conditions)):
        if pair := alike(names):
            raise NotAStudy(
                f"{what} {both_shown(*pair)}; write them in the outcomes of conditions as they are "
                f"on record."
            )
    if data.kind == "population run":  # its teachers are others than those who taught
        return replace(data, conditions=(*data.conditions, *values))
    counted = {person.id for person in data.people}
    kept = [value for value in values if value.person in counted]
    uncounted = dict.fromkeys(value.person for value in values if value.person not in counted)
    exclusions = [
        Exclusion(what="person", who=who, why="outcomes of conditions, but does not count here")
        for who in uncounted
    ]
    return replace(
        data,
        conditions=(*data.conditions, *kept),
        exclusions=(*data.exclusions, *exclusions),
    )


def _summary(
    data: StudyData,
    tables: Mapping[str, Any],
    installed: Mapping[str, str],
    seconds: Mapping[str, float],
) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "verb": "analyze",
        "kind": data.kind,
        "title": data.title,
        "simulated": data.simulated,
        "plan_sha256": data.plan.sha256 if data.plan else None,
        "analysed": tables["exclusions"]["analysed"],
        "hypotheses": {
            row["id"]: {"verdict": row["verdict"], "p_corrected": row["p_corrected"]}
            for row in tables["hypotheses"]
        },
        "deviations": deviations(data, tables["hypotheses"]),
        "notices": list(data.notices),
        "versions": dict(sorted(installed.items())),
        "seconds": {name: round(value, 2) for name, value in seconds.items()},
    }
