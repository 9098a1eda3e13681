"""Weights files: written and read back bit for bit; anything else is refused in a sentence."""

import json

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from steerlab.learning.errors import InvalidCheckpoint
from steerlab.learning.pretrained import train
from steerlab.learning.pretrained.weights import load_model, load_shipped_model, save_model


@pytest.fixture(scope="module")
def shipped():
    return load_shipped_model()


@pytest.fixture
def saved(shipped, tmp_path):
    path = tmp_path / "model.safetensors"
    save_model(shipped, path)
    return path


def _rewrite(path, *, header=None, drop=None, change=None) -> None:
    with safe_open(path, framework="pt") as file:
        old = json.loads(file.metadata()["steerlab"])
    tensors = {name: value for name, value in load_file(path).items() if name != drop}
    tensors |= change or {}
    save_file(tensors, path, metadata={"steerlab": json.dumps(old | (header or {}))})


def test_a_round_trip_is_exact(shipped, saved):
    again = load_model(saved)
    for name, value in shipped.network.state_dict().items():
        assert torch.equal(value, again.network.state_dict()[name])
    for name in ("inverse_axes", "forward_axes", "offset", "scale"):
        np.testing.assert_array_equal(getattr(shipped.encoder, name), getattr(again.encoder, name))
    for side in ("inverse", "forward"):
        old, new = getattr(shipped.encoder, side), getattr(again.encoder, side)
        np.testing.assert_array_equal(old.mean, new.mean)
        np.testing.assert_array_equal(old.covariance, new.covariance)
        assert (old.noise, old.noise_rows, old.temper) == (new.noise, new.noise_rows, new.temper)
    np.testing.assert_array_equal(shipped.style_readout, again.style_readout)
    assert again.seed == shipped.seed


def test_the_shipped_file_is_small(saved):
    assert saved.stat().st_size < 5_000_000


def test_a_missing_file_says_how_to_make_it(tmp_path):
    with pytest.raises(InvalidCheckpoint, match=r"No weights file.*train"):
        load_model(tmp_path / "none.safetensors")


def test_bytes_of_another_kind_are_refused(tmp_path):
    path = tmp_path / "model.safetensors"
    path.write_bytes(b"\x80\x04 not safetensors")
    with pytest.raises(InvalidCheckpoint, match="cannot be read as a"):
        load_model(path)


def test_a_file_without_our_header_is_refused(tmp_path):
    path = tmp_path / "model.safetensors"
    save_file({"x": torch.zeros(1)}, path)
    with pytest.raises(InvalidCheckpoint, match="no steerlab header"):
        load_model(path)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"header": {"format": "steerlab.mind_meld"}}, "mind_meld"),
        ({"header": {"version": 99}}, "version 99"),
        ({"header": {"network": {"style_size": 3}}}, "cannot be read as"),
        ({"header": {"network": {"colour": "red"}}}, "cannot be read as"),
        ({"header": {"network": {"style_size": 4, "channels": 10**9}}}, "cannot be read as"),
        ({"header": {"network": {"style_size": 10**5}}}, "its header says"),
        ({"header": {"network": {"style_size": 4, "dilations": [10**9]}}}, "dilation above 1024"),
        ({"header": {"inverse": {}}}, "cannot be read as"),
        ({"drop": "scale"}, "cannot be read as"),
        ({"drop": "network.stem.weight"}, "cannot be read as"),
        ({"change": {"offset": torch.zeros(3, dtype=torch.float64)}}, "offset"),
    ],
)
def test_a_file_that_does_not_fit_its_header_is_refused(saved, changes, match):
    _rewrite(saved, **changes)
    with pytest.raises(InvalidCheckpoint, match=match):
        load_model(saved)


def test_a_value_that_is_not_finite_is_refused(shipped, saved):
    scale = torch.from_numpy(shipped.encoder.scale.copy())
    scale[0] = float("nan")
    _rewrite(saved, change={"scale": scale})
    with pytest.raises(InvalidCheckpoint, match="scale"):
        load_model(saved)


def test_the_command_writes_what_pretraining_gives(shipped, tmp_path, monkeypatch):
    seeds: list[int] = []

    def pretrain(seed, *, progress):
        progress("training the network", 1.0)
        seeds.append(seed)
        return shipped

    monkeypatch.setattr(train, "pretrain", pretrain)
    path = tmp_path / "made.safetensors"
    train.main(["--seed", "3", "--out", str(path)])
    assert seeds == [3]
    assert load_model(path).seed == shipped.seed
