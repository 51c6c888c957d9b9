# Sourced by tests/*/run: goes to the top of the repository, and defines what several of them need.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PYTHONDONTWRITEBYTECODE=1

# Installs Debian packages.
install() { apt-get update -q && apt-get install -q -y --no-install-recommends "$@"; }

# Sets FREEPLAY to the program by its absolute path: one that it names already, or a new build.
freeplay() {
  if [ -z "${FREEPLAY:-}" ]; then
    cargo build --bin freeplay --locked
    FREEPLAY=${CARGO_TARGET_DIR:-target}/debug/freeplay
  fi
  FREEPLAY=$(realpath "$FREEPLAY")
  export FREEPLAY
}

# Makes the scratch folder $work, which is removed at the end.
scratch() {
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
}

# Makes a Python environment with the packages of tests/NAME/requirements.txt and puts its programs first: venv NAME [OPTION...]
venv() {
  python3 -c 'import ensurepip' 2>/dev/null || install python3-venv
  python3 -m venv "$work/venv"
  "$work/venv/bin/pip" install --quiet --disable-pip-version-check "${@:2}" -r "tests/$1/requirements.txt"
  PATH="$work/venv/bin:$PATH"
}
