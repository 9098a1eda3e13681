import pytest

from steerlab.sim.errors import SteerlabError
from steerlab.teleop.screen import monitors as module
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.monitors import (
    Monitor,
    NoMonitor,
    choose_monitor,
    find_monitor,
    monitors,
)
from steerlab.teleop.screen.window import Window

THERE = [
    Monitor(0, "DELL U2415", (1920, 1200)),
    Monitor(1, "BenQ GW2480", (1920, 1080)),
    Monitor(2, "BenQ GW2480", (1920, 1080)),
]


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return tmp_path / "steerlab"


@pytest.fixture
def two(home, monkeypatch):
    monkeypatch.setattr(module, "monitors", lambda: THERE[:2])
    return home


@pytest.mark.parametrize(
    ("said", "number"), [("0", 0), ("2", 2), ("dell", 0), ("DELL U2415", 0), (" 1 ", 1)]
)
def test_a_number_a_name_or_part_of_one(said, number):
    assert find_monitor(said, THERE).number == number


def test_one_that_does_not_exist_lists_those_there_are():
    for said in ("3", "-1", "sony", "0x0"):
        with pytest.raises(NoMonitor) as refused:
            find_monitor(said, THERE[:2])
        assert str(refused.value) == (
            f"No monitor {said!r} here; there is 0 (DELL U2415, 1920x1200) and "
            "1 (BenQ GW2480, 1920x1080)."
        )


def test_two_of_one_name_are_told_apart_by_number():
    with pytest.raises(NoMonitor, match=r"Several.*1 \(BenQ.*2 \(BenQ.*Give a number"):
        find_monitor("BenQ GW2480", THERE)


def test_sdl_knows_this_one(events):
    assert monitors()[0].number == 0
    assert min(monitors()[0].size_px) > 0


def test_a_choice_is_remembered_and_another_replaces_it(two):
    assert choose_monitor("benq").number == 1
    assert (two / "monitor.toml").read_text() == 'monitor = "benq"\n'
    assert choose_monitor("").number == 1
    assert choose_monitor("0").number == 0
    assert choose_monitor("").number == 0


def test_what_is_not_there_is_not_remembered(two):
    with pytest.raises(NoMonitor):
        choose_monitor("7")
    assert not two.exists()


def test_a_remembered_one_that_was_unplugged_is_never_replaced_by_another(two, monkeypatch):
    choose_monitor("benq")
    monkeypatch.setattr(module, "monitors", lambda: THERE[:1])
    with pytest.raises(NoMonitor, match=r"No monitor 'benq' here.*DELL.*monitor\.toml.*--monitor"):
        choose_monitor("")


def test_several_and_no_choice_yet_are_listed(two, caplog):
    assert choose_monitor("").number == 0
    assert "0 (DELL U2415, 1920x1200) and 1 (BenQ GW2480, 1920x1080)" in caplog.text
    assert "--monitor" in caplog.text


def test_a_damaged_file_is_named(two):
    choose_monitor("0")
    (two / "monitor.toml").write_text("monitor = \n")
    with pytest.raises(SteerlabError, match=r"monitor\.toml"):
        choose_monitor("")


def test_where_nothing_can_be_kept_the_choice_counts_and_that_is_said(two, caplog):
    two.write_text("a file where the folder should be")
    assert choose_monitor("1").number == 1
    assert "not remembered" in caplog.text


def test_a_window_refuses_a_monitor_that_is_not_there(events, home):
    with pytest.raises(NoMonitor, match="No monitor '9' here; there is 0 "):
        Window(events, ScreenConfig(monitor="9"))
