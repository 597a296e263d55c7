#!/usr/bin/env bash
# Makes sure that QEMU is there, and in the folder $1 Debian's kernel of the package $2, a busybox, and the modules $3...
# The kernel's package is only unpacked: installing it would make an initramfs and ask boot loaders.
set -euo pipefail
cache="$1"
package="$2"
shift 2
modules="$*"

if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
command -v qemu-system-x86_64 >/dev/null || "$(dirname "$0")/../install_packages.sh" qemu-system-x86

# Two tests at once do not unpack into the same folder.
mkdir -p "$cache"
exec 9>"$cache/lock"
flock 9

whole=yes
for file in vmlinuz busybox $(printf '%s.ko ' $modules); do [ -s "$cache/$file" ] || whole=no; done
[ "$whole" = no ] || exit 0

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"

newest_kernel() {
    apt-cache depends "$package" 2>/dev/null | grep -o 'linux-image-[0-9][^ ]*' | head -n 1
}

download() {
    kernel="$(newest_kernel)" && apt-get download -q "$kernel" busybox-static
}

# The lists of packages may be missing, or older than what the server still has.
download 2>/dev/null || { $as_root apt-get update -q && download; } || {
    echo "kernel: $package and busybox-static cannot be downloaded; try apt-get update and the network" >&2
    exit 1
}
echo "kernel: unpacking $kernel"
for archive in *.deb; do dpkg -x "$archive" unpacked; done
mkdir -p whole
cp unpacked/boot/vmlinuz-* whole/vmlinuz
cp unpacked/bin/busybox whole/busybox
for module in $modules; do
    found="$(find unpacked/lib/modules -name "$module.ko*" | head -n 1)"
    [ -n "$found" ] || {
        echo "kernel: $kernel has no module $module" >&2
        exit 1
    }
    case "$found" in
        *.xz) xz -dc "$found" >"whole/$module.ko" ;;
        *.zst) zstd -dc "$found" >"whole/$module.ko" ;;
        *) cp "$found" "whole/$module.ko" ;;
    esac
done
# Modules of another version do not fit to this kernel.
rm -f "$cache"/*.ko
cp whole/* "$cache/"
