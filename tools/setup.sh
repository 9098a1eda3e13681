#!/usr/bin/env bash
# Make .venv ready: tools/setup.sh run|dev. Called by make; safe to run again.
set -euo pipefail
cd "$(dirname "$0")/.."

kind=${1:-run}
python=${PYTHON:-python3}
gl_packages="libegl1 libgl1 libgl1-mesa-dri"

die() { printf '%s\n' "$*" >&2; exit 2; }

# Install Debian packages if that is permitted, else say the command and stop.
install_packages() { # why, packages...
  local why=$1; shift
  local command="apt-get update && apt-get install -y $*"
  command -v apt-get >/dev/null || die "$why. Install your system's equivalent of: $*"
  if [ "$(id -u)" = 0 ]; then
    as_root=""
  elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    as_root="sudo"
  else
    die "$why. Run: sudo sh -c '$command'"
  fi
  echo "Installing $* ($why)"
  $as_root apt-get update -qq && DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq "$@" >/dev/null ||
    die "$why, and installing failed. Run: sudo sh -c '$command'"
}

command -v "$python" >/dev/null || die "No $python found; install Python 3.11 or newer, or name one: make PYTHON=/path/to/python"
version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
  die "steerlab needs Python 3.11 or newer and $python is $version; name a newer one: make PYTHON=/path/to/python"

if [ ! -x .venv/bin/pip ]; then
  rm -rf .venv
  "$python" -c 'import ensurepip, venv' 2>/dev/null ||
    install_packages "Python $version cannot make virtual environments" "python$version-venv"
  echo "Making .venv"
  "$python" -m venv .venv
fi

.venv/bin/python tools/install.py "$kind" || exit 2

gl_works() { .venv/bin/python -c 'from steerlab.sim.engine.gl import choose_gl; raise SystemExit(choose_gl() is None)'; }
if ! gl_works; then
  install_packages "No OpenGL driver can draw offscreen" $gl_packages
  gl_works || die "OpenGL still cannot draw offscreen after installing $gl_packages; run .venv/bin/steerlab doctor"
fi

# What some tests look through: a display, a browser, and a driver for Rerun's pictures. Without
# them those tests are skipped and say so.
if [ "$kind" = dev ]; then
  missing=""
  command -v Xvfb >/dev/null || missing="$missing xvfb"
  command -v xdotool >/dev/null || missing="$missing xdotool"
  command -v chromium >/dev/null || command -v chromium-browser >/dev/null ||
    command -v google-chrome >/dev/null || missing="$missing chromium"
  ls /usr/share/vulkan/icd.d/lvp_icd*.json >/dev/null 2>&1 || missing="$missing mesa-vulkan-drivers"
  if [ -n "$missing" ]; then
    (install_packages "Some tests need$missing" $missing) ||
      echo "Going on without; the tests that need$missing will be skipped."
  fi
fi

touch .venv/.steerlab-run
[ "$kind" = dev ] && touch .venv/.steerlab-dev
exit 0
