#!/usr/bin/env bash
# Makes sure that what the live suites need is there, beside stock YARP: network namespaces, the name of the distribution, VLC and a
# browser.
set -euo pipefail
cd "$(dirname "$0")/../.."

needed=()
command -v ip >/dev/null || needed+=(iproute2)
# Stock runs it to tell of the distribution.
command -v lsb_release >/dev/null || needed+=(lsb-release)
# VLC without its windows, 35 MB; it starts without its plugins, and plays nothing.
scene=$(find /usr/lib /usr/local/lib -name libscene_plugin.so -print -quit 2>/dev/null || true)
if [ -z "$scene" ] || ! command -v cvlc >/dev/null; then needed+=(vlc-bin vlc-plugin-base); fi
conformance/install_packages.sh "${needed[@]}"
conformance/web/setup.sh
