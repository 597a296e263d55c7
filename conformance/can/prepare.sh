#!/usr/bin/env bash
# Makes sure that QEMU is there, and in the folder $1 Debian's kernel, its CAN modules and a busybox.
# The kernel's package is only unpacked: installing it would make an initramfs and ask boot loaders.
set -euo pipefail
cache="$1"
wanted="vmlinuz busybox can.ko can-raw.ko can-dev.ko vcan.ko"

if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
if ! command -v qemu-system-x86_64 >/dev/null; then
    echo "can: installing QEMU"
    $as_root apt-get update -q
    $as_root apt-get install -y -q --no-install-recommends qemu-system-x86 </dev/null
fi

whole=yes
for file in $wanted; do [ -s "$cache/$file" ] || whole=no; done
[ "$whole" = no ] || exit 0

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"

newest_kernel() {
    apt-cache depends linux-image-amd64 2>/dev/null | grep -o 'linux-image-[0-9][^ ]*' | head -n 1
}

download() {
    kernel="$(newest_kernel)" && apt-get download -q "$kernel" busybox-static
}

# The lists of packages may be missing, or older than what the server still has.
download 2>/dev/null || { $as_root apt-get update -q && download; } || {
    echo "can: linux-image-amd64 and busybox-static cannot be downloaded; try apt-get update and the network" >&2
    exit 1
}
echo "can: unpacking $kernel"
for package in *.deb; do dpkg -x "$package" unpacked; done
mkdir -p whole
cp unpacked/boot/vmlinuz-* whole/vmlinuz
cp unpacked/bin/busybox whole/busybox
for module in can can-raw can-dev vcan; do
    found="$(find unpacked/lib/modules -name "$module.ko*" | head -n 1)"
    [ -n "$found" ] || {
        echo "can: $kernel has no module $module" >&2
        exit 1
    }
    case "$found" in
        *.xz) xz -dc "$found" >"whole/$module.ko" ;;
        *.zst) zstd -dc "$found" >"whole/$module.ko" ;;
        *) cp "$found" "whole/$module.ko" ;;
    esac
done
mkdir -p "$cache"
cp whole/* "$cache/"
