#!/usr/bin/env bash
# Two name servers on three members of etcd, in network namespaces: see servers.py. With stock YARP in
# STOCK its tools are tried, too. `make test-etcd` builds what is needed.
set -euo pipefail
cd "$(dirname "$0")/../.."

options=()
if [ -n "${STOCK:-}" ] && [ -x "$STOCK/bin/yarp" ]; then
    options=(--with-stock "$PWD/conformance/stock/with_stock")
fi
if [ "$(id -u)" = 0 ]; then as_root=""; else as_root="sudo"; fi
exec $as_root env STOCK="${STOCK:-}" python3 conformance/etcd/servers.py \
    "${CARGO_TARGET_DIR:-target}/debug/yarp" "${options[@]}"
