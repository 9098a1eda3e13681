import json

import pytest

from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.run_folder import write_json


@pytest.mark.parametrize("figure", [float("nan"), float("inf")])
def test_a_run_whose_figures_are_not_finite_is_no_success(tmp_path, figure):
    path = tmp_path / "summary.json"
    write_json({"success": 0.5}, path)
    with pytest.raises(OutputError, match=r"summary\.json would hold a figure that is NaN"):
        write_json({"by_round": [{"success": figure}]}, path)
    assert json.loads(path.read_text(encoding="utf-8")) == {"success": 0.5}
