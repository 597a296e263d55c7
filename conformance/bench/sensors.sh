#!/usr/bin/env bash
# Servers of sensors, ours beside stock's, on a name server of ours: `conformance/bench/sensors.sh [SECONDS [ROUNDS]]`.
#
# From the environment: STOCK, the folder of stock YARP 3.5.0. Leaves nothing behind.
set -euo pipefail
cd "$(dirname "$0")/../.."
: "${STOCK:?set STOCK to the folder of stock YARP; \`make bench\` does}"
. conformance/stock/environment.sh
. conformance/live/running.sh
target=${CARGO_TARGET_DIR:-target}/release
cargo build --quiet --release -p yarp-cli -p yarp-conformance --bin yarp --bin bench_sensors
g++ -O2 -std=c++17 -include cstdint conformance/bench/stock_sensors.cpp -I"$stock_package/include" \
    -L"$stock_package/lib" -lYARP_os -lYARP_sig -lYARP_dev -lYARP_init -o "$work/stock_sensors"
export YARP_CONFIG_HOME=$work YARP_DATA_HOME=$work/data
"$target/yarp" server --ip 127.0.0.1 --socket 15710 --write --memory >"$work/server.log" 2>&1 &
running+=($!)
until_ok "$target/yarp" where
conformance/stock/with_stock "$target/bench_sensors" compare "${1:-10}" "${2:-3}" "$work/stock_sensors"
