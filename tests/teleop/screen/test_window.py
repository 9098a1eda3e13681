import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.teleop.screen import drive_screen
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.contract import Act
from steerlab.teleop.screen.display_loss import DisplayLost, outlive_display
from steerlab.teleop.screen.drive_screen import Window
from steerlab.teleop.sdl import NoDisplay, SdlEvents, pygame


@pytest.fixture
def window(events):
    with Window(events, ScreenConfig()) as window:
        events.poll()
        window.acts()
        yield window


def _press(key):
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, mod=0, unicode=""))


@pytest.mark.parametrize(
    ("key", "act"),
    [
        (pygame.K_SPACE, Act.CONFIRM),
        (pygame.K_RETURN, Act.CONFIRM),
        (pygame.K_KP_ENTER, Act.CONFIRM),
        (pygame.K_p, Act.PAUSE),
        (pygame.K_r, Act.REDO),
        (pygame.K_ESCAPE, Act.STOP),
    ],
)
def test_keys(events, window, key, act):
    _press(key)
    assert window.acts() == []  # not before the queue was polled
    events.poll()
    assert window.acts() == [act]
    assert window.acts() == []


def test_other_keys_and_releases_do_nothing(events, window):
    _press(pygame.K_LEFT)
    pygame.event.post(pygame.event.Event(pygame.KEYUP, key=pygame.K_SPACE, mod=0))
    events.poll()
    assert window.acts() == []


def test_acts_keep_their_order(events, window):
    pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSLOST))
    _press(pygame.K_r)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    events.poll()
    assert window.acts() == [Act.FOCUS_LOST, Act.REDO, Act.STOP]


def test_a_closed_window_hears_nothing(events, window):
    window.close()
    window.close()
    _press(pygame.K_p)
    events.poll()
    assert window.acts() == []


def test_the_size_is_as_asked(events):
    with Window(events, ScreenConfig(width=1280, height=720)) as window:
        assert window.size_px == (1280, 720)


def test_sdl_does_not_show_the_window_through_opengl(window, monkeypatch):
    """It would not notice that MuJoCo makes another context current between two frames."""
    assert drive_screen.os.environ["SDL_FRAMEBUFFER_ACCELERATION"] == "0"


def test_a_lost_display_is_said_at_the_next_look(window, monkeypatch):
    monkeypatch.setattr(drive_screen, "display_is_lost", lambda: True)
    with pytest.raises(DisplayLost, match="Every step until then is kept"):
        window.acts()
    with pytest.raises(DisplayLost):
        window.flip()


def test_other_window_systems_are_left_alone():
    assert not outlive_display({}, pygame.quit)
    assert not outlive_display({"display": 0}, pygame.quit)


def test_a_display_that_refuses_the_window(events, monkeypatch):
    def refuse(size, flags):
        raise pygame.error("out of memory")

    monkeypatch.setattr(pygame.display, "set_mode", refuse)
    with pytest.raises(NoDisplay, match="960x540: out of memory"):
        Window(events, ScreenConfig())


def test_without_a_display(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "x11")
    monkeypatch.setenv("DISPLAY", ":987")
    with pytest.raises(NoDisplay, match=":987"):
        SdlEvents(window=True)


@pytest.mark.parametrize(
    "bad",
    [
        {"width": 320},
        {"height": 9000},
        {"text_scale": 0.5},
        {"text_scale": 3.0},
        {"view": "above"},
        {"frame_budget_ms": 0.0},
    ],
)
def test_bad_settings(bad):
    with pytest.raises(InvalidConfig):
        ScreenConfig(**bad)
