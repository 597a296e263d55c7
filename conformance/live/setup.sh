#!/usr/bin/env bash
# Makes sure that what the live suites need is there, beside stock YARP: network namespaces, VLC and a browser.
set -euo pipefail
cd "$(dirname "$0")/../.."

needed=()
command -v ip >/dev/null || needed+=(iproute2)
# VLC without its windows, 35 MB; it starts without its plugins, and plays nothing.
scene=$(find /usr/lib /usr/local/lib -name libscene_plugin.so -print -quit)
if [ -z "$scene" ] || ! command -v cvlc >/dev/null; then needed+=(vlc-bin vlc-plugin-base); fi
conformance/install_packages.sh "${needed[@]}"
conformance/web/setup.sh
