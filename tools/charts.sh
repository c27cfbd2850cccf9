#!/usr/bin/env bash
# Runs the suites (all, or those named) and puts their charts and tables into docs/charts. Stopped and started again, it
# goes on where it was. The reports with pictures stay in build/charts/SUITE/report.html.
#
#     tools/charts.sh                  # everything: under an hour on two cores
#     tools/charts.sh error-time       # one suite
set -euo pipefail
cd "$(dirname "$0")/.."

tools/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release --target lanternfield scenes -- --quiet

suites=("$@")
[ ${#suites[@]} -gt 0 ] || for file in assets/suites/*.json; do suites+=("$(basename "$file" .json)"); done

mkdir -p docs/charts
for suite in "${suites[@]}"; do
  out=build/charts/$suite
  build/lanternfield bench "assets/suites/$suite.json" -o "$out" --references build/charts/references
  cp "$out/report.md" "docs/charts/$suite.md"
  for chart in "$out"/*.svg; do
    [ ! -e "$chart" ] || cp "$chart" docs/charts/
  done
done
