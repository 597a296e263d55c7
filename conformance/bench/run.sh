#!/usr/bin/env bash
# Runs the benchmark: ours beside stock, on a name server of ours on a free port.
#
#   conformance/bench/run.sh            everything
#   conformance/bench/run.sh only names the name servers alone
#   conformance/bench/run.sh only boards  boards alone, see boards.sh; parts of it: `only boards feed`, `orders` or `crowd`
#   conformance/bench/run.sh only sensors servers of 50 sensors at 1 kHz alone, see sensors.sh
#   conformance/bench/run.sh only zenoh  ours beside zenoh, whose peer takes minutes to build; not part of everything
#   conformance/bench/run.sh only optimisations [NAME]  ours without one optimisation of ports at a time; needs no stock
#   conformance/bench/run.sh WORDS      `bench` with these words
set -euo pipefail
cd "$(dirname "$0")/../.."

# Starts a name server of ours on a free port, for everything that is started afterwards.
start_server() {
    # `unix_stream` of stock needs to know where sockets go.
    export YARP_CONFIG_HOME="$work" YARP_DATA_HOME="$work/data" YARP_RUNTIME_DIR="$work"
    cargo build --quiet --release -p yarp-cli
    target/release/yarp server --ip 127.0.0.1 --socket 10490 --write >"$work/server.log" 2>&1 &
    server=$!
    for _ in $(seq 100); do
        if target/release/yarp where >/dev/null 2>&1; then break; fi
        sleep 0.1
    done
}

work=$(mktemp -d)
server=
trap 'if [ -n "$server" ]; then kill "$server" 2>/dev/null || true; fi; rm -rf "$work"' EXIT

if [ "${1:-} ${2:-}" = "only optimisations" ]; then
    start_server
    cargo build --quiet --release -p yarp-conformance --bin bench --features latency-ablation
    target/release/bench "$@"
    exit
fi

: "${STOCK:?set STOCK to the folder of stock YARP; \`make bench\` does}"
. conformance/stock/environment.sh

if [ "$*" = "only names" ]; then
    cargo build --quiet --release -p yarp-cli
    cargo build --quiet --release -p yarp-conformance --bin bench_names
    YARP=target/release/yarp target/release/bench_names
    exit
fi

if [ "$*" = "only sensors" ]; then
    exec conformance/bench/sensors.sh 10 5
fi

if [ "$*" = "only zenoh" ]; then
    cargo build --quiet --release --locked --manifest-path conformance/bench/zenoh/Cargo.toml --target-dir target/zenoh
    cargo build --quiet --release -p yarp-conformance --bin bench
    export ZENOH_PEER=$PWD/target/zenoh/release/zenoh_peer
else
    g++ -O2 -std=c++17 -include cstdint conformance/bench/stock_peer.cpp \
        -I"$stock_package/include" -L"$stock_package/lib" -lYARP_os -lYARP_sig -lYARP_init -o "$work/stock_peer"
    export STOCK_PEER=$work/stock_peer
fi

if [ "${1:-} ${2:-}" = "only boards" ]; then
    cargo build --quiet --release -p yarp-cli
    cargo build --quiet --release -p yarp-conformance --bin bench_boards
    conformance/bench/boards.sh ${3:+only "$3"}
    exit
fi

start_server
LD_LIBRARY_PATH="$stock_libraries" YARP_DATA_DIRS="$stock_package/share/yarp" \
    target/release/bench "$@"

if [ $# = 0 ]; then
    echo
    YARP=target/release/yarp target/release/bench_names
    echo
    conformance/bench/boards.sh
    echo
    conformance/bench/sensors.sh
fi
