from steerlab.teleop.screen.palette import WORDS
from steerlab.teleop.screen.text import Typesetter


def test_a_line_is_set_once_and_the_oldest_forgotten():
    text = Typesetter(1.0)
    first = text.line("48 m", 17, WORDS)
    assert text.line("48 m", 17, WORDS) is first
    for number in range(600):
        text.line(f"{number}", 17, WORDS)
    assert len(text._lines) < 600
    assert text.line("48 m", 17, WORDS) is not first


def test_lines_grow_with_the_scale_and_are_as_wide_as_said():
    small, large = Typesetter(1.0), Typesetter(2.0)
    widths = [text.line("Rollout 3 of 12", 17, WORDS).get_width() for text in (small, large)]
    assert 1.9 < widths[1] / widths[0] < 2.1
    assert small.width("Rollout 3 of 12", 17) == widths[0]


def test_shortening_keeps_what_fits():
    text = Typesetter(1.0)
    assert text.shortened("G29", 17, 100) == "G29"
    short = text.shortened("Logitech G29 Driving Force Racing Wheel", 17, 120)
    assert short.startswith("Logi")
    assert short.endswith("…")
    assert text.width(short, 17) <= 120


def test_wrapping_loses_no_word_and_fits():
    text = Typesetter(1.0)
    words = "This drive will start again from the beginning; nothing else is lost."
    lines = text.wrapped(words, 19, 200)
    assert " ".join(lines) == words
    assert len(lines) > 2
    assert all(text.width(line, 19) <= 200 for line in lines)
    assert text.wrapped("x" * 80, 19, 200)[0].endswith("…")
    assert text.wrapped("", 19, 200) == []
