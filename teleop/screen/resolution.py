"""Chooses the resolution of the world's picture: the finest that this machine draws in time."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median
from time import perf_counter_ns

WARM_FRAMES, MEASURED_FRAMES = 3, 12
DIVISORS = (1, 2)  # of the window's sides; in fewer pixels distances can no longer be judged


@dataclass(frozen=True, slots=True)
class Resolution:
    """The chosen resolution and the reason; kept with each session.

    Attributes:
        frame_ms: median time of a frame at ``divisor``: drawn, put into the window and shown.
        slower: the same at each divisor that was too slow, full size first.
        in_time: False if even the last divisor is too slow.
    """

    window_px: tuple[int, int]
    divisor: int
    frame_ms: float
    slower: tuple[float, ...] = ()
    in_time: bool = True

    @property
    def render_px(self) -> tuple[int, int]:
        """Width and height in which the world is drawn."""
        return self.window_px[0] // self.divisor, self.window_px[1] // self.divisor

    def __str__(self) -> str:
        width, height = self.render_px
        if self.divisor == 1:
            text = f"{width}x{height}"
        else:
            text = (
                f"{width}x{height} scaled to {self.window_px[0]}x{self.window_px[1]}: "
                f"a full frame took {self.slower[0]:.0f} ms"
            )
        return text if self.in_time else f"{text}, still too slow at {self.frame_ms:.0f} ms"


def choose_resolution(
    window_px: tuple[int, int],
    show_frame: Callable[[int, float], object],
    *,
    budget_ms: float,
    before: Resolution | None = None,
    now_ns: Callable[[], int] = perf_counter_ns,
) -> Resolution:
    """Show some frames at each size, the largest first, until one is in time.

    Args:
        show_frame: draws and shows a frame with the world drawn at window size / the first
            argument, looking the second's part of a full turn aside: views differ in cost.
        budget_ms: the median frame may take this long.
        before: what was chosen earlier in this session: it does not go back to a finer picture,
            so that its later drives look as its earlier ones.
    """
    slower = [] if before is None else list(before.slower)
    first_divisor = 1 if before is None else before.divisor
    divisors = [divisor for divisor in DIVISORS if divisor >= first_divisor]
    for divisor in divisors:
        frame_ms = _median_ms(partial(show_frame, divisor), now_ns)
        in_time = frame_ms <= budget_ms
        if in_time or divisor == divisors[-1]:
            return Resolution(window_px, divisor, frame_ms, tuple(slower), in_time)
        slower.append(frame_ms)
    raise AssertionError("the loop returns at its last divisor")


def _median_ms(show_frame: Callable[[float], object], now_ns: Callable[[], int]) -> float:
    for _ in range(WARM_FRAMES):
        show_frame(0.0)
    took_ns: list[int] = []
    for frame in range(MEASURED_FRAMES):
        began_ns = now_ns()
        show_frame(frame / MEASURED_FRAMES)
        took_ns.append(now_ns() - began_ns)
    return median(took_ns) / 1e6
