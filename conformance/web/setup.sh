#!/usr/bin/env bash
# Makes sure that the browser for the test of pages is there: Debian's chromium and its driver.
set -euo pipefail

missing=()
command -v chromium >/dev/null || missing+=(chromium)
command -v chromedriver >/dev/null || missing+=(chromium-driver)
if [ ${#missing[@]} != 0 ]; then
    echo "setup: installing ${missing[*]}"
    if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
    $as_root apt-get update -q
    $as_root apt-get install -y -q --no-install-recommends "${missing[@]}" </dev/null
fi
