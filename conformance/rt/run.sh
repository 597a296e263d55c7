#!/usr/bin/env bash
# The control loop of the arm with its real-time settings, `devices/examples/arm_in_real_time`, on Debian's kernel with
# PREEMPT_RT and on the ordinary one: whether the settings are in effect, and how late the periods begin under load. Then the settings alone on two
# processors, one of which the thread is kept off: QEMU counts no instructions there, so that the clock is this machine's.
set -euo pipefail
cd "$(dirname "$0")/../.."
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

on() {
    echo "rt: $1, processors: ${PROCESSORS:-1}"
    KERNEL="$1" CONSOLE="$work/$1-${PROCESSORS:-1}" DEADLINE="${RT_DEADLINE:-600}" \
        conformance/kernel/boot.sh rt arm_in_real_time conformance/rt "YARP_REALTIME_KERNEL=$2" "${@:3}"
}

on linux-image-rt-amd64 1
on linux-image-amd64 0
PROCESSORS=2 CLOCK="-accel tcg,thread=multi" on linux-image-rt-amd64 1 YARP_REALTIME_PROCESSOR=1
echo "rt: delays of control periods"
for kernel in linux-image-rt-amd64 linux-image-amd64; do
    printf '%-22s %s\n' "$kernel" "$(grep -ao 'delays of control periods: .*' "$work/$kernel-1" | cut -d: -f2-)"
done
