"""Each baseline does what its idea says, against an exact oracle where there is one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.baselines import (
    BASELINES,
    CEILING,
    FULL_ONLY,
    LEAST_RATE_HZ,
    IdentityMapper,
    NoEmbeddingMapper,
    PersonGainLagMapper,
    PersonGainMapper,
    PersonRidgeMapper,
    SharedGainMapper,
    SharedRidgeMapper,
    ShuffledEmbeddingMapper,
    TrueStyleMapper,
    fit_baselines,
    left_out,
)
from steerlab.learning.baselines.gain import DelayGrid
from steerlab.learning.baselines.ridge import choose_penalty, features, ridge_sums
from steerlab.learning.errors import InvalidLabels, NotFitted, UnknownPerson
from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.presets import PAPER, PAPER_TEXT
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import StudySplit
from steerlab.learning.windows import WindowConfig
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle
from steerlab.sim.vehicle import WHEEL_LIMIT


def series_of(label: np.ndarray, truth: np.ndarray, rollout: str = "r") -> LabelSeries:
    valid = np.isfinite(label) & np.isfinite(truth)
    return LabelSeries(
        person="p", rollout=rollout, rate_hz=20.0, label=label, truth=truth, valid=valid
    )


def improvement(mapper, series) -> float:
    return mapper_quality(mapper, series, np.random.default_rng(0)).improvement


def test_the_keys_are_those_agreed():
    assert BASELINES == (
        "identity", "no_labels", "shared_gain", "person_gain", "person_gain_lag",
        "shared_ridge", "person_ridge", "no_embedding", "mean_embedding", "shuffled_embedding",
        "mind_meld", "mind_meld_paper", "mind_meld_paper_text", "eb_nonlinear", "sim_pretrained",
        "sim_pretrained_context", "auto",
    )  # fmt: skip


def test_a_quick_ladder_lacks_what_must_be_trained(trained, study):
    without = left_out([study], trained.config, full=False)
    assert set(without) == set(FULL_ONLY) - {CEILING}
    told: list[float] = []
    quick = fit_baselines(trained, study, seed=0, on_step=told.append, without=without)
    assert list(quick) == [name for name in BASELINES if name not in FULL_ONLY]
    assert quick["mind_meld"] is trained
    assert told == sorted(told)
    assert told[-1] == 1.0


@pytest.mark.slow
def test_a_full_ladder_has_every_rung_in_order_and_tells_its_steps(trained, study, people):
    small = replace(study, train_seen=study.train_seen[:12], calibrate_new=study.calibrate_new[:6])
    told: list[float] = []
    styles = {one.name: one.style for group in people.values() for one in group}
    full = fit_baselines(
        trained,
        small,
        seed=0,
        on_step=told.append,
        without=left_out([small], trained.config, full=True, styles_known=True),
        styles=styles,
    )
    assert list(full) == [*BASELINES, CEILING]
    assert all(full[name].name == name for name in full)
    assert told == sorted(told)
    assert len(told) > len(full)  # epochs are told too


def changed(study: StudySplit, **changes: object) -> StudySplit:
    parts = ("train_seen", "held_out_seen", "calibrate_new", "held_out_new")
    return StudySplit(
        **{part: tuple(replace(one, **changes) for one in getattr(study, part)) for part in parts}
    )


PRETRAINED = {"sim_pretrained", "sim_pretrained_context"}


def test_nothing_is_left_out_without_a_reason(trained, study):
    assert left_out([study], trained.config, full=True, styles_known=True) == {}
    why = left_out([study], PAPER, full=True)
    assert why == {"mind_meld_paper": "mind_meld itself has these settings here"}
    text = left_out([study], PAPER_TEXT, full=True)
    assert set(text) == {"mind_meld_paper_text"}
    quick = left_out([study], trained.config, full=False, styles_known=True)
    assert set(quick) == set(FULL_ONLY)


def test_without_the_cars_motion_the_rung_that_reads_it_is_left_out(trained, study):
    one = study.train_seen[0]
    bare = changed(study, context=np.empty((0, 0)), context_names=())
    why = left_out([study, bare], trained.config, full=True)
    assert set(why) == {"sim_pretrained_context", "no_labels"}
    assert "yaw_rate_radps, speed_mps, robot_wheel" in why["sim_pretrained_context"]
    wild = replace(one, context=one.context + np.array([0.0, 0.0, 25.0]))
    other_units = replace(study, train_seen=(wild, *study.train_seen[1:]))
    why = left_out([other_units], trained.config, full=True)
    assert set(why) == {"sim_pretrained_context", "no_labels"}
    assert "robot_wheel reaches 10 times" in why["sim_pretrained_context"]
    degrees = replace(one, context=one.context + np.array([40.0, 0.0, 0.0]))
    in_degrees = replace(study, calibrate_new=(degrees, *study.calibrate_new[1:]))
    why = left_out([in_degrees], trained.config, full=True)
    assert "yaw_rate_radps reaches 40" in why["sim_pretrained_context"]


def test_labels_too_slow_or_too_holed_for_the_grid_are_said(trained, study):
    slow = changed(study, rate_hz=0.5)
    why = left_out([slow], trained.config, full=True)
    assert set(why) == {"eb_nonlinear", *PRETRAINED}
    assert "labels come at 0.5 Hz" in why["eb_nonlinear"]
    assert left_out([changed(study, rate_hz=LEAST_RATE_HZ)], trained.config, full=True) == {}
    # At 30 Hz every grid sample but each second lies between two steps, and needs both.
    comb = np.arange(study.train_seen[0].steps) % 3 == 1
    person = study.train_seen[0].person
    holed = replace(
        study,
        train_seen=tuple(
            replace(one, rate_hz=30.0, valid=comb) if one.person == person else one
            for one in study.train_seen
        ),
    )
    why = left_out([holed], trained.config, full=True)
    assert set(why) == {"eb_nonlinear", *PRETRAINED}
    assert f"{person!r} has no valid label" in why["sim_pretrained"]


def test_one_training_rollout_leaves_no_ridge_to_choose(trained, study):
    first = study.train_seen[0].rollout
    one = replace(study, train_seen=tuple(s for s in study.train_seen if s.rollout == first))
    assert set(left_out([study, one], trained.config, full=True)) == {
        "shared_ridge",
        "person_ridge",
        "no_labels",
        "auto",
    }
    people = list(dict.fromkeys(s.person for s in study.train_seen))
    rollouts = list(dict.fromkeys(s.rollout for s in study.train_seen))
    own = {person: rollouts[row % 2] for row, person in enumerate(people)}  # one each, of two
    each = replace(
        study, train_seen=tuple(s for s in study.train_seen if s.rollout == own[s.person])
    )
    assert set(left_out([each], trained.config, full=True)) == {"person_ridge", "auto"}


def test_one_training_person_gives_no_prior(trained, study):
    alone = study.train_seen[0].person
    one = replace(study, train_seen=tuple(s for s in study.train_seen if s.person == alone))
    assert set(left_out([study, one], trained.config, full=True)) == {"eb_nonlinear"}


def test_identity_changes_nothing(study):
    one = study.held_out_seen[0]
    np.testing.assert_array_equal(IdentityMapper().map(one), one.label)


def test_person_gain_recovers_a_gain_exactly(rollouts, label_people):
    teacher = ScriptedTeacher("p", TeacherStyle(gain=0.5), 0)
    mapper = PersonGainMapper()
    mapper.fit(label_people([teacher], rollouts[:2]))
    (held_out,) = label_people([teacher], rollouts[2:3])
    np.testing.assert_allclose(mapper.map(held_out), held_out.truth, atol=1e-12)


def test_shared_gain_is_one_least_squares_factor(study):
    mapper = SharedGainMapper()
    with pytest.raises(NotFitted, match="call fit"):
        mapper.map(study.held_out_seen[0])
    mapper.fit(study.train_seen)
    label = np.concatenate([one.label[one.valid] for one in study.train_seen])
    truth = np.concatenate([one.truth[one.valid] for one in study.train_seen])
    (factor,), *_ = np.linalg.lstsq(label[:, None], truth, rcond=None)
    one = study.held_out_new[0]
    expected = np.clip(factor * one.label, -WHEEL_LIMIT, WHEEL_LIMIT)
    np.testing.assert_allclose(mapper.map(one), expected)


@pytest.mark.parametrize("mapper", [PersonGainMapper(), PersonGainLagMapper()])
def test_a_gain_needs_a_label_and_a_person(mapper, study):
    one = study.train_seen[0]
    with pytest.raises(InvalidLabels, match=one.person):
        mapper.fit([replace(one, label=np.zeros(one.steps))])
    with pytest.raises(UnknownPerson, match="calibrate"):
        mapper.map(one)


@settings(deadline=None, max_examples=20)
@given(gain=st.floats(0.4, 0.95), delay_steps=st.integers(-8, 12), seed=st.integers(0, 2**31))
def test_gain_and_lag_recover_a_known_gain_and_delay(gain: float, delay_steps: int, seed: int):
    rng = np.random.default_rng(seed)
    longer = np.convolve(rng.normal(0.0, 1.0, 340), np.hanning(21) / 5.0, "valid")
    longer = np.clip(longer, -WHEEL_LIMIT, WHEEL_LIMIT)
    truth = longer[20:-20]
    late = gain * longer[20 - delay_steps : 20 - delay_steps + len(truth)]
    inner = np.zeros(len(truth), dtype=bool)
    inner[20:-20] = True  # beyond the ends the last label stands, which is not exact
    mapper = PersonGainLagMapper(DelayGrid(step_s=0.05))
    mapper.fit([replace(series_of(late, truth), valid=inner)])
    learned = mapper.learned("p")
    assert learned.delay_s == pytest.approx(delay_steps / 20.0, abs=1e-9)
    assert learned.factor == pytest.approx(1.0 / gain, rel=1e-6)


def test_gain_and_lag_read_between_steps(rollouts, label_people):
    teacher = ScriptedTeacher("p", TeacherStyle(gain=0.8, delay_s=0.13), 0)
    mapper = PersonGainLagMapper()
    mapper.fit(label_people([teacher], rollouts[:4]))
    assert mapper.learned("p").delay_s == pytest.approx(0.13, abs=0.021)
    assert mapper.learned("p").factor == pytest.approx(1.25, rel=0.05)
    assert improvement(mapper, label_people([teacher], rollouts[4:6])) > 0.8


def test_an_empty_grid_is_refused():
    with pytest.raises(InvalidConfig, match="holds no delay"):
        DelayGrid(step_s=0.0)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**31), penalty=st.sampled_from([0.01, 1.0, 300.0]))
def test_ridge_is_the_direct_solution(seed: int, penalty: float):
    rng = np.random.default_rng(seed)
    series = [
        series_of(rng.uniform(-2, 2, 60), rng.uniform(-2, 2, 60), f"r{index}") for index in range(2)
    ]
    window = WindowConfig(half_width_s=0.3)
    mapper = PersonRidgeMapper(window, np.array([penalty]))
    mapper.fit(series)
    x = np.concatenate([features(one, window) for one in series])
    y = np.concatenate([one.label - one.truth for one in series])
    # Centring both sides leaves the intercept without a penalty; augmented rows add it.
    slopes, centre = x[:, :-1], x[:, :-1].mean(axis=0)
    rows = np.vstack([slopes - centre, np.sqrt(penalty) * np.eye(slopes.shape[1])])
    target = np.concatenate([y - y.mean(), np.zeros(slopes.shape[1])])
    beta, *_ = np.linalg.lstsq(rows, target, rcond=None)
    predicted = y.mean() + (slopes[:60] - centre) @ beta
    expected = np.clip(series[0].label - predicted, -WHEEL_LIMIT, WHEEL_LIMIT)
    np.testing.assert_allclose(mapper.map(series[0]), expected, atol=1e-8)


def test_the_penalty_is_that_of_fits_without_the_rollout(study):
    window, penalties = WindowConfig(), np.array([0.1, 10.0, 1000.0])
    person = study.train_seen[0].person
    own = [one for one in study.train_seen if one.person == person]
    error = np.zeros(3)
    for out in own:
        mapper_error = []
        for penalty in penalties:
            rest = [one for one in own if one is not out]
            coefficients = ridge_sums(rest, window).coefficients(np.array([penalty]))[0]
            left = out.label - out.truth - features(out, window) @ coefficients
            mapper_error.append(np.square(left[out.valid]).sum())
        error += mapper_error
    everything = ridge_sums(own, window)
    np.testing.assert_allclose(everything.left_out_error(penalties), error, rtol=1e-6)
    assert choose_penalty([everything], penalties) == penalties[np.argmin(error)]


def test_a_shared_ridge_is_one_window_and_ridges_say_what_they_lack(study):
    shared, own = SharedRidgeMapper(), PersonRidgeMapper()
    one = study.held_out_new[0]
    for mapper, error in ((shared, NotFitted), (own, UnknownPerson)):
        with pytest.raises(error, match="call"):
            mapper.map(one)
    with pytest.raises(NotFitted, match="call fit"):
        own.calibrate(study.calibrate_new)
    with pytest.raises(InvalidLabels, match="two rollouts"):
        own.fit(study.train_seen[:1])
    with pytest.raises(InvalidLabels, match="has no valid label"):
        own.fit([replace(one, valid=np.zeros(one.steps, dtype=bool))])
    shared.fit(study.train_seen)
    renamed = replace(one, person="anyone")
    np.testing.assert_array_equal(shared.map(one), shared.map(renamed))


def test_a_ridge_per_person_beats_the_shared_one(ladder, study):
    for part in (study.held_out_seen, study.held_out_new):
        own, shared = (
            improvement(ladder["person_ridge"], part),
            improvement(ladder["shared_ridge"], part),
        )
        assert own > shared + 0.05


def test_shuffled_embeddings_are_far_below_the_true_ones(trained, ladder, study):
    shuffled = ladder["shuffled_embedding"]
    assert isinstance(shuffled, ShuffledEmbeddingMapper)
    assert all(shuffled.lender(person) != person for person in trained.people)
    assert len({shuffled.lender(person) for person in trained.people}) == len(trained.people)
    for part in (study.held_out_seen, study.held_out_new):
        assert improvement(shuffled, part) < improvement(trained, part) - 0.2


def test_without_embedding_people_are_mapped_alike(ladder, study, quick_config):
    one = study.held_out_seen[0]
    mapper = ladder["no_embedding"]
    stranger = replace(one, person="stranger")
    np.testing.assert_array_equal(mapper.map(one), mapper.map(stranger))
    with pytest.raises(NotFitted, match="call fit"):
        NoEmbeddingMapper(quick_config, seed=0).map(one)


def test_the_ceilings_w_is_as_large_as_it_was_unless_somebody_is_sparse(people):
    styles = {one.name: one.style for one in people["seen"]}
    assert TrueStyleMapper(styles, seed=0).config.network.embedding_size == 9
    styles["sparse"] = TeacherStyle(tolerance=0.5)
    assert TrueStyleMapper(styles, seed=0).config.network.embedding_size == 10


def test_the_ceiling_is_told_the_style_and_uses_it(ladder, study, people):
    ceiling = ladder[CEILING]
    seen, new = people["seen"][0], people["new"][0]
    one = next(s for s in study.held_out_seen if s.person == seen.name)
    as_other = replace(one, person=new.name)
    assert np.abs(ceiling.map(one) - ceiling.map(as_other))[one.valid].max() > 0.05
    with pytest.raises(UnknownPerson, match="given the style of 'stranger'"):
        ceiling.map(replace(one, person="stranger"))
    few = TrueStyleMapper({}, seed=0)
    with pytest.raises(UnknownPerson, match="add it"):
        few.fit(study.train_seen[:1])
