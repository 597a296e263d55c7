#!/usr/bin/env bash
# A name server with legs in two networks that do not know of each other: each client is told an
# address that it can reach, a port there transmits to groups in both, and a robot there is used from one of them.
# Needs root (network namespaces), and leaves nothing behind.
#
#   networks.sh OUR_YARP [WITH_STOCK]     WITH_STOCK runs stock's tools
set -euo pipefail

ours=$(realpath "$1")
with_stock=${2:+$(realpath "$2")}
work=$(mktemp -d)
running=()
# Names of their own: other tests may run beside this one.
server=yarp-s-$$ left=yarp-l-$$ right=yarp-r-$$
clean() {
    kill "${running[@]}" 2>/dev/null || true
    # A stock reader may not end when it is asked to.
    for _ in $(seq 50); do
        kill -0 "${running[@]}" 2>/dev/null || break
        sleep 0.1
    done
    kill -KILL "${running[@]}" 2>/dev/null || true
    wait "${running[@]}" 2>/dev/null || true
    for space in "$server" "$left" "$right"; do ip netns del "$space" 2>/dev/null || true; done
    rm -rf "$work"
}
trap clean EXIT

failed=0
# Whether a command prints a line that holds the words given.
says() {
    local what=$1 words=$2 said
    shift 2
    said=$("$@" 2>&1 || true)
    if grep -qF -- "$words" <<<"$said"; then
        echo "ok   $what"
    else
        echo "FAIL $what: no \"$words\" in: $said"
        failed=$((failed + 1))
    fi
}
until_ok() {
    for _ in $(seq 100); do
        if "$@" >/dev/null 2>&1; then return 0; fi
        sleep 0.2
    done
    echo "FAIL gave up waiting for: $*"
    return 1
}

for space in "$server" "$left" "$right"; do
    ip netns add "$space"
    ip -n "$space" link set lo up
done
# A cable: name of the end at the server and its address; where the other end is, and its address.
cable() {
    ip link add "$1" netns "$server" type veth peer name eth0 netns "$3"
    ip -n "$server" addr add "$2/24" dev "$1"
    ip -n "$3" addr add "$4/24" dev eth0
    ip -n "$server" link set "$1" up
    ip -n "$3" link set eth0 up
    # Stock joins groups where the system's routes lead, which a default route else tells.
    ip -n "$3" route add 224.0.0.0/4 dev eth0
}
cable toleft 10.71.1.1 "$left" 10.71.1.2
cable toright 10.71.2.1 "$right" 10.71.2.2

# A command in one of the networks, configured for the server's leg there; ends after $patience seconds.
run() {
    local space=$1
    shift
    timeout "${patience:-20}" ip netns exec "$space" env YARP_CONFIG_HOME="$work/$space" \
        YARP_DATA_HOME="$work/$space" "$@"
}
# The same in the background, until the end; reads $input, if that is set.
start() {
    local space=$1
    shift
    ip netns exec "$space" env YARP_CONFIG_HOME="$work/$space" YARP_DATA_HOME="$work/$space" \
        "$@" <"${input:-/dev/null}" >>"$work/log" 2>&1 &
    running+=($!)
}
for place in "$server 127.0.0.1" "$left 10.71.1.1" "$right 10.71.2.1"; do
    read -r space host <<<"$place"
    mkdir -p "$work/$space"
    echo "$host 10000 yarp" >"$work/$space/yarp.conf"
done

start "$server" "$ours" server --local
until_ok run "$left" "$ours" where
# A port on the server's machine, where it is known by its loopback address. It listens in all networks only if it is
# told to: a network that is configured on loopback listens there.
start "$server" env YARP_BIND=0.0.0.0 "$ours" read /here
until_ok run "$server" "$ours" exists /here
# And one in each network.
start "$left" "$ours" read /left
until_ok run "$left" "$ours" exists /left

tools=("ours")
if [ -n "$with_stock" ]; then tools+=("stock"); fi
for tool in "${tools[@]}"; do
    yarp=("$ours")
    if [ "$tool" = stock ]; then yarp=("$with_stock" yarp); fi
    says "$tool on the left: the server's port" "ip 10.71.1.1 " run "$left" "${yarp[@]}" name query /here
    says "$tool on the right: the server's port" "ip 10.71.2.1 " run "$right" "${yarp[@]}" name query /here
    says "$tool at the server: the server's port" "ip 127.0.0.1 " run "$server" "${yarp[@]}" name query /here
    says "$tool on the right, in a list" "name /here ip 10.71.2.1 " run "$right" "${yarp[@]}" name list
    says "$tool on the right, asking for the left" "ip 10.71.1.1 " run "$right" "${yarp[@]}" name query "/net=10.71.1/here"
    says "$tool on the left: its own port" "ip 10.71.1.2 " run "$left" "${yarp[@]}" name query /left
    for space in "$left" "$right" "$server"; do
        if run "$space" "${yarp[@]}" exists /here >/dev/null 2>&1; then
            echo "ok   $tool finds the port, in ${space%-*}"
        else
            echo "FAIL $tool does not find the port, in ${space%-*}"
            failed=$((failed + 1))
        fi
    done
    for space in "$left" "$right"; do
        word="from-$tool-${space%-*}"
        run "$space" "${yarp[@]}" write ... /here >/dev/null 2>&1 <<<"$word" || true
        if until_ok grep -qF "$word" "$work/log"; then
            echo "ok   $tool writes to the port, in ${space%-*}"
        else
            failed=$((failed + 1))
        fi
    done
done

# One message of a port with legs in both networks reaches the readers of a group in each.
for tool in "${tools[@]}"; do
    yarp=("$ours")
    if [ "$tool" = stock ]; then yarp=("$with_stock" yarp); fi
    mkfifo "$work/say-$tool"
    exec 3<>"$work/say-$tool"
    input=$work/say-$tool start "$server" "$ours" write "/many/$tool"
    until_ok run "$server" "$ours" exists "/many/$tool"
    for space in "$left" "$right"; do
        for reader in 1 2; do
            name=/many/$tool/${space%-*}/$reader
            start "$space" "${yarp[@]}" read "$name"
            until_ok run "$space" "$ours" exists "$name"
            says "ours connects to $tool by mcast, $name" "Success: Added connection" \
                run "$server" "$ours" connect "/many/$tool" "$name" mcast
        done
    done
    echo "said-to-many-$tool" >&3
    heard() { [ "$(grep -cF "said-to-many-$tool" "$work/log")" -ge 4 ]; }
    if until_ok heard; then
        # Nobody hears it twice.
        sleep 1
        says "$tool hears ours in both networks, each reader once" "4" grep -cF "said-to-many-$tool" "$work/log"
    else
        failed=$((failed + 1))
    fi
    exec 3>&-
done

# Arm, hand and sensors on one host, the program that tidies their table on another. Only a build with the simulated table has both.
if "$ours" demo tidy --help >/dev/null 2>&1; then
    start "$server" env YARP_BIND=0.0.0.0 "$ours" table --objects 1 --seed 7001 --speed 3 --prefix /lab --no-view
    until_ok run "$left" "$ours" exists /lab/truth/rpc:i
    patience=120 says "a table of another host is tidied" '"released":1' \
        run "$left" "$ours" demo tidy --remote /lab --speed 3 --detector truth --json
fi

if [ $failed != 0 ]; then
    echo "$failed checks failed"
    exit 1
fi
