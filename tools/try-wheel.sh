#!/usr/bin/env bash
# Install the built wheel in an empty environment where the sources cannot be seen, as a user would,
# and use it: a dependency, folder or data file that was forgotten shows here and nowhere else. Then
# again with Triton, which PyTorch's build for NVIDIA cards brings.
set -euo pipefail
top=$(cd "$(dirname "$0")/.." && pwd)
python=${PYTHON:-python3}
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
echo "Trying the wheel in an empty environment"
"$python" -m venv "$place/venv"
"$place/venv/bin/python" "$top/tools/install.py" run --wheel "$top"/dist/*.whl
cd "$place"
venv/bin/python -m pip check
venv/bin/python - "$place" <<'PY'
import sys
from importlib.util import find_spec
from pathlib import Path

import steerlab.app.cli as cli

assert Path(cli.__file__).is_relative_to(Path(sys.argv[1]) / "venv"), cli.__file__
left_out = [name for name in ("dm_control", "statsmodels", "pytest") if find_spec(name) is None]
assert len(left_out) == 3, "the environment holds more than a user's"
PY
venv/bin/steerlab --version
venv/bin/steerlab demo --out without
venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes \
  --requirement <(awk '/^[a-z]/ {keep = /^triton==/} keep' "$top/requirements/dev.txt")
small="--teachers 7 --new-teachers 2 --rollouts 4 --ladder quick"
venv/bin/steerlab simulate $small --out with
venv/bin/steerlab doctor
for report in without with; do
  [ "$(stat -c %s "$report/report/index.html")" -gt 100000 ] || { echo "No report in $report" >&2; exit 1; }
done
echo "The wheel works on its own, with and without Triton."
