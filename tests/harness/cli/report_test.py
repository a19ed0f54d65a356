#!/usr/bin/env python3
"""`tiltproof report`, and the report that `run` writes, as a user meets them. Usage: report_test.py TILTPROOF

What the page shows is tested in a browser: tests/harness/report/page_test.mjs."""
import base64
import json
import re
import struct
import sys
import unittest
import zlib

from command_line import CommandLineTest

LATE = """\
name: NAME
duration_s: 3
seed: 3
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: late, type: frame.delay, target: to_client, start_s: 1, end_s: 2, parameters: {mean_ms: 5}}
  - {id: off-and-on, type: frame.drop, target: to_plant, start_s: 1, end_s: 2, period_s: 0.5, duty: 0.5, parameters: {probability: 0.5}}
criteria:
  - {name: near, stl: "always[0.5,3](position_error_m <= 0.5)"}
"""


def summary(page):
    return json.loads(re.search(r'<script type="application/json" id="run">(.*?)</script>', page.read_text(), re.S).group(1))


def details(page, name):
    """The first part of a flight's data, as harness/report/flight_pack.h lays it out."""
    flight = next(flight for flight in summary(page)["flights"] if flight["name"] == name)
    data = base64.b64decode(re.search(rf'id="{flight["details"]}">([^<]*)<', page.read_text()).group(1))
    size, = struct.unpack("<I", data[:4])
    part = zlib.decompress(data[4:4 + size])
    size, = struct.unpack("<I", part[:4])
    return json.loads(part[4:4 + size])


class ReportTest(CommandLineTest):
    def test_run_writes_it_and_names_it_in_its_last_line(self):
        for repeat in (1, 2):
            code, out, err = self.tiltproof("run", self.scenario("hover"), "--repeat", str(repeat))
            self.assertEqual((code, err), (0, ""))
            counts, page = out.splitlines()[-1].split("; report: ")
            self.assertEqual(counts, f"{repeat} of {repeat} green")
            self.assertRegex(page, r"^results/.*/report\.html$")
            self.assertEqual(len(summary(self.folder / page)["flights"]), repeat)
        code, out, _ = self.tiltproof("run", self.scenario("hover"), "--no-report")
        self.assertEqual((code, out.splitlines()[-1]), (0, "1 of 1 green"))
        self.assertFalse((self.latest() / "report.html").exists())

    def test_a_script_that_reads_lines_of_json_meets_no_other(self):
        code, out, _ = self.tiltproof("run", self.scenario("hover"), "--format", "jsonl")
        self.assertEqual(code, 0)
        self.assertEqual([json.loads(line)["name"] for line in out.splitlines()], ["hover"])
        self.assertTrue((self.latest() / "report.html").exists())

    def test_what_it_says_of_a_flight_is_what_the_files_say(self):
        self.assertEqual(self.tiltproof("run", self.scenario("late", LATE))[0], 0)
        folder = self.latest() / "late"
        flight = details(self.latest() / "report.html", "late")
        verdict = json.loads((folder / "verdict.json").read_text())
        self.assertEqual([c["margin"] for c in flight["result"]["criteria"]], [c["margin"] for c in verdict["criteria"]])
        # The times at which a fault was active, from its column.
        lines = [line.split(",") for line in (folder / "trace.csv").read_text().splitlines()]
        self.assertEqual(flight["times"]["count"], len(lines) - 1)
        for place, fault in enumerate(("late", "off-and-on")):
            column = lines[0].index("active_" + fault)
            active = [(float(line[0]), line[column] == "1") for line in lines[1:]]
            begins = [t for (t, now), (_, before) in zip(active[1:], active) if now and not before]
            ends = [t for (t, now), (_, before) in zip(active[1:], active) if before and not now]
            bands = [band for band in flight["bands"] if band["fault"] == place]
            self.assertEqual([band["begin_s"] for band in bands], begins)
            self.assertEqual([band["end_s"] for band in bands], ends)
        self.assertEqual(len([band for band in flight["bands"] if band["fault"] == 1]), 2)
        # Every activation is a tick, and the frames that the two faults touched are line errors.
        activations = [json.loads(line) for line in (folder / "faults.jsonl").read_text().splitlines()]
        self.assertEqual(sorted(tick[1] for tick in flight["ticks"]), sorted(a["time_s"] for a in activations))
        fates = [error[2:] for error in flight["line_errors"]]
        counts = {fault["id"]: fault["activations"] for fault in verdict["faults"]}
        self.assertEqual(fates.count(["to_client", "late"]), counts["late"])
        self.assertEqual(fates.count(["to_plant", "lost"]), counts["off-and-on"])
        self.assertEqual(len(fates), sum(counts.values()))
        self.assertEqual(flight["bounds"], [{"criterion": "near", "signal": "position_error_m", "of_magnitude": False, "upper": True, "value": 0.5,
                                             "begin_s": 0.5, "end_s": 3.0}])

    def test_of_one_flight_of_several_runs_and_against_a_baseline(self):
        self.assertEqual(self.tiltproof("run", self.scenario("a"), self.scenario("b"))[0], 0)
        first = self.latest()
        self.assertEqual(self.tiltproof("run", self.scenario("a"))[0], 0)
        code, out, _ = self.tiltproof("report", first / "b")
        self.assertEqual((code, out), (0, f"report: {first / 'b' / 'report.html'}\n"))
        self.assertEqual([flight["name"] for flight in summary(first / "b" / "report.html")["flights"]], ["b"])
        self.assertEqual(self.tiltproof("report", first, self.latest())[0], 0)
        self.assertEqual(sorted(flight["name"] for flight in summary(self.folder / "report.html")["flights"]), ["a", "a", "b"])
        self.assertEqual(self.tiltproof("report", self.latest(), "--baseline", first, "--out", "changes.html")[0], 0)
        changes = summary(self.folder / "changes.html")
        self.assertEqual(changes["flights"][0]["before"], {"verdict": "pass", "margin": changes["flights"][0]["margin"]})
        self.assertEqual(changes["only_in_baseline"], ["b"])

    def test_what_is_no_run_is_a_mistake_of_the_user(self):
        self.assertEqual(self.tiltproof("run", self.scenario("a"))[0], 0)
        for arguments in (["report"], ["report", "nowhere"], ["report", self.latest(), "--baseline", "nowhere"]):
            code, out, err = self.tiltproof(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertTrue(err)
        (self.latest() / "results.json").write_text("{")
        code, _, err = self.tiltproof("report", self.latest(), "--baseline", self.latest())
        self.assertEqual(code, 2)
        self.assertIn("results.json", err)

    def test_damaged_files_are_named_in_it(self):
        self.assertEqual(self.tiltproof("run", self.scenario("a"), self.scenario("b"))[0], 0)
        (self.latest() / "a" / "trace.csv").write_text("t_s,x_m\n0,")
        (self.latest() / "b" / "scenario.resolved.yaml").write_text("nonsense: [")
        self.assertEqual(self.tiltproof("report", self.latest())[0], 0)
        self.assertIn("trace.csv", " ".join(details(self.latest() / "report.html", "a")["problems"]))
        b = next(flight for flight in summary(self.latest() / "report.html")["flights"] if flight["name"] == "b")
        self.assertIn("scenario.resolved.yaml", b["problem"])
        self.assertEqual(b["result"]["criteria"][0]["name"], "survival")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
