#!/usr/bin/env bash
# The camera driver on the virtual camera of a real kernel: `devices/examples/camera_on_vivid` with the kernel's module `vivid`.
set -euo pipefail
cd "$(dirname "$0")/../.."
DEADLINE="${CAMERA_DEADLINE:-600}" conformance/kernel/boot.sh camera camera_on_vivid conformance/camera
