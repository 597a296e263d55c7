#!/usr/bin/env bash
# Checks that each library builds alone: without features, and with each of its features. Warnings are errors.
#
#   features.sh                  all crates
#   features.sh yarp-ports       one
#
# A set of features that equals another one that is checked anyway is left out.
set -euo pipefail
cd "$(dirname "$0")/.."

# A crate per line, and its sets of features; `-` is none.
SETS='
yarp-wire           -
yarp-ports          - jpeg shmem zlib tls jpeg,shmem,tls,zlib latency-ablation
yarp-nameserver     - sqlite
yarp-devices        - image-files barrett v4l2 dc1394
yarp-wrappers       -
yarp-hosting        - v4l2 dc1394
yarp-client-derive  -
yarp-client         - jpeg shmem zlib tls barrett
yarp-planning       -
yarp-cli            - table v4l2 dc1394
'

failed=0
while read -r crate sets; do
    [[ -z $crate || ( $# -gt 0 && $1 != "$crate" ) ]] && continue
    for set in $sets; do
        [[ $set == - ]] && set=
        log=$(cargo check --quiet -p "$crate" --no-default-features --features "$set" 2>&1) && result=ok || result=FAILED
        # Warnings in the flags of the compiler would make it check all dependencies again.
        [[ $log == *warning* ]] && result=FAILED
        printf '%-20s %-22s %s\n' "$crate" "${set:-(none)}" "$result"
        if [[ $result != ok ]]; then
            printf '%s\n' "$log"
            failed=1
        fi
    done
done <<< "$SETS"
exit "$failed"
