#!/usr/bin/env python3
"""The flights of the example that plans pass, and the linear regulator fails each. Usage: flights_test.py TILTPROOF LIBRARY SOURCE_DIR"""
import json
import pathlib
import subprocess
import sys
import tempfile

tiltproof, library, source = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])


def fly(folder, *flags):
    """The verdicts by name."""
    subprocess.run([tiltproof, "run", source / "firmware/examples/nmpc/flights", "--out", folder, *flags],
                   stdout=subprocess.PIPE, text=True, check=False)
    results = json.loads((pathlib.Path(folder) / "latest/results.json").read_text())
    return {each["name"]: each["verdict"] for each in results["scenarios"]}


with tempfile.TemporaryDirectory() as folder:
    planned, linear = fly(folder, "--client", f"library:{library}"), fly(folder)
    print(planned, linear, sep="\n")
    sys.exit(0 if len(planned) >= 5 and set(planned.values()) == {"pass"} and set(linear.values()) == {"fail"} else 1)
