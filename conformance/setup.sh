#!/usr/bin/env bash
# Makes sure that what the plain build needs is there: a Rust toolchain, a C compiler and Python; and Node with the packages of
# the live view's 3D part, without which the page is built without 3D. `setup.sh vision` also installs OpenCV, its real
# photographs, and the libclang that reads its headers: `client/vision` and its tests need them.
set -euo pipefail

if ! command -v cargo >/dev/null; then
    echo "setup: Rust is missing; install 1.89 or newer (https://rustup.rs; Debian's own is older), then try again" >&2
    exit 1
fi
missing=""
command -v cc >/dev/null || missing="$missing build-essential"
command -v python3 >/dev/null || missing="$missing python3-minimal"
if [ "${1:-}" = vision ]; then
    for package in libopencv-dev opencv-doc clang libclang-dev; do
        dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q "ok installed" || missing="$missing $package"
    done
fi
if [ -n "$missing" ]; then
    echo "setup: installing$missing"
    if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
    $as_root apt-get update -q
    $as_root apt-get install -y -q $missing </dev/null
fi

# The page of the live view shows no 3D without these, and says so: no reason to stop.
web=$(dirname "$0")/../demos/view/web
if [ ! -e "$web/node_modules/.package-lock.json" ] || [ "$web/package-lock.json" -nt "$web/node_modules/.package-lock.json" ]; then
    if ! command -v npm >/dev/null; then
        echo "setup: installing nodejs npm"
        if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
        { $as_root apt-get update -q && $as_root apt-get install -y -q --no-install-recommends nodejs npm </dev/null; } \
            || echo "setup: no Node; the live view is built without 3D" >&2
    fi
    if command -v npm >/dev/null; then
        timeout 300 npm ci --prefix "$web" --no-audit --no-fund --loglevel=error </dev/null \
            || echo "setup: npm failed; the live view is built without 3D" >&2
        # As new as what it was made from, so that this is not done again.
        [ ! -e "$web/node_modules/.package-lock.json" ] || touch "$web/node_modules/.package-lock.json"
    fi
fi
