import numpy as np
import pytest

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.probe import StyleProbe, style_parameters
from steerlab.sim.populations import sample_population


def test_leave_one_out_equals_fitting_without_each_person():
    rng = np.random.default_rng(0)
    embeddings = rng.normal(size=(20, 3))
    style = embeddings @ [1.0, -2.0, 0.5] + rng.normal(size=20)
    left_out = []
    for person in range(20):
        keep = np.arange(20) != person
        probe = StyleProbe.fit(embeddings[keep], {"s": style[keep]})
        left_out.append(style[person] - probe.predict(embeddings[[person]])["s"][0])
    expected = 1.0 - np.square(left_out).sum() / np.square(style - style.mean()).sum()
    assert StyleProbe.fit(embeddings, {"s": style}).probe_r2["s"] == pytest.approx(expected)


def test_an_exact_linear_style_is_found_in_new_people():
    rng = np.random.default_rng(1)
    seen, new = rng.normal(size=(30, 4)), rng.normal(size=(10, 4))

    def styles(w):
        return {"log_gain": 1.0 + w @ [1, 2, 0, 0], "delay_s": w @ [0, 0, 1, -1]}

    probe = StyleProbe.fit(seen, styles(seen))
    assert probe.probe_r2["log_gain"] == pytest.approx(1.0)
    assert probe.r2_new(new, styles(new))["delay_s"] == pytest.approx(1.0)
    assert probe.spearman_new(new, styles(new))["log_gain"] == pytest.approx(1.0)


def test_chance_embeddings_predict_nothing():
    rng = np.random.default_rng(2)
    probe = StyleProbe.fit(rng.normal(size=(34, 4)), {"s": rng.normal(size=34)})
    assert probe.probe_r2["s"] < 0.2


def test_scripted_styles_are_read_as_parameters():
    styles = [one.style for one in sample_population("human", 3, 0, prefix="p")]
    parameters = style_parameters(styles)
    assert parameters["delay_s"].tolist() == [style.delay_s for style in styles]
    np.testing.assert_allclose(np.exp(parameters["log_gain"]), [style.gain for style in styles])


def test_what_cannot_be_probed_is_an_error():
    with pytest.raises(InvalidLabels, match="at least 7"):
        StyleProbe.fit(np.zeros((6, 4)), {"s": np.arange(6.0)})
    with pytest.raises(InvalidLabels, match="5 values of s for 9"):
        StyleProbe.fit(np.random.default_rng(0).normal(size=(9, 2)), {"s": np.arange(5.0)})
    with pytest.raises(InvalidLabels, match="same for everyone"):
        StyleProbe.fit(np.random.default_rng(0).normal(size=(9, 2)), {"s": np.ones(9)})
