"""A Rerun recording of one teacher: every learner's drives, in teaching and when it was judged."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from steerlab.analysis.figures.look import learner_looks
from steerlab.analysis.wording import learner_name
from steerlab.sim.arrays import FloatArray
from steerlab.sim.files.refusal import refusal
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec
from steerlab.study.recording import layout
from steerlab.study.recording.rebuild import timeless_stream, whole_recording
from steerlab.study.recording.scene import log_world
from steerlab.study.recording.viewer import RecordingUnavailable

ROUND, DRIVE = "round", "judged drive"  # timelines beside ``layout.TIME``
POINT_S = 0.5  # between the points of a judged drive; the last may have come sooner
FRAME_S = 0.1
_PAUSE_S = 1.0  # between two judged drives on the time line
_PALE_RGB = (232, 234, 237)  # for what is ink on paper: the viewer's ground is dark
_HEIGHT_M = 0.15
_TEACHING, _JUDGED, _CARS = "teaching", "judged", "cars"


@dataclass(frozen=True, kw_only=True)
class TaughtDrives:
    """What one teacher's recording shows.

    Attributes:
        conditions: by learner, one learner seed as a shard holds it: ``by_round`` with ``path_m``,
            and ``final_drives``.
        about: Markdown beside the drives.
    """

    teacher: str
    world: WorldSpec
    conditions: Mapping[str, Mapping[str, Any]]
    about: str


def write_taught_drives(drives: TaughtDrives, out: Path) -> None:
    """Write the recording, whole or not at all; equal drives give an equal recording.

    Raises:
        RecordingUnavailable: it cannot be written.
    """
    world = drives.world.name
    stream = timeless_stream(f"steerlab teach {world}", f"teach/{world}/{drives.teacher}")
    try:
        with whole_recording(stream, out, _blueprint(drives)):
            stream.send_recording_name(f"{drives.teacher} · {drives.world.name}")
            log_world(stream, drives.world, drives.world.start)
            text = rr.TextDocument(drives.about, media_type=rr.MediaType.MARKDOWN)
            stream.log(layout.ABOUT, text, static=True, strict=True)
            offsets_s = _offsets(list(drives.conditions.values()))
            for name, colour in _colours(list(drives.conditions)).items():
                _log_learner(stream, name, drives.conditions[name], colour, offsets_s)
    except OSError as error:
        raise RecordingUnavailable(
            f"Cannot write {out}: {refusal(error)}. Then give the same command again."
        ) from error


def drive_poses(path_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A path with a point each ``POINT_S`` -> times (n,) and poses (n, 3) each ``FRAME_S``.

    Headings are along the path: a judged drive's own are not kept.
    """
    known_s = POINT_S * np.arange(len(path_m))
    t_s = np.arange(0.0, known_s[-1] + FRAME_S / 2.0, FRAME_S)
    xy_m = np.column_stack([np.interp(t_s, known_s, column) for column in path_m.T])
    if len(xy_m) < 2:
        return t_s, np.column_stack([xy_m, np.zeros(len(xy_m))])
    ahead = np.gradient(xy_m, axis=0)
    return t_s, np.column_stack([xy_m, np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))])


def _log_learner(
    stream: rr.RecordingStream,
    name: str,
    taught: Mapping[str, Any],
    colour: layout.Rgb,
    offsets_s: Sequence[float],
) -> None:
    key = _key(name)
    path = f"{layout.WORLD}/{_TEACHING}/{key}"
    for row in taught["by_round"]:
        stream.set_time(ROUND, sequence=row["round"])
        line = rr.LineStrips3D([_above(row["path_m"])], colors=[colour], radii=[0.25])
        stream.log(path, line, strict=True)
        if row["success"] is not None:
            stream.log(f"success/{key}", rr.Scalars(row["success"]), strict=True)
    stream.reset_time()
    series = rr.SeriesLines(names=[learner_name(name)], colors=[colour], widths=[2.0])
    stream.log(f"success/{key}", series, static=True, strict=True)
    judged = [_above(drive["path_m"]) for drive in taught["final_drives"]]
    lines = rr.LineStrips3D(judged, colors=[colour] * len(judged), radii=[0.07])
    stream.log(f"{layout.WORLD}/{_JUDGED}/{key}", lines, static=True, strict=True)
    _log_cars(stream, f"{layout.WORLD}/{_CARS}/{key}", taught, colour, offsets_s)


def _log_cars(
    stream: rr.RecordingStream,
    path: str,
    taught: Mapping[str, Any],
    colour: layout.Rgb,
    offsets_s: Sequence[float],
) -> None:
    """One car a learner; it drives the judged starts one after another."""
    car = CarConfig()
    body = rr.Boxes3D(
        centers=[(0.0, 0.0, 0.7)],
        half_sizes=[(car.length_m / 2.0, car.width_m / 2.0, 0.55)],
        colors=[colour],
        fill_mode=rr.components.FillMode.Solid,
    )
    stream.log(path, body, static=True, strict=True)
    for number, (drive, offset_s) in enumerate(zip(taught["final_drives"], offsets_s, strict=True)):
        t_s, poses = drive_poses(np.array(drive["path_m"]))
        half_rad = poses[:, 2] / 2.0
        turns = np.column_stack(
            [0.0 * half_rad, 0.0 * half_rad, np.sin(half_rad), np.cos(half_rad)]
        )
        stream.send_columns(
            path,
            [
                rr.TimeColumn(layout.TIME, duration=offset_s + t_s),
                rr.TimeColumn(DRIVE, sequence=np.full(len(t_s), number)),
            ],
            rr.Transform3D.columns(
                translation=np.column_stack([poses[:, :2], 0.0 * half_rad]), quaternion=turns
            ),
            strict=True,
        )


def _offsets(conditions: Sequence[Mapping[str, Any]]) -> list[float]:
    """When each judged start's turn begins: after the longest drive from the one before."""
    longest = np.array(
        [[len(drive["path_m"]) for drive in taught["final_drives"]] for taught in conditions]
    ).max(axis=0)
    turns_s = POINT_S * longest + _PAUSE_S
    return np.concatenate([[0.0], np.cumsum(turns_s)[:-1]]).tolist()


def _colours(names: Sequence[str]) -> dict[str, layout.Rgb]:
    colours: dict[str, layout.Rgb] = {}
    for name, look in learner_looks(names).items():
        red, green, blue = bytes.fromhex(look.colour.removeprefix("#"))
        colours[name] = (red, green, blue) if red + green + blue > 150 else _PALE_RGB
    return colours


def _key(name: str) -> str:
    return name.replace(":", "-")


def _above(path_m: Any) -> FloatArray:
    points = np.array(path_m, dtype=np.float64)
    return np.column_stack([points, np.full(len(points), _HEIGHT_M)])


def _blueprint(drives: TaughtDrives) -> Any:
    """A small view for each learner: in one view the cars of good learners would hide each other."""
    success = rrb.TimeSeriesView(
        origin="/success",
        name="Success by round",
        axis_y=rrb.ScalarAxis(range=(-0.05, 1.05), zoom_lock=True),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightBottom),
    )
    about = rrb.TextDocumentView(origin=f"/{layout.ABOUT}", name="About")
    names = list(drives.conditions)
    judged = [_view(drives.world, name, _CARS, _JUDGED) for name in names]
    taught = [_view(drives.world, name, _TEACHING) for name in names]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Tabs(
                rrb.Grid(*judged, name="Judged drives (time line t)"),
                rrb.Vertical(
                    rrb.Grid(*taught),
                    success,
                    row_shares=[3, 1],
                    name="Teaching (time line round)",
                ),
            ),
            about,
            column_shares=[4, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline=layout.TIME),
        collapse_panels=True,
        auto_views=False,
        auto_layout=False,
    )


def _view(world: WorldSpec, name: str, *parts: str) -> rrb.Spatial3DView:
    """The world with one learner in it."""
    still = (layout.GROUND, layout.EDGE, layout.BLOCKS, layout.BALL)
    return rrb.Spatial3DView(
        origin=f"/{layout.WORLD}",
        name=learner_name(name),
        contents=[
            *(f"+ /{path}" for path in still),
            *(f"+ /{layout.WORLD}/{part}/{_key(name)}" for part in parts),
        ],
        background=rrb.Background(color=[24, 26, 30], kind=rrb.BackgroundKind.SolidColor),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=_eye(world),
    )


def _eye(world: WorldSpec) -> rrb.EyeControls3D:
    """From above, the way to the ball from left to right."""
    middle_x_m = (world.start.x_m + world.ball_xy_m[0]) / 2.0
    middle_y_m = (world.start.y_m + world.ball_xy_m[1]) / 2.0
    span_m = float(np.hypot(world.start.x_m - world.ball_xy_m[0], world.start.y_m - middle_y_m))
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(middle_x_m, middle_y_m - 0.57 * span_m, 0.92 * span_m),
        look_target=(middle_x_m, middle_y_m, 0.0),
        eye_up=(0.0, 0.0, 1.0),
    )
