"""``steerlab power``: simulate many studies of many sizes, go on where an earlier call stopped."""

import csv
import io
from concurrent.futures import as_completed
from dataclasses import replace
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from steerlab.analysis.power_study.design import PowerDesign
from steerlab.analysis.power_study.report import PowerCurve, PowerReport, render_power
from steerlab.analysis.power_study.simulated_studies import BLOCK, add_up, run_block
from steerlab.analysis.study_data.conditions_file import read_conditions
from steerlab.analysis.study_data.records import NotAStudy
from steerlab.analysis.study_tables.conditions import outcome_table
from steerlab.app.worker_pool import worker_pool
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.provenance import versions
from steerlab.sim.files.run_folder import SUMMARY, results, run_folder, write_json
from steerlab.sim.files.structured import json_values, structured, utf8_text, within_file
from steerlab.sim.progress import Progress

RUN_FILE, BLOCKS, SCHEMA = "power.json", "blocks", 1
Taught = tuple[tuple[str, ...], FloatArray]


def power(
    design: PowerDesign,
    out: Path,
    *,
    command: str,
    progress: Progress,
    jobs: int = 1,
    taught: Path | None = None,
    force: bool = False,
) -> dict[str, Any]:
    """Simulate what is missing in ``out``, then write ``summary.json``, ``power.csv`` and report as one.

    More sample sizes or studies are added to those that are there; results depend neither on
    ``jobs`` nor on where an earlier call was stopped.

    Args:
        taught: a ``steerlab teach`` run (or a table of outcomes) to draw people from.

    Raises:
        SteerlabError: bad input, or no place to write; finished blocks are kept.
    """
    started = perf_counter()
    if jobs < 1:
        raise InvalidConfig(f"jobs is {jobs}; give 1 or more.")
    drawn = None if taught is None else _taught(taught, design.ours)
    design = replace(design, studies=BLOCK * ceil(design.studies / BLOCK))
    settings = {"schema": SCHEMA, "block": BLOCK, **design.identity()}
    settings["taught"] = None if drawn is None else [list(drawn[0]), drawn[1].tolist()]
    with run_folder(out, settings, file=RUN_FILE, parts=(BLOCKS,), force=force):
        _run(design, drawn, out, progress, jobs)
        curves = _curves(design, out)
        seconds = {"this_call": perf_counter() - started}
        found = versions()
        summary = {
            "schema": SCHEMA,
            "verb": "power",
            "design": design.identity() | {"people": [*design.people], "studies": design.studies},
            "outcomes_from": None if taught is None else taught.name,
            "curves": [curve.values() for curve in curves],
            "versions": dict(sorted(found.items())),
            "seconds": {name: round(value, 1) for name, value in seconds.items()},
        }
        report = PowerReport(
            design=design,
            curves=curves,
            taught="" if taught is None else taught.name,
            versions=found,
            seconds=seconds,
            command=command,
        )
        with results(out) as fresh:
            (fresh / "report").mkdir()
            (fresh / "report" / "index.html").write_text(
                render_power(report), encoding="utf-8", newline="\n"
            )
            (fresh / "power.csv").write_text(_csv(curves), encoding="utf-8", newline="\n")
            write_json(summary, fresh / SUMMARY)
        return summary


def _taught(path: Path, ours: str) -> Taught:
    """Success after the last round, (teachers, conditions), of those who have all conditions."""
    values = [one for one in read_conditions(path) if one.metric == "success"]
    cells = outcome_table(values, "success")
    names = tuple(dict.fromkeys(one.condition for one in values))
    people = dict.fromkeys(one.person for one in values)
    rows = [
        [cells[who, name][0] for name in names]
        for who in people
        if all((who, name) in cells for name in names)
    ]
    if ours not in names:
        raise NotAStudy(f"{path} has the conditions {', '.join(names)}; --ours is {ours!r}.")
    if len(rows) < 2:
        raise NotAStudy(f"{path} has {len(rows)} people with every condition; 2 are needed.")
    return names, np.array(rows)


def _block_path(out: Path, people: int, number: int) -> Path:
    return out / BLOCKS / f"n{people:04d}-{number:04d}.json"


def _run(
    design: PowerDesign, drawn: Taught | None, out: Path, progress: Progress, jobs: int
) -> None:
    numbers = range(design.studies // BLOCK)
    wanted = [(people, number) for people in design.people for number in numbers]
    missing = [one for one in wanted if not _block_path(out, *one).is_file()]

    def done(place: int) -> None:
        progress("simulating studies", (len(wanted) - len(missing) + place) / len(wanted))

    done(0)
    if jobs == 1 or len(missing) < 2:
        for place, one in enumerate(missing, start=1):
            write_json(run_block(design, *one, drawn), _block_path(out, *one))
            done(place)
        return
    with worker_pool(jobs, len(missing)) as pool:
        waiting = {pool.submit(run_block, design, *one, drawn): one for one in missing}
        for place, future in enumerate(as_completed(waiting), start=1):
            write_json(future.result(), _block_path(out, *waiting[future]))
            done(place)


def _curves(design: PowerDesign, out: Path) -> list[PowerCurve]:
    by_size = [
        add_up(
            [_read(_block_path(out, people, number)) for number in range(design.studies // BLOCK)]
        )
        for people in design.people
    ]
    return [
        PowerCurve.of(
            test,
            design.people,
            [one[test] for one in by_size],
            [design.studies] * len(design.people),
        )
        for test in by_size[0]
    ]


def _read(path: Path) -> dict[str, int]:
    try:
        values = json_values(utf8_text(path), str(path))
        with within_file(str(path)):
            return structured(dict[str, int], values)
    except InvalidConfig as error:
        raise OutputError(
            f"{path} is damaged; remove it, and the same command makes it again. {error}"
        ) from error


def _csv(curves: list[PowerCurve]) -> str:
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(["test", "people", "power", "monte_carlo_error", "studies"])
    for curve in curves:
        for row in zip(curve.people, curve.power, curve.error, curve.studies, strict=True):
            people, share, error, studies = row
            writer.writerow([curve.test, people, f"{share:.6g}", f"{error:.6g}", studies])
    return sink.getvalue()
