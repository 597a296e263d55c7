#!/usr/bin/env bash
# The CAN driver of the arm against simulated pucks on a CAN bus of a real kernel.
#
# Boots Debian's kernel in QEMU, in software, with a RAM disk that holds its CAN modules, busybox and the program
# `devices/examples/arm_on_vcan`, and waits for that program's verdict on the serial console. The virtual machine's clock counts instructions
# (-icount), so that a busy host makes it slow but never late.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
cd "$here/../.."

CACHE="${CAN_CACHE:-$HOME/.cache/can-kernel}"
DEADLINE="${CAN_DEADLINE:-600}" # seconds until the machine counts as hung
MODULES="can can-raw can-dev vcan" # as in prepare.sh and init

fail() {
    echo "can: $*" >&2
    exit 1
}

"$here/prepare.sh" "$CACHE"
cargo build -p yarp-devices --example arm_on_vcan
program="${CARGO_TARGET_DIR:-target}/debug/examples/arm_on_vcan"

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
disk="$work/disk"
mkdir -p "$disk"/{bin,dev,modules,proc,sys,tmp}
cp "$CACHE/busybox" "$disk/bin/busybox"
for name in sh ip; do ln -s busybox "$disk/bin/$name"; done
cp "$program" "$disk/bin/arm_on_vcan"
for module in $MODULES; do cp "$CACHE/$module.ko" "$disk/modules/"; done
ldd "$program" | grep -o '/[^ ]*' | while read -r library; do
    mkdir -p "$disk$(dirname "$library")"
    cp -L "$library" "$disk$library"
done
cp "$here/init" "$disk/init"
chmod +x "$disk/init"
(cd "$disk" && find . | "$CACHE/busybox" cpio -o -H newc 2>"$work/cpio") | gzip -1 >"$work/initrd" ||
    fail "no RAM disk could be made: $(cat "$work/cpio")"

# The kernel hands parameters that it does not know to the first process, as variables.
histories="YARP_CAN_HISTORIES=${YARP_CAN_HISTORIES:-2} YARP_CAN_FIRST_HISTORY=${YARP_CAN_FIRST_HISTORY:-0}"
status=0
timeout "$DEADLINE" qemu-system-x86_64 -M pc -cpu max -smp 1 -m 256 -icount shift=1,sleep=off \
    -kernel "$CACHE/vmlinuz" -initrd "$work/initrd" -append "console=ttyS0 quiet panic=-1 $histories" \
    -nodefaults -no-reboot -display none -serial stdio </dev/null 2>&1 | tee "$work/console" || status=$?
[ "$status" = 0 ] || fail "the virtual machine ended with $status (124: after $DEADLINE s); try again with CAN_DEADLINE"
grep -aq '^VERDICT: all [1-9][0-9]* scenarios hold' "$work/console" ||
    fail "no verdict that all scenarios hold; see the console above"
