"""From a population run to its summary, its figures and its report."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from steerlab.analysis.figures import (
    embedding_figure,
    improvement_figure,
    label_figure,
    people_figure,
    world_figure,
)
from steerlab.analysis.report import (
    DriveCaption,
    LabelsCaption,
    ReportFigures,
    SimulationReport,
    ladder_of,
)
from steerlab.analysis.summary import SPLITS, SplitSummary, StyleSummary, Summary
from steerlab.app.population_run import PopulationResult
from steerlab.learning.probe import style_parameters
from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.driving import Driving
from steerlab.sim.files.provenance import versions
from steerlab.sim.ground_truth import Planner
from steerlab.sim.rollout import Rollout

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
        figures=ReportFigures(
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
