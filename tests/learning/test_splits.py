import pytest

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.splits import split_rollouts, split_study


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
