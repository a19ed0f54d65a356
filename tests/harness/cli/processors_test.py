#!/usr/bin/env python3
"""The same bits on every processor. Usage: processors_test.py TILTPROOF SOURCE_DIR

glibc chooses its elementary functions by the processor, and GLIBC_TUNABLES makes it believe in a lesser one. The flights of the paper and
wire suites must be those of tests/golden/flights.json, whatever it believes.
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import command_line
from golden_flights import flown

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])
GOLDEN = SOURCE / "tests/golden/flights.json"
SUITES = [SOURCE / "scenarios/paper", SOURCE / "scenarios/wire"]
# One for each variant that glibc has of an elementary function, but that of this processor: golden_flights_test.py flies as it is. On a
# processor without these features the flights are the same by themselves, and the golden hashes remain a test.
LESSER_PROCESSORS = {"without FMA": "-FMA,-FMA4", "with SSE2 alone": "-AVX,-AVX2,-FMA,-FMA4,-SSE4_1,-SSE4_2"}
# Functions that IEEE 754 or C define to the last bit, and those for the environment and the parts of a number.
EXACT = re.compile(r"(fabs|floor|ceil|trunc|l?l?round|roundeven|l?l?rint|nearbyint|fmod|remainder|remquo|fma|fmin|fmax|fdim|copysign|ldexp|scalbl?n|frexp|"
                   r"modf|nextafter|nexttoward|ilogb|logb|sqrt)[fl]?|fe\w+|__(isnan|isinf|finite|signbit|fpclassify)\w*|matherr|signgam")


def environment(hwcaps=None, **more):
    result = {name: value for name, value in os.environ.items() if name != "GLIBC_TUNABLES"}
    if hwcaps:
        result["GLIBC_TUNABLES"] = "glibc.cpu.hwcaps=" + hwcaps
    return result | more


def run(*arguments, cwd, env):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, env=env, timeout=240, check=False)


def fly(folder, env):
    done = run("run", *SUITES, "-j", os.cpu_count(), "--no-progress", "--no-report", cwd=folder, env=env)
    if done.returncode != 0:
        raise AssertionError(done.stdout + done.stderr)
    return flown(folder / "results/latest")


class ProcessorsTest(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-processors-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def test_flights_are_the_golden_ones_on_every_processor(self):
        golden = {name: flight for name, flight in json.loads(GOLDEN.read_text())["host"].items() if name.split("-")[0] in ("paper", "wire")}
        for name, hwcaps in LESSER_PROCESSORS.items():
            with self.subTest(processor=name):
                flown = fly(self.folder, environment(hwcaps))
                self.assertEqual(flown, golden)

    def test_designs_are_the_same(self):
        model = SOURCE / "plant/models/tiltrotor.sdf"
        designs = set()
        for hwcaps in [None, *LESSER_PROCESSORS.values()]:
            done = run("design-lqr", model, "--csv", "gain.csv", cwd=self.folder, env=environment(hwcaps))
            self.assertEqual(done.returncode, 0, done.stderr)
            designs.add(done.stdout + (self.folder / "gain.csv").read_text())
        self.assertEqual(len(designs), 1, designs)

    def test_a_difference_names_the_machine(self):
        scenarios = [SOURCE / "scenarios/paper", "-k", "paper-hover", "--no-progress"]
        for out, env in (("a", environment()), ("b", environment("-AVX,-AVX2,-FMA,-FMA4"))):
            self.assertEqual(run("run", *scenarios, "--out", out, cwd=self.folder, env=env).returncode, 0)
        machine, lesser = (json.loads((self.folder / out / "latest/run.json").read_text())["machine"] for out in "ab")
        self.assertRegex(machine["compiler"], r"^(GCC|Clang) \d+\.")
        self.assertRegex(machine["libc"], r"^glibc 2\.\d+$")
        self.assertTrue(machine["processor"])
        self.assertEqual({**machine, "processor_features": ""}, {**lesser, "processor_features": ""})
        self.assertNotIn("AVX", lesser["processor_features"])

        def edit(file, old, new):
            path = self.folder / "a/latest" / file
            path.write_text(path.read_text().replace(old, new, 1))

        command_line.CommandLineTest.forget_hashes(self.folder / "a/latest/paper-hover")
        edit("run.json", '"libc": "glibc 2', '"libc": "glibc 1')
        edit("paper-hover/verdict.json", '"verdict": "pass"', '"verdict": "fail"')
        done = run("compare", "a/latest", "b/latest", cwd=self.folder, env=environment())
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertRegex(done.stdout, r"another machine: libc 'glibc 1\.\d+' in A, 'glibc 2\.\d+' in B; processor_features ")
        edit("paper-hover/verdict.json", '"trace_hash": "', '"trace_hash": "x')
        done = run("replay", "a/latest", cwd=self.folder, env=environment())
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("DIFFERENT", done.stdout)
        self.assertRegex(done.stdout, r"another machine: libc 'glibc 1\.\d+' then, 'glibc 2\.\d+' now\n")
        self.assertNotIn("another machine", run("replay", "b/latest", cwd=self.folder, env=environment()).stdout)

    def test_no_library_takes_an_inexact_function_from_libm(self):
        """Every function that any part of the process could call: of the program, of ODE, of the firmware that it loads."""
        done = run("run", SOURCE / "scenarios/paper", "-k", "paper-hover", "-j1", cwd=self.folder,
                   env=environment(LD_BIND_NOW="1", LD_DEBUG="bindings", LD_DEBUG_OUTPUT=str(self.folder / "bindings")))
        self.assertEqual(done.returncode, 0, done.stderr)
        text = "".join(path.read_text() for path in self.folder.glob("bindings.*"))
        bindings = set(re.findall(r"binding file (\S+) \[\d+\] to (\S+) \[\d+\]: normal symbol `(\w+)'", text))
        self.assertTrue(any("tiltproof_firmware" in user for user, _, _ in bindings))
        from_libm = {(user, function) for user, giver, function in bindings if "/libm.so" in giver and "/libm.so" not in user}
        self.assertEqual({entry for entry in from_libm if not EXACT.fullmatch(entry[1])}, set(),
                         "these depend on the processor: give them a fixed one in link/deterministic_math.c")
        # And what ODE calls for its rotations is ours.
        of_ode = {function: giver for user, giver, function in bindings if "/libode.so" in user}
        for function in ("sincos", "asin", "acos", "atan2"):
            self.assertEqual(pathlib.Path(of_ode[function]).name, PROGRAM.name, function)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
