"""A made-up study: every number is invented, so that a report can be drawn without a run."""

from dataclasses import dataclass

import numpy as np
import pytest
from matplotlib.figure import Figure

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
)
from steerlab.analysis.summary import SplitSummary, StyleSummary, Summary
from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import Block, WorldSpec

FloatArray = np.ndarray

LADDER_CI95 = {
    "identity": {"seen": (0.0, 0.0), "new": (0.0, 0.0)},
    "person_gain": {"seen": (0.29, 0.41), "new": (0.28, 0.42)},
    "mean_embedding": {"seen": (0.16, 0.27), "new": (0.17, 0.29)},
    "mind_meld": {"seen": (0.571, 0.674), "new": (0.548, 0.671)},
}


@dataclass(frozen=True, kw_only=True)
class Arrays:
    """What the example's figures are drawn from."""

    world: WorldSpec
    pose: FloatArray
    oracle_paths: list[tuple[FloatArray, str]]
    camera_rgb: FloatArray
    t_s: FloatArray
    raw: FloatArray
    mapped: FloatArray
    truth: FloatArray
    seen: FloatArray
    new: FloatArray
    gain: FloatArray
    delay_s: FloatArray
    people: dict[str, tuple[FloatArray, FloatArray]]


def example_arrays() -> Arrays:
    rng = np.random.default_rng(7)
    world = WorldSpec(
        name="world-03",
        ball_xy_m=(34.0, 26.0),
        start=Pose2D(-36.0, -30.0, 0.9),
        blocks=tuple(
            Block(float(x), float(y), float(a), float(b))
            for x, y, a, b in (
                (-18, -8, 3.5, 2.5),
                (-2, -22, 2, 4),
                (8, 6, 3, 3),
                (22, -12, 4, 1.5),
                (-30, 18, 2, 3),
                (-6, 32, 4, 2),
                (30, 4, 1.5, 2.5),
                (12, 38, 2, 2),
                (-44, -2, 2, 2),
                (40, -34, 3, 3),
            )
        ),
    )
    s = np.linspace(0.0, 1.0, 200)
    x = -36.0 + 62.0 * s
    y = -30.0 + 42.0 * s + 13.0 * np.sin(2.6 * np.pi * s) * (1 - 0.4 * s)
    heading = np.arctan2(np.gradient(y), np.gradient(x))
    pose = np.column_stack([x, y, heading])
    paths = []
    for step in (45, 120):
        u = np.linspace(0.0, 1.0, 60)[:, None]
        start, end = pose[step, :2], np.array(world.ball_xy_m)
        bend = np.array([0.0, -9.0 if step == 45 else 5.0])
        paths.append((start + (end - start) * u + bend * np.sin(np.pi * u), f"{step / 10:.1f} s"))
    height, width = 96, 128
    rows = np.linspace(0, 1, height)[:, None]
    sky = np.stack([150 + 60 * rows, 180 + 40 * rows, 215 + 20 * rows], axis=-1)
    frame = np.broadcast_to(sky, (height, width, 3)).copy()
    frame[52:] = (118, 124, 110)
    frame[36:62, 14:44] = (70, 74, 82)
    yy, xx = np.mgrid[:height, :width]
    frame[(yy - 50) ** 2 + (xx - 84) ** 2 < 64] = (226, 120, 30)
    t = np.arange(200) / 10.0
    truth = np.clip(1.7 * np.sin(0.55 * t) + 0.7 * np.sin(1.4 * t + 1.0), -2.5, 2.5)
    late = np.interp(t - 0.45, t, truth)
    raw = np.clip(1.55 * late + 0.12 * rng.standard_normal(200), -2.5, 2.5)
    mapped = np.clip(truth + 0.35 * (raw - truth) + 0.04 * rng.standard_normal(200), -2.5, 2.5)
    truth[131:137] = np.nan
    people = 34
    gain = np.exp(0.45 * rng.standard_normal(2 * people))
    delay_s = 0.12 + 0.22 * rng.standard_normal(2 * people)
    w = np.column_stack([np.log(gain) / 0.45, (delay_s - 0.12) / 0.22, np.zeros((68, 2))])
    w = w @ np.linalg.qr(rng.standard_normal((4, 4)))[0] + 0.25 * rng.standard_normal((68, 4))
    before = np.exp(rng.normal(-0.6, 0.35, 68))
    after = before * np.clip(rng.normal(0.42, 0.18, 68), 0.15, 1.25)
    after[40] = 1.12 * before[40]
    return Arrays(
        world=world,
        pose=pose,
        oracle_paths=paths,
        camera_rgb=frame.astype(np.uint8),
        t_s=t,
        raw=raw,
        mapped=mapped,
        truth=truth,
        seen=w[:people],
        new=w[people:],
        gain=gain,
        delay_s=delay_s,
        people={
            "seen": (before[:people], after[:people]),
            "new": (before[people:], after[people:]),
        },
    )


def example_summary(**changes: object) -> Summary:
    splits = {
        name: SplitSummary(
            people=34,
            labels=labels,
            mae_before=before,
            mae_after=after,
            improvement={
                "identity": 0.0,
                "person_gain": 0.35,
                "mean_embedding": mean,
                "mind_meld": ours,
            },
            ci95=LADDER_CI95["mind_meld"][name],
            person_median=median,
            people_improved=improved,
            labels_worsened=worsened,
            per_sample_percent=percent,
        )
        for name, labels, before, after, mean, ours, median, improved, worsened, percent in (
            ("seen", 13600, 0.6123, 0.2281, 0.214, 0.62747, 0.6512, 1.0, 0.2134, -412.7),
            ("new", 13598, 0.5987, 0.2312, 0.2261, 0.61383, 0.6401, 33 / 34, 0.2251, 37.21),
        )
    }
    values: dict[str, object] = {
        "seed": 0,
        "noise": "human",
        "versions": {"steerlab": "0.1.0", "python": "3.11.7", "mujoco": "3.3.1", "torch": "2.13.0"},
        "seconds": {"drives": 4.2, "oracle": 11.8, "labels": 1.9, "fit": 31.5, "report": 2.2},
        "splits": splits,
        "left_out": {"no_embedding": "the quick ladder", "mind_meld_paper": "the quick ladder"},
        "style": {
            "gain": StyleSummary(probe_r2=0.981, spearman_new=0.974),
            "delay": StyleSummary(probe_r2=0.887, spearman_new=None),
        },
    }
    return Summary(**{**values, **changes})


def example_figures(arrays: Arrays, summary: Summary) -> dict[str, Figure]:
    a = arrays
    return dict(
        drive=world_figure(
            a.world,
            a.pose,
            a.oracle_paths,
            camera_rgb=a.camera_rgb,
            camera_label="the teacher's view at 4.5 s",
        ),
        labels=label_figure(a.t_s, a.raw, a.mapped, a.truth),
        ladder=improvement_figure(ladder_of(summary, LADDER_CI95)),
        people=people_figure(a.people),
        embeddings=embedding_figure(a.seen, a.new, a.gain, a.delay_s),
    )


def example_report(**changes: object) -> SimulationReport:
    a = example_arrays()
    summary = changes.pop("summary", example_summary())
    assert isinstance(summary, Summary)
    values: dict[str, object] = {
        "summary": summary,
        "ladder_ci95": LADDER_CI95,
        "command": "steerlab simulate --seed 0 --noise human --out study",
        "drive": DriveCaption(
            rollout="calibration-03",
            world="world-03",
            duration_s=20.0,
            outcome="time limit",
            oracle_moments_s=(4.5, 12.0),
            camera_t_s=4.5,
        ),
        "labels": LabelsCaption.of(
            teacher="new-07",
            split="new",
            rollout="calibration-11",
            raw=a.raw,
            mapped=a.mapped,
            truth=a.truth,
        ),
        "figures": example_figures(a, summary),
    }
    return SimulationReport(**{**values, **changes})


@pytest.fixture(scope="session")
def arrays() -> Arrays:
    return example_arrays()


@pytest.fixture(scope="session")
def summary() -> Summary:
    return example_summary()


@pytest.fixture(scope="session")
def report() -> SimulationReport:
    return example_report()


@pytest.fixture
def empty_figures() -> dict[str, Figure]:
    """Figures that cost nothing to draw, for tests about words."""
    return dict.fromkeys(("drive", "labels", "ladder", "people", "embeddings"), Figure())
