"""Chooses the resolution of the world's picture: the finest that this machine draws in time."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median
from time import perf_counter_ns

WARM_FRAMES, MEASURED_FRAMES = 3, 12
HOPELESS = 2.0  # times the budget: a frame so slow is not measured any further
LEAST_WIDTH_PX = 480  # in fewer pixels distances can no longer be judged
SMOOTH = 4  # samples for each pixel


@dataclass(frozen=True, slots=True)
class Quality:
    """How finely the world is drawn.

    Attributes:
        divisor: of the window's sides.
        samples: for each pixel of an edge; 0 leaves steps in it.
    """

    divisor: int
    samples: int


def qualities(width_px: int) -> list[Quality]:
    """What is tried, the finest first: smaller pictures only where there are pixels enough."""
    divisors = [1, *(by for by in (2, 3) if by == 2 or width_px // by >= LEAST_WIDTH_PX)]
    return [Quality(by, samples) for by in divisors for samples in (SMOOTH, 0)]


@dataclass(frozen=True, slots=True)
class Resolution:
    """The chosen quality and the reason; kept with each session.

    Attributes:
        frame_ms: median time of a frame: drawn, put into the window and shown.
        slower: the same for each quality that was too slow, the finest first.
        in_time: False if even the last one is too slow.
    """

    window_px: tuple[int, int]
    quality: Quality
    frame_ms: float
    slower: tuple[float, ...] = ()
    in_time: bool = True

    @property
    def render_px(self) -> tuple[int, int]:
        """Width and height in which the world is drawn."""
        by = self.quality.divisor
        return self.window_px[0] // by, self.window_px[1] // by

    def __str__(self) -> str:
        width, height = self.render_px
        text = f"{width}x{height}"
        if self.quality.samples:
            text += " with smooth edges"
        if self.quality.divisor > 1:
            text += f" scaled to {self.window_px[0]}x{self.window_px[1]}"
        if self.slower:
            text += f": a finer frame took {self.slower[-1]:.0f} ms"
        return text if self.in_time else f"{text}, still too slow at {self.frame_ms:.0f} ms"


def choose_resolution(
    window_px: tuple[int, int],
    show_frame: Callable[[Quality, float], object],
    *,
    budget_ms: float,
    before: Resolution | None = None,
    now_ns: Callable[[], int] = perf_counter_ns,
) -> Resolution:
    """Show some frames at each quality, the finest first, until one is in time.

    Args:
        show_frame: draws and shows a frame of a quality, looking the second argument's part of a
            full turn aside: views differ in cost.
        budget_ms: the median frame may take this long.
        before: what was chosen earlier in this session: it does not go back to a finer picture,
            so that its later drives look as its earlier ones.
    """
    slower = [] if before is None else list(before.slower)
    tried = qualities(window_px[0])
    if before is not None and before.quality in tried:
        tried = tried[tried.index(before.quality) :]
    for quality in tried:
        frame_ms = _median_ms(partial(show_frame, quality), now_ns, budget_ms)
        in_time = frame_ms <= budget_ms
        if in_time or quality == tried[-1]:
            return Resolution(window_px, quality, frame_ms, tuple(slower), in_time)
        slower.append(frame_ms)
    raise AssertionError("the loop returns at its last quality")


def _median_ms(
    show_frame: Callable[[float], object], now_ns: Callable[[], int], budget_ms: float
) -> float:
    """Of some frames; the quickest of the first ones if not even that is near the budget."""

    def took_ms(turn: float) -> float:
        began_ns = now_ns()
        show_frame(turn)
        return (now_ns() - began_ns) / 1e6

    quickest_ms = min(took_ms(0.0) for _ in range(WARM_FRAMES))
    if quickest_ms > HOPELESS * budget_ms:
        return quickest_ms
    return median(took_ms(frame / MEASURED_FRAMES) for frame in range(MEASURED_FRAMES))
