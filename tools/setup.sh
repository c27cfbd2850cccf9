#!/usr/bin/env bash
# Installs what Lanternfield needs on Debian 12. Safe to run again: when nothing is missing it
# returns at once and touches nothing.
set -euo pipefail

# Package and what it is for; `-t` in the third column takes it from bookworm-backports.
packages='
build-essential|the C and C++ compilers|
cmake|the build|
ninja-build|the build|
pkg-config|finding libraries|
libvulkan-dev|Vulkan headers and loader|
mesa-vulkan-drivers|lavapipe with ray query, which stock Debian 12 lacks|-t
vulkan-validationlayers|validation in the device tests|
glslang-dev|compiling shaders|
glslang-tools|named by the CMake files of glslang-dev|
spirv-tools|checking shaders (spirv-val)|
libspirv-cross-c-shared-dev|reading shader bindings|
libcglm-dev|matrices and vectors|
libtinygltf-dev|reading glTF|
libmeshoptimizer-dev|vertex order|
libstb-dev|PNG and JPEG|
libtinyexr-dev|OpenEXR images|
libcjson-dev|statistics and suites|
libembree-dev|rays on the CPU|
libosd-dev|subdivision surfaces|
gnuplot-nox|charts|
ffmpeg|movies, which lanternfield play makes|
'

missing=() backports=()
while IFS='|' read -r name purpose from; do
  [ -n "$name" ] || continue
  version=$(dpkg-query -W -f='${db:Status-Status} ${Version}' "$name" 2>/dev/null || true)
  case "$from:$version" in
    :"installed "* | -t:"installed "[0-9]*~bpo12*) continue ;;
    -t:"installed "*) dpkg --compare-versions "${version#* }" ge 24 && continue ;;
  esac
  echo "setup: needs $name ($purpose)"
  if [ -n "$from" ]; then backports+=("$name"); else missing+=("$name"); fi
done <<<"$packages"
[ ${#missing[@]} -gt 0 ] || [ ${#backports[@]} -gt 0 ] || exit 0

command -v apt-get >/dev/null || { echo "setup: no apt-get here; install the packages above by hand" >&2; exit 1; }
as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
apt() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 "$@"; }

apt update || { echo "setup: apt-get update failed; are the machine's Debian sources reachable?" >&2; exit 1; }

if [ ${#backports[@]} -gt 0 ] && ! apt-get indextargets --format '$(RELEASE) $(CODENAME)' | grep bookworm-backports >/dev/null; then
  # The address comes from the machine's own bookworm source, so that mirrors keep working.
  uri=$(apt-get indextargets --format '$(CODENAME)|$(COMPONENT)|$(REPO_URI)' | sed -n 's/^bookworm|main|//p' | head -n 1)
  [ -n "$uri" ] ||
    { echo "setup: no source for Debian 12 (bookworm, main) is configured, so bookworm-backports cannot be found" >&2; exit 1; }
  source=/etc/apt/sources.list.d/lanternfield-backports.sources
  keyring=/usr/share/keyrings/debian-archive-keyring.gpg
  echo "setup: adding bookworm-backports ($source)"
  { printf '%s\n' 'Types: deb' "URIs: $uri" 'Suites: bookworm-backports' 'Components: main'
    if [ -e $keyring ]; then echo "Signed-By: $keyring"; fi; } | as_root tee "$source" >/dev/null
  apt update || { as_root rm -f "$source"; echo "setup: bookworm-backports is not at $uri" >&2; exit 1; }
fi

[ ${#missing[@]} -eq 0 ] || apt install -y --no-install-recommends "${missing[@]}" >/dev/null
[ ${#backports[@]} -eq 0 ] || apt install -y --no-install-recommends -t bookworm-backports "${backports[@]}" >/dev/null
echo "setup: done"
