#!/usr/bin/env bash
# Installs what is missing, builds, renders the atrium, and says where the picture is.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release --target lanternfield scenes -- --quiet
build/lanternfield render build/scenes/atrium.glb --shadow-samples 4 --interleave 2 -o build/atrium.png "$@"
echo "The picture is $PWD/build/atrium.png"
