#!/usr/bin/env bash
# Makes sure that what the test with etcd needs is there: etcd, iproute2, and protoc for the build.
set -euo pipefail

needed=()
command -v etcd >/dev/null || needed+=(etcd-server)
command -v etcdctl >/dev/null || needed+=(etcd-client)
command -v ip >/dev/null || needed+=(iproute2)
command -v protoc >/dev/null || needed+=(protobuf-compiler)
[ -e /usr/include/google/protobuf/descriptor.proto ] || needed+=(libprotobuf-dev)
"$(dirname "$0")/../install_packages.sh" "${needed[@]}"
