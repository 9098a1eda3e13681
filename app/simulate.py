"""``steerlab simulate`` and ``demo``: a population run, written as one folder of results."""

import json
import logging
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from steerlab.analysis.report import render_report
from steerlab.analysis.summary import Summary
from steerlab.app.population_run import PopulationRunConfig, Progress, run_population
from steerlab.app.simulation_report import (
    camera_frame,
    compose_report,
    frame_step,
    shown_rollout,
    summarise,
)
from steerlab.learning.checkpoint import save_mapper
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import NoRenderer
from steerlab.sim.files.output_folder import output_folder
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.shards import write_shard

_log = logging.getLogger(__name__)


def simulate(
    config: PopulationRunConfig, out: Path, *, force: bool, command: str, progress: Progress
) -> Summary:
    """Run the study and write ``out``: labels, teachers, model, report and summary.

    Without OpenGL the report has no picture from the camera, and says so; nothing else needs one.

    Layout: ``labels/{seen,new}.parquet``, ``teachers.json`` (the true styles),
    ``models/mind_meld.safetensors``, ``report/index.html``, ``summary.json``.

    Args:
        command: the command line, for the report.

    Raises:
        SteerlabError: bad input or no place to write; nothing is left behind.
    """
    started = perf_counter()
    with output_folder(out, force=force) as folder:
        progress("drawing the world", 0.0)
        shown = shown_rollout(load_calibration_set()[: config.rollouts])
        frame = _picture(shown)  # first: who wants one must not learn after an hour that it lacks
        result = run_population(config, progress)
        for part in ("labels", "models", "report"):
            (folder / part).mkdir()
        for split, table in result.labels.items():
            write_shard(table, folder / "labels" / f"{split}.parquet")
        teachers = _styles(result.seen) | _styles(result.new)
        (folder / "teachers.json").write_text(
            json.dumps(teachers, indent=2) + "\n", encoding="utf-8"
        )
        save_mapper(result.mapper, folder / "models" / "mind_meld.safetensors")
        progress("writing the report", 0.0)
        # The page shows its own numbers, so the clock stops before it is drawn.
        seconds = result.seconds | {"before_report": perf_counter() - started}
        summary = summarise(result, seconds)
        page = render_report(compose_report(result, summary, frame, command))
        (folder / "report" / "index.html").write_text(page, encoding="utf-8")
        (folder / "summary.json").write_text(summary.to_json(), encoding="utf-8")
        progress("writing the report", 1.0)
    return summary


def _picture(shown: Rollout) -> NDArray[np.uint8] | None:
    try:
        return camera_frame(shown, frame_step(shown))
    except NoRenderer as error:
        _log.warning("The report will have no picture from the camera. %s", error)
        return None


def _styles(teachers: Sequence[ScriptedTeacher]) -> dict[str, dict[str, float]]:
    return {teacher.name: asdict(teacher.style) for teacher in teachers}
