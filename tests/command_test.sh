#!/usr/bin/env bash
# The command as a user meets it: what it refuses and how, what it writes, and that it writes nothing when it fails.
# usage: command_test.sh path/to/lanternfield
set -u

lanternfield=$(realpath "$1")
scenes=$(dirname "$lanternfield")/scenes
{ [ -x "$lanternfield" ] && [ -s "$scenes/cornell.glb" ]; } || { echo "$lanternfield or its scenes are not built"; exit 1; }
work=$(mktemp -d)
trap 'cd /; umount "$work/full" 2>/dev/null; rm -rf "$work"' EXIT
mkdir "$work/here" && cd "$work/here" || exit 1
failures=0

fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

run() {
  "$lanternfield" "$@" >"$work/stdout" 2>"$work/stderr"
}

# refuses CODE WORD ARGUMENT...: ends with CODE and one line that has WORD in it, prints nothing else and leaves no file.
refuses() {
  local code=$1 word=$2 actual
  shift 2
  run "$@"
  actual=$?
  [ $actual = "$code" ] || fail "lanternfield $*: exit code $actual, expected $code"
  grep -qF -- "$word" "$work/stderr" || fail "lanternfield $*: \"$word\" is not in: $(cat "$work/stderr")"
  [ "$(grep -c error "$work/stderr")" = 1 ] || fail "lanternfield $*: not one line of error: $(cat "$work/stderr")"
  [ "$code" = 1 ] || grep -qF -- --help "$work/stderr" || fail "lanternfield $*: no hint to --help"
  [ -z "$(ls -A)" ] || { fail "lanternfield $*: left $(ls -A)"; rm -rf ./*; }
}

# renders ARGUMENT...: succeeds.
renders() {
  run render "$@" || fail "lanternfield render $*: exit code $?: $(cat "$work/stderr")"
}

# background ARGUMENT...: starts a rendering and waits until its frames begin; its id is $process.
background() {
  "$lanternfield" render "$@" >"$work/stdout" 2>"$work/stderr" &
  process=$!
  # Until the program, not the shell that it is started from, catches SIGINT (bit 1 of its mask), as its frames begin.
  until [[ $(cat /proc/$process/comm 2>/dev/null) = lanternfield &&
    $(sed -n 's/^SigCgt:\s*//p' /proc/$process/status 2>/dev/null) =~ [2367abef]$ ]]; do
    kill -0 $process 2>/dev/null || break
    sleep 0.1
  done
}

cornell=$scenes/cornell.glb
small=(--size 64x36 --vpls 1000 --frames 2)

triangle() { # triangle NAME EXTRA: a scene of one triangle without light
  cat >"$work/$1" <<EOT
{"asset": {"version": "2.0"}, $2 "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
 "bufferViews": [{"buffer": 0, "byteLength": 36}],
 "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}
EOT
}

exr() { # exr NAME A B: a picture of two grey pixels; their four bytes each as printf writes them
  local zero='\0\0\0\0' one='\0\0\200\77'
  {
    printf '\166\57\61\1\2\0\0\0'
    printf 'channels\0chlist\0\23\0\0\0Y\0\2\0\0\0\0\0\0\0\1\0\0\0\1\0\0\0\0'
    printf 'compression\0compression\0\1\0\0\0\0'
    printf "dataWindow\0box2i\0\20\0\0\0$zero$zero\1\0\0\0$zero"
    printf "displayWindow\0box2i\0\20\0\0\0$zero$zero\1\0\0\0$zero"
    printf 'lineOrder\0lineOrder\0\1\0\0\0\0'
    printf "pixelAspectRatio\0float\0\4\0\0\0$one"
    printf "screenWindowCenter\0v2f\0\10\0\0\0$zero$zero"
    printf "screenWindowWidth\0float\0\4\0\0\0$one\0"
  } >"$1"
  # One row: where it begins, its number, its size.
  printf "\\$(printf %o $((($(wc -c <"$1") + 8) % 256)))\\$(printf %o $((($(wc -c <"$1") + 8) / 256)))\0\0$zero" >>"$1"
  printf "$zero\10\0\0\0$2$3" >>"$1"
}

echo "wrong usage"
refuses 2 "command is missing"
refuses 2 "unknown command draw" draw x.glb
refuses 2 "needs a SCENE" render
refuses 2 "needs a SCENE" info
refuses 2 "other.glb" info "$cornell" other.glb
refuses 2 "no argument" devices all
refuses 2 "at least one image" compare
refuses 2 "at least one image" compare a.exr
refuses 2 "unknown option --maps" compare a.exr b.exr --maps=a.png
refuses 2 "unknown option -j" compare a.exr b.exr -j
refuses 2 "--map: its value is missing" compare a.exr b.exr --map
refuses 2 "--json=1: it takes no value" compare a.exr b.exr --json=1
refuses 2 ".png" compare a.exr b.exr --map a.exr
refuses 2 "difference or flip" compare a.exr b.exr --map-kind hue
refuses 2 "--map-range: expected a number" compare a.exr b.exr --map-range wide
refuses 2 "--exposure" compare a.exr b.exr --exposure bright
refuses 2 "unknown option --vplz" render "$cornell" --vplz 3
refuses 2 "unknown option -size" render "$cornell" -size 64x36
refuses 2 "--vpls: its value is missing" render "$cornell" --vpls
refuses 2 "--validate=yes: it takes no value" render "$cornell" --validate=yes
refuses 2 "one SCENE is enough" render "$cornell" other.glb
refuses 2 ".png or .exr" render "$cornell" -o picture.jpg
refuses 2 "albedo, normal, depth" render "$cornell" --aov colour=a.exr
refuses 2 "NAME=FILE.exr" render "$cornell" --aov depth=a.png
refuses 2 "NAME=FILE.exr" render "$cornell" --aov depth
refuses 2 "demo, mean-normal, A, B, AB" render "$cornell" --emission C
refuses 2 "--alpha" render "$cornell" --alpha x
refuses 2 "--alpha" render "$cornell" --alpha nan
refuses 2 "--eye: expected x,y,z" render "$cornell" --eye 1,2
refuses 2 "--eye: expected x,y,z" render "$cornell" --eye 1,2,3,4
refuses 2 "--sun" render "$cornell" --sun 0,-1,0

echo "values that cannot be used"
refuses 1 "--size" render "$cornell" --size 0
refuses 1 "--size" render "$cornell" --size 0x0
refuses 1 "1 to 16384" render "$cornell" --size 100000x100000
refuses 1 "--alpha" render "$cornell" --alpha 0
refuses 1 "--alpha" render "$cornell" --alpha -1
refuses 1 "--vpls" render "$cornell" --vpls 5000000
refuses 1 "--interleave" render "$cornell" --interleave 3
refuses 1 "--fov" render "$cornell" --fov 180
refuses 1 "--sun" render "$cornell" --sun 0,0,0,1000
refuses 1 "--map-range: expected a number above 0" compare a.exr b.exr --map-range 0
refuses 1 "--exposure" compare a.exr b.exr --exposure 65
refuses 1 "same point" render "$cornell" --eye 1,1,1 --target 1,1,1

echo "files"
refuses 1 "no-such.glb" render no-such.glb
refuses 1 "no-such.glb" info no-such.glb
refuses 1 "$scenes" render "$scenes"
refuses 1 "$scenes" info "$scenes"
: >"$work/empty.glb"
refuses 1 "empty.glb" render "$work/empty.glb"
head -c 300 "$cornell" >"$work/cut.glb"
refuses 1 "cut.glb" render "$work/cut.glb"
refuses 1 "missing/a.png" render "$cornell" -o missing/a.png
refuses 1 "missing/a.exr" render "$cornell" -o a.png --aov depth=missing/a.exr
refuses 1 "missing/a.json" render "$cornell" --stats missing/a.json
refuses 1 "missing/a.dot" render "$cornell" --dump-graph missing/a.dot
mkdir "$work/folder.png"
refuses 1 "folder.png" render "$cornell" -o "$work/folder.png"
refuses 1 "/dev/full" render "$cornell" --stats /dev/full

echo "pictures that cannot be compared"
exr "$work/grey.exr" '\0\0\200\77' '\0\0\200\77'
exr "$work/nan.exr" '\0\0\200\77' '\0\0\300\177'
exr "$work/infinite.exr" '\0\0\200\377' '\0\0\200\77'
head -c 300 "$work/grey.exr" >"$work/cut.exr"
run compare "$work/grey.exr" "$work/grey.exr" || fail "compare with itself: $(cat "$work/stderr")"
refuses 1 "no-such.exr" compare no-such.exr "$work/grey.exr"
refuses 1 "no-such.exr" compare "$work/grey.exr" "$work/grey.exr" no-such.exr
refuses 1 "not an OpenEXR file" compare "$work/grey.exr" "$cornell"
refuses 1 "cut.exr" compare "$work/grey.exr" "$work/cut.exr"
refuses 1 "$work/nan.exr: expected finite values, pixel 1,0 is nan" compare "$work/grey.exr" "$work/nan.exr" --map a.png
refuses 1 "$work/infinite.exr: expected finite values, pixel 0,0 is -inf" compare "$work/infinite.exr" "$work/grey.exr"
refuses 1 "no folder \"missing\"" compare "$work/grey.exr" "$work/nan.exr" --map missing/a.png
refuses 1 "folder.png" compare "$work/grey.exr" "$work/grey.exr" --map "$work/folder.png"

echo "scenes that lack something"
refuses 1 "attic" render "$cornell" --camera attic
refuses 1 'there is no animation "walk"; it has none' render "$cornell" --animation walk
refuses 1 'there is no animation "all"' render "$cornell" --animation all
refuses 1 "--time: nothing moves without --animation" render "$cornell" --time 1
refuses 1 "--time: expected a number of seconds" render "$cornell" --animation all --time=-1
refuses 2 "--time: expected a number of seconds" render "$cornell" --animation all --time soon
echo '{"asset": {"version": "2.0"}, "scenes": [{"nodes": []}]}' >"$work/nothing.gltf"
refuses 1 "no geometry" render "$work/nothing.gltf"
triangle required.gltf '"extensionsUsed": ["EXT_nonsense"], "extensionsRequired": ["EXT_nonsense"],'
refuses 1 "EXT_nonsense" render "$work/required.gltf"
refuses 1 "no such device" render "$cornell" --device "no such device"

echo "parts of the picture that these settings do not make"
refuses 1 "--aov shadow-u" render "$cornell" "${small[@]}" --shadow-samples 0 --aov shadow-u=a.exr

if mkdir "$work/full" && mount -t tmpfs -o size=16k tmpfs "$work/full" 2>/dev/null; then
  echo "a full disk"
  cd "$work/full" || exit 1
  refuses 1 "$work/full/a.exr" render "$cornell" --size 320x180 --vpls 1000 --frames 1 -o "$work/full/a.exr"
  cd "$work/here" || exit 1
else
  echo "a full disk: left out, a small file system cannot be mounted here"
fi

echo "help"
for arguments in --help -h "render --help" "render -h" "compare --help" "compare a.exr -h" "info --help" "devices --help" --version; do
  # shellcheck disable=SC2086
  run $arguments || fail "lanternfield $arguments: exit code $?"
  { [ -s "$work/stdout" ] && [ ! -s "$work/stderr" ]; } || fail "lanternfield $arguments: prints to the wrong stream"
done
run render --help
for option in -o --size --camera --eye --target --fov --vpls --bounces --alpha --levels --shadow-samples --interleave \
  --emission --end-point --frames --seed --exposure --only --no-filter --taa --no-taa --start-level --no-sample-s1 --blend --sampling \
  --reservoirs --build --s1 --singularity --sun --animation --time --aov --stats --dump-graph --device --validate; do
  grep -q -- "^  $option " "$work/stdout" || fail "render --help has no $option"
done
for default in "default 1280x720" "default 100000" "default 3" "default 1" "default auto" "default AB" "default vpl" \
  "default restrict" "default ordered" "default exact" "default importance" "default 0.003" "default 8"; do
  grep -qF "($default)" "$work/stdout" || fail "render --help has no \"$default\""
done

run compare --help
for option in --json --map --map-kind --map-range --exposure relative_l2 relative_mse energy psnr flip_mean flip_p95 \
  flip_p99 hdr_flip_mean hdr_flip_p95 hdr_flip_p99; do
  grep -q -- "^  $option " "$work/stdout" || fail "compare --help has no $option"
done

echo "info and devices"
{ run info "$cornell" && grep -qi triangles "$work/stdout"; } || fail "info of the cornell box: $(cat "$work/stdout" "$work/stderr")"
{ run devices && [ -s "$work/stdout" ]; } || fail "devices: $(cat "$work/stdout" "$work/stderr")"

echo "two runs write the same bytes"
aovs=(albedo normal depth direct indirect shadow-u shadow-s shadow-ratio lights-per-pixel)
for n in 1 2; do
  mkdir $n
  arguments=()
  for aov in "${aovs[@]}"; do arguments+=(--aov "$aov=$n/$aov.exr"); done
  renders "$cornell" "${small[@]}" -o $n/a.png -o $n/a.exr "${arguments[@]}"
  { [ "$(wc -l <"$work/stdout")" = 1 ] && grep -q "^wrote $n/a.png, $n/a.exr" "$work/stdout"; } || fail "closing line: $(cat "$work/stdout")"
done
for file in a.png a.exr "${aovs[@]/%/.exr}"; do
  { [ -s "1/$file" ] && cmp "1/$file" "2/$file"; } || fail "$file differs between two runs"
done
[ "$(head -c 4 1/a.png | tail -c 3)" = PNG ] || fail "a.png is no PNG"
rm -rf 1 2

echo "comparison"
# compares ARGUMENT...: succeeds.
compares() {
  run compare "$@" || fail "lanternfield compare $*: exit code $?: $(cat "$work/stderr")"
}
renders "$cornell" "${small[@]}" -o reference.exr
renders "$cornell" "${small[@]}" --alpha 2 --seed 7 -o other.exr
renders "$cornell" --size 32x36 --vpls 0 --frames 1 -o narrow.exr
run compare reference.exr narrow.exr --map a.png && fail "pictures of two sizes are compared"
grep -q "narrow.exr is 32x36, expected the 64x36 of the reference reference.exr" "$work/stderr" || fail "two sizes: $(cat "$work/stderr")"
[ ! -e a.png ] || fail "a map of what cannot be compared"
compares reference.exr reference.exr other.exr
[ "$(wc -l <"$work/stdout")" = 4 ] || fail "compare does not print four lines: $(cat "$work/stdout")"
[ "$(awk '{ print NF }' <<<"$(tail -n 2 "$work/stdout")" | sort -u)" = 11 ] || fail "not ten measures: $(cat "$work/stdout")"
[ "$(awk '{ print length }' <<<"$(tail -n 3 "$work/stdout")" | sort -u | wc -l)" = 1 ] || fail "the table is not aligned"
grep -qE "^reference.exr +0 +0 +1 +inf( +0){6}$" "$work/stdout" || fail "equal pictures: $(cat "$work/stdout")"
compares other.exr reference.exr --json --exposure -2.5
grep -q '"exposure":	-2.5' "$work/stdout" || fail "--exposure is not used: $(cat "$work/stdout")"
for key in relative_l2 relative_mse psnr energy flip_mean flip_p95 flip_p99 hdr_flip_mean hdr_flip_p95 hdr_flip_p99; do
  grep -qE "\"$key\":	[0-9.e-]*[1-9]" "$work/stdout" || fail "--json has no $key: $(cat "$work/stdout")"
done
compares reference.exr reference.exr --json
grep -q '"psnr":	null' "$work/stdout" || fail "infinity is not null in JSON: $(cat "$work/stdout")"
for n in 1 2; do
  mkdir $n
  compares reference.exr other.exr --map $n/difference.png
  compares reference.exr other.exr --map=$n/wide.png --map-range 100
  compares reference.exr other.exr reference.exr --map $n/flip.png --map-kind flip
  cp "$work/stdout" $n/text
done
for file in difference.png wide.png flip-1.png flip-2.png text; do
  { [ -s "1/$file" ] && cmp "1/$file" "2/$file"; } || fail "compare: $file differs between two runs"
done
[ "$(ls 1 | wc -l)" = 5 ] || fail "compare wrote $(ls 1)"
for file in wide.png flip-1.png flip-2.png; do
  cmp -s 1/difference.png 1/$file && fail "the difference map is $file"
done
cmp -s 1/flip-1.png 1/flip-2.png && fail "the maps of two images are equal"
rm -rf ./*

echo "statistics and the graph"
renders "$cornell" "${small[@]}" --interleave 2 --stats a.json --dump-graph a.dot
for key in device scene settings size frames passes ms_p50 ms_p95 steps frame_ms_p50 vpls grid_lights levels \
  lights_per_pixel rays vpl direct shadow rays_per_pixel flux per_level gpu_memory_peak_bytes validation_messages; do
  grep -q "\"$key\":" a.json || fail "the statistics have no \"$key\""
done
for module in vpl_trace lgh_build gbuffer light_gather shadow composite tonemap; do
  grep -q "\"name\":	\"$module\"" a.json || fail "the statistics have no pass \"$module\""
done
grep -q '"lights_per_pixel":	[1-9]' a.json || fail "no light per pixel: $(grep lights_per_pixel a.json)"
[ "$(tr -cd '{[' <a.json | wc -c)" = "$(tr -cd '}]' <a.json | wc -c)" ] || fail "the statistics' brackets do not match"
grep -q digraph a.dot || fail "the dumped graph is no digraph"
rm -f ./*

echo "without virtual lights, in one frame"
renders "$cornell" --size 33x17 --vpls 0 --frames 1 --stats a.json
[ -s out.png ] || fail "out.png is not the default"
grep -q '"note":' a.json || fail "no note that the only frame also counted lights"
rm -f ./*

echo "without light the picture is black, and says so"
triangle dark.gltf ''
renders "$work/dark.gltf" --size 64x36 --frames 1 -o dark.exr
grep -q "no lights: the picture will be black" "$work/stderr" || fail "no warning of a black picture"
# A picture that shows nothing at all, for comparison.
renders "$cornell" --size 64x36 --vpls 0 --frames 1 --eye 1000,1000,1000 --target 2000,2000,2000 -o nothing.exr
cmp dark.exr nothing.exr || fail "the scene without light is not black"
renders "$work/dark.gltf" --size 64x36 --frames 1 --sun 0,0,-1,1000 -o sun.exr
cmp -s dark.exr sun.exr && fail "--sun makes no light"
renders "$work/dark.gltf" --size 64x36 --frames 1 --sun 0,0,-1e-30,1000 -o short.exr
cmp sun.exr short.exr || fail "the length of --sun's direction matters"
rm -f ./*

echo "Ctrl-C writes what there is"
background "$cornell" --size 64x36 --vpls 1000 --frames 1000000 -o a.png --aov lights-per-pixel=b.exr
sleep 0.5
kill -INT $process
wait $process
code=$?
[ $code = 130 ] || fail "interrupted: exit code $code"
grep -q "interrupted after" "$work/stderr" || fail "interrupted, and does not say so: $(cat "$work/stderr")"
{ [ -s a.png ] && [ ! -e b.exr ]; } || fail "interrupted: a.png is missing or b.exr is there"
rm -f ./*

# ---- Animations

echo "a scene is posed at the time that is asked for, in a loop"
z='\0\0\0\0' p='\0\0\200\77' m='\0\0\200\277' # 0, 1 and -1 as floats
numbers=$(printf "$m$m$z$p$m$z$z$p$z$z$p$z$z$z$p$z$z" | base64 -w 0) # a triangle, two times, two places
cat >"$work/moving.gltf" <<EOT
{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
  {"bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 2, "type": "SCALAR"},
  {"bufferView": 0, "byteOffset": 44, "componentType": 5126, "count": 2, "type": "VEC3"}],
 "bufferViews": [{"buffer": 0, "byteLength": 68}],
 "buffers": [{"byteLength": 68, "uri": "data:application/octet-stream;base64,$numbers"}],
 "animations": [{"name": "walk", "samplers": [{"input": 1, "output": 2}],
  "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]}
EOT
moving=(../moving.gltf --sun=0,0,-1,10 "${small[@]}")
renders "${moving[@]}" -o rest.png
renders "${moving[@]}" --animation walk -o start.png
renders "${moving[@]}" --animation walk --time 0.5 -o half.png
renders "${moving[@]}" --animation all --time 3.5 -o later.png
cmp rest.png start.png || fail "the start of a clip that starts at rest is not the picture at rest"
cmp half.png later.png || fail "a clip of one second is elsewhere three seconds later"
cmp -s rest.png half.png && fail "--time changes nothing"
rm -f ./*
refuses 1 'there is no animation "run"; its animations are "walk"' render "${moving[@]}" --animation run
run info ../moving.gltf && grep -q '^  "walk": 1 s, 1 channels$' "$work/stdout" || fail "info does not list the animation: $(cat "$work/stdout")"

# ---- References: progressive methods, their state files, instant radiosity.

tiny=(--size 64x36)
path=("${tiny[@]}" --method path)
two_rooms=$scenes/two_rooms.glb

# number KEY FILE: a number of the statistics, the last of that name
number() { sed -n "s/^\t*\"$1\":\t\([0-9.e+-]*\),\{0,1\}$/\1/p" "$2" | tail -n 1; }

echo "automatic settings: refused, chosen, said and written down"
refuses 1 "--target-ms and --target-error" render no-such.glb --target-ms 100 --target-error 0.1
refuses 1 "--target-ms: only --method lgh" render no-such.glb --method path --target-ms 100
refuses 1 "--target-error: only --method lgh" render no-such.glb --method vpl --target-error 0.1
refuses 1 "expected indirect light with shadows" render no-such.glb --target-ms 100 --only direct
refuses 1 "--target-error" render no-such.glb --target-error 2
# Far more time than 500 VPLs take: more is chosen, said and written down.
renders "$cornell" --size 64x36 --vpls 500 --target-ms 2000 --frames 9 -o auto.png --stats auto.json
grep -q "automatic: frame [0-9]*: [0-9]* VPLs, alpha .* are less than 2000" "$work/stderr" ||
  fail "--target-ms 2000 does not say what it chose: $(cat "$work/stderr")"
[ "$(number vpls auto.json)" -gt 500 ] || fail "--target-ms 2000 chose no more than 500 VPLs"
grep -q '"frame_ms":' auto.json || fail "--target-ms: no times of the frames in --stats"
rm -f auto.*

echo "options that do not fit the method are refused before any work"
refuses 1 "--state: --method lgh" render no-such.glb --state a.state
refuses 1 "--state: --method ir" render no-such.glb --method ir --state a.state
refuses 1 "--until: --method lgh" render no-such.glb --until 0.1
refuses 1 "--until: --method vpl" render no-such.glb --method vpl --until 0.1
refuses 1 "--only indirect-unshadowed: --method path" render no-such.glb --method path --only indirect-unshadowed
for aov in direct indirect shadow-u shadow-s shadow-ratio lights-per-pixel; do
  refuses 1 "--aov $aov: --method path" render no-such.glb --method path --aov $aov=a.exr
done
refuses 1 "--aov indirect: --method vpl" render no-such.glb --method vpl --aov indirect=a.exr
refuses 1 "--spp" render "$cornell" --method path --spp 0
refuses 1 "--ir-vpls" render "$cornell" --method ir --ir-vpls 65537
refuses 2 "lgh, path, vpl, ir" render "$cornell" --method photons
refuses 1 "missing/a.state" render "$cornell" --method path --state missing/a.state
refuses 1 "folder.png" render "$cornell" --method path --state "$work/folder.png"
run render --help
for option in --method --rays --spp --until --ir-vpls --state; do
  grep -q -- "^  $option " "$work/stdout" || fail "render --help has no $option"
done

echo "path"
renders "$cornell" "${path[@]}" --spp 16 -o a.exr -o a.png --aov albedo=b.exr --aov depth=c.exr --aov normal=d.exr --stats a.json
grep -q "^wrote a.exr, a.png, b.exr, c.exr, d.exr, a.json: 64x36, path, 16 samples, estimated error [0-9.e+]* %, [0-9.]* s, [0-9.]* Mrays/s on " \
  "$work/stdout" || fail "closing line: $(cat "$work/stdout")"
[ ! -s "$work/stderr" ] || fail "path is not quiet in a pipe: $(cat "$work/stderr")"
for key in method done total finished estimated_error rays seconds mrays_per_second path; do
  grep -q "\"$key\":" a.json || fail "the statistics of path have no \"$key\""
done
[ "$(number done a.json)" = 16 ] && [ "$(number total a.json)" = 16 ] || fail "path: not 16 of 16 samples"
awk "BEGIN { exit !($(number rays a.json) >= 16 * 64 * 36 / 2 && $(number path a.json) > 0) }" || fail "path: too few rays"
# Neither --frames nor a setting of another method, nor a second run, changes a byte.
renders "$cornell" "${path[@]}" --spp 16 --frames 1 --alpha 2 -o again.exr
cmp a.exr again.exr || fail "path: two runs differ"
rm -f ./*

echo "path stops at an estimated error, and goes on from there"
renders "$cornell" "${path[@]}" --spp 1000000 --until 0.2 --state a.state -o a.exr --stats a.json
done=$(number done a.json)
awk "BEGIN { exit !($done >= 16 && $done < 1000000 && $(number estimated_error a.json) <= 0.2) }" ||
  fail "--until 0.2 stopped after $done samples at an error of $(number estimated_error a.json)"
grep -q '"finished":	true' a.json || fail "--until: not finished"
cp a.state before.state
renders "$cornell" "${path[@]}" --spp 1000000 --until 0.2 --state a.state -o again.exr
cmp a.exr again.exr && cmp a.state before.state || fail "a state that --until finished changed when there was nothing to do"
renders "$cornell" "${path[@]}" --spp $((done + 5)) --state a.state -o a.exr --stats a.json
{ [ "$(number done a.json)" = $((done + 5)) ] && [ "$(number done_before a.json)" = "$done" ]; } || fail "a finished state does not go on"
renders "$cornell" "${path[@]}" --spp 1 --state a.state -o again.exr
grep -q "path, $((done + 5)) samples, " "$work/stdout" || fail "a state with more samples than asked for: $(cat "$work/stdout")"
cmp a.exr again.exr || fail "a state with nothing to add makes another picture"
mv a.state "$work/path.state"
rm -f ./*

echo "a state that does not fit is refused and left alone"
state=$work/path.state
cp "$state" "$work/path.state.before"
refuses 1 'seed' render "$cornell" "${path[@]}" --seed 2 --state "$state"
refuses 1 'bounces' render "$cornell" "${path[@]}" --bounces 1 --state "$state"
refuses 1 'sun' render "$cornell" "${path[@]}" --sun 0,-1,0,10 --state "$state"
refuses 1 'eye' render "$cornell" "${path[@]}" --eye 1,2,3 --state "$state"
refuses 1 'geometry' render "$two_rooms" "${path[@]}" --state "$state"
refuses 1 '65x36' render "$cornell" --method path --size 65x36 --state "$state"
refuses 1 'path.state' render "$cornell" "${tiny[@]}" --method vpl --state "$state"
cmp "$state" "$work/path.state.before" || fail "a refused state was changed"
head -c 5000 "$state" >"$work/cut.state"
{ head -c 20000 "$state"; printf x; tail -c +20002 "$state"; } >"$work/flipped.state"
cmp -s "$state" "$work/flipped.state" && fail "the flipped byte is the same"
echo "not a state" >"$work/text.state"
: >"$work/empty.state"
for name in cut flipped text empty; do
  cp "$work/$name.state" "$work/$name.before"
  refuses 1 "$name.state" render "$cornell" "${path[@]}" --state "$work/$name.state"
  cmp "$work/$name.state" "$work/$name.before" || fail "$name.state was changed"
done

echo "path: what Ctrl-C, SIGTERM and SIGKILL leave goes on to the same bytes as a run that nobody stopped"
for signal in INT TERM; do
  background "$cornell" "${path[@]}" --spp 10000000 --state a.state -o a.exr
  sleep 0.5
  kill -$signal $process
  wait $process
  code=$?
  [ $code = 130 ] || fail "SIG$signal: exit code $code"
  grep -q "interrupted after .* a.state" "$work/stderr" || fail "SIG$signal: $(cat "$work/stderr")"
  [ -s a.exr ] || fail "SIG$signal: no picture"
  rm -f a.exr
done
background "$cornell" "${path[@]}" --spp 10000000 --state a.state -o a.exr
before=$(stat -c %Y%i a.state)
for _ in $(seq 300); do
  [ "$(stat -c %Y%i a.state)" != "$before" ] && break
  sleep 0.1
done
kill -KILL $process
wait $process 2>/dev/null
[ "$(stat -c %Y%i a.state)" != "$before" ] || fail "the state was not saved within 30 s"
[ ! -e a.exr ] || fail "SIGKILL: a picture that is not finished"
renders "$cornell" "${path[@]}" --spp 1 --state a.state -o a.exr --stats a.json
done=$(number done a.json)
renders "$cornell" "${path[@]}" --spp $((done + 7)) --state a.state -o a.exr --stats a.json
{ [ "$done" -gt 1 ] && [ "$(number done_before a.json)" = "$done" ] && [ "$(number done a.json)" = $((done + 7)) ]; } ||
  fail "SIGKILL: $done samples, then $(number done_before a.json) and $(number done a.json)"
renders "$cornell" "${path[@]}" --spp $((done + 7)) --state b.state -o b.exr
cmp a.exr b.exr || fail "the interrupted path run differs from the other one"
rm -f ./*
renders "$cornell" "${path[@]}" --spp 4 -o a.exr
[ "$(ls)" = a.exr ] || fail "without --state: $(ls)"
rm -f ./*

echo "vpl and ir"
vpl=("${tiny[@]}" --method vpl --vpls 600)
renders "$cornell" "${vpl[@]}" -o a.exr --stats a.json
grep -q "^wrote a.exr, a.json: 64x36, vpl, 600 VPL slots, [0-9.]* s, [0-9.]* Mrays/s on " "$work/stdout" || fail "closing line: $(cat "$work/stdout")"
awk "BEGIN { exit !($(number vpls a.json) > 60) }" || fail "vpl: $(number vpls a.json) VPLs"
background "$cornell" "${vpl[@]}" --state a.state -o b.exr
kill -INT $process
wait $process
code=$?
[ $code = 130 ] || [ $code = 0 ] || fail "vpl, interrupted: exit code $code"
renders "$cornell" "${vpl[@]}" --state a.state -o b.exr
cmp a.exr b.exr || fail "the interrupted vpl run differs from the other one"
mv a.state "$work/vpl.state"
rm -f ./*
refuses 1 "vpls" render "$cornell" "${tiny[@]}" --method vpl --vpls 603 --state "$work/vpl.state"
refuses 1 "shadows" render "$cornell" "${vpl[@]}" --shadow-samples 0 --state "$work/vpl.state"
if mountpoint -q "$work/full"; then
  run render "$cornell" --size 320x180 --method vpl --vpls 0 --state "$work/full/a.state" -o a.exr && fail "a state on a full disk: exit code 0"
  { [ "$(grep -c error "$work/stderr")" = 1 ] && grep -qF "$work/full/a.state" "$work/stderr"; } || fail "a state on a full disk: $(cat "$work/stderr")"
  { [ -s a.exr ] && [ -z "$(ls -A "$work/full")" ]; } || fail "a state on a full disk: no picture, or something is left"
fi
rm -f ./*
renders "$cornell" "${tiny[@]}" --method ir --ir-vpls 30 -o a.exr --stats a.json
grep -q "^wrote a.exr, a.json: 64x36, 1 frame, " "$work/stdout" || fail "closing line: $(cat "$work/stdout")"
awk "BEGIN { exit !($(number vpls a.json) > 0 && $(number vpls a.json) <= 30) }" || fail "ir: $(number vpls a.json) VPLs"
rm -f ./*

echo "$failures failed"
[ $failures = 0 ]
