"""Another process on the same machine learns the same bits, with whatever was compiled before."""

import os
import subprocess
import sys
from hashlib import sha256

import numpy as np
import pytest
import torch

from steerlab.learning.mind_meld import NetworkConfig
from steerlab.learning.policy import IMAGE_SHAPE, Observations, PolicyConfig, PolicyNetwork, decide
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows, train_policy
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import TrainingConfig, train
from steerlab.learning.windows import WindowConfig, make_windows

PROGRAM = "from tests.learning.test_repeatable import {0}; print({0}())"


def mapper_digest() -> str:
    """Of the weights after a short training on made-up labels."""
    rng = np.random.default_rng(5)
    truth = np.clip(rng.normal(size=(6, 120)).cumsum(axis=1) * 0.2, -2.5, 2.5)
    series = [
        LabelSeries(
            person=f"p{number % 3}",
            rollout=f"r{number // 3}",
            rate_hz=20.0,
            label=np.clip(rng.uniform(0.4, 1.6) * row, -2.5, 2.5),
            truth=row,
            valid=np.ones(row.shape, dtype=bool),
        )
        for number, row in enumerate(truth)
    ]
    config = TrainingConfig(epochs=2, batch_size=64, share_per_epoch=0.5, least_per_epoch=1)
    result = train(make_windows(series, WindowConfig()), NetworkConfig(), config, seed=3)
    parts = [result.embeddings, *result.network.state_dict().values()]
    return sha256(b"".join(part.detach().numpy().tobytes() for part in parts)).hexdigest()


def policy_digest() -> str:
    """Of the weights and decisions after a short training."""
    rows, rng = 70, np.random.default_rng(0)
    image = rng.integers(0, 256, (rows, *IMAGE_SHAPE), dtype=np.uint8)
    seen = Observations(image, rng.normal(size=(rows, 5)).astype(np.float32))
    network = PolicyNetwork(PolicyConfig(), torch.Generator().manual_seed(0))
    learnt = TrainingRows(seen, np.tanh(seen.motion[:, 1].astype(np.float64)), np.ones(rows))
    train_policy(network, learnt, np.random.default_rng(1), PolicyTrainingConfig(steps=8))
    parts = [part.numpy().tobytes() for part in network.state_dict().values()]
    return sha256(b"".join(parts) + decide(network, seen).tobytes()).hexdigest()


@pytest.mark.slow
@pytest.mark.parametrize("digest", [mapper_digest, policy_digest])
def test_a_fresh_process_learns_the_same_bits(tmp_path, pytestconfig, digest):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(digest.__name__)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        cwd=pytestconfig.rootpath,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == digest()
