#!/usr/bin/env bash
# Our controller of a tool and iCub's own client of both versions of the protocol. Fails, and never skips, when something is
# missing.
#
#   STOCK         the folder of stock YARP 3.5.0, of `make stock`
#   ICUB_SOURCES  folders with sources of icub-main before 2.0 and from 2.0 on, between spaces: of each
#                 src/libraries/{ctrlLib,iKin,icubmod/cartesianController} is needed. Shown with 1.21.0 and 2.0.0
set -euo pipefail
cd "$(dirname "$0")/../.."
: "${STOCK:?set STOCK to the folder of stock YARP}" "${ICUB_SOURCES:?set it to folders with sources of icub-main}"
. conformance/stock/environment.sh
. conformance/live/running.sh

cargo build --quiet --release -p yarp-cli
yarp=${CARGO_TARGET_DIR:-target}/release/yarp
export YARP_CONFIG_HOME=$work YARP_FORWARD_LOG_ENABLE=0
export YARP_DATA_DIRS=$stock_package/share/yarp LD_LIBRARY_PATH=$stock_libraries
"$yarp" server --ip 127.0.0.1 --socket 18610 --write >"$work/server.log" 2>&1 &
running+=($!)
until_ok "$yarp" where
for version in 1.1 2.0; do
    "$yarp" up --name "/wam$version" "--cartesian=$version" >"$work/up.log" 2>&1 &
    running+=($!)
    until_ok "$yarp" exists "/cartController/wam$version/rpc:i"
done

# The version that a folder of sources insists on.
insists() { grep -oP 'CARTCTRL_CLIENT_VER\s+"?\K[0-9.]+' "$1"/src/libraries/icubmod/cartesianController/ClientCartesianController.cpp; }

shown=
for source in $ICUB_SOURCES; do
    version=$(insists "$source")
    libraries=$source/src/libraries
    # As in stock/install.sh, its headers rely on others.
    g++ -std=c++17 -O1 -w -include cstdint -include functional "-I$stock_package/include" "-I$libraries/iKin/include" \
        "-I$libraries/ctrlLib/include" "-I$libraries/icubmod/cartesianController" conformance/live/icub_client.cpp \
        "$libraries"/icubmod/cartesianController/ClientCartesianController.cpp "$libraries"/iKin/src/iKin{Hlp,Fwd}.cpp \
        "$libraries"/ctrlLib/src/math.cpp "-L$stock_package/lib" -lYARP_os -lYARP_init -lYARP_dev -lYARP_sig -lYARP_math \
        -o "$work/client$version"
    for carrier in udp tcp; do
        echo "---- iCub's client $version moves the tool over $carrier"
        timeout 300 "$work/client$version" "/cartController/wam$version" "/live/$version/$carrier" "$carrier" 2>"$work/client.log"
    done
    shown="$shown $version"
done
if [ "$(echo $shown | tr ' ' '\n' | sort -u | tr '\n' ' ')" != "1.1 2.0 " ]; then
    echo "live: there must be a client of each version, 1.1 and 2.0; there was:$shown" >&2
    exit 1
fi
echo "live: iCub's clients moved our tool"
