#!/usr/bin/env bash
# Creates the Python environment from the lock file, compiles the kernels, and installs Debian's LIGGGHTS where it is
# missing and allowed.
# Called by make; does nothing that is done already. Usage: setup.sh VENV
set -euo pipefail

venv=$1
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)

say() { printf 'setup: %s\n' "$*" >&2; }

as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi
}

may_install() {
    [ -z "${FILTERCAKE_NO_INSTALL:-}" ] && command -v apt-get >/dev/null &&
        { [ "$(id -u)" -eq 0 ] || { command -v sudo >/dev/null && sudo -n true 2>/dev/null; }; }
}

install_packages() {
    say "installing Debian packages: $*"
    as_root apt-get update -qq >/dev/null 2>&1 || true
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1
}

usable_python() {
    "$1" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
}

find_python() {
    local candidate
    for candidate in "${PYTHON:-}" python3 python3.13 python3.12 python3.11; do
        if [ -n "$candidate" ] && command -v "$candidate" >/dev/null && usable_python "$candidate"; then
            printf '%s\n' "$candidate"
            return
        fi
    done
    return 1
}

make_environment() {
    local python
    if ! python=$(find_python); then
        may_install && install_packages python3 python3-venv || true
        python=$(find_python) || {
            say "needs Python 3.11 or newer with the venv module (Debian: apt-get install python3-venv), or PYTHON=/path/to/python"
            exit 1
        }
    fi
    say "creating $venv from the lock file (a minute or two, once)"
    "$python" -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check --require-hashes -r "$here/requirements.lock"
    "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e "$root"
}

# an environment stands when it was made from this very lock file
stamp=$(cat "$here/requirements.lock" "$root/pyproject.toml" | sha256sum | cut -c1-64)
if [ "$(cat "$venv/.made-from" 2>/dev/null || true)" != "$stamp" ]; then
    rm -rf "$venv"
    make_environment
    printf '%s\n' "$stamp" >"$venv/.made-from"
    # beside the installation of LIGGGHTS; what fails here is compiled with the first packing
    "$venv/bin/python" -m filtercake.cli.warm_up &
    compiling=$!
fi

if ! command -v "${FILTERCAKE_LIGGGHTS:-liggghts}" >/dev/null; then
    packages=$(grep -v '^#' "$here/debian-packages.txt" | tr '\n' ' ')
    # shellcheck disable=SC2086
    if may_install && install_packages $packages && command -v liggghts >/dev/null; then
        say "LIGGGHTS installed: $(command -v liggghts)"
    else
        say "LIGGGHTS is not installed and cannot be installed here (needs root or sudo, and Debian): the embedded engine serves"
    fi
fi

if [ -n "${compiling:-}" ]; then
    wait "$compiling" || say "the kernels were not compiled: the first packings do it"
fi
