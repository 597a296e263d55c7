#!/usr/bin/env bash
# Runs a command and succeeds if a line of what it prints ends with the words given.
set -euo pipefail
words=$1
shift
said=$("$@")
echo "$said"
grep -q "$words\$" <<<"$said"
