#!/usr/bin/env bash
# Runs the live suite in two halves at once. Most of a suite is waiting. Needs root.
#
# Each half has a network, a /tmp and shared memory of its own: it sees no name server, port or file of the other.
set -euo pipefail
cd "$(dirname "$0")/../.."

# Installs and builds, which needs the network of this machine.
HALF=none conformance/live/run.sh

half() {
    HALF=$1 unshare --net --ipc --mount bash -c '
        set -euo pipefail
        ip link set lo up
        # An address that is not loopback, and a way for multicast.
        ip link add here type veth peer name there
        ip address add 192.0.2.2/24 dev here
        ip link set here up
        ip link set there up
        ip route add default dev here
        mount -t tmpfs none /tmp
        unset TMPDIR XDG_RUNTIME_DIR
        exec conformance/live/run.sh
    '
}

said=$(mktemp)
rm -f target/live/failures-*
trap 'rm -f "$said"' EXIT
begin=$SECONDS
half servers >"$said" 2>&1 &
other=$!
failed=()
half programs || failed+=(programs)
wait "$other" || failed+=(servers)
cat "$said"
for name in "${failed[@]}"; do
    echo "live: the half with the $name failed in:"
    tail -n 20 "target/live/failures-$name" 2>/dev/null || echo "(before its first suite)"
done
echo "live: both halves took $((SECONDS - begin)) s"
[ "${#failed[@]}" = 0 ]
