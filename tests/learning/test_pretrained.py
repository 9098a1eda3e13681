"""The simulation-pretrained mapper: contract, closed-form style, symmetry, fine-tuning."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from steerlab.learning.empirical_bayes.grid import RATE_HZ
from steerlab.learning.errors import InvalidLabels, UnknownPerson
from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.pretrained.fine_tuning import FineTuningConfig
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.pretrained.model import (
    INPUTS,
    SHOWN,
    Alignment,
    PretrainedModel,
    ResidualConfig,
    ResidualNetwork,
    network_inputs,
)
from steerlab.learning.pretrained.style import STYLE_SIZE
from steerlab.learning.pretrained.teachers import (
    STYLE,
    PretrainingDrive,
    SimulatedStudy,
    TeacherRanges,
    simulate_study,
)
from steerlab.learning.pretrained.train import PretrainConfig, pretrain
from steerlab.learning.series import CONTEXT, LabelSeries
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

TINY = PretrainConfig(
    people=64,
    rollouts=4,
    steps=20,
    batch_size=16,
    crop=100,
    network=ResidualConfig(style_size=STYLE_SIZE, channels=8, dilations=(1, 2)),
)


def waves(rng: np.random.Generator, samples: int = 160) -> PretrainingDrive:
    t_s = np.arange(samples) / RATE_HZ
    truth = sum(
        rng.normal(0.0, 0.7) * np.sin(rng.uniform(0.5, 4.0) * t_s + rng.uniform(0.0, 6.0))
        for _ in range(4)
    )
    truth = np.clip(truth, -WHEEL_LIMIT, WHEEL_LIMIT)
    motion = np.stack([0.3 * truth, np.full(samples, 5.0), truth], axis=1)
    return PretrainingDrive(truth=truth, motion=motion)


def some_drives() -> list[PretrainingDrive]:
    rng = np.random.default_rng(4)
    return [waves(rng, samples) for samples in (160, 150, 140, 160, 120, 160)]


@pytest.fixture(scope="module")
def tiny() -> PretrainedModel:
    return pretrain(0, TINY, drives=some_drives())


@pytest.fixture(scope="module")
def with_motion(study):
    """The study's parts with a car's motion beside the labels."""

    def moved(part: tuple[LabelSeries, ...]) -> list[LabelSeries]:
        return [
            replace(
                one,
                context=np.column_stack([0.2 * one.truth, np.full(one.steps, 5.0), one.truth]),
                context_names=CONTEXT,
            )
            for one in part
        ]

    return {name: moved(getattr(study, name)) for name in ("train_seen", "held_out_new")}


@pytest.fixture(params=[False, True], ids=["labels", "context"], name="mapper")
def _mapper(request, tiny, with_motion) -> SimPretrainedMapper:
    mapper = SimPretrainedMapper(context=request.param, model=tiny, fine_tuning=None)
    mapper.fit(with_motion["train_seen"])
    mapper.calibrate(with_motion["held_out_new"])
    return mapper


class TestContract:
    def test_shape_limits_and_repeatability(self, mapper, with_motion):
        one = with_motion["held_out_new"][0]
        mapped, spread = mapper.map_with_spread(one)
        assert mapped.shape == spread.shape == (one.steps,)
        assert mapped.dtype == np.float64
        assert np.abs(mapped).max() <= WHEEL_LIMIT
        assert (spread > 0.0).all()
        np.testing.assert_array_equal(mapped, mapper.map(one))

    def test_the_truth_is_never_read(self, mapper, with_motion):
        one = with_motion["held_out_new"][0]
        blind = replace(one, truth=np.full(one.steps, np.nan), valid=np.zeros(one.steps, bool))
        np.testing.assert_array_equal(mapper.map(one), mapper.map(blind))

    def test_a_missing_label_stays_missing_and_changes_nothing_far_away(self, mapper, with_motion):
        one = with_motion["held_out_new"][0]
        label = one.label.copy()
        label[20:25] = np.nan
        mapped = mapper.map(replace(one, label=label, valid=np.isfinite(label)))
        assert np.isnan(mapped).tolist() == np.isnan(label).tolist()
        np.testing.assert_allclose(mapped[-40:], mapper.map(one)[-40:], atol=1e-5)

    def test_left_and_right_are_treated_alike(self, mapper, with_motion):
        """Mirrored people on mirrored rollouts get mirrored labels."""
        mirrored = [
            replace(
                one,
                label=-one.label,
                truth=-one.truth,
                context=one.context * [-1.0, 1.0, -1.0],
            )
            for one in with_motion["held_out_new"]
        ]
        given = [mapper.map(one) for one in with_motion["held_out_new"]]
        mapper.calibrate(mirrored)
        for one, expected in zip(mirrored, given, strict=True):
            np.testing.assert_allclose(mapper.map(one), -expected, atol=1e-4)

    def test_a_finer_control_rate_maps_to_the_same_labels(self, mapper, with_motion):
        one = with_motion["held_out_new"][0]
        t_s = np.arange(one.steps) / one.rate_hz
        fine_t_s = np.arange(5 * one.steps - 4) / (5 * one.rate_hz)
        columns = [np.interp(fine_t_s, t_s, column) for column in one.context.T]
        fine = LabelSeries(
            person=one.person,
            rollout=one.rollout,
            rate_hz=5 * one.rate_hz,
            label=np.interp(fine_t_s, t_s, one.label),
            truth=np.full(len(fine_t_s), np.nan),
            valid=np.zeros(len(fine_t_s), dtype=bool),
            context=np.column_stack(columns),
            context_names=CONTEXT,
        )
        np.testing.assert_allclose(mapper.map(fine)[::5], mapper.map(one), atol=1e-5)

    def test_one_label_is_enough_to_map_and_an_unlabelled_rollout_stays_so(
        self, mapper, with_motion
    ):
        one = with_motion["held_out_new"][0]
        short = replace(
            one,
            label=one.label[:1],
            truth=one.truth[:1],
            valid=one.valid[:1],
            context=one.context[:1],
        )
        assert np.isfinite(mapper.map(short)).all()
        nothing = replace(one, label=np.full(one.steps, np.nan), valid=np.zeros(one.steps, bool))
        assert np.isnan(mapper.map(nothing)).all()


def test_it_says_who_is_unknown_and_what_is_missing(tiny, study):
    mapper = SimPretrainedMapper(model=tiny, fine_tuning=None)
    with pytest.raises(UnknownPerson, match="no one"):
        mapper.map(study.held_out_new[0])
    with pytest.raises(InvalidLabels, match="at least one"):
        mapper.calibrate([])
    one = study.train_seen[0]
    with pytest.raises(InvalidLabels, match=one.person):
        mapper.calibrate([replace(one, valid=np.zeros(one.steps, dtype=bool))])
    context = SimPretrainedMapper(context=True, model=tiny, fine_tuning=None)
    still = replace(one, context=np.empty((0, 0)), context_names=())
    with pytest.raises(InvalidLabels, match=r"yaw_rate_radps.*sim_pretrained"):
        context.calibrate([still])
    context.calibrate([replace(one, context=np.zeros((one.steps, 3)), context_names=CONTEXT)])
    with pytest.raises(InvalidLabels, match=r"yaw_rate_radps.*sim_pretrained"):
        context.map(still)


def test_labels_only_ignores_the_motion(tiny, study, with_motion):
    mapper = SimPretrainedMapper(model=tiny, fine_tuning=None)
    mapper.fit(study.train_seen)
    one, moved = study.train_seen[0], with_motion["train_seen"][0]
    np.testing.assert_array_equal(mapper.map(one), mapper.map(moved))


def test_the_clip_flag_marks_labels_at_the_stop_only():
    label = np.array([[WHEEL_LIMIT, 2.4, -WHEEL_LIMIT, 0.0]])
    alignment = Alignment(delay_s=np.zeros(1), gain=np.ones(1), bias=np.zeros(1))
    present = np.array([[True, True, True, False]])
    twice = np.stack([label, label], axis=1)
    inputs = network_inputs(label, np.ones(1), twice, present, np.array([True]), alignment, None)[0]
    flag = inputs[:, INPUTS.index("at_stop")]
    assert flag.tolist() == [1.0, 0.0, -1.0, 0.0]
    assert (inputs[:, -3:] == 0.0).all()


def test_aligned_labels_are_read_later_and_divided_by_the_gain():
    label = np.arange(40.0)[None] / 20.0
    alignment = Alignment(delay_s=np.array([0.25]), gain=np.array([2.0]), bias=np.array([0.2]))
    present = np.ones((1, 40), bool)
    twice = np.stack([label, label], axis=1)
    inputs = network_inputs(label, np.ones(1), twice, present, np.array([False]), alignment, None)[
        0
    ].numpy()
    aligned = inputs[:, INPUTS.index("aligned_label")]
    present = inputs[:, INPUTS.index("aligned_present")]
    np.testing.assert_allclose(aligned[:35], (label[0, 5:] - 0.2) / 2.0, atol=1e-6)
    assert present.tolist() == [1.0] * 35 + [0.0] * 5


def test_an_odd_number_of_samples_keeps_its_length():
    network = ResidualNetwork(TINY.network, torch.Generator().manual_seed(0))
    sums = network.shown_sums(torch.zeros(2, 7, len(SHOWN)))
    correction, log_spread = network(
        torch.zeros(2, 7, len(INPUTS)), torch.zeros(2, STYLE_SIZE), sums
    )
    assert correction.shape == log_spread.shape == (2, 7)


def test_pretraining_is_seeded(tiny):
    again, other = (pretrain(seed, TINY, drives=some_drives()) for seed in (0, 1))
    for name, value in tiny.network.state_dict().items():
        assert torch.equal(value, again.network.state_dict()[name])
    np.testing.assert_array_equal(tiny.style_readout, again.style_readout)
    assert (tiny.style_readout != other.style_readout).any()


def test_nonsense_sizes_are_refused():
    for wrong in ({"people": 1}, {"rollouts": 1}, {"steps": 0}, {"rate": float("nan")}):
        with pytest.raises(InvalidConfig):
            PretrainConfig(**wrong)
    with pytest.raises(InvalidConfig):
        ResidualConfig(style_size=3, dilations=())


def test_simulated_teachers_keep_the_limits_and_know_the_ends():
    drives = some_drives()
    study = simulate_study(drives, 20, 3, RATE_HZ, np.random.default_rng(0))
    assert study.label.shape == study.truth.shape == study.present.shape == (20, 3, 160)
    assert study.motion.shape == (20, 3, 160, 3)
    assert study.style.shape == (20, len(STYLE))
    assert np.abs(study.label).max() <= WHEEL_LIMIT
    assert set(study.present.sum(axis=-1).ravel().tolist()) <= set(range(80, 161))


def test_what_the_set_encoder_says_is_a_mean_over_all_that_is_shown():
    """Twice the same rollouts say the same, in any order; what is not valid says nothing."""
    rng = torch.Generator().manual_seed(1)
    network = ResidualNetwork(TINY.network, rng)
    shown = torch.randn(3, 40, len(SHOWN), generator=rng)
    shown[..., SHOWN.index("valid")] = 1.0
    once = network.shown_sums(shown)
    said = network.said_of(once.sum(0, keepdim=True))
    again = network.said_of(once.flip(0).sum(0, keepdim=True) + once.sum(0, keepdim=True))
    torch.testing.assert_close(said, again, atol=1e-4, rtol=1e-3)
    gap = torch.cat([shown, torch.zeros(3, 40, len(SHOWN))], dim=1)
    sums = network.shown_sums(gap)
    assert torch.equal(sums[:, -1], once[:, -1])


def of_one_kind(**shares: float) -> SimulatedStudy:
    """A hundred teachers without noise to speak of, who have but the given quirks."""
    none = dict.fromkeys(
        ["on_processes", "late", "slow_noise", "wandering", "sparse", "other_drives", "surprised", "lapsing", "notched", "slow_handed", "changing", "lopsided", "coarse"], 0.0,
    )  # fmt: skip
    ranges = TeacherRanges(
        **(none | shares),
        constant_noise=(1e-4, 2e-4),
        signal_noise=(1e-4, 2e-4),
        dead_zone=(1e-6, 2e-6),
        bias_std=(1e-6, 2e-6),
    )
    return simulate_study(some_drives(), 96, 3, RATE_HZ, np.random.default_rng(0), ranges)


def test_sparse_teachers_rest_where_the_robot_is_right_and_act_where_it_is_wrong():
    """The robot of these drives is always right; that of a random truth seldom is."""
    content = of_one_kind(sparse=0.5)
    resting = (np.abs(content.label) < 0.3).all(axis=(1, 2))
    assert 0.25 < resting.mean() < 0.75  # half of the studies have them
    wrong = of_one_kind(sparse=1.0, on_processes=1.0)
    off = np.abs(wrong.truth - wrong.motion[..., 2])
    assert np.abs(wrong.label[off > 2.0]).mean() > 3.0 * np.abs(wrong.label[off < 0.1]).mean()


def test_notches_and_slow_hands_are_what_they_say():
    notched = of_one_kind(notched=1.0)
    steps = [len(np.unique(one)) for one in notched.label.reshape(96, -1)]
    assert np.mean(np.array(steps) < 300) > 0.2  # of 480; the other studies turn smoothly
    slow = of_one_kind(slow_handed=1.0)
    fastest = np.abs(np.diff(slow.label, axis=-1)).max(axis=(1, 2)) * RATE_HZ
    assert np.mean(fastest <= 8.0 + 1e-3) > np.mean(
        np.abs(np.diff(of_one_kind().label, axis=-1)).max(axis=(1, 2)) * RATE_HZ <= 8.0
    )


def test_a_study_is_of_one_kind_of_truth():
    study = simulate_study(some_drives(), 64, 3, RATE_HZ, np.random.default_rng(0))
    given = {drive.truth[0].astype(np.float32) for drive in some_drives()}
    given |= {-one for one in given}
    on_drives = np.isin(study.truth[:, :, 0], list(given)).all(axis=1)
    assert {tuple(one) for one in on_drives.reshape(4, 16)} == {(True,) * 16, (False,) * 16}


def test_a_mirrored_drive_turns_the_other_way():
    drive = waves(np.random.default_rng(0))
    twice = drive.mirrored().mirrored()
    np.testing.assert_array_equal(twice.motion, drive.motion)
    np.testing.assert_array_equal(drive.mirrored().motion[:, 1], drive.motion[:, 1])


class TestFineTuning:
    def test_a_choice_is_made_on_held_out_rollouts(self, tiny, study):
        mapper = SimPretrainedMapper(
            model=tiny, fine_tuning=FineTuningConfig(steps=60, rate=4e-3), seed=1
        )
        mapper.fit(study.train_seen)
        assert mapper.is_fine_tuned == (mapper.fine_tuning_gain > FineTuningConfig().margin)
        never = SimPretrainedMapper(model=tiny, fine_tuning=FineTuningConfig(steps=2, margin=9.0))
        never.fit(study.train_seen)
        assert not never.is_fine_tuned

    def test_it_leaves_the_shared_weights_alone(self, tiny, study):
        before = {name: value.clone() for name, value in tiny.network.state_dict().items()}
        SimPretrainedMapper(model=tiny, fine_tuning=FineTuningConfig(steps=3, margin=-9.0)).fit(
            study.train_seen
        )
        for name, value in tiny.network.state_dict().items():
            assert torch.equal(value, before[name])

    def test_one_rollout_a_person_is_too_few_and_stays_frozen(self, tiny, study):
        one_each = list({one.person: one for one in study.train_seen}.values())
        mapper = SimPretrainedMapper(model=tiny)
        mapper.fit(one_each)
        assert not mapper.is_fine_tuned


def test_the_shipped_weights_improve_everyone_of_the_small_study(study, people):
    mapper = SimPretrainedMapper(fine_tuning=None)
    mapper.fit(study.train_seen)
    mapper.calibrate(study.calibrate_new)
    for part in (study.held_out_seen, study.held_out_new):
        quality = mapper_quality(mapper, part, np.random.default_rng(0))
        assert quality.improvement > 0.6
        assert quality.people_improved == 1.0
    found = [mapper.teacher_style(one.name) for one in people["new"]]
    true_gain = np.log([one.style.gain for one in people["new"]])
    assert np.corrcoef(true_gain, [one["log_gain"] for one in found])[0, 1] > 0.95


def test_the_last_second_is_not_made_worse_than_raw(study):
    mapper = SimPretrainedMapper(fine_tuning=None)
    mapper.fit(study.train_seen)
    before = after = 0.0
    for one in study.held_out_seen:
        before += np.abs(one.label - one.truth)[-20:].sum()
        after += np.abs(mapper.map(one) - one.truth)[-20:].sum()
    assert after < before
