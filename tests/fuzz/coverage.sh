#!/usr/bin/env bash
# What the corpus and the earlier findings reach, without a new input: lines and regions by llvm-cov, for the table in
# docs/fuzz-targets.md. A build of its own, build/fuzz-coverage.
#
#   tests/fuzz/coverage.sh [TARGET...]      every target by default; shows the sources in $SOURCES
#   tests/fuzz/coverage.sh --missed FILE    the lines of a source that the last measurement did not reach
set -eu
cd "$(dirname "$(readlink -f "$0")")/../.."
build=build/fuzz-coverage
: "${SOURCES:=link/frame.cpp link/fletcher16.cpp link/message_kind.cpp link/protocol.cpp firmware/messages.cpp
  harness/run/plant_server.cpp harness/run/line.cpp harness/run/receiving_end.cpp harness/run/message_receiver.h}"
objects() { for program in "$build"/tests/fuzz/fuzz_*; do [ ! -f "$program" ] || printf -- '-object\n%s\n' "$program"; done | sed 1d; }

if [ "${1:-}" = --missed ]; then
  # shellcheck disable=SC2046
  llvm-cov show $(objects) -instr-profile="$build/all.profdata" "$2" | grep -E '^ *[0-9]+\| +0\|' || echo "none"
  exit 0
fi

cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ \
  -DCMAKE_C_FLAGS="-O0 -g" -DCMAKE_CXX_FLAGS="-O0 -g -fprofile-instr-generate -fcoverage-mapping" -DCMAKE_UNITY_BUILD=ON \
  -DTILTPROOF_FUZZ=ON -DTILTPROOF_BUILD_TESTS=OFF -DTILTPROOF_BUILD_BENCHMARKS=OFF -DTILTPROOF_STM32F4=OFF >/dev/null
targets=("$@")
[ $# -gt 0 ] || mapfile -t targets < <(tests/fuzz/corpus.sh targets)
cmake --build "$build" --target "${targets[@]/#/fuzz_}"
rm -f "$build"/*.profraw
for target in "${targets[@]}"; do
  LLVM_PROFILE_FILE=$PWD/$build/$target.profraw BUILD=$build tests/fuzz/run.sh 0 "$target"
done
llvm-profdata merge -sparse "$build"/*.profraw -o "$build/all.profdata"
# shellcheck disable=SC2046,SC2086
llvm-cov report $(objects) -instr-profile="$build/all.profdata" $SOURCES
