"""The kernels compute what the torch module says, row by row, and the same bits on any processor."""

import os
import subprocess
import sys
from hashlib import sha256

import numpy as np
import pytest
import torch
from torch.nn.utils import parameters_to_vector

from steerlab.learning.policy import IMAGE_SHAPE, Observations, PolicyConfig, PolicyNetwork
from steerlab.learning.policy_inference import Decider, decide
from steerlab.learning.policy_kernels.gradient import ByValues, Rows, batch_gradient
from steerlab.learning.policy_kernels.layout import room_for, sizes_of
from steerlab.learning.policy_kernels.products import LANES
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows, train_policy

PROGRAM = "from tests.learning.policy_kernels.test_policy_kernels import digest; print(digest())"
CONFIGS = [
    PolicyConfig(),
    PolicyConfig(inputs="image"),
    PolicyConfig(inputs="state"),
    PolicyConfig(channels=(8, 24, 16), hidden=40),
]
ROWS = 70


def _seen(rows: int = ROWS, seed: int = 0) -> Observations:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (rows, *IMAGE_SHAPE), dtype=np.uint8)
    return Observations(image, rng.normal([5, 0, 0, 0, 0], 1.0, (rows, 5)).astype(np.float32))


def _network(config: PolicyConfig, seed: int = 0) -> PolicyNetwork:
    generator = torch.Generator().manual_seed(seed)
    network = PolicyNetwork(config, generator)
    with torch.no_grad():
        for parameter in network.parameters():  # biases begin at 0, which would hide a mistake
            parameter.add_(0.05 * torch.randn(parameter.shape, generator=generator))
        network.wheel.weight.mul_(3.0)
    return network


def _by_torch(network: PolicyNetwork, seen: Observations) -> tuple[np.ndarray, np.ndarray]:
    image, motion = torch.from_numpy(seen.image), torch.from_numpy(seen.motion)
    with torch.no_grad():
        return network(image, motion).numpy(), network.features(image, motion).numpy()


@pytest.mark.parametrize("config", CONFIGS, ids=str)
def test_what_is_computed_is_what_the_module_says(config):
    network, seen = _network(config), _seen()
    wheel, hidden = _by_torch(network, seen)
    assert np.ptp(wheel) > 0.1
    assert decide(network, seen) == pytest.approx(np.clip(wheel, -2.5, 2.5), abs=2e-6)
    np.testing.assert_allclose(Decider(network).features(seen), hidden, atol=2e-6, rtol=1e-5)


@pytest.mark.parametrize("config", CONFIGS, ids=str)
@pytest.mark.parametrize("batch", [1, LANES, 37, 64])
def test_the_gradient_is_autograds(config, batch):
    network, seen = _network(config), _seen()
    rng = np.random.default_rng(batch)
    target, weight = rng.normal(size=ROWS), rng.uniform(size=ROWS)
    weight[::5] = 0.0
    chosen = rng.permutation(ROWS)[:batch]
    sizes, blocks = sizes_of(config), -(-batch // LANES)
    vector = parameters_to_vector(network.used()).detach()
    gradient = torch.full_like(vector, float("nan"))
    rows = Rows(
        seen.image.reshape(ROWS, -1),
        seen.motion,
        target.astype(np.float32),
        weight.astype(np.float32),
    )
    values, by = room_for(sizes, blocks), ByValues.of(sizes, blocks)
    for one in (*values[3:], *by):
        one.fill(7.0)  # what an earlier batch left must not matter
    loss = batch_gradient(sizes, vector.numpy(), rows, chosen, values, by, gradient.numpy())

    at = torch.from_numpy(chosen)
    error = network(torch.from_numpy(seen.image)[at], torch.from_numpy(seen.motion)[at])
    error = error - torch.from_numpy(rows.target)[at]
    expected = (torch.from_numpy(rows.weight)[at] * error.square()).mean()
    slopes = torch.autograd.grad(expected, network.used())
    assert loss == pytest.approx(float(expected.detach()), rel=1e-5)
    whole = torch.cat([slope.flatten() for slope in slopes])
    assert whole.abs().max() > 0.01
    torch.testing.assert_close(gradient, whole, atol=2e-6, rtol=2e-5)


def test_other_rows_change_no_bit_of_a_row():
    network, seen = _network(PolicyConfig()), _seen()
    together = decide(network, seen)
    alone = [decide(network, seen.take(np.array([row])))[0] for row in range(ROWS)]
    assert (together == alone).all()
    backwards = decide(network, seen.take(np.arange(ROWS)[::-1]))
    assert (together == backwards[::-1]).all()


def test_not_a_number_stays_one():
    network = _network(PolicyConfig())
    with torch.no_grad():
        network.image[0].weight[0, 0, 0, 0] = float("nan")
    assert np.isnan(decide(network, _seen(3))).all()


def digest() -> str:
    """Of the weights after a short training."""
    network, seen = _network(PolicyConfig()), _seen()
    rows = TrainingRows(seen, np.tanh(seen.motion[:, 1].astype(np.float64)), np.ones(ROWS))
    train_policy(network, rows, np.random.default_rng(1), PolicyTrainingConfig(steps=8))
    parts = [*network.state_dict().values()]
    wheels = decide(network, seen).tobytes()
    return sha256(b"".join(part.numpy().tobytes() for part in parts) + wheels).hexdigest()


@pytest.mark.slow
def test_a_policy_repeats_on_an_older_processor(tmp_path, pytestconfig):
    older = {"NUMBA_CPU_NAME": "haswell"} if os.uname().machine == "x86_64" else {}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, **older, "NUMBA_CACHE_DIR": str(tmp_path)},
        cwd=pytestconfig.rootpath,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert any(tmp_path.rglob("*.nbi"))  # it did compile
    assert done.stdout.strip() == digest()
