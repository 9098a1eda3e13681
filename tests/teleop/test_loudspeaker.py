"""What is heard, on SDL's sound driver without a device."""

import numpy as np
import pytest

from steerlab.sim.geometry import Pose2D
from steerlab.sim.rollout import Outcome
from steerlab.teleop import sounds
from steerlab.teleop.devices.contract import DeviceSample
from steerlab.teleop.loudspeaker import Mixer, open_loudspeaker
from steerlab.teleop.pages import countdown_page, drive_done_page, session_done_page
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.contract import DriveView
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import SdlEvents, pygame


@pytest.fixture
def speaker(monkeypatch):
    monkeypatch.setenv("SDL_AUDIODRIVER", "dummy")
    speaker = open_loudspeaker(True)
    assert isinstance(speaker, Mixer)
    yield speaker
    speaker.close()
    speaker.close()
    assert pygame.mixer.get_init() is None


@pytest.fixture
def heard(speaker, monkeypatch):
    cues: list[str] = []
    monkeypatch.setattr(speaker, "_play", cues.append)
    return cues


def _view(**changes) -> DriveView:
    values = {"pose": Pose2D(0, 0, 0), "elapsed_s": 1.0, "number": 1, "count": 12, "needle": 0.0}
    return DriveView(**(values | {"device": "G29"} | changes))


def _countdown(left_s: float):
    sample = DeviceSample(wheel=0.0)
    return countdown_page(
        1, 12, sample, left_s=left_s, centred=True, focused=True, device="G29"
    )  # fmt: skip


def _engine(speaker) -> list[float]:
    return [channel.get_volume() for channel in speaker._engine]


def test_without_a_sound_device_it_is_silent_and_says_so_once(monkeypatch, caplog):
    monkeypatch.setenv("SDL_AUDIODRIVER", "no such driver")
    speaker = open_loudspeaker(True)
    assert speaker.said.startswith("off: no sound device (")
    assert caplog.text.count("No sound, for no sound device can be opened") == 1
    assert "--no-sound" in caplog.text
    speaker.drive(_view())
    speaker.page(_countdown(3.0))
    speaker.close()


def test_a_screen_without_a_sound_device_goes_on_and_keeps_that(monkeypatch, caplog):
    monkeypatch.setenv("SDL_AUDIODRIVER", "no such driver")
    with SdlEvents(window=False) as events, DriveScreen(events, ScreenConfig(sound=True)) as screen:
        assert screen.settings["sound"].startswith("off: no sound device (")
        screen.show_page(_countdown(3.0))


def test_what_was_not_wanted_is_not_opened(caplog):
    with SdlEvents(window=False) as events, DriveScreen(events, ScreenConfig()) as screen:
        assert screen.settings["sound"] == "off: not wanted"
    assert not pygame.mixer.get_init()
    assert not caplog.text


def test_what_was_heard_is_kept_with_the_session(monkeypatch):
    monkeypatch.setenv("SDL_AUDIODRIVER", "dummy")
    with SdlEvents(window=False) as events, DriveScreen(events, ScreenConfig(sound=True)) as screen:
        assert screen.settings["sound"] == "on"
    assert not pygame.mixer.get_init()


def test_the_countdown_ticks_once_a_digit_and_ends_when_the_drive_begins(speaker, heard):
    speaker.drive(_view(elapsed_s=0.0))
    for left_s in (2.9, 2.5, 1.9, 1.2, 0.9, 0.1):
        speaker.page(_countdown(left_s))
    speaker.drive(_view(elapsed_s=0.01))
    speaker.drive(_view(elapsed_s=0.02))
    assert heard == ["count", "count", "count", "go"]


def test_a_countdown_that_was_broken_off_ends_without_its_end(speaker, heard):
    speaker.page(_countdown(1.9))
    speaker.drive(_view())
    assert heard == ["count"]


@pytest.mark.parametrize("outcome", [one for one in Outcome if one is not Outcome.RUNNING])
def test_each_end_is_heard_once_and_the_engine_falls(speaker, heard, outcome):
    speaker.drive(_view(speed_mps=8.0))
    loud = sum(_engine(speaker))
    for _ in range(3):
        speaker.drive(_view(speed_mps=8.0, outcome=outcome))
    assert heard == [outcome]
    assert 0.0 < sum(_engine(speaker)) < loud
    speaker.drive(_view())
    speaker.drive(_view(outcome=outcome))
    assert heard == [outcome, outcome]


def test_every_cue_can_be_played(speaker):
    for cue in speaker._cues:
        speaker._play(cue)
        assert speaker._cue_channel.get_busy()


def test_the_end_of_all_drives_is_heard_once_and_of_one_drive_not(speaker, heard):
    speaker.page(drive_done_page(Outcome.BALL_REACHED, (), 3, 12))
    assert heard == []
    for _ in range(3):
        speaker.page(session_done_page(12))
    assert heard == ["done"]


def test_the_engine_s_pitch_follows_the_speed_and_pages_are_quiet(speaker):
    pitches = []
    for speed_mps in (0.0, 2.0, 5.0, 9.0):
        speaker.drive(_view(speed_mps=speed_mps))
        volumes = np.array(_engine(speaker))
        pitches.append(volumes @ np.array(sounds.ENGINE_HZ) / volumes.sum())
    assert pitches == sorted(pitches)
    assert pitches[-1] > 2.0 * pitches[0]
    speaker.page(session_done_page(12))
    assert sum(_engine(speaker)) == 0.0


@pytest.mark.parametrize("speed_mps", [-3.0, 0.0, 3.3, 10.0, 99.0])
def test_the_mix_is_as_loud_at_any_speed(speed_mps):
    mix = sounds.engine_mix(speed_mps)
    assert sum(mix) == pytest.approx(1.0)
    assert sum(share > 0.0 for share in mix) <= 2


def test_waves_fit_and_loops_have_no_seam():
    rng = np.random.default_rng(0)
    for wave in (
        sounds.beep(440.0, 0.1),
        sounds.chime((440.0, 660.0)),
        sounds.thud(rng),
        sounds.engine_loop(41.3, rng),
    ):
        assert np.abs(wave).max() <= 1.0
        assert np.isfinite(wave).all()
    loop = sounds.engine_loop(41.3, rng)
    assert abs(loop[0] - loop[-1]) <= np.abs(np.diff(loop)).max()
    again = sounds.engine_loop(41.3, np.random.default_rng(0))
    np.testing.assert_array_equal(again, sounds.engine_loop(41.3, np.random.default_rng(0)))
