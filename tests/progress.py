#!/usr/bin/env python3
"""Shows how far CTest is: `ctest ... 2>&1 | progress.py LOG`.

On a terminal one line that moves, elsewhere a line now and then; then what failed, and which tests took longest. LOG gets all that CTest
prints.
"""
import re
import sys
import time

# "  12/80 Test   #3: cli_fuzz ........................   Passed   64.13 sec"
ENDED = re.compile(r"\s*(\d+)/(\d+) Test\s+#\d+: (\S+) \.*\s*(\**)(.*?)\s+([\d.]+) sec")
EVERY_S = 20
SLOWEST_COUNT = 5


def main():
    moving = sys.stdout.isatty()
    erase = "\r\033[K" if moving else ""
    began = shown = time.monotonic()
    times, failed = [], False
    with open(sys.argv[1], "w", encoding="utf-8", buffering=1) as log:
        for line in sys.stdin:
            log.write(line)
            ended = ENDED.match(line)
            if not ended:
                # A failed test's line is followed by what it printed, and then by the next test's.
                if line.endswith("tests failed out of %d\n" % len(times)) or failed and not re.match(r"\s*Start\s+\d+:", line):
                    print(f"{erase}{line}", end="", flush=True)
                continue
            count, total, name, stars, state, seconds = ended.groups()
            times.append((float(seconds), name))
            failed = bool(stars)
            now = time.monotonic()
            if failed:
                print(f"{erase}{name}: {state.strip()}", flush=True)
            elif moving:
                print(f"{erase}{count} of {total} tests, {now - began:.0f} s: {name}", end="", flush=True)
            elif now - shown >= EVERY_S or count == total:
                print(f"{count} of {total} tests, {now - began:.0f} s", flush=True)
                shown = now
    times.sort(reverse=True)
    print(f"{erase}{time.monotonic() - began:.0f} s; the slowest: " + ", ".join(f"{name} {seconds:.0f} s" for seconds, name in times[:SLOWEST_COUNT]))


if __name__ == "__main__":
    main()
