#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test: those that need no GPU under AddressSanitizer and UBSan too.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release -- --quiet
exec ctest --test-dir build --output-on-failure -j "$(nproc)"
