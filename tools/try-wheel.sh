#!/usr/bin/env bash
# Install the built wheel where the sources cannot be seen, and use it: a package list that forgets
# a folder or a data file shows here and nowhere else.
set -euo pipefail
top=$(cd "$(dirname "$0")/.." && pwd)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
"$top/.venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps \
  --target "$place/site" "$top"/dist/*.whl
cd "$place"
PYTHONPATH="$place/site" "$top/.venv/bin/python" - "$place" <<'PY'
import sys
from pathlib import Path

place = Path(sys.argv[1])
import steerlab.analysis.report
import steerlab.learning.mapper
import steerlab.sim.ground_truth
import steerlab.teleop.simulate as simulate
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.teleop.population_run import PopulationConfig

assert Path(simulate.__file__).is_relative_to(place / "site"), simulate.__file__
assert len(load_calibration_set()) == 12
config = PopulationConfig(
    teachers=7, new_teachers=2, noise="low", rollouts=4, ladder="quick"
)
simulate.simulate(
    config, place / "out", force=False, command="try-wheel", progress=lambda what, share: None
)
assert (place / "out/report/index.html").stat().st_size > 100_000
print("The wheel works on its own.")
PY
