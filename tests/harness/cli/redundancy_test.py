#!/usr/bin/env python3
"""Several clients and an arbiter that chooses between them, as a user flies them. Usage: redundancy_test.py TILTPROOF CLIENTS_DIR"""
import csv
import json
import pathlib
import sys
import unittest

from command_line import CommandLineTest

CLIENTS = pathlib.Path(sys.argv[2]).resolve()
RESET = pathlib.Path(__file__).resolve().parents[3] / "scenarios/redundancy/failover-reset-survive.yaml"
MISBEHAVING = f"library:{CLIENTS / 'libmisbehaving_client.so'}"

FLIGHT = """\
name: NAME
firmware: tolerant
seed: 5
duration_s: 2
reference: {type: hover, at_m: [0, 0, 2]}
clients: CLIENTS
arbiter: {ARBITER}
FAULTS
criteria:
  - {name: near, stl: "always(position_error_m <= 1.0)"}
"""
TWO, THREE = "[{id: a}, {id: b}]", "[{id: a}, {id: b}, {id: c}]"
SILENT = "faults: [{id: silent, type: link.silence, client: a, target: to_plant, start_s: 0.5, end_s: 1.2}]"


class RedundancyTest(CommandLineTest):
    def write(self, name, arbiter, clients=TWO, faults="", folder="."):
        return self.scenario(name, FLIGHT, folder=folder, CLIENTS=clients, ARBITER=arbiter, FAULTS=faults)

    def fly(self, name, *flags, code=0):
        """The verdict of one flight, and its rows by column."""
        done, out, err = self.tiltproof("run", self.folder / f"{name}.yaml", "--no-progress", *flags)
        self.assertEqual(done, code, out + err)
        folder = self.latest() / name
        with open(folder / "trace.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        return json.loads((folder / "verdict.json").read_text()), rows

    def events(self, name):
        lines = (self.latest() / "events.jsonl").read_text().splitlines()
        return [event for event in map(json.loads, lines) if event.get("scenario", name) == name]

    def kinds(self, name):
        return [event["kind"] for event in self.events(name) if event["kind"].startswith(("arbiter_", "client_"))]

    def test_it_flies_the_same_in_several_processes(self):
        loss = "faults: [{id: loss, type: frame.drop, target: to_plant, parameters: {probability: 0.4}}, {id: blind, type: link.silence, client: b, " \
               "target: to_client, start_s: 0.3, end_s: 0.6}]"
        for arbiter, clients, transports in (("type: mid_value, timeout_ms: 20", THREE, ("socket",)), ("type: active_claims, timeout_ms: 20", TWO, ("socket", "dds")),
                                             ("type: primary_backup, timeout_ms: 20, return: 30", TWO, ("socket",))):
            file = self.write("same", arbiter, clients, loss)
            file.write_text(file.read_text().replace("duration_s: 2", "duration_s: 1"))
            here, _ = self.fly("same")
            folder = self.latest()
            self.assertGreater(here["metrics"]["redundancy.switches_count"], 1, arbiter)
            for transport in transports:
                there, _ = self.fly("same", f"--distributed={transport}")
                self.assertEqual((there["trace_hash"], there["metrics"]), (here["trace_hash"], here["metrics"]), (arbiter, transport))
            self.assertEqual(self.tiltproof("replay", folder)[0], 0)
            self.assertEqual(self.tiltproof("score", folder)[0], 0)

    def test_a_backup_takes_over_and_gives_back(self):
        self.write("back", "type: primary_backup, timeout_ms: 36, return: 200", faults=SILENT)
        verdict, rows = self.fly("back")
        self.assertEqual(self.kinds("back"), ["arbiter_switched", "arbiter_switched"])
        metrics = verdict["metrics"]
        self.assertEqual((metrics["redundancy.switches_count"], metrics["redundancy.without_control_s"]), (2, 0))
        self.assertNotIn("redundancy.disagreement_s", metrics)
        self.assertEqual(verdict["outcome"], "detected")
        # The last command before the silence is up to a period old, and counts for 36 ms; the boundaries of the plant are 4 ms apart.
        by_b = [float(row["t_s"]) for row in rows if row["arbiter_selected"] == "1"]
        self.assertTrue(0.5 + 0.024 <= by_b[0] <= 0.5 + 0.036 + 0.004 + 0.012, by_b[0])
        self.assertTrue(1.2 + 0.2 <= by_b[-1] + 0.012 <= 1.2 + 0.2 + 3 * 0.012, by_b[-1])

    def test_a_board_that_was_reset_flies_again_whenever_its_periods_begin(self):
        # With 500.5 to 501.5 ms its first reply comes before the first heartbeat of the other board.
        text = RESET.read_text()
        # The same phases of the periods, and less of the flight before, between and after the resets.
        for long, short in (("duration_s: 12", "duration_s: 6.5"), ("start_s: 4,", "start_s: 1,"), ("start_s: 7.5,", "start_s: 4.5,"), ("[5,12]", "[2,6.5]"),
                            ("[8,12]", "[5,6.5]")):
            self.assertEqual(text.count(long), 1, long)
            text = text.replace(long, short)
        code, out, err = self.tiltproof("run", self.scenario("reset", text), "--set", "faults.reset-a.parameters.boot_ms=500,500.5,501.5,503", "--no-progress")
        self.assertEqual(code, 0, out + err)

    def test_any_start_is_t_0(self):
        self.write("late", "type: primary_backup", faults="faults: [{id: silent, type: link.silence, client: a, target: to_plant}]")
        verdict, rows = self.fly("late")
        self.assertEqual({row["arbiter_selected"] for row in rows[2:]}, {"1"})
        self.assertEqual(verdict["metrics"]["redundancy.switches_count"], 0)

    def test_a_client_that_ends_is_out_and_the_others_fly_on(self):
        for how, kind, why in (("crash", "client_crashed", "Segmentation fault"), ("raw_exit", "client_crashed", "process"), ("asleep", "client_hung", "did not return")):
            self.write("loss", "type: primary_backup, timeout_ms: 36", f"[{{id: a, firmware: {how}}}, {{id: b}}]")
            flags = ("--client", "host", "--client", f"a={MISBEHAVING}")
            verdict, rows = self.fly("loss", *flags)
            self.assertIn(kind, self.kinds("loss"))
            self.assertIn("arbiter_switched", self.kinds("loss"))
            self.assertEqual(verdict["metrics"]["redundancy.clients_lost_count"], 1)
            self.assertAlmostEqual(verdict["metrics"]["firmware.a.lost_at_s"], 0.3, delta=0.03)
            survival = next(criterion for criterion in verdict["criteria"] if criterion["name"] == "survival")
            self.assertRegex(survival["explanation"], f"flew to the end at 2.000 s, without client a \\((crashed|hung) at 0.3.*{why}")
            self.assertEqual(verdict["outcome"], "detected")
            self.assertEqual(rows[-1]["arbiter_selected"], "1")
            if how == "crash":
                self.assertEqual(self.fly("loss", *flags, "--distributed=socket")[0]["trace_hash"], verdict["trace_hash"])
                self.assertEqual(self.tiltproof("score", self.latest())[0], 0)

    def test_nobody_is_left(self):
        self.write("none", "type: mid_value", "[{id: a, firmware: crash}, {id: b, firmware: abort}]")
        verdict, _ = self.fly("none", "--client", MISBEHAVING, code=1)
        self.assertEqual((verdict["end_reason"], verdict["outcome"]), ("firmware_crashed", "crashed"))
        self.assertIn("no client is left", verdict["reason"])

    def test_single_needs_only_its_own(self):
        for flies, code in (("a", 1), ("b", 0)):
            self.write("one", f"client: {flies}", "[{id: a, firmware: crash}, {id: b}]")
            verdict, _ = self.fly("one", "--client", "host", "--client", f"a={MISBEHAVING}", code=code)
            self.assertEqual(verdict["end_reason"], "firmware_crashed" if code else "completed")
            self.assertNotIn("redundancy.switches_count", verdict["metrics"])

    def test_claims_need_roles(self):
        self.write("claims", "type: active_claims", folder="suite")
        self.write("other", "type: mid_value", folder="suite")
        verdict_of = lambda: {entry["name"]: entry["verdict"] for entry in self.results()["scenarios"]}
        code, out, err = self.tiltproof("run", "suite/claims.yaml", "--client", MISBEHAVING)
        self.assertEqual(code, 2, out + err)
        self.assertRegex(err, r"claims.yaml:7:17: arbiter: active_claims needs the role of client 'a': library:.* has no function tiltproof_client_role")
        code, out, err = self.tiltproof("run", "suite", "--no-progress")
        self.assertEqual((code, verdict_of()), (0, {"claims": "pass", "other": "pass"}), out + err)
        with open(self.latest() / "claims/trace.csv", newline="") as file:
            self.assertEqual({row["role_a"] for row in list(csv.DictReader(file))[3:]}, {"1"})

    def test_mistakes(self):
        for arbiter, clients, place, why in (
                ("type: mid_valeu", TWO, "7:17", "unknown value 'mid_valeu'; did you mean 'mid_value'?"),
                ("type: mid_value", "[{id: a}]", "7:17", "mid_value needs several `clients`"),
                ("type: duplex_compare, tolerance_percent: 1", THREE, "7:17", "compares two clients, and there are 3"),
                ("type: duplex_compare", TWO, "7:10", "tolerance_percent"),
                ("type: duplex_compare, tolerance_percent: 1, on_disagreement: c", TWO, "7:72", "on_disagreement: there is no client 'c'"),
                ("type: primary_backup, order: [a, c]", TWO, "7:44", "order: there is no client 'c'"),
                ("type: primary_backup, order: [a, a]", TWO, "7:44", "order: 'a' is there already"),
                ("type: primary_backup, return: soon", TWO, "7:41", "return: expected 'never' or a number"),
                ("type: primary_backup, return: -1", TWO, "7:41", "return"),
                ("type: primary_backup, timeout_ms: 0", TWO, "7:45", "timeout_ms"),
                ("type: mid_value, client: a", TWO, "7:28", "client")):
            code, out, err = self.tiltproof("check", self.write("wrong", arbiter, clients))
            self.assertEqual(code, 2, arbiter + out + err)
            self.assertIn(f"wrong.yaml:{place}: ", err)
            self.assertIn(why, err)
        self.write("alone", "type: single", "[{id: a}]")
        (self.folder / "alone.yaml").write_text((self.folder / "alone.yaml").read_text() + "  - {name: n, metric: redundancy.switches_count, max: 1}\n")
        self.assertIn("redundancy.switches_count", self.tiltproof("check", "alone.yaml")[2])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
