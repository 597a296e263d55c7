#!/usr/bin/env bash
# Boards on the network, ours beside stock's: `conformance/bench/run.sh only boards [feed|orders|crowd]`.
#
# Two hosts are two network namespaces with a cable, which need root; without it only localhost is measured. Leaves
# nothing behind. From the environment:
#
#   STOCK          the folder of stock YARP 3.5.0
#   STOCK_PEER     its client, stock_peer.cpp, which run.sh builds
#   STOCK4_BOARD   live/fake_board_4.cpp, built as live/run_4.sh builds it, or a script that starts it with the
#                  environment that it needs; without it orders of 4.0 are left out
#   ROUNDS         how often each measurement is made, 5
#   LONGER         how many times longer states are looked at, 1: then all takes six minutes
#   CARRIER        what states travel over, fast_tcp
set -euo pipefail
cd "$(dirname "$0")/../.."
: "${STOCK:?set STOCK to the folder of stock YARP; \`make bench\` does}"
target=${CARGO_TARGET_DIR:-target}/release

server=bench-s-$$ client=bench-c-$$
clean() {
    ip netns del "$server" 2>/dev/null || true
    ip netns del "$client" 2>/dev/null || true
}
trap clean EXIT

address=10.213.78.1
if ip netns add "$server" 2>/dev/null && ip netns add "$client" 2>/dev/null; then
    ip link add eth0 netns "$server" type veth peer name eth0 netns "$client"
    ip -n "$server" address add "$address/24" dev eth0
    ip -n "$client" address add 10.213.78.2/24 dev eth0
    for space in "$server" "$client"; do
        ip -n "$space" link set lo up
        ip -n "$space" link set eth0 up
    done
    export NETWORKS="$server $client $address"
else
    echo "no network namespaces: run as root, with iproute2, to measure between two hosts" >&2
fi

YARP=$target/yarp "$target/bench_boards" "$@"
