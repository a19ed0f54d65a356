#!/usr/bin/env bash
# Runs fuzz targets of a build (cmake --preset fuzz && cmake --build --preset fuzz): first the corpus and all earlier
# findings, then new inputs.
#
#   tests/fuzz/run.sh SECONDS [TARGET...]    every target by default; SECONDS of new inputs each, 0: none
#
# BUILD=build/fuzz says which build. Inputs of interest go on in BUILD/found/TARGET; an input that breaks something is
# BUILD/found/TARGET.crash-* (docs/fuzz-targets.md says what to do with it). Exit code 1 when a target fails.
set -u
# Readers of files get theirs from here: from memory several times as fast.
[ -n "${TMPDIR:-}" ] || [ ! -w /dev/shm ] || export TMPDIR=/dev/shm
here=$(dirname "$(readlink -f "$0")")
build=${BUILD:-build/fuzz}
[ $# -ge 1 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0" >&2; exit 2; }
seconds=$1
shift
targets=("$@")
[ $# -gt 0 ] || mapfile -t targets < <("$here/corpus.sh" targets)
if [ ${#targets[@]} -gt 1 ]; then # as many at once as there are processors
  printf '%s\n' "${targets[@]}" | xargs -P "$(nproc)" -n 1 "$here/run.sh" "$seconds"
  exit $(($? > 0))
fi

target=${targets[0]}
program=$build/tests/fuzz/fuzz_$target
[ -x "$program" ] || { echo "$target: there is no $program" >&2; exit 2; }
mkdir -p "$build/found/$target"
log=$build/found/$target.log
"$here/corpus.sh" unpack "$target" "$build/corpus/$target" || exit 2
inputs=("$build/corpus/$target")
[ -d "$here/regressions/$target" ] && inputs+=("$here/regressions/$target")
flags=(-timeout=20 "-artifact_prefix=$build/found/$target.")
[ -f "$here/$target.dict" ] && flags+=("-dict=$here/$target.dict")
if "$program" "${flags[@]}" -runs=0 "${inputs[@]}" >"$log" 2>&1 &&
  { [ "$seconds" = 0 ] || "$program" "${flags[@]}" -max_total_time="$seconds" "$build/found/$target" "${inputs[@]}" >"$log" 2>&1; }; then
  printf '%-22s %s\n' "$target" "$(grep -E '^#[0-9]+[[:space:]]+(DONE|INITED)' "$log" | tail -n 1 | tr '\t' ' ')"
else
  tail -n 60 "$log"
  printf '%-22s FAILED: %s\n' "$target" "$(grep -m 1 -E '^does not hold|^SUMMARY|runtime error' "$log")"
  exit 1
fi
