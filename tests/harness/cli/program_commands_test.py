#!/usr/bin/env python3
"""Commands that fly many flights, with programs in lockstep: what they find is what they find with the same code as a library.
Usage: program_commands_test.py TILTPROOF"""
import json
import unittest

from command_line import PROGRAM
from program_flights import ProgramFlights

LIB = PROGRAM.parent / "lib"
LIBRARY, MINIMAL = f"library:{LIB / 'minimal_firmware.so'}", f"program:{LIB / 'minimal_program'}"
CLOCKED = f"clocked:{LIB / 'posix_firmware'} {{port}} {{reference_port}} {{baud}}"

LATE = "{id: late, type: frame.delay, target: to_client, start_s: 0.1, parameters: {mean_ms: 60}}"
NOISE = "{id: noise, type: wire.bit_error, target: both, start_s: 0.1, parameters: {ber: 1.0e-5}}"
SHORT = "duration_s: 0.6"


class ProgramCommandsTest(ProgramFlights):
    def write(self, name, *faults, duration_s=1.8):
        text = "".join(f"  - {fault}\n" for fault in faults)
        return self.scenario(name, **{"criteria:": f"faults:\n{text}criteria:", SHORT: f"duration_s: {duration_s}"})

    def told(self, *arguments, client, codes=(0, 1)):
        """What a command prints, without what names the client, counts flights of its own or measures time."""
        code, out, err = self.tiltproof(*arguments, *(("--client", client) if client else ()), "-j", "2")
        self.assertIn(code, codes, out + err)
        lines = [line for line in out.splitlines() if not any(word in line for word in ("client", "library:", "program:", "clocked:", "results", "per s", ".json"))]
        self.assertTrue(lines or arguments[0] == "fuzz", out + err)
        return lines

    def compare(self, *arguments, clients=(LIBRARY, MINIMAL), codes=(0, 1)):
        told = [self.told(*arguments, client=client, codes=codes) for client in clients]
        for other in told[1:]:
            self.assertEqual(other, told[0], arguments)

    def test_why(self):
        self.write("late", LATE, NOISE)
        told = []
        for client in (LIBRARY, MINIMAL, CLOCKED):
            self.assertEqual(self.flown("late.yaml", client=client)[0], 1)
            told.append(self.told("why", self.latest() / "late", "--futures", "2", client=None))
        self.assertEqual(told, told[:1] * 3)
        self.assertTrue(any(line.startswith("point of no return") for line in told[0]), told[0])

    def test_margin(self):
        self.write("late", LATE)
        self.compare("margin", "late.yaml", "--fault", "late", "--repeats", "1", "--tolerance", "0.5", "--low", "10", clients=(LIBRARY, CLOCKED))

    def test_envelope(self):
        self.write("base", "{id: none, type: harness.null, start_s: 0.1}", duration_s=0.8)
        rows = []
        for out_folder, client in (("library", LIBRARY), ("program", MINIMAL)):
            code, out, err = self.tiltproof("envelope", "base.yaml", "--types", "device.reset", "--repeats", "1", "--tolerance", "0.5", "-j", "2", "--client", client,
                                            "--out", out_folder)
            self.assertEqual(code, 0, out + err)
            envelope = json.loads((self.folder / out_folder / "envelope.json").read_text())
            rows.append([{key: row[key] for key in ("type", "parameter", "survives", "fails")} for row in envelope["rows"]])
        self.assertEqual([row["type"] for row in rows[0]], ["device.reset"])
        self.assertEqual(*rows)

    def test_minimise(self):
        self.write("late", LATE, NOISE, duration_s=1.8)
        minimal = []
        for client in (LIBRARY, MINIMAL):
            code, out, err = self.tiltproof("minimise", "late.yaml", "--max-runs", "12", "--out", "minimal.yaml", "--client", client)
            self.assertEqual(code, 0, out + err)
            minimal.append((self.folder / "minimal.yaml").read_text().replace(client, ""))
        self.assertEqual(*minimal)

    def test_search(self):
        self.write("late", LATE)
        self.compare("search", "late.yaml", "--over", "faults.late.parameters.mean_ms=0..8", "--runs", "6", "--out", "least.yaml")

    def test_fuzz(self):
        self.compare("fuzz", "--runs", "40", "--seed", "2", "--no-progress")

    def test_campaign(self):
        self.scenario("base")
        # Types that each of them can take: a clocked program cannot state how long it computes.
        (self.folder / "night.yaml").write_text("""campaign: night
scenarios: [base.yaml]
runs_count: 12
draw: {types: ["wire.*", "frame.*", "link.*", "sensor.*", "actuator.*", "plant.*", "clock.*", device.reset, device.task_delay]}
""")
        rows = []
        for out_folder, client in (("library", LIBRARY), ("program", MINIMAL), ("clocked", CLOCKED)):
            code, out, err = self.tiltproof("campaign", "night.yaml", "-j", "2", "--client", client, "--out", out_folder)
            self.assertIn(code, (0, 1), out + err)
            summary = json.loads((self.folder / out_folder / "campaign.json").read_text())
            rows.append({key: summary[key] for key in ("flights", "passed", "failed", "by_type", "curve", "coverage")})
        self.assertEqual(rows, rows[:1] * 3)

    def test_active_claims_need_a_role(self):
        self.scenario("claims", **{"criteria:": "clients: [{id: a}, {id: b}]\narbiter: {type: active_claims}\ncriteria:"})
        code, text, results = self.flown("claims.yaml", client=MINIMAL)
        self.assertEqual((code, results["claims"]["verdict"]), (3, "error"), text)
        self.assertIn("client a tells no role, and the arbiter active_claims needs it", results["claims"]["reason"])
        self.await_none()


if __name__ == "__main__":
    unittest.main(argv=["program_commands_test.py"])
