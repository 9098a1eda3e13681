"""Figures: what is drawn, what is refused, and that the same figure gives the same bytes."""

import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from steerlab.analysis.figures import (
    embedding_figure,
    improvement_figure,
    label_figure,
    people_figure,
    style_directions,
    world_figure,
)
from steerlab.analysis.figures.look import clearest_spot, spread
from steerlab.analysis.page import svg_data_uri, svg_text
from steerlab.analysis.wording import method_name
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import BALL_RADIUS_M, WorldSpec


def texts(figure: Figure) -> set[str]:
    return {text.get_text() for axes in figure.axes for text in axes.texts}


def draw(figure: Figure) -> ElementTree.Element:
    """Render (any layout warning is an error here) and parse."""
    return ElementTree.fromstring(svg_text(figure))


def test_no_figure_needs_pyplot():
    assert "matplotlib.pyplot" not in sys.modules


def test_world_shows_blocks_ball_start_and_paths(arrays):
    a = arrays
    figure = world_figure(a.world, a.pose, a.oracle_paths, camera_rgb=a.camera_rgb)
    above, camera = figure.axes
    blocks = [p for p in above.patches if isinstance(p, Rectangle)]
    assert [(b.get_x(), b.get_width()) for b in blocks] == [
        (b.x_m - b.half_x_m, 2 * b.half_x_m) for b in a.world.blocks
    ]
    (ball,) = (p for p in above.patches if isinstance(p, Circle))
    assert (ball.center, ball.radius) == (a.world.ball_xy_m, BALL_RADIUS_M)
    (car,) = (p for p in above.patches if isinstance(p, Polygon) and not isinstance(p, Rectangle))
    np.testing.assert_allclose(car.get_xy()[:4].mean(axis=0), a.pose[0, :2])
    lines = {line.get_label(): line.get_xydata() for line in above.lines}
    np.testing.assert_array_equal(lines["rollout"], a.pose[:, :2])
    for points, label in a.oracle_paths:
        np.testing.assert_array_equal(lines[label], points)
    np.testing.assert_array_equal(camera.images[0].get_array(), a.camera_rgb)
    assert {"ball", "start", "rollout", "4.5 s", "12.0 s"} == texts(figure)
    draw(figure)


def test_world_without_camera_blocks_or_paths():
    world = WorldSpec(name="bare", ball_xy_m=(49.0, 49.0), start=Pose2D(-50.0, -50.0, 0.0))
    figure = world_figure(world, np.array([(-50.0, -50.0, 0.0), (-49.0, -50.0, 0.0)]))
    assert len(figure.axes) == 1
    for text in figure.axes[0].texts:  # labels stay on the ground, even from its corner
        assert max(map(abs, text.get_position())) < world.half_extent_m
    draw(figure)


def test_labels_show_three_lines_gaps_and_errors(arrays):
    a = arrays
    figure = label_figure(a.t_s, a.raw, a.mapped, a.truth)
    above, below = figure.axes
    lines = {line.get_label(): line.get_ydata() for line in above.lines}
    for name, values in (("teacher", a.raw), ("mapped", a.mapped), ("oracle", a.truth)):
        np.testing.assert_array_equal(lines[name], values)
    assert np.isnan(lines["oracle"]).any()
    np.testing.assert_array_equal(below.lines[0].get_ydata(), np.abs(a.raw - a.truth))
    np.testing.assert_array_equal(below.lines[1].get_ydata(), np.abs(a.mapped - a.truth))
    limits = [line.get_ydata()[0] for line in above.lines if line.get_linestyle() == "--"][:2]
    assert limits == [-2.5, 2.5]
    assert {"oracle", "teacher", "mapped", "before", "after", "wheel at its limit"} == texts(figure)
    draw(figure)


def test_labels_of_different_length_or_without_truth_are_refused():
    t_s = np.arange(5.0)
    with pytest.raises(InvalidConfig, match=r"'mapped': \(4,\)"):
        label_figure(t_s, t_s, t_s[:4], t_s)
    with pytest.raises(InvalidConfig, match="choose another rollout"):
        label_figure(t_s, t_s, t_s, np.full(5, np.nan))


def test_ladder_has_a_dot_and_an_interval_for_each(arrays):
    ladder = {
        "identity": {"seen": (0.0, 0.0, 0.0), "new": (0.0, 0.0, 0.0)},
        "mind_meld": {"seen": (0.6, 0.5, 0.7), "new": (0.55, 0.4, 0.6)},
        "my_method": {"seen": (0.2, 0.1, 0.3), "new": (0.7, 0.6, 0.8)},
    }
    figure = improvement_figure(ladder)
    (axes,) = figure.axes
    dots = {line.get_label(): line for line in axes.lines if len(line.get_xdata()) == 1}
    for method, splits in ladder.items():
        for split, (value, low, high) in splits.items():
            dot = dots[f"{method} {split}"]
            assert dot.get_xdata()[0] == value
            (interval,) = (
                line
                for line in axes.lines
                if len(line.get_xdata()) == 2 and line.get_ydata()[0] == dot.get_ydata()[0]
                if list(line.get_xdata()) == [low, high]
            )
            assert interval.get_color() == dot.get_color()
    rows = {method: dots[f"{method} new"].get_ydata()[0] for method in ladder}
    assert rows["my_method"] > rows["mind_meld"] > rows["identity"]
    assert {"my method", "MIND MELD", "labels as given"} == texts(figure)
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["seen people", "new people"]
    draw(figure)


def test_a_crowd_is_drawn_as_pixels_and_stays_small(arrays):
    rng = np.random.default_rng(0)
    crowd = {
        split: (rng.uniform(0.0, 1.0, 5000), rng.uniform(0.0, 1.0, 5000))
        for split in ("seen", "new")
    }
    few = svg_text(people_figure(arrays.people))
    assert "<image" not in few
    many = svg_text(people_figure(crowd))
    assert "<image" in many
    assert len(many) < 1_000_000
    assert many == svg_text(people_figure(crowd))


@pytest.mark.parametrize("value", [-400.0, -0.3, 0.0, 0.99])
def test_ladder_of_one_method_far_from_the_rest(value: float):
    same = (value, value - 0.1, value + 0.1)
    figure = improvement_figure({"mind_meld": {"seen": same, "new": same}})
    (axes,) = figure.axes
    left, right = axes.get_xlim()
    assert left <= value - 0.1
    assert value + 0.1 <= right  # the whole interval is on the page
    assert texts(figure) == {"MIND MELD"}
    draw(figure)


def test_a_ladder_with_holes_is_refused():
    with pytest.raises(InvalidConfig, match="no method"):
        improvement_figure({})
    with pytest.raises(InvalidConfig, match=r"'x' has \['seen'\]"):
        improvement_figure({"x": {"seen": (0.0, 0.0, 0.0)}})
    assert method_name("brand_new") == "brand new"


def test_people_are_points_and_counted(arrays):
    figure = people_figure(arrays.people)
    (axes,) = figure.axes
    lines = {line.get_label(): line for line in axes.lines}
    for split, (before, after) in arrays.people.items():
        np.testing.assert_array_equal(lines[f"{split} people"].get_xdata(), before)
        np.testing.assert_array_equal(lines[f"{split} people"].get_ydata(), after)
    assert "33 of 34 new people improved" in " ".join(texts(figure))
    assert axes.get_xlim() == axes.get_ylim()
    draw(figure)
    with pytest.raises(InvalidConfig, match="'new' has 0 errors"):
        people_figure({"seen": arrays.people["seen"]})


def test_style_directions_are_recovered_exactly():
    rng = np.random.default_rng(3)
    gain, delay_s = np.exp(rng.normal(size=60)), rng.normal(size=60)
    axes = np.linalg.qr(rng.normal(size=(4, 4)))[0][:, :2]
    embeddings = np.column_stack([np.log(gain), delay_s]) @ axes.T + 5.0
    np.testing.assert_allclose(style_directions(embeddings, gain, delay_s), axes, atol=1e-9)


def test_a_style_that_does_not_vary_has_no_direction():
    rng = np.random.default_rng(3)
    directions = style_directions(rng.normal(size=(9, 2)), np.ones(9), rng.normal(size=9))
    np.testing.assert_array_equal(directions[:, 0], 0.0)
    assert np.linalg.norm(directions[:, 1]) == pytest.approx(1.0)


def test_embeddings_share_a_plane_and_a_scale(arrays):
    a = arrays
    figure = embedding_figure(a.seen, a.new, a.gain, a.delay_s)
    by_gain, by_delay = figure.axes[:2]
    for axes, values in ((by_gain, a.gain), (by_delay, a.delay_s)):
        seen, new = axes.collections
        assert (len(seen.get_offsets()), len(new.get_offsets())) == (34, 34)
        np.testing.assert_array_equal(np.r_[seen.get_array(), new.get_array()], values)
        assert seen.norm is new.norm
        assert len(seen.get_paths()[0].vertices) != len(new.get_paths()[0].vertices)
    np.testing.assert_array_equal(
        by_gain.collections[0].get_offsets(), by_delay.collections[0].get_offsets()
    )
    assert isinstance(by_gain.collections[0].norm, LogNorm)
    draw(figure)


@pytest.mark.parametrize("spread", [0.0, 0.01, 3.0])
@pytest.mark.parametrize(("people", "dimensions"), [(3, 1), (3, 8), (10, 2)])
def test_embeddings_of_odd_populations_still_draw(people: int, dimensions: int, spread: float):
    rng = np.random.default_rng(0)
    gain = np.exp(spread * rng.normal(size=people + 2))
    delay_s = spread * rng.normal(size=people + 2)
    seen, new = rng.normal(size=(people, dimensions)), rng.normal(size=(2, dimensions))
    figure = embedding_figure(seen, new, gain, delay_s)
    for axes in figure.axes[:2]:
        shown = [dots.get_offsets() for dots in axes.collections]
        assert [len(points) for points in shown] == [people, 2]
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        for x, y in np.concatenate(shown):  # each person is on the page
            assert left <= x <= right
            assert low <= y <= high
    draw(figure)


def test_embeddings_that_do_not_match_are_refused():
    w = np.zeros((3, 2))
    with pytest.raises(InvalidConfig, match="6 embeddings, 5 gains and 6 delays"):
        embedding_figure(w, w, np.ones(5), np.ones(6))
    with pytest.raises(InvalidConfig, match="three or more"):
        embedding_figure(w[:2], w, np.ones(5), np.ones(5))
    with pytest.raises(InvalidConfig, match="positive gains"):
        embedding_figure(w, w, np.r_[np.ones(5), 0.0], np.ones(6))


def test_the_same_figure_gives_the_same_svg(arrays):
    first, second = (people_figure(arrays.people) for _ in range(2))
    assert svg_text(first) == svg_text(second) == svg_text(first)
    assert "<dc:date>" not in svg_text(first)
    assert svg_data_uri(first).startswith("data:image/svg+xml;base64,")


def test_the_map_shows_the_drive_and_some_ground_around_it(arrays):
    short = arrays.pose[:20]
    world = WorldSpec(name="w", ball_xy_m=(-30.0, -20.0), start=Pose2D(-36.0, -30.0, 0.9))
    (axes,) = world_figure(world, short).axes
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert right - left == top - bottom == 50.0
    assert left == -50.0  # never beyond the ground
    assert bottom >= -50.0


numbers = st.floats(-100, 100)


@given(st.lists(numbers, max_size=8), st.floats(0.01, 10))
def test_spread_labels_keep_their_order_and_distance(wanted: list[float], gap: float):
    placed = spread(wanted, gap)
    order = sorted(range(len(wanted)), key=lambda i: wanted[i])
    steps = np.diff([placed[i] for i in order])
    assert (steps >= gap - 1e-6).all()


@given(st.lists(numbers, min_size=1, max_size=8, unique=True))
def test_labels_with_room_stay_where_they_belong(wanted: list[float]):
    gaps = np.diff(sorted(wanted))
    gap = 0.99 * float(gaps.min()) if len(gaps) else 1.0
    np.testing.assert_allclose(spread(wanted, gap), wanted, atol=1e-9)


def test_touching_labels_centre_on_what_they_name():
    assert spread([1.0, 1.0, 1.0], 2.0) == [-1.0, 1.0, 3.0]


def test_the_clearest_spot_avoids_what_is_taken():
    candidates = np.array([(0.0, 0.0), (5.0, 0.0), (20.0, 0.0)])
    taken = np.array([(1.0, 0.0), (6.0, 0.5)])
    assert clearest_spot(candidates, (4.0, 2.0), taken) == 2
    assert clearest_spot(candidates, (4.0, 2.0), np.empty((0, 2))) == 0
    # Both cover a point; the second covers it nearer to its edge.
    assert clearest_spot(np.array([(1.0, 0.0), (2.5, 0.0)]), (4.0, 2.0), taken[:1]) == 1
