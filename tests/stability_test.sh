#!/bin/bash
# What a user sees of `lanternfield stability`: files, exit codes, references that are kept, and numbers that make sense.
# usage: stability_test.sh LANTERNFIELD
set -u
program=$(realpath "$1")
scene=$(dirname "$program")/scenes/cornell.glb
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "failed: $*"
  cat "$work/stdout" "$work/stderr"
  exit 1
}
run() {
  "$program" "$@" > "$work/stdout" 2> "$work/stderr"
}

cat > "$work/switch.json" << END
{
  "scene": "$scene", "duration": 0.4, "frame_rate": 30,
  "settings": {"vpls": 500},
  "lights": [{"name": "fill", "type": "point", "intensity": 30, "position": [1.6, 4, 1.8]}],
  "events": [{"time": 0.13, "light": "lamp", "on": false}]
}
END
sed 's/"on": false/"on": 0/' "$work/switch.json" > "$work/wrong.json"

# ---- Wrong usage
run stability; [ $? = 2 ] || fail "no script"
run stability "$work/switch.json"; [ $? = 2 ] || fail "no folder"
run stability "$work/switch.json" -o "$work/out" --taa off; [ $? = 1 ] || fail "--taa"
run stability "$work/switch.json" -o "$work/out" --range 3:3; [ $? = 1 ] || [ $? = 2 ] || fail "an empty range"
run stability "$work/switch.json" -o "$work/out" --range 3:99; [ $? = 1 ] || fail "a range beyond the script"
run stability "$work/wrong.json" -o "$work/out"; [ $? = 1 ] || fail "a wrong script"
grep -q "wrong.json:" "$work/stderr" || fail "the error names no place"
run stability --help || fail "--help"
grep -q -- "--reference-spp" "$work/stdout" || fail "--help lacks an option"

# ---- A run
measure() {
  run stability "$work/switch.json" -o "$work/$1" --size 24x24 --reference-spp 4 --references "$work/references" \
    || fail "exit code $?"
}
measure first
for file in report.html report.md frames.csv strip.png; do
  [ -s "$work/first/$file" ] || fail "$file is missing"
done
[ "$(wc -l < "$work/first/frames.csv")" = $((1 + 4 * 12)) ] || fail "frames.csv: rows"
[ "$(find "$work/references" -name '*.exr' | wc -l)" = 12 ] || fail "references"
grep -q "lamp off at 4" "$work/first/report.md" || fail "the event is not in the report"
if grep -q "nan\|inf" "$work/first/frames.csv"; then fail "a number is not one"; fi
# Where a light goes out, the reference's light falls, and the picture's with it.
awk -F, 'NR > 1 && ($6 < 0.5 || $6 > 2) { exit 1 }' "$work/first/frames.csv" || fail "energy"

# ---- The references are kept, and the report is the same
find "$work/references" -name '*.exr' -exec md5sum {} + | sort > "$work/before"
measure second
find "$work/references" -name '*.exr' -exec md5sum {} + | sort | cmp - "$work/before" || fail "references were made anew"
cmp "$work/first/frames.csv" "$work/second/frames.csv" || fail "two runs differ"
grep -q "references:" "$work/stderr" "$work/stdout" && fail "references took time again"
echo passed
