#!/usr/bin/env bash
# `lanternfield bench`: a tiny suite, measured once, found again, killed in the middle and continued; and the suites that
# it refuses.
# usage: bench_test.sh path/to/lanternfield
set -u

lanternfield=$(realpath "$1")
scene=$(dirname "$lanternfield")/scenes/cornell.glb
{ [ -x "$lanternfield" ] && [ -s "$scene" ]; } || { echo "$lanternfield or its scenes are not built"; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0

fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

bench() {
  "$lanternfield" bench "$@" >stdout 2>stderr
}

# suite FILE CONFIGURATIONS [MORE]: a suite of one view.
suite() {
  cat >"$1" <<EOT
{
  "name": "tiny", "title": "Tiny", "repeats": 2, "warm_up": 0, ${3:-}
  "settings": {"size": "64x36", "vpls": 1000, "frames": 3},
  "views": [{"name": "box", "scene": "$scene"}],
  "configurations": [$2]
}
EOT
}

# column FILE CONFIGURATION NAME: a number of results.csv. No column before "device" holds a comma here.
column() {
  awk -F, -v configuration="$2" -v name="$3" '
    NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) column = i }
    NR > 1 && $3 == configuration { print column ? $column : "no column" }' "$1"
}

is_number() {
  [[ $1 =~ ^-?[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?$ ]]
}

# lines JOURNAL KIND [WORD]: how many lines of a kind hold a word.
lines() {
  grep -F "\"kind\":\"$2\"" "$1" 2>/dev/null | grep -cF -- "${3:-}"
}

# wait_for PROCESS COMMAND...: until the command succeeds.
wait_for() {
  local process=$1
  shift
  until "$@"; do
    kill -0 "$process" 2>/dev/null || { fail "ended too early: $(cat stderr)"; return; }
    sleep 0.05
  done
}

references='"references": [{"name": "truth", "settings": {"method": "path", "spp": 16}}],'
charts='"charts": [{"name": "time", "title": "Time", "x": "alpha", "y": "frame_ms", "lines": true}],
  "tables": [{"title": "All", "columns": ["frame_ms", "truth.relative_l2", "ms:lgh_build/merge"]}],
  "pictures": [{"title": "Lights", "what": "lights-per-pixel", "configurations": ["alpha=1"]}],'
sweep='{"sweep": {"alpha": [1, 2]}}'

echo "a suite is measured"
suite tiny.json "$sweep" "$references $charts"
bench tiny.json -o once || fail "exit code $?: $(cat stderr)"
{ [ "$(wc -l <stdout)" = 1 ] && grep -q "^wrote once/report.html, results.csv, 1 charts: 2 rows, 0 reused" stdout; } ||
  fail "closing line: $(cat stdout)"
[ ! -s stderr ] || fail "not quiet: $(cat stderr)"
[ "$(wc -l <once/results.csv)" = 3 ] || fail "results.csv has not two rows: $(cat once/results.csv)"
for configuration in alpha=1 alpha=2; do
  for name in frame_ms frame_ms_p95 picture_ms lights_per_pixel rays_per_pixel grid_lights memory_mb ms:light_gather \
    ms_p95:shadow truth.relative_l2 truth.relative_mse truth.energy truth.psnr truth.flip_mean truth.hdr_flip_p99; do
    value=$(column once/results.csv $configuration $name)
    is_number "$value" || fail "$configuration: $name is \"$value\""
  done
done
[ "$(column once/results.csv alpha=2 alpha)" = 2 ] || fail "alpha=2 has alpha $(column once/results.csv alpha=2 alpha)"
awk -v a="$(column once/results.csv alpha=1 lights_per_pixel)" -v b="$(column once/results.csv alpha=2 lights_per_pixel)" \
  'BEGIN { exit !(a > 1 && b > a) }' || fail "alpha 2 has not more lights per pixel than alpha 1"
awk -v e="$(column once/results.csv alpha=2 truth.relative_l2)" 'BEGIN { exit !(e > 0.001 && e < 0.5) }' ||
  fail "alpha 2 has a relative error of $(column once/results.csv alpha=2 truth.relative_l2)"
for file in report.html report.md time.svg time.png; do
  [ -s once/$file ] || fail "no $file"
done
[ "$(ls once/images/*.lights.exr | wc -l)" = 1 ] || fail "not one picture of lights per pixel: $(ls once/images)"
[ "$(ls once/references/*.exr | wc -l)" = 1 ] || fail "not one reference: $(ls once/references)"

echo "a second run measures nothing"
cp once/journal.jsonl before.jsonl
cp once/results.csv before.csv
bench tiny.json -o once || fail "exit code $?: $(cat stderr)"
grep -q "2 rows, 2 reused" stdout || fail "closing line: $(cat stdout)"
cmp once/journal.jsonl before.jsonl || fail "the journal changed"
cmp once/results.csv before.csv || fail "results.csv changed"
bench tiny.json -o once --report-only || fail "exit code $?: $(cat stderr)"
cmp once/results.csv before.csv || fail "results.csv of --report-only differs"

bench tiny.json -o once --fresh-references || fail "exit code $?: $(cat stderr)"
[ "$(lines once/journal.jsonl reference truth)" = 2 ] || fail "--fresh-references rendered none"
cmp once/results.csv before.csv || fail "results.csv with the fresh reference differs"

echo "a damaged line is measured again"
cp -r once damaged
printf '{"kind":"times\0"}\n' >>damaged/journal.jsonl
bench tiny.json -o damaged || fail "exit code $?: $(cat stderr)"
{ grep -q "damaged" stderr && cmp damaged/results.csv before.csv; } || fail "a damaged line: $(cat stderr)"

echo "a changed option is measured anew, alone"
suite changed.json '{"sweep": {"alpha": [1, 3]}}' "$references"
bench changed.json -o once || fail "exit code $?: $(cat stderr)"
grep -q "2 rows, 1 reused" stdout || fail "closing line: $(cat stdout)"
[ "$(lines once/journal.jsonl times alpha=1)" = 2 ] || fail "alpha=1 was measured again"

suite lights.json '{"sweep": {"alpha": [1, 3]}}' "$references \"pictures\": [{\"title\": \"Lights\", \"what\": \"lights-per-pixel\"}],"
bench lights.json -o once || fail "exit code $?: $(cat stderr)"
{ grep -q "2 rows, 1 reused" stdout && ls once/images/*alpha_3*.lights.exr >/dev/null; } ||
  fail "a picture of lights that the suite asks for later is not made: $(cat stdout)"
rm once/images/*alpha_3*.lights.exr
bench lights.json -o once || fail "a picture of lights that is gone is not made again: exit code $?: $(cat stderr)"

echo "killed in the middle, started again"
endless='{"sweep": {"alpha": [1]}}, {"name": "alpha=2", "settings": {"alpha": 2, "frames": 1000000}}'
suite endless.json "$endless" "$references"
"$lanternfield" bench endless.json -o killed >stdout 2>stderr &
process=$!
wait_for $process eval '[ "$(lines killed/journal.jsonl times alpha=1)" = 1 ]'
kill -9 $process
wait $process 2>/dev/null
[ -s killed/journal.jsonl ] || fail "killed: no journal"
cp killed/journal.jsonl before.jsonl
printf '{"kind":"times","key":"torn' >>killed/journal.jsonl
bench tiny.json -o killed || fail "exit code $?: $(cat stderr)"
[ ! -s stderr ] || fail "the torn line is not passed over in silence: $(cat stderr)"
cmp -n "$(stat -c %s before.jsonl)" before.jsonl killed/journal.jsonl || fail "the finished lines are not kept"
for configuration in alpha=1 alpha=2; do
  for repeat in 0 1; do
    count=$(grep -F '"kind":"times"' killed/journal.jsonl | grep -F "\"configuration\":\"$configuration\"" | grep -cF "\"repeat\":$repeat,")
    [ "$count" = 1 ] || fail "$configuration, repeat $repeat: measured $count times"
  done
  for name in truth.relative_l2 lights_per_pixel rays_per_pixel grid_lights memory_mb; do
    [ "$(column killed/results.csv $configuration $name)" = "$(column before.csv $configuration $name)" ] ||
      fail "$configuration: $name differs from that of a run that was not killed"
  done
done
for image in once/images/*alpha_[12].*.exr; do
  cmp "$image" "killed/images/$(basename "$image")" || fail "$image differs from that of a run that was killed"
done

echo "killed in a reference, which goes on"
# 4e11 rays: no machine traces them before the budget is spent.
suite slow.json "$sweep" '"references": [{"name": "truth", "settings": {"method": "vpl", "vpls": 2000000, "size": "640x360"}, "budget_s": 7}],'
"$lanternfield" bench slow.json -o slow >stdout 2>stderr &
process=$!
wait_for $process eval 'ls slow/references/*.json >/dev/null 2>&1'
kill -9 $process
wait $process 2>/dev/null
number() {
  sed -n "s/.*\"$1\":[[:space:]]*\([0-9.]*\).*/\1/p" slow/references/*.json
}
before_done=$(number done)
before_seconds=$(number seconds)
grep -q '"picture":[[:space:]]*false' slow/references/*.json || fail "the reference is said to be there"
cp slow/references/*.state before.state
bench slow.json -o slow || fail "exit code $?: $(cat stderr)"
awk -v a="$before_done" -v b="$(number done)" 'BEGIN { exit !(a > 0 && b > a) }' ||
  fail "the reference had $before_done VPLs and has $(number done)"
awk -v a="$before_seconds" -v b="$(number seconds)" 'BEGIN { exit !(a >= 4 && b >= 7) }' ||
  fail "the reference had $before_seconds seconds and has $(number seconds)"
ls slow/references/*.exr >/dev/null || fail "no reference"
grep -q "64x36 pixels, but the reference truth has 640x360" stderr || fail "sizes that differ: $(cat stderr)"

echo "Ctrl-C leaves what there is"
suite interrupted.json "$endless"
sed -i 's/"repeats": 2/"repeats": 1/' interrupted.json
"$lanternfield" bench interrupted.json -o interrupted >stdout 2>stderr &
process=$!
wait_for $process eval '[ "$(lines interrupted/journal.jsonl times alpha=1)" = 1 ]'
kill -INT $process
wait $process
code=$?
[ $code = 130 ] || fail "interrupted: exit code $code"
{ grep -q interrupted stderr && grep -q "1 rows" stdout; } || fail "interrupted, and does not say so: $(cat stdout stderr)"
{ [ "$(wc -l <interrupted/results.csv)" = 2 ] && is_number "$(column interrupted/results.csv alpha=1 frame_ms)"; } ||
  fail "interrupted: $(cat interrupted/results.csv)"

echo "a time limit skips, and says why"
suite limit.json '{"sweep": {"alpha": [1]}}, {"name": "slow", "settings": {"alpha": 2}, "time_limit_s": 0.0001}'
bench limit.json -o limit || fail "exit code $?: $(cat stderr)"
grep -q '^tiny,box,slow,.*more than the limit of 0.0001 s' limit/results.csv || fail "no reason: $(cat limit/results.csv)"

# refuses PLACE CODE ARGUMENT...: one line with PLACE in it, and no folder.
refuses() {
  local place=$1 code=$2 actual
  shift 2
  bench "$@"
  actual=$?
  [ $actual = "$code" ] || fail "$*: exit code $actual, expected $code"
  { [ "$(wc -l <stderr)" = 1 ] && grep -qF -- "$place" stderr; } || fail "$*: \"$place\" is not in: $(cat stderr)"
  [ ! -e none ] || fail "$*: left a folder"
}

echo "suites that are refused"
broken() { # broken PLACE CONFIGURATIONS [MORE]
  suite broken.json "$2" "${3:-}"
  refuses "broken.json: $1" 1 broken.json -o none
}
broken 'configurations[1].settings.target-ms: a row of a suite' "$sweep, {\"name\": \"a\", \"settings\": {\"target-ms\": 100}}"
broken 'configurations[1].settings.alhpa: unknown option' "$sweep, {\"name\": \"a\", \"settings\": {\"alhpa\": 1}}"
broken 'configurations[0].settings.alpha: expected a number greater than 0' '{"name": "a", "settings": {"alpha": 0}}'
broken 'configurations[0].sweep.emission[1]: expected one of demo' '{"sweep": {"emission": ["AB", "C"]}}'
broken 'configurations[0].settings.no-filter: expected no value, true or false' '{"name": "a", "settings": {"no-filter": 1}}'
broken 'configurations[0].sweep.alpha: set twice' '{"name": "a", "settings": {"alpha": 1}, "sweep": {"alpha": [1]}}'
broken 'configurations[0].settings.alpha: set twice' '{"name": "a", "settings": {"alpha": 1, "alpha": 2}}'
broken 'configurations[0].sweeep: unknown key; expected one of name' '{"name": "a", "sweeep": {}}'
broken 'configurations[0].name: missing' '{"settings": {}}'
broken 'configurations: two are named "alpha=1"' "$sweep, {\"name\": \"alpha=1\"}"
broken 'configurations[0].views[0]: there is no view "bx"' '{"name": "a", "views": ["bx"]}'
broken 'configurations: expected at least one' ''
broken 'title: given twice' "$sweep" '"title": "again",'
broken 'repeats: given twice' "$sweep" '"repeats": 3,'
broken 'references[0].name: missing' "$sweep" '"references": [{"settings": {}}],'
broken 'references[0].budget_s: expected a number of seconds' "$sweep" \
  '"references": [{"name": "a", "settings": {}, "budget_s": -1}],'
broken 'charts[0].y: unknown metric "frame_mss"' "$sweep" \
  '"charts": [{"name": "a", "title": "a", "x": "alpha", "y": "frame_mss"}],'
broken 'charts[0].y: unknown metric "truth.energy"' "$sweep" \
  '"charts": [{"name": "a", "title": "a", "x": "alpha", "y": "truth.energy"}],'
broken 'charts[0].series[0]: there is no series "b"' "$sweep" \
  '"charts": [{"name": "a", "title": "a", "x": "alpha", "y": "frame_ms", "series": ["b"]}],'
broken 'charts[0].name: expected letters' "$sweep" \
  '"charts": [{"name": "../a", "title": "a", "x": "alpha", "y": "frame_ms"}],'
broken 'comparisons[0].to: there is no configuration "alpha=3"' "$sweep" \
  '"comparisons": [{"text": "a", "metric": "frame_ms", "of": "alpha=1", "to": "alpha=3"}],'
broken 'tables[0].columns[0]: unknown metric "ms:shadow+"' "$sweep" '"tables": [{"title": "a", "columns": ["ms:shadow+"]}],'
broken 'tables[0].column_titles: expected as many' "$sweep" \
  '"tables": [{"title": "a", "columns": ["alpha"], "column_titles": ["a", "b"]}],'
broken 'pictures[0].what: there is no kind of picture "map"' "$sweep" '"pictures": [{"title": "a", "what": "map"}],'
suite broken.json "$sweep"
sed -i '4s/"views"/"views" "views"/' broken.json
refuses "broken.json:4: not JSON" 1 broken.json -o none
suite broken.json "$sweep"
sed -i "s|$scene|$work/no-such.glb|" broken.json
refuses "views[0].scene: there is no readable file" 1 broken.json -o none
refuses "no-such.json" 1 no-such.json -o none
refuses '--views: tiny.json has no view "attic"' 1 tiny.json -o none --views=box,attic
refuses "-o: its value is missing" 2 tiny.json -o ''
refuses "--references: its value is missing" 2 tiny.json -o none --references=
refuses "--validate: it takes no value" 2 tiny.json -o none --validate=1
refuses "bench needs a SUITE.json" 2 -o none
refuses "bench needs -o DIR" 2 tiny.json
refuses "unknown option --frobnicate" 2 tiny.json -o none --frobnicate
refuses "cannot make the folder" 1 tiny.json -o tiny.json

echo "$failures failed"
[ $failures = 0 ]
