#!/usr/bin/env bash
# Make the lists of packages in requirements/ again, from pyproject.toml: pinned, with hashes, for
# every Python and system at once. Versions that are there stay; tools/lock.sh --upgrade takes the
# newest. torch.txt is written by hand: PyTorch has a build for each kind of machine, in several
# places and with a hash for each, so tools/install.py chooses one and only its version is pinned.
set -euo pipefail
cd "$(dirname "$0")/.."
uv=.venv/bin/uv
[ -x "$uv" ] || { echo "No $uv; run make check once, which installs it." >&2; exit 2; }
compile=("$uv" pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate
  --no-header "$@")

# With its builds for NVIDIA cards PyTorch brings packages that others must not get.
brought=$("$uv" pip compile --quiet --universal --python-version 3.11 --no-annotate --no-header \
  requirements/torch.txt | grep -oE '^(torch|triton|cuda-[a-z-]+|nvidia-[a-z0-9-]+)' | sort -u)
leave_out=()
for name in $brought; do leave_out+=(--no-emit-package "$name"); done
leave_out_dev=()
for name in $brought; do
  [ "$name" = triton ] || leave_out_dev+=(--no-emit-package "$name")
done

"${compile[@]}" --constraint requirements/torch.txt "${leave_out_dev[@]}" --extra dev \
  pyproject.toml --output-file requirements/dev.txt
"${compile[@]}" --constraint requirements/torch.txt --constraint requirements/dev.txt \
  "${leave_out[@]}" pyproject.toml --output-file requirements/run.txt
echo uv | "${compile[@]}" --constraint requirements/dev.txt - --output-file requirements/uv.txt
