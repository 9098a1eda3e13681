"""Many series at once are mapped as one by one."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.learning import batch_mapping
from steerlab.learning.batch_mapping import map_in_chunks
from steerlab.learning.errors import UnknownPerson
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.series import LabelSeries


@pytest.fixture(scope="module")
def uneven(study) -> list[LabelSeries]:
    """Other lengths, a hole, another rate, one step, nothing at all."""
    series = list(study.held_out_seen[:6] + study.held_out_new[:6])
    for row, keep in ((1, 77), (3, 77), (4, 1)):
        one = series[row]
        series[row] = replace(
            one,
            label=one.label[:keep],
            truth=one.truth[:keep],
            valid=one.valid[:keep],
            context=one.context[:keep],
        )
    label = series[2].label.copy()
    label[40:60] = np.nan
    series[2] = replace(series[2], label=label, valid=np.isfinite(label))
    series[5] = replace(series[5], rate_hz=10.0)
    blank = np.full(series[8].steps, np.nan)
    series[8] = replace(series[8], label=blank, valid=np.isfinite(blank))
    return series


@pytest.mark.parametrize("steps_at_once", [1, 500, 1_000_000])
def test_every_rung_maps_as_each_series_alone(ladder, uneven, monkeypatch, steps_at_once):
    monkeypatch.setattr(batch_mapping, "_STEPS_AT_ONCE", steps_at_once)
    found: dict[str, list[np.ndarray]] = {name: [] for name in ladder}
    given: list[LabelSeries] = []
    for several, mapped in map_in_chunks(ladder, uneven):
        given += several
        for name, values in mapped.items():
            found[name] += values
    assert [id(one) for one in given] == [id(one) for one in uneven]
    for name, mapper in ladder.items():
        for one, mapped in zip(uneven, found[name], strict=True):
            np.testing.assert_allclose(mapped, mapper.map(one), atol=1e-5, err_msg=name)


def test_mappers_that_share_a_network_share_its_work(ladder, study, monkeypatch):
    calls = []
    encode = batch_mapping.encode
    monkeypatch.setattr(
        batch_mapping, "encode", lambda *arguments: calls.append(1) or encode(*arguments)
    )
    few = {name: ladder[name] for name in ("mind_meld", "mean_embedding", "shuffled_embedding")}
    list(map_in_chunks(few, study.held_out_new))
    assert len(calls) == 1


@pytest.mark.parametrize("name", ["mind_meld", "shuffled_embedding", "sim_pretrained"])
def test_someone_unknown_is_said(ladder, study, name):
    stranger = replace(study.held_out_new[0], person="stranger")
    with pytest.raises(UnknownPerson, match="stranger"):
        list(map_in_chunks({name: ladder[name]}, [stranger]))


def test_no_series_give_nothing(trained: MindMeldMapper):
    assert list(map_in_chunks({"mind_meld": trained}, [])) == []
