#!/bin/sh
# Makes .venv with everything pinned. Usage: scripts/setup.sh EXTRA (all | dev). Installs missing Debian packages where it
# may (root); elsewhere it says in one sentence which are missing. It says what it does at least every 5 s.
# Only the modules that cfem uses are compiled to bytecode: that takes half the time and 270 MB less than all of them.
set -eu

extra=$1
venv=.venv
packages="libglu1-mesa libgomp1 libgl1 libxcursor1 libxft2 libxinerama1 libxfixes3 libxrender1 libfontconfig1"
case $extra in dev) size=2400 ;; *) size=1700 ;; esac # MB on disk, with PyTorch for the CPU
cuda=3900                                             # MB that PyPI's PyTorch for Linux adds to that

say() { printf '%s\n' "$*" >&2; }

# watch WHAT COMMAND ...: runs it, its output in a file, and says every 4 s how far it is
watch() {
    what=$1
    shift
    log=$(mktemp)
    "$@" > "$log" 2>&1 &
    running=$!
    trap 'kill "$running" 2> /dev/null; rm -f "$log"; exit 130' INT TERM
    begin=$(date +%s)
    while sleep 1 && kill -0 "$running" 2> /dev/null; do
        passed=$(($(date +%s) - begin))
        [ $((passed % 4)) -eq 1 ] || continue
        holds=
        if [ "$what" = installing ]; then holds=", $(du -sm "$venv" | cut -f 1) of about $size MB"; fi
        last=$(grep -E '^ *(Collecting|Downloading|Processing|Installing|Get:|Unpacking|Setting up)' "$log" | tail -n 1)
        last=$(printf '%s' "$last" | tr -dc '[:print:]' | sed 's|^ *||; s|/[^ ]*/||' | cut -c 1-40)
        case $last in "Installing collected"*) last=unpacking ;; esac
        say "  $what, $passed s$holds${last:+: $last}"
    done
    trap - INT TERM
    wait "$running" || {
        say "cfem: $what failed:"
        tail -n 20 "$log" >&2
        rm -f "$log"
        exit 1
    }
    rm -f "$log"
}

get_packages() {
    apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$@"
}

install_packages() {
    if [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null; then
        say "installing system packages: $*"
        watch "system packages" get_packages "$@"
    else
        say "cfem: missing system packages; install them first: apt-get install $*"
        exit 1
    fi
}

find_python() {
    for name in python3.13 python3.12 python3.11 python3.14 python3; do
        if command -v "$name" > /dev/null && "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2> /dev/null; then
            printf '%s' "$name"
            return
        fi
    done
}

# gmsh's wheel needs X and GL libraries that a bare system lacks
lacks_libraries() {
    command -v apt-get > /dev/null && [ -x /sbin/ldconfig ] && [ "$(uname -m)" = x86_64 ] || return 1
    for library in libGLU.so.1 libGL.so.1 libgomp.so.1 libXcursor.so.1 libXft.so.2 libXinerama.so.1 libXrender.so.1; do
        /sbin/ldconfig -p | grep -q "$library" || return 0
    done
    return 1
}

# PyPI's PyTorch for Linux brings CUDA with it. A pip with other sources may hold that for the CPU
may_bring_cuda() {
    [ "$(uname -sm)" = "Linux x86_64" ] && [ ! -d "$(echo "$venv"/lib/python3*/site-packages/torch)" ] || return 1
    ! "$venv/bin/python" -m pip config list | grep -E 'index-url|find-links' > /dev/null
}

has_cpu_torch() {
    ! command -v nvidia-smi > /dev/null && "$venv/bin/python" -c 'from urllib.request import urlopen; urlopen("https://download.pytorch.org/whl/cpu/torch/", timeout=3)' \
        2> /dev/null
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

[ -x "$venv/bin/python" ] || watch "making $venv" "$python" -m venv "$venv"
if may_bring_cuda; then
    if has_cpu_torch; then export PIP_EXTRA_INDEX_URL=https://download.pytorch.org/whl/cpu; else size=$((size + cuda)); fi
fi
say "installing cfem and its packages into $venv (about $size MB on disk, 2-5 minutes)"
watch installing "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off --no-compile -c constraints.txt -e ".[$extra]"

if [ "$(uname -sm)" != "Linux aarch64" ]; then
    "$venv/bin/python" -c 'import gmsh' || { say "cfem: gmsh cannot be loaded, see above; it needs: $packages"; exit 1; }
fi

# The first import of a package writes its bytecode: here rather than in the user's first command
watch "compiling what is imported" "$venv/bin/python" -c 'import onnx, onnxruntime, matplotlib.pyplot, numba, pyarrow.parquet, scipy.optimize, torch.onnx'
