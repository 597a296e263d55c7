#!/usr/bin/env bash
# Our control boards, cameras, hand, controller of a tool and typed messages against live stock YARP 4.0, in both directions. Fails, and never skips, when stock is missing.
#
#   STOCK4_SOURCE   sources of YARP 4.0.0
#   STOCK4_BUILD    a build of them, with the plugins fakeMotionControl, controlBoard_nws_yarp, frameGrabber_nws_yarp
#                   and frameGrabber_nwc_yarp
set -euo pipefail
cd "$(dirname "$0")/../.."
: "${STOCK4_SOURCE:?set it to the sources of YARP 4.0.0}" "${STOCK4_BUILD:?set it to a build of them}"

. conformance/live/running.sh

include=("-I$STOCK4_BUILD/src/devices/messages/ControlBoardMsgs")
for library in conf os sig dev math companion; do
    for root in "$STOCK4_SOURCE/src" "$STOCK4_BUILD/src"; do
        for folder in "$root/libYARP_$library/src" "$root/libYARP_$library/idl_generated_code"; do
            if [ -d "$folder" ]; then include+=("-I$folder"); fi
        done
    done
done
libraries=("-L$STOCK4_BUILD/lib" -lYARP_dev -lYARP_sig -lYARP_os -lYARP_init -lYARP_math "-Wl,-rpath,$STOCK4_BUILD/lib")
client=$STOCK4_SOURCE/src/devices/networkWrappers/controlBoard_nwc_yarp
messages=$STOCK4_BUILD/src/devices/messages/ControlBoardMsgs/CMakeFiles/ControlBoardMsgs.dir
g++ -std=c++17 -O1 "-I$client" "${include[@]}" conformance/live/control_board_4.cpp "$client"/*.cpp "$messages"/*.o \
    "${libraries[@]}" -o "$work/client"
g++ -std=c++17 -O1 "${include[@]}" conformance/live/fake_board_4.cpp "${libraries[@]}" -o "$work/board"
g++ -std=c++17 -O1 "${include[@]}" conformance/live/caller_4.cpp "${libraries[@]}" -o "$work/caller"
g++ -std=c++17 -O1 "${include[@]}" conformance/live/words_4.cpp "${libraries[@]}" -o "$work/words"
g++ -std=c++17 -O1 "${include[@]}" conformance/live/typed_peer.cpp "${libraries[@]}" -o "$work/typed_peer"
grabber=$STOCK4_SOURCE/src/devices/fake/fakeFrameGrabber
g++ -std=c++17 -O1 "-I$grabber" "${include[@]}" conformance/live/frame_grabber_4.cpp "$grabber"/*.cpp \
    "${libraries[@]}" -o "$work/grabber"

cargo build --quiet --release -p yarp-cli -p yarp-conformance
cargo build --quiet -p yarp-wire --example typed
target=${CARGO_TARGET_DIR:-target}/release
export YARP_CONFIG_HOME=$work YARP_FORWARD_LOG_ENABLE=0
export YARP_DATA_DIRS=$STOCK4_BUILD/share/yarp LD_LIBRARY_PATH=$STOCK4_BUILD/lib:$STOCK4_BUILD/lib/yarp
echo "---- typed messages of both"
timeout 300 python3 conformance/live/typed.py "$target/../debug/examples/typed" "$work/typed_peer" 4.0
"$target/yarp" server --ip 127.0.0.1 --socket 18510 --write >"$work/server.log" 2>&1 &
running+=($!)
until_ok "$target/yarp" where
"$target/yarp" up --name /wam --cartesian >"$work/up.log" 2>&1 &
running+=($!)
until_ok "$target/yarp" exists /wam/stateExt:o
for carrier in fast_tcp tcp udp; do
    echo "---- stock 4.0 client over $carrier"
    timeout 300 "$work/client" /wam "/live4/$carrier" "$carrier" 2>"$work/client.log"
done
echo "---- a program of stock 4.0 types 3.x's words"
timeout 120 "$work/caller" /wam/rpc:i
echo "---- a program of stock 4.0 hears how moves end"
timeout 300 "$work/words" moves /wam 2>"$work/moves.log"
until_ok "$target/yarp" exists /cartController/wam/rpc:i
for carrier in udp tcp; do
    echo "---- a program of stock 4.0 moves the tool as iCub's client does, over $carrier"
    timeout 400 "$work/words" tool /cartController/wam $carrier 2>"$work/tool.log"
done
start_hand "$target/yarp" "$work/line"
echo "---- a program of stock 4.0 calls the hand as a whole"
timeout 300 "$work/words" hand /hand 2>"$work/hand.log"
"$work/board" /fake4 600 >"$work/board.log" 2>&1 &
running+=($!)
until_ok "$target/yarp" exists /fake4/stateExt:o
echo "---- our client drives stock's control board of 4.0"
timeout 300 "$target/drive_stock" /fake4
"$target/yarp" camera --name /eye --mode grid --width 32 --height 24 >"$work/camera.log" 2>&1 &
running+=($!)
until_ok "$target/yarp" exists /eye
echo "---- stock 4.0 looks through our camera"
timeout 300 "$work/grabber" look /eye /live4/eye 2>"$work/look.log"
"$target/yarp" camera --name /fire --mode grid --width 32 --height 24 --firewire >"$work/firewire.log" 2>&1 &
running+=($!)
until_ok "$target/yarp" exists /fire
timeout 300 "$work/grabber" wire /fire /live4/fire 2>"$work/wire.log"
"$work/grabber" serve /fakecam4 600 >"$work/fakecam.log" 2>&1 &
running+=($!)
until_ok "$target/yarp" exists /fakecam4
echo "---- our client looks through stock's camera of 4.0"
timeout 300 "$target/drive_camera" /fakecam4 4.0
echo "live: everything passed against stock 4.0"
