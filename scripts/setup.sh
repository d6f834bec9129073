#!/usr/bin/env bash
# Makes .venv: system libraries, virtual environment, pinned packages. Costs a few hundredths of a second when all is there.
# PYTHON=/path/to/python3.12 chooses the interpreter. As root (or with sudo that asks nothing) it installs what Debian lacks;
# otherwise it says what to install, and stops before anything long.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly ENVIRONMENT=.venv
readonly STAMP=$ENVIRONMENT/ready # written last: an environment without it is not trusted
readonly DECLARED=(pyproject.toml constraints.txt scripts/setup.sh)

# Shared libraries that Open3D, pymeshlab's plugins and Playwright's driver link even without a screen, each with its
# Debian package. tests/test_shared_libraries.py names what is missing here.
readonly LIBRARIES=(
  libusb-1.0.so.0=libusb-1.0-0
  libGL.so.1=libgl1
  libOpenGL.so.0=libopengl0
  libEGL.so.1=libegl1
  libX11.so.6=libx11-6
  libudev.so.1=libudev1
  libidn2.so.0=libidn2-0
  libatomic.so.1=libatomic1
)

main() {
  if ready; then return; fi
  serialise
  if ready; then return; fi # another call has just made it

  SECONDS=0
  local python
  python=$(choose_python)
  provide_system_packages "$python"
  make_environment "$python"
  say "installing the pinned packages (the first time it downloads about 380 MB; 1.4 GB on disk)"
  "$ENVIRONMENT/bin/python" -I -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
  fingerprint >"$STAMP"
  say "ready after $SECONDS s: $ENVIRONMENT/bin/footscan"
}

say() { echo "setup: $*"; }

refuse() {
  echo "setup: $*" >&2
  exit 1
}

# What the environment was made from and where: a virtual environment holds absolute paths, so a moved one is broken.
fingerprint() {
  pwd -P
  cksum "${DECLARED[@]}"
}

ready() { [[ -f $STAMP && $(<"$STAMP") == "$(fingerprint)" ]] && starts; }

starts() { "$ENVIRONMENT/bin/python" -I -c 'import footscan' 2>/dev/null && [[ -x $ENVIRONMENT/bin/footscan ]]; }

# One set-up at a time, where the system has flock: the lock is this script, and goes with the process.
serialise() {
  command -v flock >/dev/null || return 0
  exec 9<scripts/setup.sh
  flock 9
}

choose_python() {
  local candidate
  for candidate in ${PYTHON:-python3 python3.11 python3.12 python3.13 python3.14}; do
    if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null; then
      echo "$candidate"
      return
    fi
  done
  local found
  found=$("${PYTHON:-python3}" --version 2>/dev/null | grep -o '^Python [0-9.]*') || found="nothing that runs"
  refuse "footscan needs Python 3.11 to 3.14, and ${PYTHON:-python3} is $found; PYTHON=/path/to/python3.11 make setup names another"
}

provide_system_packages() {
  local python=$1 missing
  missing=$(missing_packages "$python")
  if [[ -z $missing ]]; then return; fi
  command -v apt-get >/dev/null || refuse "install what these Debian packages hold, then call again: $missing"

  local as_root=()
  if ((EUID != 0)); then
    sudo -n true 2>/dev/null || refuse "missing on this machine; install with: sudo apt-get install $missing"
    as_root=(sudo -n)
  fi
  say "installing from Debian: $missing"
  quietly "${as_root[@]}" apt-get -q update
  # shellcheck disable=SC2086  # a list of package names
  quietly "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qy install --no-install-recommends $missing
  missing=$(missing_packages "$python")
  [[ -z $missing ]] || refuse "installed, but still not found by $python: $missing"
}

# Asks the interpreter itself, since its loader is the one that will have to find them.
missing_packages() {
  "$1" - "${LIBRARIES[@]}" <<'PYTHON'
import ctypes, importlib.util, sys

missing = [] if importlib.util.find_spec("ensurepip") else ["python3.%d-venv" % sys.version_info.minor]
for library, package in (pair.split("=") for pair in sys.argv[1:] if sys.platform == "linux"):
    try:
        ctypes.CDLL(library)
    except OSError:
        missing.append(package)
print(*missing)
PYTHON
}

# A whole environment of this place takes the new pins as it stands; any other (moved, broken, half made) is made anew.
make_environment() {
  local python=$1
  if [[ -f $STAMP && $(head -n 1 "$STAMP") == "$(pwd -P)" ]] && starts; then
    rm "$STAMP"
    return
  fi
  say "virtual environment $ENVIRONMENT with $("$python" --version)"
  rm -rf "$ENVIRONMENT"
  quietly "$python" -m venv "$ENVIRONMENT"
}

# Says what a command said only if it failed.
quietly() {
  local output
  output=$("$@" 2>&1) || refuse "$* failed:"$'\n'"$output"
}

main
