#!/usr/bin/env python3
"""How long `tiltproof fuzz` needs for each planted defect, and what it says of the correct client: the tables of
docs/measurements.md. Not a test: it takes what time it is given.

Usage: measure.py BUILD-FOLDER [--forms coverage,plain,image] [--seeds N] [--time S] [--correct-time S] [--only NAME,...]

Every campaign has one worker and ends with its first finding, or after S seconds by the clock. Seconds in the tables
are the processor's, of all processes of a campaign, its start included: others may use the machine. Progress goes to
standard error, the tables to standard output.
"""
import argparse
import json
import pathlib
import re
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
FORMS = {
    "coverage": ("library with coverage", "library:{}/tests/planted/planted_{}_coverage.so"),
    "plain": ("library without coverage", "library:{}/tests/planted/planted_{}.so"),
    "image": ("image", "qemu:{}/firmware/stm32f4/planted/planted_{}.elf"),
}


def defects():
    text = (HERE / "defects.cmake").read_text()
    return re.search(r"set\(planted_defects\s+([^)]*)\)", text).group(1).split()


def processor_seconds():
    """Of all processes that have ended, and their children."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Campaign:
    """One `tiltproof fuzz`: what it found first, after how many executions and seconds; or nothing."""

    def __init__(self, build, form, name, seed, limit_s, stop_at_finding=True):
        self.finding = self.executions = self.seconds = None
        folder = pathlib.Path(tempfile.mkdtemp(prefix="planted-"))
        begin = processor_seconds()
        process = subprocess.Popen(
            [build / "tiltproof", "fuzz", "--client", FORMS[form][1].format(build, name), "--seed", str(seed), "-j", "1",
             "--time", str(limit_s), "--out", folder, "--no-progress"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for line in process.stdout:
            found = re.match(r"(\w+)-[0-9a-f]{8} after (\d+) inputs?: (.*)", line)
            if found and self.finding is None:
                self.finding, self.executions = found[1], int(found[2])
                self.reason = found[3]
                if stop_at_finding:
                    process.send_signal(signal.SIGINT)
        errors = process.stderr.read()
        if process.wait() == 3:
            raise RuntimeError(f"{name} as {form}, seed {seed}: {errors}")
        self.seconds = processor_seconds() - begin
        self.summary = json.loads((folder / "fuzz.json").read_text())
        shutil.rmtree(folder)


def row(build, form, name, options):
    found = []
    for seed in range(1, options.seeds + 1):
        campaign = Campaign(build, form, name, seed, options.time)
        print(f"{name} as {form}, seed {seed}: " +
              (f"{campaign.finding} after {campaign.executions} executions, {campaign.seconds:.1f} s: {campaign.reason}"
               if campaign.finding else f"nothing in {campaign.summary['executions']} executions"), file=sys.stderr)
        if campaign.finding:
            found.append(campaign)
    kinds = " or ".join(sorted({campaign.finding for campaign in found}))
    if not found:
        return f"0 of {options.seeds}", "", "", ""
    return (f"{len(found)} of {options.seeds}", kinds, f"{statistics.median(campaign.seconds for campaign in found):.1f}",
            f"{statistics.median(campaign.executions for campaign in found):.0f}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--forms", default=",".join(FORMS))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--time", type=float, default=60)
    parser.add_argument("--correct-time", type=float, default=60)
    parser.add_argument("--only", default=",".join(defects()))
    options = parser.parse_args()
    build = options.build.resolve()
    for form in options.forms.split(","):
        print(f"\n| defect, as {FORMS[form][0]} | found | as | s | executions |\n|---|---:|---|---:|---:|")
        for name in filter(None, options.only.split(",")):
            print(f"| `{name}` | " + " | ".join(row(build, form, name, options)) + " |", flush=True)
        if options.correct_time > 0:
            campaign = Campaign(build, form, "correct", 1, options.correct_time, stop_at_finding=False)
            correct = campaign.summary
            print(f"| the correct client | {len(correct['findings'])} findings | | {campaign.seconds:.0f} | "
                  f"{correct['executions']} |", flush=True)


if __name__ == "__main__":
    main()
