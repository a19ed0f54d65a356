#!/usr/bin/env bash
# How long set-up, build and tests take: cold, in a clone of its own, without a compiler cache. For the table in CONTRIBUTING.md.
#
#   tests/times.sh [--ci] [COMMIT...]    HEAD by default; several are measured one after the other. --ci: .ci/run, too
#
# Wall time and processor time, in seconds. The packages are there already (./setup --test-packages). Other work on the machine
# makes both longer: compare commits that were measured in one go.
set -u
cd "$(dirname "$(readlink -f "$0")")/.."
ci=
[ "${1:-}" != --ci ] || { ci=yes; shift; }
[ $# -gt 0 ] || set -- HEAD
export CCACHE_DISABLE=1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
TIMEFORMAT='%R %U %S'

row() { # WHAT COMMAND...: in the clone
  local what=$1 times state=
  shift
  times=$( { time (cd "$work/$commit" && "$@" >"$work/log" 2>&1) || state=failed; [ -z "$state" ] || echo failed; } 2>&1)
  read -r wall user system state <<<"$(echo "$times" | tr '\n' ' ')"
  awk -v row="| $commit | $what |" -v wall="$wall" -v user="$user" -v kernel="$system" -v why="${state:+failed: $(tail -n 1 "$work/log")}" \
    'BEGIN { printf "%s %.0f | %.0f | %s\n", row, wall, user + kernel, why }'
}

rebuild() { # after a change in one source
  echo '// changed' >>harness/run/plant_server.cpp
  cmake --build --preset dev
}

printf '| commit | what | wall s | processor s |\n|---|---|---:|---:|\n'
for name in "$@"; do
  commit=$(git rev-parse --short "$name") || exit 2
  git clone -q . "$work/$commit" && git -C "$work/$commit" checkout -q "$commit" || exit 2
  row './setup' ./setup
  row './test' ./test
  row './test, nothing changed' ./test
  row 'dev: build' sh -c 'cmake --preset dev && cmake --build --preset dev'
  row 'dev: harness/run/plant_server.cpp changed' rebuild
  if [ -n "$ci" ]; then
    rm -rf "$work/$commit/build"
    row '.ci/run' .ci/run
  fi
  rm -rf "${work:?}/$commit"
done
