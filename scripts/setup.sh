#!/bin/sh
# Makes .venv with everything pinned. Usage: scripts/setup.sh EXTRA (all | dev). Installs missing Debian packages where it
# may (root); elsewhere it says in one sentence which are missing.
set -eu

extra=$1
venv=.venv
packages="libglu1-mesa libgomp1 libgl1 libxcursor1 libxft2 libxinerama1 libxfixes3 libxrender1 libfontconfig1"

say() { printf '%s\n' "$*" >&2; }

install_packages() {
    if [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null; then
        say "installing: $*"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" > /dev/null
    else
        say "cfem: missing system packages; install them first: apt-get install $*"
        exit 1
    fi
}

find_python() {
    for name in python3.13 python3.12 python3.11 python3; do
        if command -v "$name" > /dev/null && "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2> /dev/null; then
            printf '%s' "$name"
            return
        fi
    done
}

# gmsh's wheel needs X and GL libraries that a bare system lacks
lacks_libraries() {
    command -v apt-get > /dev/null && [ -x /sbin/ldconfig ] || return 1
    for library in libGLU.so.1 libGL.so.1 libgomp.so.1 libXcursor.so.1 libXft.so.2 libXinerama.so.1 libXrender.so.1; do
        /sbin/ldconfig -p | grep -q "$library" || return 0
    done
    return 1
}

missing=
python=$(find_python)
if [ -z "$python" ] || ! "$python" -c 'import ensurepip, venv' 2> /dev/null; then
    missing="python3 python3-venv"
fi
if lacks_libraries; then missing="$missing $packages"; fi
if [ -n "$missing" ]; then install_packages $missing; fi
python=$(find_python)
[ -n "$python" ] || { say "cfem: needs Python 3.11 or newer, and this system has none"; exit 1; }

[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install -q --disable-pip-version-check -c constraints.txt torch
"$venv/bin/python" -m pip install -q --disable-pip-version-check -c constraints.txt -e ".[$extra]"

"$venv/bin/python" -c 'import gmsh' || { say "cfem: gmsh cannot be loaded, see above; it needs: $packages"; exit 1; }
