import numpy as np
import pytest
import torch

from steerlab.learning.errors import InvalidCheckpoint, InvalidLabels
from steerlab.learning.policy import (
    IMAGE_SHAPE,
    Observations,
    PolicyConfig,
    PolicyNetwork,
    decide,
    hidden_features,
    load_policy,
    pool_frame,
    save_policy,
)
from steerlab.learning.policy_training import (
    PolicyTrainingConfig,
    TrainingDiverged,
    TrainingRows,
    train_policy,
)
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

ROWS = 48


@pytest.fixture
def seen() -> Observations:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (ROWS, *IMAGE_SHAPE), dtype=np.uint8)
    return Observations(image, rng.normal(size=(ROWS, 5)).astype(np.float32))


def _network(inputs="image+state", seed=0) -> PolicyNetwork:
    return PolicyNetwork(PolicyConfig(inputs=inputs), torch.Generator().manual_seed(seed))


def test_pooling_averages_pairs_of_the_middle_rows():
    frame = np.zeros((64, 64, 3), np.uint8)
    frame[16:18, 0:2] = 100
    frame[18, 2] = (40, 0, 0)
    frame[:16] = 255  # sky
    pooled = pool_frame(frame)
    assert pooled.shape == IMAGE_SHAPE
    assert pooled[:, 0, 0].tolist() == [100, 100, 100]
    assert pooled[:, 1, 1].tolist() == [10, 0, 0]
    assert pooled.sum() == 310


def test_an_ablation_does_not_read_what_it_must_not(seen):
    other_image = Observations(255 - seen.image, seen.motion)
    other_motion = Observations(seen.image, seen.motion + 1.0)
    for inputs, same, differs in (
        ("image", other_motion, other_image),
        ("state", other_image, other_motion),
    ):
        network = _network(inputs)
        assert (decide(network, seen) == decide(network, same)).all()
        assert (decide(network, seen) != decide(network, differs)).any()


def test_other_rows_change_a_decision_by_rounding_alone(seen):
    network = _network()
    together = decide(network, seen)
    alone = [decide(network, seen.take(np.array([row])))[0] for row in range(ROWS)]
    np.testing.assert_allclose(alone, together, atol=2e-6)
    backwards = decide(network, seen.take(np.arange(ROWS)[::-1]))
    np.testing.assert_allclose(backwards[::-1], together, atol=2e-6)


def test_the_features_are_those_that_the_wheel_is_read_from(seen):
    network = _network()
    features = torch.from_numpy(hidden_features(network, seen)).float()
    wheel = network.wheel(features).squeeze(1).detach().numpy()
    np.testing.assert_allclose(
        wheel.clip(-WHEEL_LIMIT, WHEEL_LIMIT), decide(network, seen), atol=2e-6
    )


def test_not_a_number_stays_one(seen):
    network = _network()
    with torch.no_grad():
        next(network.image.parameters())[0, 0, 0, 0] = float("nan")
    assert np.isnan(decide(network, seen)).all()


def test_training_fits_and_repeats_bit_for_bit(seen):
    rows = TrainingRows(seen, np.tanh(seen.motion[:, 1].astype(np.float64)), np.ones(ROWS))
    found = []
    for _ in range(2):
        network = _network()
        loss = train_policy(network, rows, np.random.default_rng(1), PolicyTrainingConfig())
        found.append(decide(network, seen))
        assert loss < 0.05
    assert (found[0] == found[1]).all()


def test_weight_0_teaches_nothing(seen):
    target = np.where(np.arange(ROWS) < 24, 1.0, -1.0)
    weight = np.where(np.arange(ROWS) < 24, 1.0, 0.0)
    network = _network()
    train_policy(
        network,
        TrainingRows(seen, target, weight),
        np.random.default_rng(1),
        PolicyTrainingConfig(),
    )
    assert decide(network, seen).min() > 0.0


def test_wheels_stay_within_the_limit(seen):
    network = _network()
    with torch.no_grad():
        network.wheel.bias.fill_(100.0)
    assert (decide(network, seen) == WHEEL_LIMIT).all()


def test_a_loss_that_is_no_number_is_said(seen):
    network = _network()
    with torch.no_grad():
        network.wheel.bias.fill_(float("nan"))
    rows = TrainingRows(seen, np.zeros(ROWS), np.ones(ROWS))
    with pytest.raises(TrainingDiverged, match="lower the rate"):
        train_policy(network, rows, np.random.default_rng(0), PolicyTrainingConfig())


def test_a_last_step_that_spoils_the_weights_is_said_and_undone(seen):
    network = _network()
    before = decide(network, seen)
    rows = TrainingRows(seen, np.ones(ROWS), np.ones(ROWS))
    config = PolicyTrainingConfig(steps=1, rate=1e39)  # beyond float32
    with pytest.raises(TrainingDiverged, match="not finite after 1 steps"):
        train_policy(network, rows, np.random.default_rng(0), config)
    assert (decide(network, seen) == before).all()


def test_rows_that_are_not_finite_or_empty_are_refused(seen):
    with pytest.raises(InvalidLabels, match="not finite"):
        TrainingRows(seen, np.full(ROWS, np.nan), np.ones(ROWS))
    none = seen.take(np.zeros(ROWS, dtype=bool))
    with pytest.raises(InvalidLabels, match="at least one"):
        TrainingRows(none, np.empty(0), np.empty(0))


def test_a_policy_survives_its_file(seen, tmp_path):
    network = _network("image", seed=5)
    save_policy(network, tmp_path / "p.safetensors")
    loaded = load_policy(tmp_path / "p.safetensors")
    assert loaded.config == network.config
    assert (decide(loaded, seen) == decide(network, seen)).all()


def test_other_files_are_no_policies(tmp_path):
    with pytest.raises(InvalidCheckpoint, match="No policy file"):
        load_policy(tmp_path / "none.safetensors")
    (tmp_path / "bad.safetensors").write_bytes(b"not a tensor")
    with pytest.raises(InvalidCheckpoint):
        load_policy(tmp_path / "bad.safetensors")


@pytest.mark.parametrize("sizes", [{"channels": (16, 10**5, 32)}, {"hidden": 10**9}])
def test_sizes_that_a_header_makes_up_get_no_memory(tmp_path, sizes):
    path = tmp_path / "p.safetensors"
    network = _network()
    network.config = PolicyConfig(**sizes)
    save_policy(network, path)
    with pytest.raises(InvalidCheckpoint, match="its header says"):
        load_policy(path)


@pytest.mark.parametrize("sizes", [{"channels": (16, 0, 32)}, {"hidden": 0}, {"channels": (8, 8)}])
def test_sizes_that_are_none_are_refused(sizes):
    with pytest.raises(InvalidConfig, match="all positive"):
        PolicyConfig(**sizes)


def test_progress_is_told_and_may_end_a_training_that_then_changes_nothing(seen):
    network = _network()
    before = decide(network, seen)
    rows = TrainingRows(seen, np.ones(ROWS), np.ones(ROWS))
    config, told = PolicyTrainingConfig(steps=4), []
    train_policy(network, rows, np.random.default_rng(0), config, told.append)
    assert told == [0.25, 0.5, 0.75, 1.0]
    after = decide(network, seen)
    assert (after != before).any()

    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_policy(network, rows, np.random.default_rng(0), config, stop)
    assert (decide(network, seen) == after).all()


def test_unknown_inputs_list_the_valid_ones():
    with pytest.raises(InvalidConfig, match=r"image\+state, image, state"):
        PolicyConfig(inputs="sonar")  # pyright: ignore[reportArgumentType]
