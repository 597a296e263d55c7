#!/usr/bin/env bash
# The CAN driver of the arm against simulated pucks on a CAN bus of a real kernel: `devices/examples/arm_on_vcan`.
set -euo pipefail
cd "$(dirname "$0")/../.."
DEADLINE="${CAN_DEADLINE:-600}" conformance/kernel/boot.sh can arm_on_vcan conformance/can \
    "YARP_CAN_HISTORIES=${YARP_CAN_HISTORIES:-2}" "YARP_CAN_FIRST_HISTORY=${YARP_CAN_FIRST_HISTORY:-0}"
