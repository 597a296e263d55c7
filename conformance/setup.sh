#!/usr/bin/env bash
# Makes sure that what the plain build needs is there: a Rust toolchain, a C compiler and Python; and Node with the packages of
# the live view's 3D part, without which the page is built without 3D. `setup.sh vision` also installs OpenCV, its real
# photographs, and the libclang that reads its headers: `client/vision` and its tests need them.
set -euo pipefail

if ! command -v cargo >/dev/null; then
    echo "setup: Rust is missing; install 1.89 or newer (https://rustup.rs; Debian's own is older), then try again" >&2
    exit 1
fi
install=$(dirname "$0")/install_packages.sh
needed=()
command -v cc >/dev/null || needed+=(build-essential)
command -v python3 >/dev/null || needed+=(python3-minimal)
if [ "${1:-}" = vision ]; then needed+=(libopencv-dev opencv-doc clang libclang-dev); fi
"$install" "${needed[@]}"

# The page of the live view shows no 3D without these, and says so: no reason to stop.
web=$(dirname "$0")/../demos/view/web
if [ ! -e "$web/node_modules/.package-lock.json" ] || [ "$web/package-lock.json" -nt "$web/node_modules/.package-lock.json" ]; then
    if ! command -v npm >/dev/null; then
        "$install" nodejs npm || echo "setup: no Node; the live view is built without 3D" >&2
    fi
    if command -v npm >/dev/null; then
        timeout 300 npm ci --prefix "$web" --no-audit --no-fund --loglevel=error </dev/null \
            || echo "setup: npm failed; the live view is built without 3D" >&2
        # As new as what it was made from, so that this is not done again.
        [ ! -e "$web/node_modules/.package-lock.json" ] || touch "$web/node_modules/.package-lock.json"
    fi
fi
