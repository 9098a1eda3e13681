from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.errors import InvalidLabels, UnknownPerson
from steerlab.learning.mapper import map_windows
from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.streaming import LabelStream, StreamingMapper
from steerlab.learning.windows import WindowConfig, make_windows
from steerlab.sim.errors import InvalidConfig

NETWORK = MindMeld(NetworkConfig(), torch.Generator().manual_seed(2)).requires_grad_(False)


def streamed(stream: LabelStream, label: np.ndarray) -> np.ndarray:
    mapped = [stream.push(None if np.isnan(one) else float(one)) for one in label]
    assert all(one is None for one in mapped[: stream.delay_steps])
    due = [one for one in mapped if one is not None] + stream.finish()
    return np.array(due, dtype=np.float64)


def test_a_stream_equals_the_batch(streaming, study):
    for one in (study.held_out_seen[0], study.held_out_new[-1]):
        stream = streaming.stream(one.person, one.rate_hz)
        assert stream.delay_steps == 4  # 0.2 s at 20 Hz
        np.testing.assert_allclose(streamed(stream, one.label), streaming.map(one), atol=1e-5)
        np.testing.assert_allclose(streamed(stream, one.label), streaming.map(one), atol=1e-5)


@settings(deadline=None, max_examples=25)
@given(
    look_ahead_s=st.sampled_from([0.0, 0.1, 0.2, 0.5, 1.0]),
    rate_hz=st.sampled_from([10.0, 12.5, 20.0, 30.0, 47.0]),
    steps=st.integers(1, 60),
    missing=st.floats(0.0, 0.5),
    seed=st.integers(0, 2**31),
)
def test_any_rate_look_ahead_and_gaps(look_ahead_s, rate_hz, steps, missing, seed):
    rng = np.random.default_rng(seed)
    label = rng.uniform(-2.5, 2.5, steps)
    label[rng.random(steps) < missing] = np.nan
    window = WindowConfig(look_ahead_s=look_ahead_s)
    embedding = torch.from_numpy(rng.normal(size=4).astype(np.float32))
    series = LabelSeries(
        person="p",
        rollout="r",
        rate_hz=rate_hz,
        label=label,
        truth=np.full(steps, np.nan),
        valid=np.zeros(steps, dtype=bool),
    )
    batch = map_windows(NETWORK, make_windows([series], window), embedding)
    stream = LabelStream(NETWORK, window, embedding, rate_hz)
    assert stream.delay_steps <= np.ceil(look_ahead_s * rate_hz)
    np.testing.assert_allclose(streamed(stream, label), batch, atol=1e-5)


def test_what_comes_later_than_the_look_ahead_changes_nothing(streaming, study):
    one = study.held_out_new[0]
    changed = one.label.copy()
    changed[105:] = -changed[105:] + 0.1
    other = replace(one, label=np.clip(changed, -2.5, 2.5))
    np.testing.assert_array_equal(streaming.map(one)[:101], streaming.map(other)[:101])
    assert streaming.map(one)[101] != streaming.map(other)[101]


def test_a_causal_stream_answers_at_once_and_has_a_name(study, quick_config):
    causal = StreamingMapper(0.0, quick_config, seed=0)
    assert causal.name == "mind_meld_causal"
    stream = LabelStream(NETWORK, WindowConfig(look_ahead_s=0.0), torch.zeros(4), 20.0)
    assert stream.delay_steps == 0
    assert stream.push(0.5) is not None
    assert np.isnan(stream.push(None))
    assert stream.finish() == []


def test_bad_input_is_refused(streaming):
    stream = LabelStream(NETWORK, WindowConfig(), torch.zeros(4), 20.0)
    with pytest.raises(InvalidLabels, match="outside"):
        stream.push(3.0)
    with pytest.raises(InvalidLabels, match="must be positive"):
        LabelStream(NETWORK, WindowConfig(), torch.zeros(4), 0.0)
    with pytest.raises(UnknownPerson, match="calibrate"):
        streaming.stream("stranger", 20.0)
    with pytest.raises(InvalidConfig, match="look_ahead_s is 2"):
        StreamingMapper(2.0, seed=0)
