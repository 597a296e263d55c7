#!/usr/bin/env bash
# Makes sure that the browser for the test of pages is there: Debian's chromium and its driver.
set -euo pipefail

needed=()
command -v chromium >/dev/null || needed+=(chromium)
command -v chromedriver >/dev/null || needed+=(chromium-driver)
"$(dirname "$0")/../install_packages.sh" "${needed[@]}"
