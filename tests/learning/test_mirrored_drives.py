"""Rollouts that are mirror images of each other are one drive, and are held out together."""

import numpy as np
import pytest

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_table import GivenSeries, LabelScale, LabelTable
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import drive_names, plan_folds

DRIVES = 4
STEPS = 20


def _series(person: str, rollout: str, truth: np.ndarray) -> LabelSeries:
    label = np.clip(1.3 * truth + 0.05, -2.5, 2.5)
    return LabelSeries(
        person=person,
        rollout=rollout,
        rate_hz=10.0,
        label=label,
        truth=truth,
        valid=np.ones(len(truth), dtype=bool),
    )


def _truth(drive: int) -> np.ndarray:
    truth = np.random.default_rng(drive).uniform(-1.0, 1.0, STEPS)
    truth[: drive + 1] = 0.0  # as where nothing has moved yet
    return truth


def _mirrored(people: int = 5, steps: int = STEPS) -> list[LabelSeries]:
    """Everyone on every drive and on its mirror image, which may be cut short."""
    return [
        _series(f"p{person}", f"d{drive}{image}", truth)
        for person in range(people)
        for drive in range(DRIVES)
        for image, truth in (("+", _truth(drive)), ("-", -_truth(drive)[:steps]))
    ]


def _table(series: list[LabelSeries]) -> LabelTable:
    given = tuple(GivenSeries(series=one, steps=np.arange(one.steps), split=None) for one in series)
    return LabelTable(given=given, scale=LabelScale(), notices=())


@pytest.mark.parametrize("steps", [STEPS, 12])
def test_mirror_images_are_held_out_together_and_said_to_be(steps):
    series = _mirrored(steps=steps)
    plan = plan_folds(_table(series), DRIVES, 0)
    for fold in plan.folds:
        learned = {one.rollout[:2] for one in (*fold.train_seen, *fold.calibrate_new)}
        scored = {one.rollout[:2] for one in (*fold.held_out_seen, *fold.held_out_new)}
        assert scored
        assert not learned & scored
    (notice,) = plan.notices
    assert "one and the same truth, or its mirror image (the negative at every step)," in notice
    assert "'d0+', 'd0-'" in notice
    with pytest.raises(InvalidLabels, match=r"4 rollouts .* cannot make 5 folds"):
        plan_folds(_table(series), DRIVES + 1, 0)


def test_where_one_bit_differs_they_are_two_drives():
    truth = _truth(0)
    other = -truth
    other[15] = np.nextafter(other[15], 9.0)
    series = [_series("p", "a", truth), _series("p", "b", other)]
    assert drive_names(series) == {"a": "a", "b": "b"}
    series[1] = _series("p", "b", -truth)
    assert drive_names(series) == {"a": "a", "b": "a"}


def test_copies_alone_are_not_called_mirror_images():
    copies = [
        _series(f"p{person}", f"p{person}-{drive}", -_truth(drive))
        for person in range(4)
        for drive in range(DRIVES)
    ]
    (notice,) = plan_folds(_table(copies), 4, 0).notices
    assert "one and the same truth are one drive" in notice
    assert "mirror" not in notice


def test_constant_truths_are_nobodys_mirror_image():
    flat = [_series("p", name, np.full(STEPS, value)) for name, value in (("a", 0.5), ("b", -0.5))]
    assert drive_names(flat) == {"a": "a", "b": "b"}
