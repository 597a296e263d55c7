#!/usr/bin/env bash
# The driver of IIDC cameras on a simulated camera at the far end of the virtual USB of a real kernel: `devices/examples/iidc_on_usb`, with
# libdc1394, libusb and the kernel's module `vhci-hcd`.
set -euo pipefail
cd "$(dirname "$0")/../.."
library() { ldconfig -p | sed -n "s|.*libdc1394\.so\.[0-9]* .*=> ||p" | head -n 1; }
[ -n "$(library)" ] || conformance/install_packages.sh libdc1394-25
LIBRARIES="$(library)" DEADLINE="${CAMERA_DEADLINE:-600}" conformance/kernel/boot.sh iidc iidc_on_usb conformance/iidc
