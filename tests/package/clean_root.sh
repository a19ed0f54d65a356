#!/usr/bin/env bash
# Installs tiltproof where nothing of it is: fresh roots of Debian 12, as a new user's machine and as the container have it.
#   tests/package/clean_root.sh [--deb FILE] [FOLDER]
# FOLDER (default: a new one in /var/tmp) gets the roots, some 4 GB, and loses them again. With a package that is built
# already the first of them is left out. A file base.tar in FOLDER, with a root `base`, saves the debootstrap.
#
#   build      the Containerfile's first stage: this tree, `./setup --deb`
#   user       apt-get install ./tiltproof_*.deb: flights from the installed share, help, a manual page, the emulator
#   container  the Containerfile's second stage, and a run as its entry point does it
#
# At the end it prints a table of times and sizes. Needs root, debootstrap and apt's mirror; where they are missing it says so
# and exits 77, which ctest and others take for "skipped".
set -euo pipefail

say() { printf 'clean_root: %s\n' "$*"; }
skip() { say "skipped: $*"; exit 77; }
[ "$(id -u)" -eq 0 ] || skip "only root may make a root; run it with sudo"
command -v debootstrap >/dev/null || skip "debootstrap is missing: apt-get install debootstrap"

package=
if [ "${1:-}" = --deb ]; then
  package=$(readlink -e "$2") || { say "error: no file $2"; exit 2; }
  shift 2
fi
source=$(cd "$(dirname "$0")/../.." && pwd)
folder=${1:-$(mktemp -d /var/tmp/tiltproof-roots-XXXXXX)}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 2>/dev/null | grep '/debian$' | head -n 1) || true
mirror=${mirror:-http://deb.debian.org/debian}
roots=(base build user container)
# A root that is mounted into would take what is mounted with it.
remove_roots() { for root in "${roots[@]}"; do rm -rf --one-file-system "${folder:?}/$root"; done; }
trap 'remove_roots; rmdir "$folder" 2>/dev/null || true' EXIT
remove_roots

# inside ROOT COMMAND...: in a fresh shell of that root. What is mounted for it is gone when it ends.
inside() {
  local root=$folder/$1
  shift
  unshare --mount --pid --fork --kill-child sh -ec '
    root=$1; shift
    mount --make-rprivate /
    mount -t proc proc "$root/proc"
    mount -t tmpfs -o mode=755 dev "$root/dev"
    for device in null zero full random urandom; do touch "$root/dev/$device"; mount --bind "/dev/$device" "$root/dev/$device"; done
    mkdir "$root/dev/shm"; mount -t tmpfs shm "$root/dev/shm"
    ln -s /proc/self/fd "$root/dev/fd"; ln -s fd/0 "$root/dev/stdin"; ln -s fd/1 "$root/dev/stdout"; ln -s fd/2 "$root/dev/stderr"
    exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"
  ' sh "$root" "$@"
}

table="| step | s | MB more on the disk |
|---|---:|---:|"
used() { du -sxm "$folder/$1" | cut -f 1; }
# step ROOT WHAT COMMAND...: runs it there, and writes its line of the table.
step() {
  local root=$1 what=$2 began before
  shift 2
  say "$root: $what"
  before=$(used "$root")
  began=$(date +%s)
  inside "$root" sh -ec "$*" || { say "FAILED in the root '$root': $what"; exit 1; }
  table+=$'\n'"| $root: $what | $(($(date +%s) - began)) | $(($(used "$root") - before)) |"
}

if [ -f "$folder/base.tar" ]; then
  say "a minimal Debian 12 from $folder/base.tar"
  tar -C "$folder" -xf "$folder/base.tar"
else
  say "a minimal Debian 12 from $mirror"
  debootstrap --variant=minbase bookworm "$folder/base" "$mirror" >"$folder/debootstrap.log" 2>&1 ||
    { tail -n 5 "$folder/debootstrap.log" >&2; skip "debootstrap cannot reach $mirror"; }
  rm "$folder/debootstrap.log"
fi
# As the images of Debian for containers: what was fetched is not kept.
inside base apt-get clean
apt-config dump --format '%f "%v";%n' Acquire::http::Proxy >"$folder/base/etc/apt/apt.conf.d/01proxy"
for root in build user container; do cp -a --one-file-system --reflink=auto "$folder/base" "$folder/$root"; done

# run_lines STAGE: the commands of the Containerfile's stage, 1 or 2.
run_lines() {
  awk -v wanted="$1" '/^FROM/ { stage++ } stage == wanted && (/^RUN/ || more) { sub(/^RUN /, ""); more = sub(/\\$/, ""); print }' \
    "$source/Containerfile"
}

if [ -z "$package" ]; then
  # What git knows of, as it is.
  mkdir "$folder/build/src"
  git -C "$source" ls-files -z | tar -C "$source" --null --files-from=- -cf - | tar -C "$folder/build/src" -xf -
  step build "$(run_lines 1)" "cd /src && $(run_lines 1)"
  package=$(echo "$folder"/build/src/build/release/tiltproof_*.deb)
fi
say "$(basename "$package"): $(stat -c %s "$package") bytes"

cp "$package" "$folder/user/root/"
step user "apt-get update" "apt-get update -q"
step user "apt-get install ./tiltproof_*.deb" "cd /root && apt-get install -q -y --no-install-recommends ./tiltproof_*.deb"
inside user sh -ec '! command -v c++ && ! command -v cmake' || { say "FAILED: the package brings a compiler"; exit 1; }
step user "tiltproof run /usr/share/tiltproof/scenarios/paper" "cd /root && tiltproof run /usr/share/tiltproof/scenarios/paper && test -s results/latest/report.html"
step user "tiltproof run --help" "tiltproof run --help | grep -q -- --live"
step user "the manual page" "gzip -dc /usr/share/man/man1/tiltproof-run.1.gz | grep -q -- live "
step user "apt-get install qemu-system-arm" "apt-get install -q -y --no-install-recommends qemu-system-arm"
step user "run .../paper -k hover --client qemu" "cd /root && tiltproof run /usr/share/tiltproof/scenarios/paper -k hover --client qemu"
step user "the example project's sources, and no build tree" "test -f /usr/share/tiltproof/examples/out_of_tree/CMakeLists.txt && test ! -e /src"
step user "apt-get purge tiltproof" "apt-get purge -q -y tiltproof && test ! -e /usr/share/tiltproof"

cp "$package" "$folder/container/tmp/"
step container "the second stage" "$(run_lines 2)"
step container "its entry point: tiltproof run .../paper" "mkdir -p /work && cd /work && tiltproof run /usr/share/tiltproof/scenarios/paper"

printf '%s\n' "$table"
say "done"
