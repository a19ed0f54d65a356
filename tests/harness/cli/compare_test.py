#!/usr/bin/env python3
"""`tiltproof compare` as a user runs it. Usage: compare_test.py TILTPROOF"""
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(sys.argv[1]).resolve()

HOVER = """\
name: NAME
duration_s: 1.2
seed: 3
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


class CompareTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-compare-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def tiltproof(self, *arguments):
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, cwd=self.folder, timeout=120, check=False)
        return done.returncode, done.stdout.decode(), done.stderr.decode()

    def fly(self, names=("hover",), text=HOVER, flags=(), **changes):
        """A run folder with a flight of each name."""
        for old, new in changes.items():
            text = text.replace(old, new)
        suite = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        for name in names:
            (suite / f"{name}.yaml").write_text(text.replace("NAME", name))
        code, out, err = self.tiltproof("run", suite, "--out", suite / "out", *flags)
        self.assertIn(code, (0, 1), out + err)
        return (suite / "out/latest").resolve()

    def compare(self, *arguments):
        code, out, err = self.tiltproof("compare", *arguments, "--format", "jsonl")
        return code, [json.loads(line) for line in out.splitlines()], err

    def columns(self, run, name="hover"):
        rows = [line.split(",") for line in (run / name / "trace.csv").read_text().splitlines()]
        return {column: [float(row[i]) for row in rows[1:]] for i, column in enumerate(rows[0])}

    def test_the_same_flight_twice_is_identical(self):
        a, b = self.fly(), self.fly()
        code, out, err = self.tiltproof("compare", a, b)
        self.assertEqual((code, err), (0, ""), out)
        self.assertRegex(out, r"IDENTICAL +hover +to the bit")
        self.assertIn("1 of 1 flights identical, 0 within 0.001 (m, rad, m/s, rad/s), 0 different", out)
        code, (entry,), _ = self.compare(a, b)
        self.assertEqual((code, entry["identical"], entry["differs"]), (0, True, False))
        self.assertTrue(all(column["max"] == column["rms"] == 0 for column in entry["columns"]))
        self.assertEqual(entry["rows"], {"a": 101, "b": 101, "matched": 101})

    def test_numbers_are_those_of_the_traces(self):
        """Two builds of the firmware, with gains of their own; expectations straight from the files."""
        faulty = HOVER + "faults:\n  - {id: drop, type: frame.drop, target: to_client, start_s: 0.3, parameters: {probability: 0.3}}\n"
        start = "initial: {position_m: [0.2, 0, 2]}\nfirmware: "
        a = self.fly(text=faulty, **{"seed: 3": start + "paper\nseed: 3"})
        b = self.fly(text=faulty, **{"seed: 3": start + "paper_published\nseed: 3"})
        code, (entry,), err = self.compare(a, b)
        self.assertEqual(err, "")
        in_a, in_b = self.columns(a), self.columns(b)
        self.assertEqual(in_a["t_s"], in_b["t_s"])
        found = {column["name"]: column for column in entry["columns"]}
        self.assertEqual(set(found), set(in_a) - {"t_s"})
        for name, column in found.items():
            apart = [abs(x - y) for x, y in zip(in_a[name], in_b[name]) if not (math.isnan(x) or math.isnan(y))]
            self.assertAlmostEqual(column["max"], max(apart, default=0), places=12, msg=name)
            self.assertAlmostEqual(column["rms"], math.sqrt(sum(d * d for d in apart) / max(len(apart), 1)), places=12, msg=name)
        self.assertEqual([c["max"] for c in entry["columns"]], sorted((c["max"] for c in entry["columns"]), reverse=True))
        vehicle = list(in_a)[1:17]
        beyond = [t for i, t in enumerate(in_a["t_s"]) if any(abs(in_a[c][i] - in_b[c][i]) > 1e-3 for c in vehicle)]
        self.assertEqual(entry["differs"], bool(beyond))
        self.assertEqual(code, 1 if beyond else 0)
        if beyond:
            self.assertEqual(entry["first_difference"]["time_s"], beyond[0])
            self.assertEqual(entry["first_difference"]["period"], round(beyond[0] / 0.012))
        # A tolerance just below and just above the greatest difference decides.
        greatest = max(abs(x - y) for c in vehicle for x, y in zip(in_a[c], in_b[c]))
        self.assertGreater(greatest, 0)
        self.assertEqual(self.compare(a, b, "--tolerance", greatest * 1.001)[0], 0)
        self.assertEqual(self.compare(a, b, "--tolerance", greatest * 0.999)[0], 1)
        metrics = {run: json.loads((run / "hover/verdict.json").read_text())["metrics"] for run in (a, b)}
        for name in ("timing.request_period_mean_ms", "timing.reply_latency_p99_ms", "timing.firmware_missed_count"):
            self.assertEqual(entry["metrics"][name], {"a": metrics[a][name], "b": metrics[b][name]})
        _, human, _ = self.tiltproof("compare", a, b, "--tolerance", greatest / 2)
        self.assertRegex(human, r"DIFFERENT +hover +apart by more than \S+ from \d\.\d+ s on \(period \d+\): \w+ is \S+ in A")
        self.assertIn("max difference", human)

    def test_a_verdict_that_changed_is_a_difference(self):
        a = self.fly()
        b = self.fly(**{"position_error_m <= 0.5": "position_error_m < 0"})
        code, out, _ = self.tiltproof("compare", a, b)
        self.assertEqual(code, 1)
        self.assertRegex(out, r"DIFFERENT +hover +verdict pass in A, fail in B")

    def test_scenarios_that_only_one_has_are_named(self):
        a, b = self.fly(("hover", "here")), self.fly(("hover", "there"))
        code, out, _ = self.tiltproof("compare", a, b)
        self.assertEqual(code, 1)
        self.assertRegex(out, r"UNMATCHED +here +only in A\n")
        self.assertRegex(out, r"UNMATCHED +there +only in B\n")
        self.assertRegex(out, r"IDENTICAL +hover")
        self.assertTrue(out.endswith(", 1 only in A, 1 only in B\n"))
        _, lines, _ = self.compare(a, b)
        self.assertEqual([(line["scenario"], line.get("only_in")) for line in lines], [("hover", None), ("here", "a"), ("there", "b")])
        # Asked for one scenario, the others are not missing; two folders are a pair by whatever name.
        self.assertEqual(self.tiltproof("compare", a / "hover", b)[0], 0)
        self.assertEqual(self.tiltproof("compare", a, b / "hover")[0], 0)
        code, out, _ = self.tiltproof("compare", a / "here", b / "there")
        self.assertEqual(code, 0)
        self.assertIn("here and there", out)
        code, _, err = self.tiltproof("compare", a / "here", b)
        self.assertEqual(code, 2)
        self.assertIn("have no scenario of the same name", err)

    def test_different_flights_are_not_compared(self):
        a = self.fly()
        for old, new, said in (("seed: 3", "seed: 4", "seed: 3 and 4"), ("duration_s: 1.2", "duration_s: 0.6", "duration_s: 1.2 and 0.6"),
                               ("[0, 0, 2]", "[0, 0, 3]", ": [0, 0, 2] and [0, 0, 3]")):
            code, out, err = self.tiltproof("compare", a, self.fly(**{old: new}))
            self.assertEqual((code, out), (2, ""), said)
            self.assertIn("different flights", err)
            self.assertIn(said, err)

    def test_anyway_compares_different_flights_and_says_what_differs(self):
        a = self.fly()
        b = self.fly(**{"seed: 3": "seed: 4", "duration_s: 1.2": "duration_s: 0.6"})
        self.assertIn("--anyway compares them", self.tiltproof("compare", a, b)[2])
        code, out, err = self.tiltproof("compare", a, b, "--anyway")
        self.assertEqual((code, err), (1, ""), out)
        for said in (r"DIFFERENT +hover +different flights: seed: 3 and 4\n", r"\n +different flights: duration_s: 1.2 and 0.6\n",
                     r"\n +101 rows to 1.200 s in A, 51 to 0.600 s in B; 51 in both\n"):
            self.assertRegex(out, said)
        _, (entry,), _ = self.compare(a, b, "--anyway")
        self.assertEqual(entry["different_flights"], ["seed: 3 and 4", "duration_s: 1.2 and 0.6"])
        self.assertEqual(self.compare(a, a, "--anyway")[1][0]["different_flights"], [])
        self.assertEqual(self.tiltproof("compare", a, b, "--anyway", "--baseline")[0], 2)

    def test_a_flight_that_ended_early_says_how_long_both_are(self):
        a, b = self.fly(), self.fly()
        trace = b / "hover/trace.csv"
        trace.write_text("".join(trace.read_text().splitlines(keepends=True)[:51]))
        code, out, err = self.tiltproof("compare", a, b)
        self.assertEqual(code, 3)
        self.assertRegex(err, r"UNREADABLE +hover +\S*trace.csv has changed since the flight")
        self.assertNotIn("UNREADABLE", out)
        crash = "harness.canary, start_s: 0.1"
        c = self.fly(text=HOVER + f"faults:\n  - {{id: f, type: {crash}}}\n", **{"duration_s: 1.2": "duration_s: 3"})
        d = self.fly(text=HOVER + f"faults:\n  - {{id: f, type: {crash}}}\n", **{"duration_s: 1.2": "duration_s: 3", "seed: 3": "initial: {position_m: [0, 0, 2]}\nseed: 3"})
        self.assertEqual(self.tiltproof("compare", c, d)[0], 0)
        flight = json.loads((d / "hover/flight.json").read_text())
        self.assertLess(flight["end_ns"], 3e9)  # it fell

    def test_what_cannot_be_read(self):
        a, b = self.fly(("hover", "other")), self.fly(("hover", "other"))
        (b / "hover/verdict.json").unlink()
        code, out, err = self.tiltproof("compare", a, b)
        self.assertEqual(code, 3)
        self.assertRegex(err, r"UNREADABLE +hover +.*verdict.json")
        self.assertRegex(out, r"IDENTICAL +other")  # the others are compared all the same
        self.assertIn("1 unreadable", out)
        (b / "other/trace.csv").write_text("t_s,x_m\n0,zero\n")
        code, lines, _ = self.compare(a, b)
        self.assertEqual(code, 3)
        self.assertIn("line 2: 'zero' is not a number", lines[1]["error"])

    def test_usage(self):
        a = self.fly()
        for arguments in ([], [a], [a, "nowhere"], [self.folder, a], [a, a, "--tolerance", "-1"], [a, a, "--format", "xml"]):
            code, _, err = self.tiltproof("compare", *arguments)
            self.assertEqual(code, 2, arguments)
            self.assertTrue(err)

    # --outcomes

    def campaign(self, **faults):
        """A run folder with a flight of each name, each with its fault."""
        suite = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        for name, fault in faults.items():
            (suite / f"{name}.yaml").write_text(HOVER.replace("NAME", name) + f"allow_restarts: true\nfaults:\n  - {{id: it, {fault}}}\n")
        code, out, err = self.tiltproof("run", suite, "--out", suite / "out")
        self.assertIn(code, (0, 1, 4), out + err)
        return (suite / "out/latest").resolve()

    def test_outcomes_class_each_flight_beside_one_without_faults(self):
        golden = self.fly()
        campaign = self.campaign(
            nothing="type: sensor.noise, start_s: 0.5, parameters: {signal: x_m, std: 0}",
            little="type: sensor.bias, start_s: 0.5, parameters: {signal: x_m, offset: 0.001}",
            lost="type: sensor.bias, start_s: 0.1, parameters: {signal: z_m, offset: 100}",
            reset="type: device.reset, start_s: 0.5, parameters: {boot_ms: 20}",
            hung="type: device.hang, start_s: 0.5")
        expected = {"nothing": "masked", "little": "wrong_output", "lost": "failed", "reset": "detected", "hung": "hung"}
        kept = {flight.name for flight in campaign.iterdir() if flight.is_dir()}
        self.assertLessEqual({"nothing", "little", "lost", "reset"}, kept)
        code, out, err = self.tiltproof("compare", "--outcomes", golden, campaign, "--format", "jsonl")
        self.assertEqual((code, err), (0, ""), out)
        self.assertEqual({entry["scenario"]: entry["outcome"] for entry in map(json.loads, out.splitlines())},
                         {name: expected[name] for name in kept})
        code, out, err = self.tiltproof("compare", "--outcomes", golden, campaign)
        self.assertEqual((code, err), (0, ""), out)
        self.assertIn("lost: failed, fail\n", out)
        self.assertNotIn("nothing:", out)
        self.assertIn("| masked | 1 | ", out)
        self.assertIn("| crashed | 0 | 0 |", out)
        # The flight alone says the same, but for what takes the reference to tell.
        alone = {name: json.loads((campaign / name / "verdict.json").read_text())["outcome"] for name in kept}
        self.assertEqual(alone["lost"], "failed")
        self.assertIn(alone["nothing"], ("unaffected", "degraded"))

    def test_outcomes_say_which_flights_they_lack(self):
        golden = self.fly()
        kept = self.fly(names=("a", "b"), flags=("--keep", "verdicts"))
        code, out, err = self.tiltproof("compare", "--outcomes", golden, kept)
        self.assertEqual(code, 3, out)
        self.assertIn("a: no outcome: it left no folder (--keep verdicts)", err)
        self.assertIn("| masked | 0 | 0 |", out)

    def test_outcomes_need_one_flight_to_compare_with(self):
        two = self.fly(names=("a", "b"))
        code, out, err = self.tiltproof("compare", "--outcomes", two, two)
        self.assertEqual((code, out), (2, ""))
        self.assertIn("takes one flight as its reference, and here are 2", err)
        code, out, err = self.tiltproof("compare", "--outcomes", two / "a", two)
        self.assertEqual(code, 0, err)
        self.assertIn("| masked | 2 | 2 |", out)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
