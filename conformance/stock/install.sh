#!/usr/bin/env bash
# Builds stock YARP 3.5.0 from its package into the folder given, unless it is there already.
#
# Takes about seven minutes on two cores. Needs Debian (apt-get) and Python 3 with venv.
set -euo pipefail

stock=${1:?usage: install.sh FOLDER}
version=3.5.0
# What it is built with; a folder built with something else is built anew.
options='set(BUILD_SHARED_LIBS ON)
set(ENABLE_yarpmod_fakeMotionControl ON CACHE BOOL "")
set(ENABLE_yarpcar_shmem ON CACHE BOOL "")
set(ENABLE_yarpcar_unix_stream ON CACHE BOOL "")
set(ENABLE_yarpcar_mjpeg ON CACHE BOOL "")
set(ENABLE_yarpcar_websocket ON CACHE BOOL "")
set(ENABLE_yarpcar_portmonitor ON CACHE BOOL "")
set(ENABLE_yarppm_depthimage_to_mono ON CACHE BOOL "")
set(ENABLE_yarppm_depthimage_to_rgb ON CACHE BOOL "")
set(ENABLE_yarppm_depthimage_compression_zlib ON CACHE BOOL "")'
if [ -e "$stock/complete" ] && [ "$(cat "$stock/options.cmake")" = "$options" ]; then
    echo "stock YARP $version is in $stock"
    exit 0
fi

"$(dirname "$0")/../install_packages.sh" build-essential cmake ninja-build swig libace-dev libtinyxml-dev libsqlite3-dev \
    libedit-dev libeigen3-dev libjpeg-dev libpng-dev zlib1g-dev python3-dev python3-venv

rm -rf "$stock"
mkdir -p "$(dirname "$stock")"
python3 -m venv "$stock"
printf '%s\n' "$options" >"$stock/options.cmake"
# Its headers rely on others to include these; the compilers of today do not.
flags=""
for header in iterator utility cstdint limits memory string array functional algorithm; do
    flags="$flags -include $header"
done
CMAKE_POLICY_VERSION_MINIMUM=3.5 CMAKE_TOOLCHAIN_FILE="$stock/options.cmake" CXXFLAGS="$flags" \
    "$stock/bin/pip" install --quiet --no-cache-dir "yarp-middleware==$version"
touch "$stock/complete"
echo "stock YARP $version is in $stock"
