# Sourced by the scripts of the live suites, which put the processes they start into `running`: those end with the script,
# and so does the folder `$work`.
work=$(mktemp -d)
running=()
stop() {
    for process in "${running[@]}"; do
        kill "$process" 2>/dev/null || true
    done
    for process in "${running[@]}"; do
        for _ in $(seq 50); do
            kill -0 "$process" 2>/dev/null || break
            sleep 0.1
        done
        kill -KILL "$process" 2>/dev/null || true
        wait "$process" 2>/dev/null || true
    done
    running=()
}
trap 'stop; rm -rf "$work"' EXIT

# Waits until a command succeeds, half a minute at the most.
until_ok() {
    for _ in $(seq 150); do
        if "$@" >/dev/null 2>&1; then return 0; fi
        sleep 0.2
    done
    echo "live: gave up waiting for: $*" >&2
    return 1
}

# Starts a simulated hand on a serial line and its control board, and waits for the board: start_hand OUR_YARP LINE.
start_hand() {
    "$1" hand-sim --link "$2" >"$work/hand-sim.log" 2>&1 &
    running+=($!)
    until_ok test -e "$2"
    "$1" hand-board --serial "$2" >"$work/hand-board.log" 2>&1 &
    running+=($!)
    until_ok "$1" exists /hand/hand/rpc:i
}
