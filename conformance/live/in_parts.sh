#!/usr/bin/env bash
# Runs the live suite in four parts at once. Most of a suite is waiting. Needs root.
#
# Each part has a network, a /tmp and shared memory of its own: it sees no name server, port or file of the others.
set -euo pipefail
cd "$(dirname "$0")/../.."

# Installs and builds, which needs the network of this machine.
PART=none conformance/live/run.sh

part() {
    PART=$1 unshare --net --ipc --mount bash -c '
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

said=$(mktemp -d)
rm -f target/live/failures-*
trap 'rm -rf "$said"' EXIT
begin=$SECONDS
parts=(programs commands ours stock)
others=()
for name in "${parts[@]:1}"; do
    part "$name" >"$said/$name" 2>&1 &
    others+=($!)
done
failed=()
part "${parts[0]}" || failed+=("${parts[0]}")
for place in "${!others[@]}"; do
    name=${parts[place + 1]}
    wait "${others[place]}" || failed+=("$name")
    cat "$said/$name"
done
for name in "${failed[@]}"; do
    echo "live: the part \"$name\" failed in:"
    tail -n 20 "target/live/failures-$name" 2>/dev/null || echo "(before its first suite)"
done
echo "live: all parts took $((SECONDS - begin)) s"
[ "${#failed[@]}" = 0 ]
