#!/usr/bin/env bash
# Makes sure that what the live suites need is there, beside stock YARP: network namespaces, VLC and a browser.
set -euo pipefail
cd "$(dirname "$0")/../.."

missing=()
command -v ip >/dev/null || missing+=(iproute2)
# VLC without its windows, 35 MB.
command -v cvlc >/dev/null || missing+=(vlc-bin vlc-plugin-base)
if [ ${#missing[@]} != 0 ]; then
    echo "live: installing ${missing[*]}"
    if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
    $as_root apt-get update -q
    $as_root apt-get install -y -q --no-install-recommends "${missing[@]}" </dev/null
fi
conformance/web/setup.sh
