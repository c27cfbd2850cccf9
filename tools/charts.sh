#!/usr/bin/env bash
# Runs the suites (all, or those named) and puts their charts and tables into docs/charts. Stopped and started again, it
# goes on where it was. The reports with pictures stay in build/charts/SUITE/report.html.
#
#     tools/charts.sh                  # everything: about an hour on two cores
#     tools/charts.sh error-time       # one suite
#     tools/charts.sh motion           # the scripts of assets/playback, by `lanternfield stability`
set -euo pipefail
cd "$(dirname "$0")/.."

tools/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release --target lanternfield scenes -- --quiet

suites=("$@")
[ ${#suites[@]} -gt 0 ] || {
  for file in assets/suites/*.json; do suites+=("$(basename "$file" .json)"); done
  suites+=(motion)
}

# Scripts, the frames that are measured, and what their references are.
motion_scripts='
slow_pan 16:34 --reference-vpls 20000
moving_sun 16:30 --reference-spp 48
swinging_door 28:76 --reference-spp 64
still 88:120 --reference-spp 64
light_switch 28:60 --reference-spp 32
fast_pan 0:16 --reference-vpls 20000
lanterns 16:24 --reference-spp 32
dancers 30:40 --reference-spp 32
'

# One page for all scripts: tables, and the flicker over the frames.
motion() {
  local page=build/charts/motion.md script range reference
  mkdir -p build/charts
  cat > "$page" <<END
# Motion

\`lanternfield stability\` plays a script with TAA on the shadow ratio, which is the default, on the shadowed light, which
is what the paper rejects, and without, and with VPLs from new random numbers in every frame; it measures each frame
against a reference of that frame, 160x90. The reports with pictures stay in build/charts/motion.

Flicker (ii): change from frame to frame that the reference does not have, over its mean light. FLIP (iv): of a frame.
Deviation (i): standard deviation over mean of a pixel over the last 32 frames. Frames to settle (iii): until the light,
over the reference's, stays within 5 % of what it comes to before the next event.

References are path traced (spp), or, where the camera moves, all of so many VPLs of another seed at every pixel: the
noise of a path tracer would move with the picture, and count as flicker (with 256 samples it counted for 0.047). In the
lanterns, whose lights move too, it is nearly all that counts.
END
  while read -r script range reference; do
    [ -n "$script" ] || continue
    local out=build/charts/motion/$script
    # shellcheck disable=SC2086
    build/lanternfield stability "assets/playback/$script.json" -o "$out" --range "$range" $reference \
      --references build/charts/motion/references </dev/null
    cp "$out/flicker.svg" "docs/charts/motion-$script.svg"
    { printf '\n## %s, frames %s, %s\n\n' "$script" "$range" "${reference#--reference-}"
      grep '^|' "$out/report.md"
      printf '\n![Flicker by frame](motion-%s.svg)\n' "$script"; } >> "$page"
  done <<<"$motion_scripts"
  mv "$page" docs/charts/motion.md
}

mkdir -p docs/charts
for suite in "${suites[@]}"; do
  if [ "$suite" = motion ]; then motion; continue; fi
  out=build/charts/$suite
  build/lanternfield bench "assets/suites/$suite.json" -o "$out" --references build/charts/references
  cp "$out/report.md" "docs/charts/$suite.md"
  for chart in "$out"/*.svg; do
    [ ! -e "$chart" ] || cp "$chart" docs/charts/
  done
done
