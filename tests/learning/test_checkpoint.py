import json

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.torch import load_file, save_file

from steerlab.learning.checkpoint import load_mapper, save_mapper
from steerlab.learning.errors import InvalidCheckpoint, NotFitted
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.presets import (
    LAB,
    PAPER,
    PAPER_TEXT,
    MapperConfig,
    preset,
)
from steerlab.sim.errors import InvalidConfig


@pytest.fixture(name="path")
def _path(tmp_path, trained):
    path = tmp_path / "mapper.safetensors"
    save_mapper(trained, path)
    return path


def header_of(trained) -> dict:
    return {
        "format": "steerlab.mind_meld",
        "version": 2,
        "seed": 5,
        "config": trained.config.to_dict(),
        "people": list(trained.people),
        "calibrated": {},
    }


def rewrite(path, header: object, **changes):
    save_file(load_file(path) | changes, path, metadata={"steerlab": json.dumps(header)})


def test_round_trip_is_bit_exact(trained, study, path):
    loaded = load_mapper(path)
    assert loaded.config == trained.config
    assert loaded.seed == trained.seed
    assert loaded.people == trained.people
    for one in (*study.held_out_seen[:3], *study.held_out_new[:3]):
        assert (loaded.map(one) == trained.map(one)).all()
    again = loaded.network.state_dict()
    assert all(
        torch.equal(value, again[name]) for name, value in trained.network.state_dict().items()
    )


def test_a_loaded_mapper_calibrates_new_people_the_same(trained, study, path):
    loaded = load_mapper(path)
    loaded.calibrate(study.calibrate_new)
    one = study.held_out_new[0]
    assert (loaded.map(one) == trained.map(one)).all()


def test_the_same_model_gives_the_same_file(trained, path, tmp_path):
    save_mapper(load_mapper(path), tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == path.read_bytes()


def test_an_unfitted_mapper_cannot_be_saved(tmp_path):
    with pytest.raises(NotFitted):
        save_mapper(MindMeldMapper(seed=0), tmp_path / "none.safetensors")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InvalidCheckpoint, match="No model file at"):
        load_mapper(tmp_path / "absent.safetensors")


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=200))
def test_any_bytes_are_refused_without_a_traceback_of_theirs(tmp_path, content: bytes):
    path = tmp_path / "junk.safetensors"
    path.write_bytes(content)
    with pytest.raises(InvalidCheckpoint):
        load_mapper(path)


@pytest.mark.parametrize("kept", [0, 7, 100, -1])
def test_a_truncated_file_is_refused(path, kept: int):
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(InvalidCheckpoint, match="cannot be read as a"):
        load_mapper(path)


def test_a_pickle_is_refused(tmp_path, trained):
    path = tmp_path / "pickle.pt"
    torch.save(trained.network.state_dict(), path)
    with pytest.raises(InvalidCheckpoint, match="cannot be read as a"):
        load_mapper(path)


def test_foreign_headers_are_refused(path, trained):
    save_file({"a": torch.zeros(1)}, path)
    with pytest.raises(InvalidCheckpoint, match="no steerlab header"):
        load_mapper(path)
    for header, message in (
        ([], "not a JSON object"),
        ({"format": "other"}, "'other'"),
        (header_of(trained) | {"version": 1}, "version 1"),
    ):
        rewrite(path, header)
        with pytest.raises(InvalidCheckpoint, match=message):
            load_mapper(path)


def test_contents_that_do_not_fit_the_header_are_refused(path, trained):
    header = header_of(trained)
    network = {**header["config"]["network"], "embedding_size": 3}
    bad_config = header | {"config": header["config"] | {"network": network}}
    rewrite(path, bad_config)
    with pytest.raises(InvalidCheckpoint, match="cannot be read as"):
        load_mapper(path)
    rewrite(path, header, embeddings=torch.zeros(2, 4))
    with pytest.raises(InvalidCheckpoint, match=r"\(2, 4\) for 18 people"):
        load_mapper(path)
    rewrite(path, {"format": "steerlab.mind_meld", "version": 2})
    with pytest.raises(InvalidCheckpoint, match="cannot be read as"):
        load_mapper(path)


@pytest.mark.parametrize("size", [10**5, 10**9, 10**30])
def test_sizes_that_a_header_makes_up_get_no_memory(path, trained, size):
    """Those of the second network would be 40 GB, of the third 10^19 bytes."""
    header = header_of(trained)
    for name in ("lstm_size", "encoding_size", "difference_hidden", "embedding_size"):
        network = {**header["config"]["network"], name: size}
        rewrite(path, header | {"config": header["config"] | {"network": network}})
        with pytest.raises(InvalidCheckpoint, match=r"its header says|cannot be read as"):
            load_mapper(path)


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        ("window", "half_width_s", 1e9),
        ("window", "rate_hz", 1e30),
        ("window", "half_width_steps", 10**9),
        ("training", "threads", 10**9),
    ],
)
def test_settings_that_would_fill_the_memory_later_are_refused(path, trained, part, name, value):
    header = header_of(trained)
    changed = {**header["config"][part], name: value}
    rewrite(path, header | {"config": header["config"] | {part: changed}})
    with pytest.raises(
        InvalidCheckpoint, match=r"mapper.*(more than 1000 samples|whole, 1 to 1000|at most 1024)"
    ):
        load_mapper(path)


@pytest.mark.parametrize("config", [LAB, PAPER, PAPER_TEXT])
def test_presets_survive_json(config: MapperConfig):
    assert MapperConfig.from_dict(json.loads(json.dumps(config.to_dict()))) == config


def test_settings_of_before_are_read():
    """Files written before windows in steps, sampled w and its start have no such fields."""
    values = LAB.to_dict()
    del values["window"]["half_width_steps"]
    for name in ("sampled", "uniform_start", "least_factor"):
        del values["training"][name]
    assert MapperConfig.from_dict(values) == LAB


def test_presets_by_name():
    assert preset("lab") is LAB
    assert preset("paper") is PAPER
    assert preset("paper-text") is PAPER_TEXT
    for config, weight, sampled in ((PAPER, 0.01, False), (PAPER_TEXT, 1.0, True)):
        assert config.network.embedding_size == 2
        assert config.training.embedding_loss_weight == weight
        assert config.training.sampled is sampled
    assert (PAPER.window.length, PAPER.training.share_per_epoch) == (25, 1.0)
    assert PAPER.training.uniform_start
    with pytest.raises(InvalidConfig, match="'papers'; choose one of lab, paper, paper-text"):
        preset("papers")
    with pytest.raises(InvalidConfig, match="unexpected keyword"):
        MapperConfig.from_dict({"window": {"wide": 1}, "network": {}, "training": {}})
