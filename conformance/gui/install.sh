#!/usr/bin/env bash
# Builds `yarpmotorgui` and `yarpview` of stock YARP 3.5.0 and 4.0.0 into the folder given, unless they are there already.
#
#   STOCK          stock 3.5.0, of `make stock`: the libraries of the first
#   STOCK4_SOURCE  sources of YARP 4.0.0, and
#   STOCK4_BUILD   a build of them with the plugins fakeMotionControl, controlBoard_nws_yarp, controlBoard_nwc_yarp and
#                  deviceBundler: the libraries of the second; without these two variables they are built here
#   YARP_GIT, YCM_GIT  where the sources come from: addresses, or folders with a bare repository
#
# Needs Debian 12 (apt-get). Takes about five minutes on two cores, and much longer if 4.0.0 is built, too.
set -euo pipefail

into=${1:?usage: install.sh FOLDER}
here=$(cd "$(dirname "$0")" && pwd)
: "${STOCK:?set STOCK to the folder of stock YARP; \`make test-gui\` does}"
. "$here/../stock/environment.sh"
yarp_git=${YARP_GIT:-https://github.com/robotology/yarp}
ycm_git=${YCM_GIT:-https://github.com/robotology/ycm-cmake-modules}
jobs=${JOBS:-2}

"$here/../install_packages.sh" build-essential cmake ninja-build libace-dev libtinyxml-dev libsqlite3-dev libedit-dev \
    libeigen3-dev libjpeg-dev libpng-dev zlib1g-dev xvfb openbox xdotool imagemagick x11-utils at-spi2-core dbus python3-gi \
    gir1.2-atspi-2.0 python3-pil git qtbase5-dev qtdeclarative5-dev qtmultimedia5-dev libqt5svg5-dev qml-module-qtquick2 \
    qml-module-qtquick-window2 qml-module-qtquick-controls qml-module-qtquick-dialogs qml-module-qtquick-layouts \
    qml-module-qtgraphicaleffects qml-module-qt-labs-settings qml-module-qt-labs-folderlistmodel qml-module-qtmultimedia
mkdir -p "$into"

# Puts files of a version of YARP into a folder: VERSION FOLDER FILES...
sources() {
    local version=$1 folder=$2
    shift 2
    local repository=$yarp_git
    if [ ! -d "$repository" ]; then
        repository=$into/$version.git
        rm -rf "$repository"
        git clone --quiet --bare --depth 1 --branch "v$version" "$yarp_git" "$repository"
    fi
    rm -rf "$folder"
    mkdir -p "$folder"
    GIT_INDEX_FILE=$folder.index git --git-dir="$repository" --work-tree="$folder" checkout --quiet "v$version" -- "$@"
}

# Builds the windows: VERSION, where YARP's CMake files are, the sources, where in them the programs are, compiler flags.
windows() {
    cmake -S "$here" -B "$into/$1" -G Ninja -DCMAKE_BUILD_TYPE=MinSizeRel -DYARP_DIR="$2" \
        -DCMAKE_PREFIX_PATH="$into/ycm;${2%/YARP}" -DSOURCES="$3" -DFOLDER="$4" -DCMAKE_CXX_FLAGS="-w $5" >"$into/$1.log" 2>&1
    nice ninja -C "$into/$1" -j "$jobs" >>"$into/$1.log" 2>&1
    touch "$into/$1/complete"
}

if [ ! -e "$into/3.5.0/complete" ]; then
    echo "install: the windows of 3.5.0"
    sources 3.5.0 "$into/3.5.0-source" cmake data/icons src/yarpmotorgui src/yarpview
    # As in stock/install.sh.
    flags=""
    for header in iterator utility cstdint limits memory string array functional algorithm; do
        flags="$flags -include $header"
    done
    windows 3.5.0 "$stock_package/lib/cmake/YARP" "$into/3.5.0-source" src "$flags"
fi

if [ -z "${STOCK4_BUILD:-}" ]; then
    STOCK4_SOURCE=$into/yarp-source STOCK4_BUILD=$into/yarp
    if [ ! -e "$STOCK4_BUILD/complete" ]; then
        echo "install: YARP 4.0.0"
        rm -rf "$into/ycm-source"
        git clone --quiet --depth 1 "$ycm_git" "$into/ycm-source"
        cmake -S "$into/ycm-source" -B "$into/ycm-build" -G Ninja -DCMAKE_INSTALL_PREFIX="$into/ycm" -DBUILD_TESTING=OFF \
            >"$into/ycm.log" 2>&1
        cmake --build "$into/ycm-build" --target install >>"$into/ycm.log" 2>&1
        # SQLite is Debian's.
        sources 4.0.0 "$STOCK4_SOURCE" . ':!extern/sqlite/sqlite/sqlite3.c'
        plugins=(fakeMotionControl controlBoard_nws_yarp controlBoard_nwc_yarp deviceBundler)
        asked=("${plugins[@]/#/-DENABLE_yarpmod_}")
        cmake -S "$STOCK4_SOURCE" -B "$STOCK4_BUILD" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$into/ycm" \
            -DYARP_COMPILE_GUIS=OFF -DYARP_COMPILE_TESTS=OFF -DYARP_COMPILE_BINDINGS=OFF -DBUILD_TESTING=OFF \
            -DYARP_COMPILE_ALL_FAKE_DEVICES=OFF -DYARP_USE_SYSTEM_SQLite=ON "${asked[@]/%/=ON}" \
            >"$into/yarp.log" 2>&1
        nice ninja -C "$STOCK4_BUILD" -j "$jobs" yarp yarpserver yarpdev "${plugins[@]/#/yarp_}" >>"$into/yarp.log" 2>&1
        touch "$STOCK4_BUILD/complete"
    fi
fi
if [ ! -e "$into/4.0.0/complete" ]; then
    echo "install: the windows of 4.0.0"
    windows 4.0.0 "$STOCK4_BUILD" "$STOCK4_SOURCE" src/guis ""
fi
echo "STOCK4_BUILD=$STOCK4_BUILD" >"$into/built"
echo "yarpmotorgui and yarpview of 3.5.0 and 4.0.0 are in $into"
