"""Camera settings; kept out of ``engine`` so that naming a view does not load MuJoCo."""

from dataclasses import dataclass
from typing import Literal, get_args

from steerlab.sim.errors import InvalidConfig

View = Literal["front", "chase"]
MAX_SIDE_PX = 4096


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Size in pixels and view; ``samples`` > 0 smooths edges and is slow on software OpenGL."""

    width: int = 64
    height: int = 64
    view: View = "front"
    samples: int = 0

    def __post_init__(self) -> None:
        if not (0 < self.width <= MAX_SIDE_PX and 0 < self.height <= MAX_SIDE_PX):
            raise InvalidConfig(
                f"A camera of {self.width} x {self.height} px; both must be 1 to {MAX_SIDE_PX}."
            )
        if self.view not in get_args(View):
            raise InvalidConfig(f"View {self.view!r}; choose one of {', '.join(get_args(View))}.")
