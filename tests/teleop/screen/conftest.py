from collections.abc import Iterator

import numpy as np
import pytest

from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import WorldSpec
from steerlab.teleop.screen.contract import DriveView
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.sdl import SdlEvents, pygame

MAGENTA = (255, 0, 255)  # a ground that nothing is drawn in


@pytest.fixture
def events() -> Iterator[SdlEvents]:
    with SdlEvents(window=False) as events:
        yield events


@pytest.fixture
def words(monkeypatch) -> list[str]:
    """Every line of text that was drawn."""
    said: list[str] = []
    line = Typesetter.line

    def listening(self, words, size, colour):
        said.append(words)
        return line(self, words, size, colour)

    monkeypatch.setattr(Typesetter, "line", listening)
    return said


@pytest.fixture
def view():
    def make(**changes) -> DriveView:
        values = {
            "pose": Pose2D(0.0, 0.0, 0.0),
            "elapsed_s": 12.4,
            "number": 3,
            "count": 12,
            "needle": 0.0,
            "device": "G29",
            "instruction": "Steer as you think the car should have steered.",
        }
        return DriveView(**(values | changes))

    return make


@pytest.fixture
def open_world() -> WorldSpec:
    return WorldSpec(name="open", ball_xy_m=(30.0, 0.0), start=Pose2D(0.0, 0.0, 0.0))


@pytest.fixture
def blank():
    def make(size=(960, 540)) -> pygame.Surface:
        surface = pygame.Surface(size)
        surface.fill(MAGENTA)
        return surface

    return make


@pytest.fixture
def pixels():
    def read(surface: pygame.Surface) -> np.ndarray:
        """(height, width, 3)"""
        return pygame.surfarray.array3d(surface).swapaxes(0, 1).astype(int)

    return read


@pytest.fixture
def grey(pixels):
    def read(surface: pygame.Surface) -> np.ndarray:
        """(height, width): what someone sees who sees no colours."""
        return pixels(surface) @ np.array([0.299, 0.587, 0.114])

    return read
