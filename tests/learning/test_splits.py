"""What trains and what is held out: the fixed split, and folds without leaks."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning import training_budget
from steerlab.learning.baselines import BASELINES, CEILING, FULL_ONLY
from steerlab.learning.cross_validation import cross_validate
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_table import GivenSeries, LabelScale, LabelTable
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import plan_folds, split_rollouts, split_study
from steerlab.learning.training import TrainingConfig
from steerlab.learning.training_budget import (
    LEAST_TRAINING_STEPS,
    fit_long_enough,
    fit_within_budget,
    valid_labels,
    with_enough_steps,
    within_budget,
)
from steerlab.learning.windows import WindowConfig
from steerlab.sim.errors import InvalidConfig


def test_twelve_rollouts_hold_out_three_interleaved():
    names = [f"r{index:02d}" for index in range(12)]
    split = split_rollouts(names)
    assert split.held_out == ("r02", "r06", "r10")
    assert sorted((*split.train, *split.held_out)) == names


def test_no_rollout_person_pair_is_shared_and_nothing_is_lost(study, rollouts, people):
    parts = (study.train_seen, study.held_out_seen, study.calibrate_new, study.held_out_new)
    pairs = [(one.person, one.rollout) for part in parts for one in part]
    assert len(set(pairs)) == len(pairs) == len(rollouts) * 18
    assert {one.person for one in study.train_seen} == {one.name for one in people["seen"]}
    assert {one.person for one in study.calibrate_new} == {one.name for one in people["new"]}
    train = {one.rollout for one in (*study.train_seen, *study.calibrate_new)}
    held_out = {one.rollout for one in (*study.held_out_seen, *study.held_out_new)}
    assert not train & held_out


def test_no_noise_seed_is_shared_across_the_split(study, rollouts, people):
    teachers = {one.name: one for one in (*people["seen"], *people["new"])}
    states = [
        tuple(teachers[one.person].noise_seed(one.rollout, 0).generate_state(4))
        for part in (study.train_seen, study.held_out_seen, study.calibrate_new, study.held_out_new)
        for one in part
    ]
    assert len(set(states)) == len(states)


def test_what_cannot_be_split_is_an_error(study):
    with pytest.raises(InvalidLabels, match="needs 3"):
        split_rollouts(["a", "b"])
    with pytest.raises(InvalidLabels, match="twice"):
        split_rollouts(["a", "b", "a"])
    split = split_rollouts(["a", "b", "c"])
    with pytest.raises(InvalidLabels, match="in no part"):
        split_study(study.train_seen, split, [])
    names = sorted({one.rollout for one in (*study.train_seen, *study.held_out_seen)})
    with pytest.raises(InvalidLabels, match="stranger"):
        split_study(study.train_seen, split_rollouts(names), ["stranger"])
    with pytest.raises(InvalidLabels, match="two series"):
        split_study([study.train_seen[0]] * 2, split_rollouts(names), [])


QUICK = MapperConfig(
    window=WindowConfig(half_width_s=0.3), training=TrainingConfig(epochs=2, share_per_epoch=1.0)
)


@pytest.fixture(autouse=True)
def few_steps(monkeypatch):
    monkeypatch.setattr(training_budget, "LEAST_TRAINING_STEPS", 10)


def _silent(what: str, share: float) -> None:
    pass


def _one(person: str, rollout: str, split: str | None = None, *, steps: int = 20) -> GivenSeries:
    rng = np.random.default_rng([*person.encode(), *rollout.encode()])
    truth = rng.uniform(-1.0, 1.0, steps)
    label = np.clip(1.5 * truth + rng.normal(0.0, 0.2, steps), -2.5, 2.5)
    series = LabelSeries(
        person=person,
        rollout=rollout,
        rate_hz=10.0,
        label=label,
        truth=truth,
        valid=np.ones(steps, dtype=bool),
    )
    return GivenSeries(series=series, steps=np.arange(steps), split=split)


def _table(given: list[GivenSeries]) -> LabelTable:
    return LabelTable(given=tuple(given), scale=LabelScale(), notices=())


def _shared(people: int, rollouts: int) -> LabelTable:
    return _table([_one(f"p{p:02d}", f"r{r:02d}") for p in range(people) for r in range(rollouts)])


def _pair(one: LabelSeries) -> tuple[str, str]:
    return one.person, one.rollout


@settings(max_examples=60, deadline=None)
@given(
    people=st.integers(2, 9),
    rollouts=st.integers(2, 9),
    count=st.integers(2, 9),
    seed=st.integers(0, 99),
    own=st.booleans(),
    drop=st.floats(0.0, 0.6),
)
def test_folds_never_leak_and_hold_out_each_label_at_most_once(
    people, rollouts, count, seed, own, drop
):
    rng = np.random.default_rng(seed)
    given = [
        _one(f"p{p}", f"p{p}-r{r}" if own else f"r{r}", steps=3)
        for p in range(people)
        for r in range(rollouts)
        if rng.random() >= drop
    ]
    if not given:
        return
    try:
        plan = plan_folds(_table(given), count, seed)
    except InvalidLabels:
        return
    held_out = [
        _pair(one) for fold in plan.folds for one in (*fold.held_out_seen, *fold.held_out_new)
    ]
    assert len(held_out) == len(set(held_out))
    for fold in plan.folds:
        learned = (*fold.train_seen, *fold.calibrate_new)
        scored = (*fold.held_out_seen, *fold.held_out_new)
        assert not {one.rollout for one in learned} & {one.rollout for one in scored}
        new = {one.person for one in (*fold.calibrate_new, *fold.held_out_new)}
        assert not {one.person for one in fold.train_seen} & new
        assert {one.person for one in fold.held_out_seen} <= {o.person for o in fold.train_seen}
        assert {one.person for one in fold.held_out_new} <= {o.person for o in fold.calibrate_new}
    assert len(plan.fit) == len(given)
    assert bool(plan.notices) == (len(held_out) < len(given))


def test_a_full_table_is_scored_wholly():
    plan = plan_folds(_shared(10, 8), 4, 0)
    scored = [one for fold in plan.folds for one in (*fold.held_out_seen, *fold.held_out_new)]
    assert len(scored) == 80
    assert len([one for fold in plan.folds for one in fold.held_out_new]) == 20
    assert {one.person for fold in plan.folds for one in fold.held_out_new} == {
        f"p{p:02d}" for p in range(10)
    }
    assert plan.notices == ()
    other = plan_folds(_shared(10, 8), 4, 1)
    assert [_pair(o) for o in other.folds[0].train_seen] != [
        _pair(o) for o in plan.folds[0].train_seen
    ]


def test_people_with_one_rollout_train_but_are_not_scored():
    given = [_one(f"p{p}", f"r{r}") for p in range(4) for r in range(4)] + [_one("single", "r0")]
    plan = plan_folds(_table(given), 2, 0)
    assert "single" in {one.person for one in plan.fit}
    assert "single" not in {
        one.person for fold in plan.folds for one in (*fold.held_out_seen, *fold.held_out_new)
    }
    assert plan.notices[0].startswith("'single': 1 of 17 rollouts train but are not scored")


@pytest.mark.parametrize(
    ("people", "rollouts", "count", "said"),
    [
        (3, 8, 4, "3 people .* cannot make 4 folds; give --folds 3 or fewer"),
        (8, 2, 4, "2 rollouts .* give --folds 2 or fewer"),
        (8, 1, 2, "1 rollouts .* more must be recorded"),
        (1, 8, 2, "1 people .* more must be recorded"),
    ],
)
def test_too_few_are_said(people, rollouts, count, said):
    with pytest.raises(InvalidLabels, match=said):
        plan_folds(_shared(people, rollouts), count, 0)
    with pytest.raises(InvalidConfig, match="folds is 1"):
        plan_folds(_shared(8, 8), 1, 0)


def test_one_rollout_each_cannot_be_scored():
    with pytest.raises(InvalidLabels, match="it takes two with two or more rollouts each"):
        plan_folds(_table([_one(f"p{p}", f"r{p}") for p in range(8)]), 4, 0)


def test_people_without_truth_are_left_out():
    given = list(_shared(4, 4).given)
    blind = given[0].series
    given[:4] = [
        replace(one, series=replace(one.series, valid=np.zeros(blind.steps, dtype=bool)))
        for one in given[:4]
    ]
    plan = plan_folds(_table(given), 2, 0)
    assert plan.notices == ("'p00': no row has both label and truth; left out.",)
    assert "p00" not in {one.person for one in plan.fit}


def _renamed(
    given: list[GivenSeries], person: str, rollout: str, name: str, steps: int = 20
) -> list[GivenSeries]:
    """With one person's series of ``rollout`` under another name, perhaps cut short."""
    (one,) = [g for g in given if _pair(g.series) == (person, rollout)]
    series = replace(
        one.series,
        rollout=name,
        label=one.series.label[:steps],
        truth=one.series.truth[:steps],
        valid=one.series.valid[:steps],
        context=one.series.context[:steps],
    )
    return [g for g in given if g is not one] + [
        replace(one, series=series, steps=one.steps[:steps])
    ]


def _drives(people: int, rollouts: int) -> list[GivenSeries]:
    """Everyone on the same drives: a rollout's truth is the same for all of them."""
    given = _shared(people, rollouts).given
    truth = {g.series.rollout: g.series.truth for g in given}
    return [replace(g, series=replace(g.series, truth=truth[g.series.rollout])) for g in given]


@pytest.mark.parametrize("steps", [20, 12])
def test_one_truth_under_two_names_is_held_out_once(steps):
    """Or every held-out label's truth is trained on under the other name."""
    given = _drives(6, 4)
    for person, rollout in (("p01", "r01"), ("p02", "r02"), ("p03", "r01")):
        given = _renamed(given, person, rollout, f"{person}'s {rollout}", steps)
    plan = plan_folds(_table(given), 3, 0)
    for fold in plan.folds:
        learned = (*fold.train_seen, *fold.calibrate_new)
        scored = (*fold.held_out_seen, *fold.held_out_new)
        starts = [{one.truth[:12].tobytes() for one in part} for part in (learned, scored)]
        assert not starts[0] & starts[1]
    (notice,) = plan.notices
    assert "one and the same truth are one drive, whatever their names: 'r01', " in notice
    assert "held out together" in notice
    with pytest.raises(InvalidLabels, match=r"4 rollouts .*one truth is one rollout"):
        plan_folds(_table(given), 5, 0)


def test_truths_that_only_begin_alike_are_two_drives():
    given = list(_shared(4, 4).given)
    for index, one in enumerate(given):
        truth = np.r_[np.full(9, 0.5), one.series.truth[9:]]
        given[index] = replace(one, series=replace(one.series, truth=truth))
    assert plan_folds(_table(given), 4, 0).notices == ()
    flat = [replace(g, series=replace(g.series, truth=np.full(20, 0.5))) for g in given]
    assert plan_folds(_table(flat), 4, 0).notices == ()


def test_one_truth_on_both_sides_of_a_split_column_is_noticed():
    table = _with_splits()
    truth = {one.series.rollout: one.series.truth for one in table.given}
    given = [
        replace(one, series=replace(one.series, truth=truth["1"]))
        if _pair(one.series) in (("a", "1"), ("b", "2"))
        else one
        for one in table.given
    ]
    flattered, same = plan_folds(_table(given), 4, 0).notices
    assert flattered.startswith("'2': held out for some people, trained on by others")
    assert "whatever their names: '1', '2'. So the split column says" in same


def _with_splits(**splits: str) -> LabelTable:
    pairs = {
        ("a", "1"): "train",
        ("a", "2"): "heldout",
        ("b", "1"): "train",
        ("b", "2"): "heldout",
        ("c", "1"): "new_calibration",
        ("c", "2"): "new_test",
        ("d", "1"): "new_calibration",
        ("d", "2"): "new_test",
    }
    pairs |= {(name[0], name[1]): split for name, split in splits.items()}
    return _table([_one(p, r, split) for (p, r), split in pairs.items()])


def test_the_split_column_is_obeyed():
    plan = plan_folds(_with_splits(), 4, 0)
    (fold,) = plan.folds
    assert [_pair(one) for one in fold.train_seen] == [("a", "1"), ("b", "1")]
    assert [_pair(one) for one in fold.held_out_new] == [("c", "2"), ("d", "2")]
    assert plan.fit is None
    assert plan.notices == ()


@pytest.mark.parametrize(
    ("splits", "said"),
    [
        ({"c2": "new_calibration", "d2": "new_calibration"}, "no usable row for new_test"),
        ({"a2": "new_test"}, "'a' is both seen"),
        ({"b1": "heldout"}, "'b' is heldout but not in train"),
        ({"d1": "new_test"}, "'d' is in new_test without new_calibration"),
        ({"b2": "train"}, "1 seen people can be scored"),
    ],
)
def test_a_split_column_that_leaks_or_lacks_is_said(splits, said):
    with pytest.raises(InvalidLabels, match=said):
        plan_folds(_with_splits(**splits), 4, 0)


def test_a_rollout_on_both_sides_is_noticed():
    (notice,) = plan_folds(_with_splits(a3="heldout", b3="train"), 4, 0).notices
    assert notice.startswith("'3': held out for some people, trained on by others")


def test_held_out_truth_and_people_cannot_be_read():
    """Change everything that fold 1 holds out: what it predicts there must not move by a bit."""
    table = _shared(4, 4)
    plan = plan_folds(table, 2, 0)
    first = plan.folds[0]
    held = {_pair(one) for one in (*first.held_out_seen, *first.held_out_new)}
    spoilt = [
        replace(one, series=replace(one.series, truth=-one.series.truth))
        if _pair(one.series) in held
        else one
        for one in table.given
    ]
    before = cross_validate(plan, QUICK, seed=3, progress=_silent, full=False)
    after = cross_validate(
        plan_folds(_table(spoilt), 2, 0), QUICK, seed=3, progress=_silent, full=False
    )
    moved = 0
    for one, other in zip(before.predictions, after.predictions, strict=True):
        assert _pair(one.series) == _pair(other.series)
        if one.fold == 1:
            np.testing.assert_array_equal(one.mapped, other.mapped)
        else:
            moved += int(not np.array_equal(one.mapped, other.mapped))
    assert moved > 0  # fold 2 trains on what fold 1 held out


def test_results_pool_all_folds_and_repeat():
    plan = plan_folds(_shared(5, 4), 2, 0)
    one = cross_validate(plan, QUICK, seed=3, progress=_silent, full=False)
    again = cross_validate(plan, QUICK, seed=3, progress=_silent, full=False)
    assert one.quality == again.quality
    labels = {split: ladder["mind_meld"].labels for split, ladder in one.quality.items()}
    assert labels["seen"] + labels["new"] == 5 * 4 * 20
    assert one.quality["new"]["identity"].improvement == 0.0
    mapped = np.concatenate([p.mapped for p in one.predictions if p.split == "new"])
    truth = np.concatenate([p.series.truth for p in one.predictions if p.split == "new"])
    assert one.quality["new"]["mind_meld"].mae_after == pytest.approx(np.abs(mapped - truth).mean())


def test_every_method_is_judged_or_said_to_be_left_out():
    quick = cross_validate(
        plan_folds(_shared(5, 4), 2, 0), QUICK, seed=3, progress=_silent, full=False
    )
    for ladder in quick.quality.values():
        assert set(ladder) == set(BASELINES) - set(quick.left_out)
    assert set(quick.left_out) == {*FULL_ONLY, "sim_pretrained_context", "no_labels"} - {CEILING}


def test_a_method_that_one_fold_cannot_judge_is_left_out_of_all():
    two = cross_validate(
        plan_folds(_shared(2, 4), 2, 0), QUICK, seed=3, progress=_silent, full=False
    )
    assert "there is 1" in two.left_out["eb_nonlinear"]
    assert "eb_nonlinear" not in two.quality["new"]


def test_progress_is_told_and_never_falls_back():
    told: dict[str, list[float]] = {}
    cross_validate(
        plan_folds(_shared(4, 4), 2, 0),
        QUICK,
        seed=3,
        progress=lambda what, share: told.setdefault(what, []).append(share),
        full=False,
    )
    assert list(told) == [
        f"{what}, fold {number} of 2"
        for number in (1, 2)
        for what in ("MIND MELD", "rival mappers", "scoring")
    ]
    for shares in told.values():
        assert shares == sorted(shares)
        assert shares[-1] == 1.0


def test_a_table_beyond_the_budget_still_knows_everyone():
    series = [one.series for one in _shared(12, 3).given]
    mapper = fit_within_budget(series, QUICK, seed=0, what="x", progress=_silent, most_labels=240)
    assert set(mapper.people) == {one.person for one in series}
    budget = within_budget(series, 0, 240)
    assert len(budget.trained) + len(budget.calibrated) == len(series)
    trained = {one.person for one in budget.trained}
    assert not trained & {one.person for one in budget.calibrated}
    assert sum(one.steps for one in budget.trained) == 240
    (notice,) = budget.notices
    assert "were learned of 4 of 12 people" in notice
    assert within_budget(series, 0).calibrated == ()
    assert within_budget(series, 0).notices == ()
    assert len({one.person for one in within_budget(series, 0, 1).trained}) == 2


def test_all_methods_learn_of_the_budget_and_judge_everyone():
    plan = plan_folds(_shared(12, 4), 2, 0)
    found = cross_validate(plan, QUICK, seed=0, progress=_silent, full=False, most_labels=160)
    assert found.notices
    for split in ("seen", "new"):
        assert {one.people for one in found.quality[split].values()} == {12}


def test_small_tables_are_trained_long_enough(monkeypatch):
    monkeypatch.setattr(training_budget, "LEAST_TRAINING_STEPS", LEAST_TRAINING_STEPS)
    for labels in (0, 10, 1_000, 3_000):
        training = with_enough_steps(LAB, labels).training
        assert LEAST_TRAINING_STEPS <= training.steps(labels or 1) < 1.1 * LEAST_TRAINING_STEPS
        assert training.batch_size < LAB.training.batch_size
    for labels in (3_500, 20_000):
        assert LAB.training.steps(labels) >= LEAST_TRAINING_STEPS
        assert with_enough_steps(LAB, labels) == LAB
    assert with_enough_steps(LAB, 100_000) == LAB


def _gains(people: int, drives: int, noise: float) -> list[LabelSeries]:
    """People who multiply by a gain, and add noise."""
    rng = np.random.default_rng(3)
    truths = [0.5 * np.sin(0.2 * np.arange(60) + rng.uniform(0.0, 6.0)) for _ in range(drives)]
    return [
        LabelSeries(
            person=f"p{person}",
            rollout=f"r{number}",
            rate_hz=20.0,
            label=gain * truth + noise * rng.normal(size=60),
            truth=truth,
            valid=np.ones(60, dtype=bool),
        )
        for person, gain in enumerate(np.linspace(0.3, 1.8, people))
        for number, truth in enumerate(truths)
    ]


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_clean_labels_are_learned_for_longer_and_noisy_ones_are_not(monkeypatch, noise):
    monkeypatch.setattr(training_budget, "LEAST_TRAINING_STEPS", 60)
    monkeypatch.setattr(training_budget, "LONGER", 5)
    monkeypatch.setattr(training_budget, "CLEAN", 1.0)  # held-out labels alone decide
    series = _gains(6, 5, noise)
    config = replace(QUICK, training=replace(LAB.training, epochs=1))
    found = fit_long_enough(series, config, 0, "x", _silent).config
    enough = with_enough_steps(config, valid_labels(series))
    if noise > 0.0:
        assert found == enough
        return
    steps = enough.training.steps(valid_labels(series))
    assert found.training.steps(valid_labels(series)) >= training_budget.LONGER * steps
    settled = replace(config, training=replace(config.training, longer_if_clean=False))
    assert fit_long_enough(series, settled, 0, "x", _silent).config.training.epochs == (
        enough.training.epochs
    )


def test_too_few_drives_to_hold_one_out_are_trained_as_before():
    for drives, held in ((2, 0), (3, 1), (12, 2)):
        rest, out = training_budget._hold_out(_gains(3, drives, 0.0))
        assert len({one.rollout for one in out}) == held
        assert not {one.rollout for one in rest} & {one.rollout for one in out}
        assert len(rest) + len(out) == 3 * drives
