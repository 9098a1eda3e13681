"""What was compiled before, and for which processor, changes no bit of a training."""

import os
import subprocess
import sys
from hashlib import sha256

import numpy as np
import pytest

from steerlab.learning.mind_meld import NetworkConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import TrainingConfig, train
from steerlab.learning.windows import WindowConfig, make_windows

PROGRAM = "from tests.learning.kernels.test_repeatable import digest; print(digest())"


def digest() -> str:
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


@pytest.mark.slow
def test_a_first_training_repeats_on_an_older_processor(tmp_path, pytestconfig):
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
