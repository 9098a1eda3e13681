"""A video (.mp4) of one attempt: the camera's view, and below it the person's wheel and the robot's.

H.264 in yuv420p, a frame a control step, which browsers play; by the extra ``video`` (PyAV).
"""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from steerlab.sim.errors import MissingPackage
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.whole_file import whole_file
from steerlab.sim.geometry import Pose2D
from steerlab.sim.progress import Progress
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.study.derived import VIDEO_LABEL, ErasureGuard
from steerlab.study.recording.layout import ROBOT_RGB, TEACHER_RGB, Rgb, recording_name
from steerlab.study.recording.rebuild import OpenView, choose, open_study
from steerlab.study.recording.viewer import RecordingUnavailable
from steerlab.study.store.records import Attempt, AttemptData

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

VIDEO_PX = (960, 540)
STRIP_PX = 64
"""Height of the strip with the wheels, over the picture's lower edge."""
_BAR_PX, _ROWS_PX = 420, (10, 38)
_CODEC, _QUALITY = "libx264", {"preset": "veryfast", "crf": "23"}
_STRIP_RGB, _LINE_RGB, _TEXT_RGB = (24, 26, 30), (90, 95, 102), (200, 205, 210)


def check_installed() -> None:
    """Refuse before anything is read.

    Raises:
        MissingPackage: with how to install it.
    """
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise MissingPackage(
            "Videos need PyAV, which is not installed; run pip install 'steerlab[video]'."
        ) from error


def make_video(
    folder: Path,
    out: Path,
    *,
    participant: str | None = None,
    rollout: str | None = None,
    attempt: int | None = None,
    open_view: OpenView,
    progress: Progress = lambda what, share: None,
) -> Attempt:
    """Write the last of the chosen attempts to ``out``, whole or not at all.

    Args:
        folder: of the study.
        open_view: draws frames of ``VIDEO_PX``.

    Raises:
        MissingPackage: PyAV is not installed.
        RecordingUnavailable: there is nothing to show, or it cannot be written.
        ErasedMeanwhile: somebody was erased; nothing is kept.
        StoreError: the study cannot be read.
    """
    check_installed()
    with open_study(folder) as store:
        guard = ErasureGuard.of(store.path.parent)
        with guard.reading():
            chosen = choose(store, participant=participant, rollout=rollout, attempt=attempt)[-1]
            data = store.attempt_data(chosen)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(out, guard.placing()) as part:
            write_video(data, part, open_view=open_view, progress=progress)
    except OSError as error:
        raise RecordingUnavailable(
            f"Cannot write {out}: {refusal(error, 'choose another file')}."
        ) from error
    return chosen


def write_video(
    data: AttemptData,
    out: Path,
    *,
    open_view: OpenView,
    progress: Progress = lambda what, share: None,
) -> None:
    """Write an attempt that has steps; a frame lasts a control step.

    Raises:
        RecordingUnavailable: this PyAV has no encoder for H.264.
        OSError: the disk does not take it.
    """
    import av
    from av.codec.codec import UnknownCodecError

    attempt = data.attempt
    rate = Fraction(data.rollout.control_hz).limit_denominator(1000)
    # The index comes first, so that a browser can begin before it has all.
    with av.open(str(out), "w", format="mp4", options={"movflags": "faststart"}) as container:
        container.metadata["title"] = recording_name(*attempt.key)
        container.metadata["comment"] = f"{VIDEO_LABEL}{attempt.participant}"
        try:
            stream: Any = container.add_stream(_CODEC, rate=rate, options=_QUALITY)
        except UnknownCodecError as error:
            raise RecordingUnavailable(
                f"This PyAV ({av.__version__}) has no encoder {_CODEC}; install one that has, with "
                "pip install --force-reinstall --only-binary av av."
            ) from error
        stream.width, stream.height = VIDEO_PX
        stream.pix_fmt = "yuv420p"
        for number, picture in enumerate(_pictures(data, open_view)):
            progress("drawing the video", number / len(data.steps))
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = number, 1 / rate
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    progress("drawing the video", 1.0)


def _pictures(data: AttemptData, open_view: OpenView) -> Iterator[NDArray[np.uint8]]:
    """(height, width, 3) RGB for each step."""
    car, strip = CarConfig(), _Strip(recording_name(*data.attempt.key))
    with open_view(data.rollout.world) as view:
        for step in data.steps:
            pose = Pose2D(step.x_m, step.y_m, step.heading_rad)
            picture = view.frame(pose, car.road_wheel_rad(step.executed_wheel))
            picture[-STRIP_PX:] = strip.drawn(step)
            yield picture


class _Strip:
    """Draws who drove whom, the time, and both wheels as bars; left is left.

    Args:
        title: of the attempt.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._small: FreeTypeFont | Any = ImageFont.load_default(15)
        self._left_px = VIDEO_PX[0] - _BAR_PX - 16

    def drawn(self, step: LabelledStep) -> NDArray[np.uint8]:
        """(strip, width, 3) RGB."""
        image = Image.new("RGB", (VIDEO_PX[0], STRIP_PX), _STRIP_RGB)
        draw = ImageDraw.Draw(image)
        draw.text((16, 8), self._title, font=self._small, fill=_TEXT_RGB)
        said = f"{step.t_s:.2f} s, the {step.gate.value} drives"
        draw.text((16, 36), said, font=self._small, fill=_TEXT_RGB)
        wheels = (
            ("person", step.teacher_label, TEACHER_RGB),
            ("robot", step.robot_wheel, ROBOT_RGB),
        )
        for top_px, (name, wheel, rgb) in zip(_ROWS_PX, wheels, strict=True):
            self._bar(draw, top_px, name, wheel, rgb)
        return np.asarray(image)

    def _bar(
        self, draw: ImageDraw.ImageDraw, top_px: int, name: str, wheel: float | None, rgb: Rgb
    ) -> None:
        left, middle = self._left_px, self._left_px + _BAR_PX // 2
        box = (left, top_px, left + _BAR_PX, top_px + 16)
        draw.rectangle(box, outline=_LINE_RGB)
        said = name if wheel is not None else f"{name}: none"
        draw.text((left - 12, top_px - 2), said, font=self._small, fill=rgb, anchor="ra")
        if wheel is not None:
            at = middle - round(max(-1.0, min(1.0, wheel / WHEEL_LIMIT)) * (_BAR_PX // 2))
            draw.rectangle((min(at, middle), top_px + 2, max(at, middle), top_px + 14), fill=rgb)
        draw.line((middle, top_px - 2, middle, top_px + 18), fill=_TEXT_RGB)
