"""``steerlab simulate`` and ``demo``: a population run, written as one folder of results."""

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from steerlab.analysis.figures import (
    embedding_figure,
    improvement_figure,
    label_figure,
    people_figure,
    world_figure,
)
from steerlab.analysis.mapper_report import (
    DriveCaption,
    LabelsCaption,
    SimulationReport,
    ladder_of,
    render_report,
)
from steerlab.analysis.summary import SPLITS, SplitSummary, StyleSummary, Summary
from steerlab.app.population_run import PopulationResult, PopulationRunConfig, run_population
from steerlab.learning.checkpoint import save_mapper
from steerlab.learning.probe import style_parameters
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import NoRenderer
from steerlab.sim.files.output_folder import output_folder
from steerlab.sim.files.provenance import versions
from steerlab.sim.ground_truth import Planner
from steerlab.sim.progress import Progress
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


FRAME = CameraConfig(width=640, height=640, samples=4)
_PROBED = {"gain": "log_gain", "delay": "delay_s"}  # summary name: what the probe calls it


def summarise(result: PopulationResult, seconds: Mapping[str, float]) -> Summary:
    """The numbers of ``summary.json``."""
    probe_r2 = result.probe.probe_r2 if result.probe else {}
    return Summary(
        seed=result.config.seed,
        noise=result.config.noise,
        versions=versions(),
        seconds=seconds,
        splits={split: SplitSummary.of(result.scores[split].ladder) for split in SPLITS},
        left_out=result.left_out,
        style={
            name: StyleSummary(
                probe_r2=probe_r2.get(probed), spearman_new=result.spearman_new.get(probed)
            )
            for name, probed in _PROBED.items()
        },
    )


def camera_frame(rollout: Rollout, step: int) -> NDArray[np.uint8]:
    """What the teacher saw at ``step``, (height, width, 3) RGB.

    Raises:
        NoRenderer: this machine cannot draw.
    """
    with Driving(rollout.world) as driving:
        driving.restore(rollout.physics_state[step])
        with Camera(driving.model, driving.data, FRAME) as camera:
            return camera.frame().copy()


def frame_step(rollout: Rollout) -> int:
    """A moment early in the rollout, when the ball is still far."""
    return rollout.steps // 4


def shown_rollout(result_rollouts: tuple[Rollout, ...]) -> Rollout:
    """The rollout of the drive figure: the one that strays most from what the oracle asked for."""
    return max(
        result_rollouts,
        key=lambda rollout: float(np.nanmean(np.abs(rollout.robot_wheel - rollout.oracle_label))),
    )


def compose_report(
    result: PopulationResult, summary: Summary, frame: NDArray[np.uint8] | None, command: str
) -> SimulationReport:
    """The report of a run; ``frame`` is the camera's picture of the drive figure, if there is one."""
    rollout = shown_rollout(result.rollouts)
    planner = Planner(rollout.world, seed=result.config.seed)
    moments = [frame_step(rollout), (5 * rollout.steps) // 8]
    paths = [planner.label_path(rollout.pose_at(step)).points for step in moments]
    times = [float(rollout.t_s[step]) for step in moments]
    drive = world_figure(
        rollout.world,
        rollout.pose,
        [(path, f"{t_s:.0f} s") for path, t_s in zip(paths, times, strict=True)],
        camera_rgb=frame,
        camera_label=f"what the teacher sees at {times[0]:.0f} s",
    )
    ladder_ci95 = {
        name: {split: result.scores[split].ladder[name].ci95 for split in SPLITS}
        for name in summary.splits["new"].improvement
    }
    labels_caption, labels_figure = _labels(result)
    people = [*result.seen, *result.new]
    styles = style_parameters([teacher.style for teacher in people])
    return SimulationReport(
        summary=summary,
        ladder_ci95=ladder_ci95,
        command=command,
        drive=DriveCaption(
            rollout=rollout.name,
            world=rollout.world.name,
            duration_s=float(rollout.t_s[-1]),
            outcome=str(rollout.outcome),
            oracle_moments_s=tuple(times),
            camera_t_s=None if frame is None else times[0],
        ),
        labels=labels_caption,
        figures=dict(
            drive=drive,
            labels=labels_figure,
            ladder=improvement_figure(ladder_of(summary, ladder_ci95)),
            people=people_figure(
                {
                    split: (scores.people_before, scores.people_after)
                    for split, scores in result.scores.items()
                }
            ),
            embeddings=embedding_figure(
                result.embeddings(result.seen),
                result.embeddings(result.new),
                np.exp(styles["log_gain"]),
                styles["delay_s"],
            ),
        ),
    )


def _labels(result: PopulationResult):
    """Before and after for the new teacher whose improvement is the median one."""
    scores = result.scores["new"]
    improvement = 1.0 - scores.people_after / scores.people_before
    middle = int(np.argsort(improvement)[len(improvement) // 2])
    person = sorted(teacher.name for teacher in result.new)[middle]
    series = next(one for one in result.parts.held_out_new if one.person == person)
    mapped = result.mapper.map(series)
    caption = LabelsCaption.of(
        teacher=person,
        split="new",
        rollout=series.rollout,
        raw=series.label,
        mapped=mapped,
        truth=series.truth,
    )
    t_s = np.arange(series.steps) / series.rate_hz
    return caption, label_figure(t_s, series.label, mapped, series.truth)
