#!/usr/bin/env bash
# Installs those of the named Debian packages that are not installed: `install_packages.sh PACKAGE...`. Needs root or sudo.
set -euo pipefail

missing=()
for package in "$@"; do
    status=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) || status=unknown
    [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} != 0 ] || exit 0
if ! command -v apt-get >/dev/null; then
    echo "setup: install what Debian has in ${missing[*]}, then try again" >&2
    exit 1
fi

echo "setup: installing ${missing[*]}"
if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
# Two of these scripts at once: the lists of packages have a lock that `apt-get` does not wait for.
exec 9<"$0"
flock 9
$as_root apt-get update -q
# Only programs are wanted, no services of the machine's own: none starts at runlevel 1.
$as_root env RUNLEVEL=1 DEBIAN_FRONTEND=noninteractive \
    apt-get -o DPkg::Lock::Timeout=300 install -y -q --no-install-recommends "${missing[@]}" </dev/null
