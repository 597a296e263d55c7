#!/usr/bin/env bash
# Makes sure that what the plain build needs is there: a Rust toolchain and a C compiler.
set -euo pipefail

if ! command -v cargo >/dev/null; then
    echo "setup: Rust is missing; install 1.88 or newer (https://rustup.rs; Debian's own is older), then try again" >&2
    exit 1
fi
if ! command -v cc >/dev/null; then
    echo "setup: installing a C compiler"
    if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
    $as_root apt-get update -q
    $as_root apt-get install -y -q build-essential </dev/null
fi
