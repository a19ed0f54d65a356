#!/usr/bin/env python3
"""Makes `expect` of scenarios what was flown, for each build of the firmware.

Usage: expectations.py [--write] SOURCE_DIR RESULTS...
RESULTS: folders of `tiltproof run scenarios/... --firmware NAME` (or their latest), of one build or several. Prints the flights that are not
green; with --write, says in their files what was flown: each difference is to be understood before it is committed. Verdicts `error` and
`inconclusive` are printed and never written.
"""
import argparse
import json
import pathlib
import re
import sys

BUILDS = ("paper", "tolerant")


def text_of(expected, own):
    """Of the verdicts by build; a build that is not named is to pass. `own`: the scenario's."""
    if len(set(expected.values())) == 1 and own in expected:
        verdict = next(iter(expected.values()))
        return f"expect: {verdict}\n" if verdict != "pass" else ""
    return "expect: {" + ", ".join(f"{build}: {expected[build]}" for build in sorted(expected)) + "}\n"


def said(text):
    """What the file expects of each build."""
    found = re.search(r"^expect: (.*)\n", text, re.M)
    if not found:
        return dict.fromkeys(BUILDS, "pass")
    if not found[1].startswith("{"):
        return dict.fromkeys(BUILDS, found[1])
    return dict.fromkeys(BUILDS, "pass") | dict(re.findall(r"(\w+): (\w+)", found[1]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("results", type=pathlib.Path, nargs="+")
    options = parser.parse_args()
    files = {}
    for file in (options.source / "scenarios").rglob("*.yaml"):
        files[re.search(r"^name: (\S+)", file.read_text(), re.M)[1]] = file
    for folder in options.results:
        command = json.loads((folder / "run.json").read_text())["command"]
        if "--firmware" not in command:
            sys.exit(f"expectations: {folder} was flown without --firmware")
        build = command[command.index("--firmware") + 1]
        for flight in json.loads((folder / "results.json").read_text())["scenarios"]:
            if flight["green"]:
                continue
            file, verdict = files[flight["name"]], flight["verdict"]
            print(f"{file}: {build} is expected to {flight['expected']}: {verdict}: {flight['reason']}")
            if not options.write or verdict not in ("pass", "fail"):
                continue
            text = file.read_text()
            own = re.search(r"^firmware: (\w+)", text, re.M)
            line = text_of(said(text) | {build: verdict}, own[1] if own else BUILDS[0])
            without = re.sub(r"^expect: .*\n", "", text, flags=re.M)
            # Where it stood, or before the length of the flight.
            at = text.find("\nexpect: ") + 1 or re.search(r"^(seed|duration_s): ", without, re.M).start()
            file.write_text(without[:at] + line + without[at:])


if __name__ == "__main__":
    main()
