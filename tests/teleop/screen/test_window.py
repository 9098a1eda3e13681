import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.teleop.screen import window as window_module
from steerlab.teleop.screen.config import ScreenConfig, WindowChoice
from steerlab.teleop.screen.confirm import AGAIN_WITHIN_NS
from steerlab.teleop.screen.contract import Act
from steerlab.teleop.screen.display_loss import DisplayLost, outlive_display
from steerlab.teleop.screen.window import Window
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
    ],
)
def test_keys(events, window, key, act):
    _press(key)
    assert window.acts() == []  # not before the queue was polled
    events.poll()
    assert window.acts() == [act]
    assert window.acts() == []


@pytest.fixture
def clock():
    return [0]


@pytest.fixture
def timed(events, clock):
    with Window(events, ScreenConfig(), now_ns=lambda: clock[0]) as window:
        events.poll()
        window.acts()
        yield window


@pytest.mark.parametrize(
    ("key", "act", "question"),
    [
        (pygame.K_ESCAPE, Act.STOP, "Press it once more to stop"),
        (pygame.K_r, Act.REDO, "Press it once more to start this again"),
    ],
)
def test_keys_that_end_something_count_the_second_time(events, timed, clock, key, act, question):
    _press(key)
    events.poll()
    assert timed.acts() == []
    assert timed.question == question
    clock[0] += AGAIN_WITHIN_NS
    _press(key)
    events.poll()
    assert timed.acts() == [act]
    assert timed.question is None


def test_a_question_is_forgotten(events, timed, clock):
    timed.press(Act.STOP)
    clock[0] += AGAIN_WITHIN_NS + 1
    assert timed.question is None
    timed.press(Act.STOP)
    timed.press(Act.REDO)  # asks about something else
    timed.press(Act.STOP)
    assert timed.acts() == []
    timed.press(Act.PAUSE)  # answers no
    timed.press(Act.STOP)
    assert timed.acts() == [Act.PAUSE]


def test_a_button_of_the_wheel_and_the_key_are_one(events, timed):
    timed.press(Act.REDO)
    _press(pygame.K_r)
    events.poll()
    assert timed.acts() == [Act.REDO]


def test_the_close_button_asks_nothing(events, timed):
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    events.poll()
    assert timed.acts() == [Act.STOP]


def test_other_keys_and_releases_do_nothing(events, window):
    _press(pygame.K_LEFT)
    pygame.event.post(pygame.event.Event(pygame.KEYUP, key=pygame.K_SPACE, mod=0))
    events.poll()
    assert window.acts() == []


def test_acts_keep_their_order(events, window):
    pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSLOST))
    _press(pygame.K_p)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    events.poll()
    assert window.acts() == [Act.FOCUS_LOST, Act.PAUSE, Act.STOP]


def test_a_closed_window_hears_nothing(events, window):
    window.close()
    window.close()
    _press(pygame.K_p)
    events.poll()
    assert window.acts() == []


def test_the_size_is_as_asked(events):
    with Window(events, ScreenConfig(width=1280, height=720)) as window:
        assert window.size_px == (1280, 720)
        assert window.place == "window of 1280x720"


def test_a_full_screen_has_the_monitor_s_size(events):
    with Window(events, ScreenConfig(full_screen=True)) as window:
        assert window.size_px == pygame.display.get_desktop_sizes()[0]
        assert window.place.startswith("full screen on 0 (")
    assert pygame.display.get_caption()[0] == "steerlab"


def test_what_is_chosen_at_the_computer_changes_nothing_else():
    planned = ScreenConfig(full_screen=True, sound=True, view="chase", text_scale=1.3)
    assert WindowChoice().of(planned) == planned
    chosen = WindowChoice(monitor="1", windowed=True, silent=True).of(planned)
    assert chosen == ScreenConfig(monitor="1", view="chase", text_scale=1.3)
    assert not WindowChoice().of(ScreenConfig()).sound  # a silent plan stays silent


def test_sdl_does_not_show_the_window_through_opengl(window, monkeypatch):
    """It would not notice that MuJoCo makes another context current between two frames."""
    assert window_module.os.environ["SDL_FRAMEBUFFER_ACCELERATION"] == "0"


def test_a_lost_display_is_said_at_the_next_look(window, monkeypatch):
    monkeypatch.setattr(window_module, "display_is_lost", lambda: True)
    with pytest.raises(DisplayLost, match="Every step until then is kept"):
        window.acts()
    with pytest.raises(DisplayLost):
        window.flip()


def test_other_window_systems_are_left_alone():
    assert not outlive_display({}, pygame.quit)
    assert not outlive_display({"display": 0}, pygame.quit)


def test_a_display_that_refuses_the_window(events, monkeypatch):
    def refuse(size, flags, display):
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
