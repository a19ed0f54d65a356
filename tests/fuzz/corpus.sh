#!/usr/bin/env bash
# The corpora of the fuzz targets, one archive each: tests/fuzz/corpus/TARGET.tar.
#
#   tests/fuzz/corpus.sh targets                  the targets that have one
#   tests/fuzz/corpus.sh unpack TARGET FOLDER     writes its inputs into a folder, one file each
#   tests/fuzz/corpus.sh pack TARGET FOLDER       replaces the archive by the files of a folder
#   tests/fuzz/corpus.sh merge TARGET             adds what run.sh has found: the fewest inputs that reach every edge;
#                                                 BUILD=build/fuzz says which build
set -eu
here=$(dirname "$(readlink -f "$0")")

usage() { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }

unpack() { # TARGET FOLDER
  rm -rf "$2"
  mkdir -p "$2"
  tar -xf "$here/corpus/$1.tar" -C "$2"
}

# The same files give the same bytes.
pack() { # TARGET FOLDER
  (cd "$2" && LC_ALL=C ls) | tar --create --file "$here/corpus/$1.tar.part" --directory "$2" --format=ustar --owner=0 --group=0 \
    --numeric-owner --mode=0644 --mtime=@0 --verbatim-files-from --files-from=-
  mv "$here/corpus/$1.tar.part" "$here/corpus/$1.tar"
}

merge() { # TARGET
  local build=${BUILD:-build/fuzz} work
  work=$(mktemp -d)
  # shellcheck disable=SC2064
  trap "rm -rf '$work'" EXIT
  unpack "$1" "$work/before"
  mkdir -p "$work/merged" "$build/found/$1"
  "$build/tests/fuzz/fuzz_$1" -set_cover_merge=1 -use_counters=0 "$work/merged" "$work/before" "$build/found/$1"
  pack "$1" "$work/merged"
}

case "${1:-} $#" in
  "targets 1") for archive in "$here"/corpus/*.tar; do basename "$archive" .tar; done ;;
  "unpack 3" | "pack 3") "$@" ;;
  "merge 2") merge "$2" ;;
  *) usage ;;
esac
