#!/usr/bin/env bash
# Runs an example of yarp-devices on Debian's kernel, booted in QEMU in software, and waits for its verdict on the serial console.
#
#   boot.sh NAME EXAMPLE FOLDER [PARAMETER=VALUE...]
#
# FOLDER has `modules`, a kernel module and its parameters per line in the order of loading, and `test`, the script that the
# first process runs. The kernel hands parameters that it does not know to that process, as variables.
#
# KERNEL is Debian's package of the kernel, CACHE where it is kept unpacked, DEADLINE the seconds until the machine counts as
# hung, PROCESSORS how many the machine has (1), LIBRARIES the files of libraries that the program loads by itself, CLOCK the option of QEMU for
# its clock: by default it counts instructions, so that a busy host makes the machine slow but never late. The last line of its console is the
# verdict, and `$CONSOLE` has all of them.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
cd "$here/../.."
name="$1"
example="$2"
folder="$3"
shift 3

KERNEL="${KERNEL:-linux-image-amd64}"
CACHE="${CACHE:-$HOME/.cache/debian-kernel/$KERNEL}"
DEADLINE="${DEADLINE:-600}"
PROCESSORS="${PROCESSORS:-1}"
CLOCK="${CLOCK:--icount shift=1,sleep=off}"

fail() {
    echo "$name: $*" >&2
    exit 1
}

modules_of() {
    cat conformance/*/modules | grep -o '^[a-z][^ ]*' | sort -u
}

# The modules of all tests, so that one package serves them.
"$here/prepare.sh" "$CACHE" "$KERNEL" $(modules_of)
cargo build -p yarp-devices --example "$example"
program="${CARGO_TARGET_DIR:-target}/debug/examples/$example"

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
disk="$work/disk"
CONSOLE="${CONSOLE:-$work/console}"
mkdir -p "$disk"/{bin,dev,modules,proc,sys,tmp}
cp "$CACHE/busybox" "$disk/bin/busybox"
for command in sh ip; do ln -s busybox "$disk/bin/$command"; done
cp "$program" "$disk/bin/$example"
cp "$folder/modules" "$disk/modules/order"
while read -r module _; do cp "$CACHE/$module.ko" "$disk/modules/"; done <"$folder/modules"
for file in ${LIBRARIES:-}; do
    mkdir -p "$disk$(dirname "$file")"
    cp -L "$file" "$disk$file"
done
for file in "$program" ${LIBRARIES:-}; do ldd "$file"; done | grep -o '/[^ ]*' | while read -r library; do
    mkdir -p "$disk$(dirname "$library")"
    cp -L "$library" "$disk$library"
done
cp "$folder/test" "$disk/test"
cp "$here/init" "$disk/init"
chmod +x "$disk/init"
(cd "$disk" && find . | "$CACHE/busybox" cpio -o -H newc 2>"$work/cpio") | gzip -1 >"$work/initrd" ||
    fail "no RAM disk could be made: $(cat "$work/cpio")"

status=0
timeout "$DEADLINE" qemu-system-x86_64 -M pc -cpu max -smp "$PROCESSORS" -m 256 $CLOCK \
    -kernel "$CACHE/vmlinuz" -initrd "$work/initrd" -append "console=ttyS0 quiet panic=-1 $*" \
    -nodefaults -no-reboot -display none -serial stdio </dev/null 2>&1 | tee "$CONSOLE" || status=$?
[ "$status" = 0 ] || fail "the virtual machine ended with $status (124: after $DEADLINE s); try again with more seconds"
grep -aq '^VERDICT: all [1-9][0-9]* scenarios hold' "$CONSOLE" ||
    fail "no verdict that all scenarios hold; see the console above"
