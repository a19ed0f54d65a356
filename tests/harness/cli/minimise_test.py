#!/usr/bin/env python3
"""The command minimise, on flights whose causes are known.

Usage: minimise_test.py TILTPROOF
"""
import random
import re
import signal
import subprocess
import time
import unittest

from command_line import PROGRAM, CommandLineTest

HEAD = """\
name: NAME
duration_s: 6
seed: 5
reference: {type: line, from_m: [2, 0, 2], to_m: [2.5, 0, 2], time_s: 6}
faults:
FAULTS
criteria:
  - {name: upright, stl: "always(tilt_rad <= 0.6)"}
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


def bias(name, signal_name, offset, start_s=1.0, end_s=None):
    window = f", end_s: {end_s}" if end_s else ""
    return f"  - {{id: {name}, type: sensor.bias, start_s: {start_s}{window}, parameters: {{signal: {signal_name}, offset: {offset}}}}}"


def among(count, causes, seed=1):
    """Faults that are too mild to matter, with the causes between them."""
    draw = random.Random(seed)
    types = ["{id: ID, type: frame.drop, target: both, start_s: 0.5, probability: 0.5, parameters: {probability: 0.01}}",
             "{id: ID, type: sensor.noise, start_s: 0.5, parameters: {signal: y_m, std: 0.001}}",
             "{id: ID, type: plant.force, start_s: 1, end_s: 2, parameters: {force_n: 0.01, direction: [0, 1, 0]}}",
             "{id: ID, type: frame.delay, target: to_client, start_s: 5, parameters: {mean_ms: 0.1}}"]
    lines = ["  - " + draw.choice(types).replace("ID", f"mild{i}") for i in range(count - len(causes))]
    for cause in causes:
        lines.insert(draw.randrange(len(lines) + 1), cause)
    return "\n".join(lines)


class MinimiseTest(CommandLineTest):
    def minimise(self, *arguments, code=0):
        found, out, err = self.tiltproof("minimise", *arguments)
        self.assertEqual(found, code, out + err)
        return out, err

    def failing(self, name="planted", faults=None):
        return self.scenario(name, HEAD, FAULTS=faults or among(12, [bias("one", "z_m", 0.35), bias("two", "z_m", 0.35)]))

    def fails_by(self, file, criterion):
        """The written file, flown by `run`: the time of the violation."""
        code, out, err = self.tiltproof("run", file, "--no-report")
        self.assertEqual(code, 1, out + err)
        [flight] = self.results()["scenarios"]
        times = {found["name"]: found["time_s"] for found in flight["criteria"] if found["verdict"] == "fail"}
        self.assertEqual(min(times, key=times.get), criterion)
        return times[criterion]

    def test_two_of_forty_that_only_fail_together(self):
        scenario = self.failing("forty", among(40, [bias("one", "z_m", 0.35), bias("two", "z_m", 0.35, 2)]))
        out, _ = self.minimise(scenario, "--out", "small.yaml")
        flights = int(re.search(r"^faults: 40 -> 2 in (\d+) flights$", out, re.M)[1])
        self.assertLessEqual(flights, 30)
        self.assertLessEqual(int(re.search(r"^total: (\d+) flights$", out, re.M)[1]), flights + 150)
        text = (self.folder / "small.yaml").read_text()
        self.assertEqual(re.findall(r"- id: \"(\w+)\"", text), ["one", "two"])
        self.assertIn("type: hover", text, "the path does not matter")
        time_s = self.fails_by("small.yaml", "near")
        self.assertRegex(text, rf"^# Minimised by tiltproof minimise from forty \(.*forty\.yaml\), seed 5\.\n# It fails at {time_s:.3f} s: near: ")
        self.assertIn("# 2 of 40 faults are left.\n", text)
        self.assertLess(float(re.search(r"^duration_s: (\S+)$", text, re.M)[1]), time_s + 0.03)
        self.assert_minimal(text)

    def assert_minimal(self, text):
        """Each window one control period shorter at either end, and each severity 2 % milder, is survived."""
        milder = []
        for found in re.finditer(r"start_s: (\d\S*)\n|end_s: (\d\S*)\n|offset: (\S+)\n", text):
            start, end, offset = found.groups()
            new = f"start_s: {float(start) + 0.012:.6f}\n" if start else f"end_s: {float(end) - 0.012:.6f}\n" if end else f"offset: {float(offset) * 0.98}\n"
            milder.append(text[:found.start()] + new + text[found.end():])
        self.assertGreaterEqual(len(milder), 6)
        for i, changed in enumerate(milder):
            self.scenario(f"milder{i}", changed.replace("forty-minimal", f"milder{i}"), folder="milder")
        code, out, err = self.tiltproof("run", "milder", "--keep", "verdicts", "--no-report")
        self.assertEqual(code, 0, out + err)

    def test_a_flight_with_its_seed(self):
        self.failing()
        self.assertEqual(self.tiltproof("run", "planted.yaml", "--seed", "77", "--no-report")[0], 1)
        out, _ = self.minimise(self.latest() / "planted")
        self.assertRegex(out, r"(?m)^faults: 12 -> 2 in \d+ flights$")
        text = (self.folder / "planted-minimal.yaml").read_text()
        self.assertIn("seed: 77\n", text)
        self.fails_by("planted-minimal.yaml", "near")
        # The run's folder is as good, because it has one flight only. A file of this command is written over.
        again, _ = self.minimise(self.latest().parent / "latest", "--seed", "77")
        self.assertRegex(again, r"(?m)^faults: 2 -> 2 in \d+ flights$")

    def test_a_flight_with_its_client(self):
        self.failing("library", bias("one", "z_m", 0.7))
        library = PROGRAM.parent / "lib/libtiltproof_firmware.so"
        self.assertEqual(self.tiltproof("run", "library.yaml", "--client", f"library:{library}", "--no-report")[0], 1)
        out, _ = self.minimise(self.latest() / "library", "--max-runs", "20")
        self.assertIn(f"--client library:{library}", out.replace("'", "").replace("\\\n", ""))

    def test_the_same_every_time(self):
        self.failing()
        outs = [self.minimise("planted.yaml", "--out", "small.yaml")[0] for _ in range(2)]
        self.assertEqual(*outs)

    def test_the_same_with_any_number_of_jobs(self):
        self.failing()
        found = set()
        for jobs in ("1", "2", "5"):
            out, _ = self.minimise("planted.yaml", "-j", jobs, "--out", "small.yaml")
            found.add((out, (self.folder / "small.yaml").read_text()))
        self.assertEqual(len(found), 1)

    def test_as_many_flights_as_allowed(self):
        self.failing()
        out, err = self.minimise("planted.yaml", "--max-runs", "8")
        self.assertIn("total: 8 flights\n", out)
        self.assertIn("--max-runs above 8 may find a smaller one", err)
        self.assertIn("the flights ran out", (self.folder / "planted-minimal.yaml").read_text().lower())
        self.fails_by("planted-minimal.yaml", "near")

    def test_nothing_to_minimise(self):
        self.scenario("passes", HEAD, FAULTS=among(5, []))
        _, err = self.minimise("passes.yaml", code=4)
        self.assertIn("nothing to minimise: the flight 'passes' does not fail", err)
        self.assertFalse((self.folder / "passes-minimal.yaml").exists())

    def test_mistakes(self):
        self.failing()
        (self.folder / "mine.yaml").write_text("name: mine\n")
        for arguments, message in ((("planted.yaml", "--out", "mine.yaml"), "mine.yaml: something else is there"),
                                   (("planted.yaml", "--max-runs", "1"), "--max-runs"),
                                   (("planted.yaml", "--client", "serial:/dev/ttyS0"), "no virtual time"),
                                   (("none.yaml",), "none.yaml"), ((".",), "run.json"),
                                   (("planted.yaml", "--firmware", "papers"), "did you mean 'paper'")):
            _, err = self.minimise(*arguments, code=2)
            self.assertIn(message, err)
        self.assertEqual((self.folder / "mine.yaml").read_text(), "name: mine\n")

    def test_an_interrupt_keeps_the_smallest_so_far(self):
        self.failing("forty", among(40, [bias("one", "z_m", 0.35), bias("two", "z_m", 0.35, 2)]))
        with subprocess.Popen([PROGRAM, "minimise", "forty.yaml"], cwd=self.folder, stdout=subprocess.PIPE, text=True) as process:
            self.assertTrue(process.stdout.readline().startswith("faults: 40 -> 2"))
            process.send_signal(signal.SIGINT)
            deadline = time.monotonic() + 60
            while process.poll() is None and time.monotonic() < deadline:
                time.sleep(0.02)
            process.stdout.read()
        self.assertEqual(process.returncode, 130)
        text = (self.folder / "forty-minimal.yaml").read_text()
        self.assertIn("# The search was interrupted", text)
        self.assertEqual(re.findall(r"- id: \"(\w+)\"", text), ["one", "two"])
        self.fails_by("forty-minimal.yaml", "near")


if __name__ == "__main__":
    import sys
    unittest.main(argv=sys.argv[:1])
