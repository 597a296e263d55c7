#!/usr/bin/env bash
# Ours against live stock YARP 3.5.0. Fails, and never skips, when stock is missing.
#
#   conformance/live/run.sh           all suites
#   conformance/live/run.sh copies    those that have this in their title
#
# PART=programs, PART=commands, PART=ours and PART=stock each run a part, PART=none only installs and builds. `in_parts.sh` runs all at once.
#
# PROFILE=dev tries the programs that the tests were built with, which check more and are slower, instead of a release.
set -euo pipefail
cd "$(dirname "$0")/../.."
: "${STOCK:?set STOCK to the folder of stock YARP; \`make test-live\` does}"
. conformance/stock/environment.sh
with_stock=$PWD/conformance/stock/with_stock

case ${PROFILE:-release} in
release)
    built=$PWD/target/release
    build=(--release -p yarp-cli -p yarp-conformance)
    ;;
dev)
    built=$PWD/target/debug
    # As `make test FEATURES=etcd` builds them.
    build=(--workspace --features "yarp-cli/table,yarp-cli/vision,yarp-cli/etcd")
    ;;
*)
    echo "live: PROFILE is release or dev, not $PROFILE" >&2
    exit 1
    ;;
esac
ours=$built/yarp
if ! peer=$("$with_stock" yarp version); then
    echo "live: no stock YARP in $STOCK; run \`make stock\`" >&2
    exit 1
fi
echo "live: the peer is stock $peer, in $STOCK"

. conformance/live/running.sh
# What failed, which outlives the suite: who runs parts tells it of all at the end.
failures=target/live/failures-${PART:-all}
mkdir -p target/live
: >"$failures"
# What name servers of ours keep is no business of the user's.
export YARP_DATA_HOME=$work/data

export PYTHONUNBUFFERED=1
only=${1:-}
ran=0
failed=0
# Runs a command with a title, if it is one of those to run; goes on after a failure, and remembers it and what it said.
suite() {
    local title=$1 code=0 begin=$SECONDS
    shift
    [[ $title == *"$only"* ]] || return 0
    ran=$((ran + 1))
    echo "---- $title"
    timeout 600 "$@" 2>&1 | tee "$work/said" || code=$?
    if [ $code = 0 ]; then
        echo "---- $title: passed in $((SECONDS - begin)) s"
    else
        echo "---- $title: FAILED, exit code $code"
        failed=$((failed + 1))
        {
            echo "---- $title: FAILED, exit code $code"
            # A check that failed and what it found; of a suite without checks, its last words.
            grep -A 3 '^FAIL' "$work/said" | grep -v '^ok' || tail -n 6 "$work/said"
        } >>"$failures"
    fi
}
python=$STOCK/bin/python

conformance/live/setup.sh
cargo build --quiet "${build[@]}"
cargo build --quiet -p yarp-ports --example mjpeg_images
cargo build --quiet -p yarp-wire --example bottle --example typed --example settings

# Suites that start their name servers themselves.
try_programs() {
    suite "text of bottles" "$with_stock" "$python" conformance/live/bottle_text.py target/debug/examples/bottle

    suite "configuration files and command lines" "$with_stock" "$python" conformance/live/settings.py \
        target/debug/examples/settings
    suite "where files are found" "$python" conformance/live/resources.py "$ours" "$with_stock"

    g++ -O1 -std=c++17 -include cstdint conformance/live/typed_peer.cpp -I"$stock_package/include" \
        -L"$stock_package/lib" -lYARP_os -lYARP_sig -lYARP_init -o "$work/typed_peer"
    suite "typed messages" "$with_stock" "$python" conformance/live/typed.py target/debug/examples/typed "$work/typed_peer"

    suite "applications of yarpmanager" "$python" conformance/live/applications.py "$ours" "$STOCK"

    suite "requests to the name server" "$python" conformance/live/name_server.py \
        --our-yarp "$ours" --stock-server "$with_stock" yarpserver
    suite "two hosts and a link that goes down and up" \
        python3 conformance/live/two_hosts.py "$ours" "$built/hosts"
    suite "what another host and another user may not do" python3 conformance/live/untrusted_peers.py "$ours"

    suite "VLC watches an image port" python3 conformance/live/vlc.py target/debug/examples/mjpeg_images

    suite "the page of the name server in a browser" "$python" conformance/web/name_server.py \
        --yarp "$ours" --with-stock "$with_stock" --out target/web
    suite "ports of ours in a browser" "$python" conformance/web/ports.py \
        --yarp "$ours" --pictures target/debug/examples/mjpeg_images --out target/web
    suite "pages of other origins in a browser" "$python" conformance/web/origins.py \
        --yarp "$ours" --pictures target/debug/examples/mjpeg_images
    # Only a build with the simulated table has it, as `make test` makes.
    tidy=""
    if "$ours" demo tidy --help >/dev/null 2>&1; then tidy=--tidy; fi
    suite "the live view in a browser" "$python" conformance/web/view.py --yarp "$ours" --out target/web $tidy
    # Only a build with the simulated table has it, as `make test` makes.
    if "$ours" demo reorder --help >/dev/null 2>&1; then
        suite "objects into slots, commanded by stock's Python" "$with_stock" "$python" conformance/live/reordering.py "$ours"
        suite "the cameras of a table in stock's viewer" "$with_stock" "$python" conformance/live/table_camera.py "$ours"
    fi

    suite "several name servers at once" "$python" conformance/live/namespaces.py \
        --stock-yarp "$STOCK/bin/yarp" --our-yarp "$ours"
    # Two networks, one server: what needs to make networks needs root.
    if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
    suite "a name server with legs in two networks" $as_root env STOCK="$STOCK" \
        conformance/live/networks.sh "$ours" "$with_stock"
}

# Suites of commands, which start a name server of "ours" and then one of "stock".
try_commands() {
    for server in ours stock; do
        suite "the yarp command, server: $server" "$python" conformance/live/cli.py \
            --stock-yarp "$STOCK/bin/yarp" --our-yarp "$ours" --server "$server"
        suite "connections that last, server: $server" "$python" conformance/live/lasting.py \
            --stock-yarp "$STOCK/bin/yarp" --our-yarp "$ours" --server "$server"
        suite "keys of auth.conf, server: $server" "$python" conformance/live/auth.py \
            --stock-yarp "$STOCK/bin/yarp" --our-yarp "$ours" --server "$server"
    done
}

# Suites with a name server of "ours" or of "stock".
try_server() {
    local server=$1 port=$2
    g++ -O1 -std=c++17 -include cstdint conformance/live/logger_peer.cpp -I"$stock_package/include" \
        -L"$stock_package/lib" -lYARP_logger -lYARP_os -lYARP_init -o "$work/logger_peer"
    export YARP_CONFIG_HOME=$work/$server YARP_DATA_HOME=$work/$server/data
    mkdir -p "$YARP_CONFIG_HOME"
    if [ "$server" = ours ]; then
        "$ours" server --ip 127.0.0.1 --socket $port --write >"$work/server.log" 2>&1 &
    else
        "$with_stock" yarpserver --ip 127.0.0.1 --socket $port --write >"$work/server.log" 2>&1 &
    fi
    running+=($!)
    until_ok "$ours" where
    # Whoever has no configuration finds the server by multicast: stock ours, ours stock's.
    if [ "$server" = ours ]; then finder=("$with_stock" yarp detect); else finder=("$ours" detect); fi
    suite "the other side finds the name server, server: $server" \
        env YARP_CONFIG_HOME="$work/empty" conformance/live/says.sh "port $port" "${finder[@]}"

    mkdir -p "$work/$server/tmp"
    suite "messages within one machine, server: $server" \
        env TMPDIR="$work/$server/tmp" YARP_RUNTIME_DIR="$work/$server/tmp" \
        "$with_stock" "$python" conformance/live/carriers.py "$ours" "$with_stock yarp"
    suite "clocks, server: $server" \
        "$with_stock" "$python" conformance/live/clock.py "$ours" "$with_stock yarp"
    suite "the log in stock's logger, server: $server" \
        "$with_stock" "$python" conformance/live/log_forwarding.py "$ours" "$work/logger_peer"
    # Stock's unix_stream needs this, or a user with a name.
    suite "copies of what ports receive, server: $server" \
        env TMPDIR="$work/$server/tmp" YARP_RUNTIME_DIR="$work/$server/tmp" \
        "$with_stock" "$python" conformance/live/copies.py "$ours" "$with_stock yarp"
    suite "pictures, server: $server" "$with_stock" "$python" conformance/live/mjpeg.py "$ours"
    suite "pages that talk in frames, server: $server" \
        "$with_stock" "$python" conformance/live/websocket.py "$ours" "$with_stock yarp"

    "$ours" up --name /wam --cartesian >"$work/up.log" 2>&1 &
    arm=$!
    running+=($arm)
    until_ok "$ours" exists /wam/stateExt:o
    for carrier in tcp udp; do
        suite "stock remote_controlboard over $carrier, server: $server" \
            "$with_stock" "$python" conformance/live/remote_controlboard.py /wam $carrier
    done
    suite "stock's yarp read hears the ends of moves, server: $server" \
        "$with_stock" "$python" conformance/live/finished_moves.py /wam "$with_stock yarp"
    suite "modifiers of carriers, server: $server" \
        "$with_stock" "$python" conformance/live/monitors.py "$ours" \
        depthimage_to_mono depthimage_to_rgb depthimage_compression_zlib
    suite "who is heard of several writers, server: $server" \
        "$with_stock" "$python" conformance/live/priority.py "$ours" "$with_stock yarp"
    until_ok "$ours" exists /cartController/wam/rpc:i
    suite "stock tools talk with the controller of a tool, server: $server" \
        "$with_stock" "$python" conformance/live/cartesian.py /cartController/wam
    suite "yarp up ends cleanly" bash -c "kill -INT $arm; for i in \$(seq 100); do kill -0 $arm 2>/dev/null || exit 0; sleep 0.1; done; exit 1"
    start_hand "$ours" "$work/$server/line-of-the-hand"
    suite "stock moves the fingers of a hand, and types to it, server: $server" \
        "$with_stock" "$python" conformance/live/hand.py /hand
    "$ours" up --arm dynamic --name /dynamic >"$work/dynamic.log" 2>&1 &
    running+=($!)
    until_ok "$ours" exists /dynamic/stateExt:o
    suite "stock remote_controlboard pushes an arm with masses, server: $server" \
        "$with_stock" "$python" conformance/live/dynamic_arm.py /dynamic
    left=$("$ours" name list | grep -c -e ' /wam/' -e ' /cartController/' || true)
    suite "no name is left behind" test "$left" = 0

    "$ours" up --arm embedded --name /embedded --ports 14321,14323 >"$work/embedded.log" 2>&1 &
    running+=($!)
    "$ours" wam-node --arm simulated --ports 14321,14323 >"$work/node.log" 2>&1 &
    running+=($!)
    until_ok "$ours" exists /embedded/stateExt:o
    suite "stock remote_controlboard drives an arm behind its PC, server: $server" \
        "$with_stock" "$python" conformance/live/embedded_arm.py /embedded

    "$with_stock" yarpdev --device controlBoard_nws_yarp --subdevice fakeMotionControl \
        --name /fake --period 0.02 --GENERAL::Joints 3 >"$work/fake.log" 2>&1 &
    running+=($!)
    until_ok "$ours" exists /fake/stateExt:o
    suite "our client drives stock's control board, server: $server" "$built/drive_stock" /fake
    suite "devices and robots from the same files, server: $server" \
        "$with_stock" "$python" conformance/live/hosting.py "$ours"

    suite "stock's client reads our sensors, and ours stock's, server: $server" \
        "$with_stock" "$python" conformance/live/analog_sensors.py "$ours"

    g++ -O1 -std=c++17 -include cstdint conformance/live/sensors_peer.cpp -I"$stock_package/include" \
        -L"$stock_package/lib" -lYARP_os -lYARP_sig -lYARP_dev -lYARP_init -o "$work/sensors_peer"
    suite "inertial sensors and torques of other programs, server: $server" \
        "$with_stock" "$python" conformance/live/inertial_and_torques.py "$ours" "$work/sensors_peer"

    suite "what servers of commands tell about their machine, server: $server" \
        "$with_stock" "$python" conformance/live/sysinfo.py "$ours"
    suite "terminals for commands, server: $server" \
        "$with_stock" "$python" conformance/live/run_terminals.py "$ours"
    suite "port names of a robot with fakes, server: $server" \
        "$with_stock" "$python" conformance/live/robot_port_names.py "$ours"

    "$ours" camera --name /eye --mode grid --width 32 --height 24 >"$work/camera.log" 2>&1 &
    running+=($!)
    until_ok "$ours" exists /eye
    "$ours" camera --name /fire --mode grid --width 32 --height 24 --firewire >"$work/firewire.log" 2>&1 &
    running+=($!)
    until_ok "$ours" exists /fire
    suite "stock's clients look through our camera, server: $server" \
        "$with_stock" "$python" conformance/live/frame_grabber.py /eye /fire
    "$with_stock" yarpdev --device frameGrabber_nws_yarp --subdevice fakeFrameGrabber \
        --name /fakecam --width 32 --height 24 --mode line >"$work/fakecam.log" 2>&1 &
    running+=($!)
    until_ok "$ours" exists /fakecam
    suite "our client looks through stock's camera, server: $server" "$built/drive_camera" /fakecam 3.x
    stop
}

case ${PART:-all} in
all)
    try_programs
    try_commands
    # Numbers that the first server gave out may still be busy.
    try_server ours 15510
    try_server stock 16510
    ;;
programs) try_programs ;;
commands) try_commands ;;
ours) try_server ours 15510 ;;
stock) try_server stock 16510 ;;
none) exit 0 ;;
*)
    echo "live: PART is programs, commands, ours, stock or none, not $PART" >&2
    exit 1
    ;;
esac

if [ $failed != 0 ]; then
    tail -n 40 "$failures"
    echo "live: $failed suites failed"
    exit 1
fi
if [ $ran = 0 ]; then
    echo "live: no suite has \"$only\" in its title" >&2
    exit 1
fi
echo "live: against stock $peer passed suites${only:+ with \"$only\" in their title}: $ran"
