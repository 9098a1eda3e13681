import numpy as np
import pytest

from steerlab.sim.engine.camera import CameraConfig
from steerlab.sim.engine.world_view import WorldView
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.contract import Page
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.screen.palette import GROUND
from steerlab.teleop.sdl import pygame

SKY, ROAD = (120, 150, 200), (110, 120, 110)


class Painted:
    """Paints a horizon; a frame takes ``cost`` of a clock that stands still otherwise."""

    def __init__(self, cost=lambda camera: 0.0) -> None:
        self.now_ns, self.cost = 0, cost
        self.cameras: list[CameraConfig] = []
        self.poses: list[Pose2D] = []
        self.open = 0

    def make(self, world, camera):
        self.cameras.append(camera)
        self.open += 1
        return self

    def frame(self, pose, road_wheel_rad, out):
        self.poses.append(pose)
        camera = self.cameras[-1]
        assert out.shape == (camera.height, camera.width, 3)
        out[: camera.height // 2], out[camera.height // 2 :] = SKY, ROAD
        self.now_ns += round(self.cost(camera) * 1e6)
        return out

    def close(self):
        self.open -= 1


def _slow(full_ms):
    """Costs as many milliseconds at 960x540, less in fewer pixels and thrice with smooth edges."""
    return lambda camera: (
        full_ms * camera.width * camera.height / (960 * 540) * (3.0 if camera.samples else 1.0)
    )


def _screen(events, painted, **config):
    return DriveScreen(
        events,
        ScreenConfig(**config),
        make_picture=painted.make,
        now_ns=lambda: painted.now_ns,
    )


def test_a_fast_machine_draws_every_pixel(events, open_world):
    painted = Painted(_slow(3.0))
    with _screen(events, painted) as screen:
        assert screen.resolution is None
        screen.enter(open_world)
        assert str(screen.resolution) == "960x540 with smooth edges"
        assert screen.resolution.frame_ms == pytest.approx(9.0)
        assert painted.cameras == [CameraConfig(width=960, height=540, view="driver", samples=4)]


def test_edges_are_smooth_only_where_there_is_time(events, open_world):
    with _screen(events, Painted(_slow(11.0))) as screen:
        screen.enter(open_world)
        assert str(screen.resolution) == "960x540: a finer frame took 33 ms"
        assert screen.resolution.frame_ms == pytest.approx(11.0)


@pytest.mark.parametrize(
    ("full_ms", "drawn"), [(7.0, (960, 540, 4)), (11.9, (960, 540, 0)), (20.0, (640, 360, 0))]
)
def test_a_large_window_has_more_steps_down(events, open_world, full_ms, drawn):
    """At 960x540 a frame takes ``full_ms``, at 1920x1080 four times as long."""
    painted = Painted(lambda camera: _slow(full_ms)(camera) * (0.5 if camera.samples else 1.0))
    with _screen(events, painted, width=1920, height=1080) as screen:
        screen.enter(open_world)
        camera = painted.cameras[-1]
        assert (camera.width, camera.height, camera.samples) == drawn
        assert screen.resolution.in_time


def test_a_slow_machine_draws_half_and_says_why(events, open_world, view, pixels):
    painted = Painted(_slow(21.0))
    with _screen(events, painted, view="chase") as screen:
        screen.enter(open_world)
        assert str(screen.resolution) == "480x270 scaled to 960x540: a finer frame took 16 ms"
        assert screen.resolution.slower == pytest.approx((63.0, 21.0, 15.75))
        assert screen.resolution.in_time
        assert painted.cameras[-1] == CameraConfig(width=480, height=270, view="chase")
        assert painted.open == 1
        screen.show_drive(view())
        image = pixels(screen.window.surface)
        assert image.shape == (540, 960, 3)
        assert tuple(image[250, 480]) == SKY
        assert tuple(image[300, 480]) == ROAD


def test_too_slow_for_anything_is_said(events, open_world):
    with _screen(events, Painted(lambda camera: 50.0)) as screen:
        screen.enter(open_world)
        assert not screen.resolution.in_time
        assert screen.resolution.render_px == (480, 270)
        assert "still too slow at 50 ms" in str(screen.resolution)


def test_a_session_does_not_go_back_to_a_finer_picture(events, open_world):
    painted = Painted(_slow(30.0))
    with _screen(events, painted) as screen:
        screen.enter(open_world)
        first = screen.resolution
        painted.cost = _slow(1.0)
        painted.cameras.clear()
        screen.enter(open_world)
        assert screen.resolution is first
        assert [(camera.width, camera.samples) for camera in painted.cameras] == [(480, 0)]
        assert painted.open == 1
    assert painted.open == 0


def test_a_machine_that_grows_slower_draws_less(events, open_world):
    painted = Painted(_slow(10.0))
    with _screen(events, painted) as screen:
        screen.enter(open_world)
        painted.cost = _slow(30.0)
        screen.enter(open_world)
        assert str(screen.resolution) == "480x270 scaled to 960x540: a finer frame took 22 ms"
        assert screen.resolution.slower == pytest.approx((30.0, 30.0, 22.5))


def test_a_drive_needs_a_world(events, view):
    with (
        _screen(events, Painted()) as screen,
        pytest.raises(InvalidConfig, match="call enter"),
    ):
        screen.show_drive(view())


def test_the_pose_is_drawn_with_instruments_over_it(events, open_world, view, pixels):
    painted = Painted()
    with _screen(events, painted) as screen:
        screen.enter(open_world)
        pose = Pose2D(3.0, 4.0, 0.5)
        screen.show_drive(view(pose=pose))
        assert painted.poses[-1] is pose
        image = pixels(screen.window.surface)
        assert tuple(image[200, 480]) == SKY
        assert tuple(image[30, 40]) != SKY


def test_pages_dim_the_picture_of_the_drive_without_its_instruments(
    events, open_world, view, pixels
):
    with _screen(events, Painted()) as screen:
        page = Page(title="Drive 3 of 12", over_drive=True)
        screen.show_page(page)
        assert tuple(pixels(screen.window.surface)[0, 0]) == GROUND  # nothing to dim yet
        screen.enter(open_world)
        screen.show_drive(view())
        for _ in range(2):  # not darker each time
            screen.show_page(page)
            image = pixels(screen.window.surface)
            for place in ((30, 40), (200, 20)):
                assert 0.2 < image[place].sum() / sum(SKY) < 0.5
                assert tuple(image[place]) == tuple(image[0, 0])
        screen.show_page(Page(title="Pause"))
        assert tuple(pixels(screen.window.surface)[0, 0]) == GROUND


def test_a_new_frame_is_what_is_dimmed_next(events, open_world, view, pixels, monkeypatch):
    painted = Painted()
    with _screen(events, painted) as screen:
        screen.enter(open_world)
        page, seen = Page(title="Drive", over_drive=True), []
        for sky in ((200, 200, 200), (40, 40, 40)):
            monkeypatch.setitem(globals(), "SKY", sky)
            screen.show_drive(view())
            screen.show_page(page)
            seen.append(pixels(screen.window.surface)[0, 0].sum())
        assert seen[0] > 3 * seen[1]


def test_frames_are_measured_behind_a_page_and_in_all_directions(events, open_world, pixels, words):
    painted = Painted()
    with _screen(events, painted) as screen:
        screen.enter(open_world)
        assert "One moment" in words
        assert tuple(pixels(screen.window.surface)[0, 0]) == GROUND
        assert len({round(pose.heading_rad, 3) for pose in painted.poses}) >= 8
        assert painted.poses[-1] == open_world.start  # what a countdown would dim


@pytest.mark.parametrize("size", [(1280, 720), (700, 700), (300, 200)])
def test_a_window_manager_may_give_it_another_size(events, open_world, view, pixels, size):
    with _screen(events, Painted()) as screen:
        screen.enter(open_world)
        pygame.display.set_mode(size)
        for over_drive in (False, True):
            screen.show_drive(view())
            width, height = screen.window.size_px
            assert (width, height) == size
            image = pixels(screen.window.surface)
            assert abs(image[height // 2 - 4, width // 2] - SKY).max() < 4
            screen.show_page(Page(title="Pause", keys=(("Esc", "stop"),), over_drive=over_drive))
        screen.enter(open_world)
        assert screen.resolution.render_px == size


def test_a_picture_that_cannot_be_made_leaves_none_open(events, open_world, view):
    painted = Painted()

    def fail(world, camera):
        raise InvalidConfig("no")

    with _screen(events, painted) as screen:
        screen.enter(open_world)
        screen._make_picture = fail
        with pytest.raises(InvalidConfig):
            screen.enter(open_world)
        assert painted.open == 0
        with pytest.raises(InvalidConfig, match="call enter"):
            screen.show_drive(view())


@pytest.mark.render
def test_the_world_in_the_window_is_the_world(events, open_world, view, pixels):
    pose = Pose2D(5.0, 1.0, 0.1)
    with DriveScreen(events, ScreenConfig(frame_budget_ms=1e6)) as screen:
        screen.enter(open_world)
        screen.show_drive(view(pose=pose))
        shown, ring = pixels(screen.window.surface), screen._hud.rects["marker"]
    camera = CameraConfig(width=960, height=540, view="driver", samples=4)
    with WorldView(open_world, camera) as world:
        expected = world.frame(pose)
    around = slice(ring.left, ring.right)
    shown[:, around] = expected[:, around]
    np.testing.assert_array_equal(shown[180:360], expected[180:360])
