#!/usr/bin/env bash
# Builds the fuzz targets as OSS-Fuzz asks for them: with the compilers, flags and engine that it gives, into $OUT, each
# with its corpus and its dictionary, and with the libraries that a bare machine does not have.
#
# In OSS-Fuzz's container $CC, $CXX, $CFLAGS, $CXXFLAGS, $LIB_FUZZING_ENGINE and $OUT are set. By hand, with clang
# (packages.txt) and zip:
#
#   OUT=/tmp/out tests/fuzz/oss-fuzz/build.sh [TARGET...]
set -eu
source_root=$(dirname "$(readlink -f "$0")")/../../..
: "${OUT:?says where the programs go}" "${CC:=clang}" "${CXX:=clang++}" "${LIB_FUZZING_ENGINE:=-fsanitize=fuzzer}"
: "${CFLAGS=-O1 -gline-tables-only -fsanitize=address,fuzzer-no-link}" "${CXXFLAGS=$CFLAGS}" "${WORK:=$OUT/../work}"
# The C++ libraries that we link (SDF, YAML, fmt) are the distribution's: with libstdc++.
CXXFLAGS=${CXXFLAGS//-stdlib=libc++/}
export CC CXX CFLAGS CXXFLAGS

mkdir -p "$OUT/lib" "$WORK"
cmake -S "$source_root" -B "$WORK/build" -G Ninja -DCMAKE_BUILD_TYPE=None -DTILTPROOF_FUZZ=ON \
  -DTILTPROOF_FUZZ_ENGINE="$LIB_FUZZING_ENGINE" -DTILTPROOF_BUILD_TESTS=OFF \
  -DTILTPROOF_BUILD_BENCHMARKS=OFF -DTILTPROOF_STM32F4=OFF -DCMAKE_UNITY_BUILD=ON \
  -DCMAKE_BUILD_RPATH='$ORIGIN/lib' >/dev/null
targets=("$@")
[ $# -gt 0 ] || mapfile -t targets < <("$source_root/tests/fuzz/corpus.sh" targets)
cmake --build "$WORK/build" --target "${targets[@]/#/fuzz_}"

for target in "${targets[@]}"; do
  program=$WORK/build/tests/fuzz/fuzz_$target
  cp "$program" "$OUT/"
  ldd "$program" | awk '$3 ~ /^\// {print $3}' | grep -vE '/lib(c|m|dl|rt|pthread|gcc_s)\.so' | xargs -r cp -Lut "$OUT/lib"
  "$source_root/tests/fuzz/corpus.sh" unpack "$target" "$WORK/corpus/$target"
  inputs=("$WORK/corpus/$target"/*)
  [ ! -d "$source_root/tests/fuzz/regressions/$target" ] || inputs+=("$source_root/tests/fuzz/regressions/$target"/*)
  rm -f "$OUT/fuzz_${target}_seed_corpus.zip"
  zip -q -j "$OUT/fuzz_${target}_seed_corpus.zip" "${inputs[@]}"
  [ ! -f "$source_root/tests/fuzz/$target.dict" ] || cp "$source_root/tests/fuzz/$target.dict" "$OUT/fuzz_$target.dict"
done
