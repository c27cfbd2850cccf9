#!/usr/bin/env bash
# `lanternfield play`: two runs, a run in parts, and runs that are killed and resumed give the same bytes; nothing is left
# half written; and what is refused. Without ffmpeg its movies are skipped, which is said.
# usage: play_test.sh path/to/lanternfield
set -u

lanternfield=$(realpath "$1")
scenes=$(dirname "$lanternfield")/scenes
{ [ -x "$lanternfield" ] && [ -s "$scenes/door.glb" ]; } || { echo "$lanternfield or its scenes are not built"; exit 1; }
shared=$(realpath -m ../shared)
work=$(mktemp -d)
trap 'cd /; rm -rf "$work"' EXIT
mkdir "$work/here" && cd "$work/here" || exit 1
failures=0

fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

# plays ARGUMENT...: succeeds.
plays() {
  "$lanternfield" play "$@" >"$work/stdout" 2>"$work/stderr" || fail "play $*: exit code $?: $(cat "$work/stderr")"
}

# refuses CODE WORD ARGUMENT...: ends with CODE and one line that has WORD in it, and leaves no file.
refuses() {
  local code=$1 word=$2 actual
  shift 2
  "$lanternfield" play "$@" >"$work/stdout" 2>"$work/stderr"
  actual=$?
  [ $actual = "$code" ] || fail "play $*: exit code $actual, expected $code"
  grep -qF -- "$word" "$work/stderr" || fail "play $*: \"$word\" is not in: $(cat "$work/stderr")"
  [ "$(grep -c error "$work/stderr")" = 1 ] || fail "play $*: not one line of error: $(cat "$work/stderr")"
  [ -z "$(ls -A)" ] || { fail "play $*: left $(ls -A)"; rm -rf ./*; }
}

# same A B: the folders hold the same files with the same bytes.
same() {
  diff -rq "$1" "$2" >"$work/diff" || fail "$1 and $2 differ: $(head -3 "$work/diff")"
}

# background ARGUMENT...: starts to play; its id is $process.
background() {
  "$lanternfield" play "$@" >"$work/stdout" 2>"$work/stderr" &
  process=$!
}

frames() {
  find "$1" -name 'frame_*.png' 2>/dev/null | wc -l
}

# until_frames FOLDER COUNT: waits until so many frames are there.
until_frames() {
  while [ "$(frames "$1")" -lt "$2" ] && kill -0 $process 2>/dev/null; do sleep 0.02; done
}

# whole FOLDER: every file there is a whole one, and those that are not yet are not there under their names.
whole() {
  local file
  for file in "$1"/*.png; do
    [ "$(tail -c 8 "$file" | od -An -c | tr -d ' ')" = 'IEND256B`202' ] || fail "$file is cut"
  done
}

# All that moves, changes and is switched, with a cut at frame 30: 60 frames.
script=$work/all.json
cat >"$script" <<EOT
{
  "scene": "$scenes/door.glb", "duration": 2, "frame_rate": 30, "size": "96x54", "seed": 3,
  "settings": {"vpls": 600, "exposure": -1},
  "cameras": [
    {"keys": [{"time": 0, "position": [3.6, 1.7, 1.7], "target": [0, 1, -0.5]},
              {"time": 1, "position": [3.4, 1.6, 1.2], "target": [0, 1, 0]}], "yfov": 1.1},
    {"camera": "lit", "start": 1}
  ],
  "lights": [
    {"name": "lantern", "type": "point", "intensity": 40,
     "keys": [{"time": 0, "position": [-1, 1.5, 0]}, {"time": 1, "position": [-1.5, 2, 1]}, {"time": 2, "position": [-3, 1, 0]}]}
  ],
  "nodes": [
    {"node": "door", "interpolation": "linear",
     "keys": [{"time": 0.2, "rotation": [0, 0, 0, 1]}, {"time": 0.5, "rotation": [0, 0.7071068, 0, 0.7071068]}]}
  ],
  "events": [
    {"time": 0.7, "light": "lamp", "on": false},
    {"time": 1.2, "light": "lamp", "on": true},
    {"time": 1.4, "node": "table", "visible": false},
    {"time": 1.6, "settings": {"alpha": 1.5}}
  ]
}
EOT

echo "two runs give the same bytes"
plays "$script" -o "$work/whole" --outputs png,exr,depth --stats "$work/whole.csv"
[ "$(frames "$work/whole")" = 60 ] || fail "$(frames "$work/whole") frames of 60"
plays "$script" -o "$work/again" --outputs png,exr,depth
same "$work/whole" "$work/again"
[ "$(cd "$work/whole" && sha256sum frame_*.png | cut -d' ' -f1 | sort -u | wc -l)" -ge 58 ] ||
  fail "the frames do not differ, so nothing is shown"

echo "the validation layer has nothing to say, over a cut too"
plays "$script" -o "$work/validated" --validate --range 28:32
cmp -s "$work/whole/frame_000031.png" "$work/validated/frame_000031.png" || fail "validated frame 31 differs"

echo "a row a frame"
[ "$(wc -l <"$work/whole.csv")" = 61 ] || fail "rows: $(wc -l <"$work/whole.csv")"
awk -F, 'NR == 1 { columns = NF; for (i = 1; i <= NF; i++) name[$i] = i }
  NR > 1 && (NF != columns || $1 != NR - 2 || !($name["ms"] > 0) || !($name["lights_per_pixel"] > 0) ||
    !($name["rays_per_pixel"] > 0) || !($name["shadow_ms"] > 0)) { print; bad = 1 } END { exit bad }' \
  "$work/whole.csv" || fail "a row is wrong"

echo "ranges give the bytes of the whole"
plays "$script" -o "$work/parts" --outputs png,exr,depth --range 45:60
plays "$script" -o "$work/parts" --outputs png,exr,depth --range 0:10
[ "$(frames "$work/parts")" = 25 ] || fail "$(frames "$work/parts") frames of 25"
plays "$script" -o "$work/parts" --outputs png,exr,depth --resume
same "$work/whole" "$work/parts"

echo "killed runs go on with the same bytes"
for count in 5 $((RANDOM % 25 + 6)) $((RANDOM % 25 + 32)); do
  rm -rf "$work/killed"
  background "$script" -o "$work/killed" --outputs png,exr,depth
  until_frames "$work/killed" $count
  kill -KILL $process
  wait $process 2>/dev/null
  [ "$(frames "$work/killed")" -lt 60 ] || fail "nothing was left to be resumed after $count"
  whole "$work/killed"
  plays "$script" -o "$work/killed" --outputs png,exr,depth --resume
  find "$work/killed" -name '.*' -type f -delete # what the killed process was writing
  find "$work/killed" -type f ! -name '*.png' ! -name '*.exr' ! -name playback.txt -delete
  same "$work/whole" "$work/killed"
done

echo "statistics of a run that goes on are whole"
rm -rf "$work/killed"
background "$script" -o "$work/killed" --stats "$work/killed.csv"
until_frames "$work/killed" 40
kill -KILL $process
wait $process 2>/dev/null
plays "$script" -o "$work/killed" --stats "$work/killed.csv" --resume
[ "$(cut -d, -f1,2 "$work/killed.csv" | cksum)" = "$(cut -d, -f1,2 "$work/whole.csv" | cksum)" ] || fail "rows are missing"

echo "Ctrl-C leaves the frames so far"
rm -rf "$work/killed"
(trap - INT; exec "$lanternfield" play "$script" -o "$work/killed" >"$work/stdout" 2>"$work/stderr") &
process=$!
until_frames "$work/killed" 3
kill -INT $process
wait $process
code=$?
[ $code = 130 ] || fail "exit code $code, expected 130"
grep -q 'interrupted after' "$work/stderr" || fail "does not say so: $(cat "$work/stderr")"
whole "$work/killed"

echo "the room behind the door is dark until it opens"
# energy FRAME CAMERA: mean radiance over that of the lit room.
energy() {
  printf '{"scene": "%s/door.glb", "duration": 2, "frame_rate": 10, "cameras": [{"camera": "%s"}], "outputs": ["exr"],
    "settings": {"vpls": 2000, "size": "96x54"}, "nodes": [{"node": "door", "interpolation": "step",
    "keys": [{"time": 0, "rotation": [0, 0, 0, 1]}, {"time": 1, "rotation": [0, 0.7071068, 0, 0.7071068]}]}]}' \
    "$scenes" "$2" >"$work/$2.json"
  plays "$work/$2.json" -o "$work/$2"
  "$lanternfield" compare "$work/lit/frame_000009.exr" "$work/$2/frame_$1.exr" | awk '/energy/ { for (i = 1; i <= NF; i++)
    if ($i == "energy") column = i + 1 } END { print $column }'
}
energy 000009 lit >/dev/null
awk -v dark="$(energy 000009 unlit)" -v open="$(energy 000019 unlit)" 'BEGIN { exit !(dark < 0.01 && open > 0.02) }' ||
  fail "the dark room has $(energy 000009 unlit) and $(energy 000019 unlit) of the lit one"

echo "references keep nothing over a frame"
plays "$script" -o "$work/reference" --method path --spp 2 --size 32x18 --range 0:3
plays "$script" -o "$work/reference2" --method path --spp 2 --size 32x18 --range 2:3
cmp -s "$work/reference/frame_000002.png" "$work/reference2/frame_000002.png" || fail "the reference of frame 2 differs"

echo "clips move, and nothing else does"
truck=$shared/scenes/animated/CesiumMilkTruck/CesiumMilkTruck.gltf
if [ -s "$truck" ]; then
  for clips in '' '{"clip": "Wheels", "start": 0.1, "loop": true}'; do
    printf '{"scene": "%s", "duration": 0.4, "frame_rate": 10, "lights": [{"name": "sun", "type": "directional",
      "intensity": 50, "direction": [-1, -1, -0.5]}], "animations": [%s]}' "$truck" "$clips" >"$work/truck.json"
    # A reference keeps nothing over a frame, so frames of a still scene are equal.
    plays "$work/truck.json" -o "$work/truck$clips" --method path --spp 1 --size 96x54
    pictures=$(cd "$work/truck$clips" && sha256sum frame_*.png | cut -d' ' -f1 | sort -u | wc -l)
    # At 0 and 0.1 s the clip is at its beginning.
    [ "$pictures" = $((${#clips} > 0 ? 3 : 1)) ] || fail "$pictures different pictures with clips \"$clips\""
  done
  # A part that is hidden before the whole, or after it. At first all is shown; then the part is hidden, or the whole.
  for events in 'Wheels 0.1 Yup2Zup 0.2' 'Yup2Zup 0.1 Wheels 0.2'; do
    read -r first at then after <<<"$events"
    printf '{"scene": "%s", "duration": 0.4, "frame_rate": 10, "lights": [{"name": "sun", "type": "directional",
      "intensity": 50, "direction": [-1, -1, -0.5]}], "events": [{"time": %s, "node": "%s", "visible": false},
      {"time": %s, "node": "%s", "visible": false}]}' "$truck" "$at" "$first" "$after" "$then" >"$work/truck.json"
    plays "$work/truck.json" -o "$work/hidden$first" --method path --spp 1 --size 96x54
    pictures=$(cd "$work/hidden$first" && sha256sum frame_*.png | cut -d' ' -f1 | uniq -c | awk '{ printf "%s ", $1 }')
    [ "$pictures" = "$([ "$first" = Wheels ] && echo '1 1 2 ' || echo '1 3 ')" ] || fail "$events hidden: $pictures"
  done
else
  echo "skipped: clips and parts that are hidden, as there is no $truck"
fi

echo "a still view comes to rest"
printf '{"scene": "%s/cornell.glb", "duration": 7, "frame_rate": 10, "size": "16x16", "settings": {"vpls": 300}}' \
  "$scenes" >"$work/still.json"
plays "$work/still.json" -o "$work/still" --outputs exr
[ "$(cd "$work/still" && sha256sum frame_000066.exr frame_00006[789].exr | cut -d' ' -f1 | uniq | wc -l)" = 1 ] ||
  fail "frames 66 to 69 differ"
cmp -s "$work/still/frame_000002.exr" "$work/still/frame_000066.exr" && fail "frames 2 and 66 do not differ"

echo "what automatic settings chose plays to the same bytes"
plays "$script" -o "$work/chosen" --target-ms 3 --record "$work/chosen.json"
[ "$(grep -c '"vpls"' "$work/chosen.json")" -ge 2 ] || fail "nothing was chosen"
plays "$work/chosen.json" -o "$work/replayed"
rm "$work/chosen/playback.txt" "$work/replayed/playback.txt"
same "$work/chosen" "$work/replayed"

echo "refusals"
refuses 2 "needs a SCRIPT.json"
refuses 2 "one SCRIPT.json is enough" "$script" other.json
refuses 2 "unknown option --rnage" "$script" --rnage 1:2
refuses 2 "--range: expected A:B" "$script" --range 1-2
refuses 1 "--range: expected A:B" "$script" --range 3:3
refuses 1 "expected at most 60" "$script" --range 3:61
refuses 2 ".csv" "$script" --stats a.json
refuses 2 "at most one folder" "$script" -o a -o b
refuses 1 "--target-ms: cannot be used to play" "$script" --target-ms 30
refuses 1 "--target-error: cannot be used to play" "$script" --target-error 0.1
refuses 1 "--record: expected with" "$script" --record a.json
refuses 1 "without --range and --resume" "$script" --record a.json --target-ms 30 --resume
refuses 1 "only --method lgh" "$script" --record a.json --target-ms 30 --method ir
refuses 1 "--frames: cannot be used to play" "$script" --frames 3
refuses 1 "--vpls" "$script" --vpls -1
refuses 1 "--outputs: expected png, exr" "$script" --outputs png,colour
refuses 1 "--method path does not make it" "$script" --method path --outputs direct
refuses 1 "no-such.json" no-such.json
refuses 1 "cannot make the folder" "$script" -o missing/folder
refuses 1 "expected a folder, or nothing" "$script" -o "$script"
refuses 1 "holds frames of something else" "$script" -o "$work/whole" --seed 4
refuses 1 "cannot write" "$script" --stats missing/a.csv
printf '{"scene": "%s/cornell.glb", "duration": 1,\n "cameras": [\n  {"camera": "nowhere"}]}' "$scenes" >"$work/bad.json"
refuses 1 'bad.json:3: expected the name of a camera' "$work/bad.json"
printf '{"scene": "%s/cornell.glb", "duration": 1,\n "outputs": ["png",\n "gif"]}' "$scenes" >"$work/bad.json"
refuses 1 'bad.json:3: outputs: expected png, exr, albedo' "$work/bad.json"
printf '{"scene": "none.glb", "duration": 1}' >"$work/bad.json"
refuses 1 'none.glb' "$work/bad.json"
PATH=/nowhere "$lanternfield" play "$script" -o a.mp4 2>"$work/stderr"
[ $? = 1 ] && grep -q 'cannot write "a.mp4": movies need the program ffmpeg' "$work/stderr" && [ -z "$(ls -A)" ] ||
  fail "without ffmpeg: $(cat "$work/stderr"; ls -A)"

echo "movies"
if command -v ffmpeg >/dev/null; then
  few=(--range 0:12)
  plays "$script" -o a.mp4 "${few[@]}"
  [ "$(ls -A)" = a.mp4 ] || fail "left $(ls -A)"
  plays "$script" -o b.mp4 "${few[@]}"
  cmp -s a.mp4 b.mp4 || fail "two movies differ"
  background "$script" -o c.mp4 "${few[@]}"
  until_frames c.mp4.frames 4
  kill -KILL $process
  wait $process 2>/dev/null
  [ ! -e c.mp4 ] || fail "a killed run left a movie"
  plays "$script" -o c.mp4 "${few[@]}" --resume
  cmp -s a.mp4 c.mp4 || fail "the movie of a killed run differs"
  plays "$script" -o d.mp4 -o d "${few[@]}"
  cmp -s a.mp4 d.mp4 && [ "$(frames d)" = 12 ] || fail "the movie with a folder differs, or the folder is not there"
  mkdir "$work/bin"
  printf '#!/bin/sh\n[ "$1" = -version ] || { echo "no such codec" >&2; exit 1; }\n' >"$work/bin/ffmpeg"
  chmod +x "$work/bin/ffmpeg"
  PATH=$work/bin:$PATH "$lanternfield" play "$script" -o e.mp4 "${few[@]}" >"$work/stdout" 2>"$work/stderr" &&
    fail "a movie that ffmpeg does not make"
  grep -q 'cannot write "e.mp4": ffmpeg: no such codec' "$work/stderr" || fail "ffmpeg fails: $(cat "$work/stderr")"
  [ ! -e e.mp4 ] && [ ! -e e.part.mp4 ] || fail "half a movie"
  if command -v ffprobe >/dev/null; then
    count=$(ffprobe -v error -count_frames -show_entries stream=nb_read_frames,width,height -of csv=p=0 a.mp4)
    [ "$count" = 96,54,12 ] || fail "the movie has $count, expected 96,54,12"
  fi
else
  echo "skipped: movies, as there is no ffmpeg"
fi

[ $failures = 0 ] && echo "all passed"
exit $((failures > 0))
