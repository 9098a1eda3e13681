"""What the pages say at the end of a part, and of a drive."""

import pytest

from steerlab.sim.rollout import Outcome
from steerlab.teleop.pages import drive_done_page, practice_done_page, session_done_page
from steerlab.teleop.timing_limits import TimingViolation

LATE = TimingViolation(name="lateness_p99_ms", value=9.13, limit=2.0)


def test_thanks_come_where_nothing_follows():
    last, part = session_done_page(12), session_done_page(12, "How it was")
    assert last.title == "Thank you"
    assert "thank" not in part.title.lower()
    assert any("How it was" in line for line in part.lines)
    assert any("go back to your page" in line for line in part.lines)
    assert not any("Next comes" in line for line in last.lines)
    assert any("How it was" in line for line in practice_done_page(1, 0, "How it was").lines)


@pytest.mark.parametrize("outcome", [one for one in Outcome if one is not Outcome.BALL_REACHED])
def test_no_tick_stands_over_what_went_wrong(outcome):
    assert drive_done_page(outcome, (), 1, 12).tone == "neutral"
    assert drive_done_page(Outcome.BALL_REACHED, (), 1, 12).tone == "good"


def test_participants_read_no_limits():
    said = " ".join(drive_done_page(Outcome.BALL_REACHED, (LATE,), 1, 12).lines)
    assert "could not keep time" in said
    assert not any(words in said for words in ("9.13", "lateness", "limit", "ms"))
