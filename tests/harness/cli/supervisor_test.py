#!/usr/bin/env python3
"""What a firmware says of its own state, as a column of the trace. Usage: supervisor_test.py TILTPROOF SOURCE_DIR CLIENTS_DIR"""
import csv
import pathlib
import sys
import unittest

from command_line import CommandLineTest

SOURCE, CLIENTS = (pathlib.Path(a).resolve() for a in sys.argv[2:4])
SILENT = CLIENTS / "libmisbehaving_client.so"  # a firmware without tiltproof_client_status

# After five periods without a reply the firmware says that it is blind.
BLIND = """\
name: NAME
firmware: tolerant
duration_s: 2
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: silence, type: link.silence, target: to_client, start_s: 1, end_s: 1.3}
criteria:
  - {name: says-that-it-is-blind, stl: "always[0.1,0.9](FORMULA <= 0) and always[1.1,1.3](FORMULA >= 4) and always[1.4,2](FORMULA <= 3)"}
"""


class SupervisorTest(CommandLineTest):
    def column(self, name, column):
        with open(self.latest() / name / "trace.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        return [(float(row["t_s"]), row.get(column)) for row in rows]

    def test_the_state_is_a_column_that_formulas_read(self):
        self.scenario("blind", BLIND, FORMULA="supervisor_state")
        hashes = set()
        for flags in ([], ["--distributed=socket"], ["--distributed=dds"]):
            code, out, err = self.tiltproof("run", "blind.yaml", *flags)
            self.assertEqual(code, 0, out + err)
            hashes.add(self.results()["scenarios"][0]["trace_hash"])
            states = self.column("blind", "supervisor_state")
            self.assertEqual({state for _, state in states}, {"0", "1", "3", "4"})
            self.assertEqual([state for time, state in states if time < 0.001], ["1"], "no reply before the first row")
            self.assertEqual(states[-1][1], "3", "degraded for 3 s after it")
            blind = [time for time, state in states if state == "4"]
            # Five requests in vain, of which the first goes out just after 1 s; sight returns with the first reply.
            self.assertTrue(1.048 <= min(blind) <= 1.08 and 1.29 <= max(blind) <= 1.32, (min(blind), max(blind)))
        self.assertEqual(len(hashes), 1)
        self.assertEqual(self.tiltproof("score", "results/latest")[0], 0)
        self.assertEqual(self.tiltproof("replay", "results/latest")[0], 0)

    def test_several_clients_have_one_each(self):
        self.scenario("two", BLIND, **{"faults:": "clients: [{id: a}, {id: b}]\nfaults:", "type: link.silence": "type: link.silence, client: b",
                                       "FORMULA": "supervisor_state_b"})
        code, out, err = self.tiltproof("run", "two.yaml")
        self.assertEqual(code, 0, out + err)
        self.assertEqual({state for _, state in self.column("two", "supervisor_state_a")[1:]}, {"0"})
        self.assertEqual({state for _, state in self.column("two", "supervisor_state")}, {None})

    def test_a_client_that_tells_none_has_no_column(self):
        self.scenario("plain")
        self.tiltproof("run", "plain.yaml", "--client", f"library:{SILENT}")
        self.assertEqual({state for _, state in self.column("plain", "supervisor_state")} - {None}, set())
        self.scenario("blind", BLIND, folder="suite", FORMULA="supervisor_state")
        self.scenario("fine", folder="suite")
        why = "blind.yaml:8:40: stl: 'supervisor_state': library:.* has no function tiltproof_client_status"
        for command in ("run", "check"):
            code, out, err = self.tiltproof(command, "suite/blind.yaml", "--client", f"library:{SILENT}")
            self.assertEqual((code, out), (2, ""))
            self.assertRegex(err, why)
        out = self.tiltproof("run", "suite", "--client", f"library:{SILENT}")[1]
        self.assertRegex(out, r"not applicable: stl: 'supervisor_state': library:.* has no function tiltproof_client_status.*\n +blind\n")
        code, _, err = self.tiltproof("check", "suite/blind.yaml", "--client", "serial:/dev/null")
        self.assertEqual(code, 2)
        self.assertIn("'supervisor_state': the client serial:/dev/null does not report its state", err)

    def test_conditions_of_faults_cannot_use_it(self):
        self.scenario("blind", BLIND, **{"FORMULA": "supervisor_state", "start_s: 1,": 'when: "supervisor_state > 0",'})
        code, _, err = self.tiltproof("check", "blind.yaml")
        self.assertEqual(code, 2)
        self.assertIn("unknown signal 'supervisor_state'", err)

    def test_a_firmware_that_never_starts_is_judged_all_the_same(self):
        self.scenario("dead", BLIND, **{"FORMULA": "supervisor_state", "link.silence, target: to_client, start_s: 1, end_s: 1.3":
                                        "link.silence, target: both"})
        code, _, _ = self.tiltproof("run", "dead.yaml")
        self.assertEqual(code, 1)
        self.assertEqual(self.results()["scenarios"][0]["end_reason"], "never_started")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
