#!/usr/bin/env python3
"""Computing takes time, as a user sees it: commands leave exactly that much later, faults stretch it, and what cannot be
stretched is refused. Usage: computing_test.py TILTPROOF SOURCE_DIR CLIENTS_DIR"""
import json
import pathlib
import sys
import unittest

from command_line import PROGRAM, CommandLineTest

CLIENTS = pathlib.Path(sys.argv[3]).resolve()
NMPC = PROGRAM.parent / "lib/nmpc_firmware.so"
MINIMAL = PROGRAM.parent / "lib/minimal_firmware.so"
LINE = """\
name: NAME
duration_s: 0.6
seed: 3
firmware: lqr
link: {ideal: true}
reference: {type: hover, at_m: [0, 0, 2]}
KEYS
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


def numbers(**values):
    return "firmware_parameters:" + "".join(f"\n  - {{name: {name}, value: {value}}}" for name, value in values.items())


def slow(factor, start_s=0.3):
    return f"\nfaults:\n  - {{id: hot, type: device.slow_cpu, start_s: {start_s}, parameters: {{factor: {factor}}}}}"


class ComputingTest(CommandLineTest):
    def flown(self, keys, *flags, name="flight", text=LINE, **changes):
        """The result of one flight, which is not an error."""
        path = self.scenario(name, text, KEYS=keys, **changes)
        code, out, err = self.tiltproof("run", path, "--no-report", *flags)
        self.assertIn(code, (0, 1, 4), out + err)
        return self.results()["scenarios"][0]

    def refusal(self, keys, *flags, **changes):
        code, out, err = self.tiltproof("run", self.scenario("refused", LINE, KEYS=keys, **changes), *flags)
        self.assertEqual(code, 2, out + err)
        return " ".join((out + err).split())

    def round_trip_ms(self, result):
        """On an ideal line nothing but computing is between a reply and its command."""
        timing = {key.split("trip_")[1]: value for key, value in result["metrics"].items() if "round_trip" in key}
        return timing["p50_ms"], timing["max_ms"]

    def test_commands_leave_later_by_exactly_that_time(self):
        for compute_us in (3000, 12000):
            result = self.flown(numbers(compute_us=compute_us))
            self.assertEqual(self.round_trip_ms(result), (compute_us / 1e3, compute_us / 1e3))
            self.assertEqual(result["metrics"]["timing.deadline_missed_count"], 0)
        late = self.flown(numbers(compute_us=12001))["metrics"]
        # Half of the 51 replies come while it computes, and are not answered.
        self.assertEqual(late["timing.deadline_missed_count"], 26)
        self.assertEqual(late["timing.firmware_missed_count"], 25)

    def test_a_slow_processor_takes_its_factor(self):
        result = self.flown(numbers(compute_us=3000) + slow(2.5))
        self.assertEqual(self.round_trip_ms(result)[1], 7.5)
        self.assertEqual(result["faults"][0]["activations"], 26, "each period from 0.3 s on")
        sound = self.flown(numbers(compute_us=3000) + slow(1), name="factor-one")
        self.assertEqual((self.round_trip_ms(sound), sound["verdict"]), ((3.0, 3.0), "inconclusive"), "it never acted")
        error_m = self.flown(numbers(compute_us=3000), name="sound")["metrics"]["tracking.rmse_m"]
        self.assertEqual(sound["metrics"]["tracking.rmse_m"], error_m)

    def test_without_computing_nothing_changes(self):
        without, zero = self.flown(""), self.flown(numbers(compute_us=0), name="zero")
        self.assertEqual(without["trace_hash"], zero["trace_hash"])
        self.assertNotIn("timing.deadline_missed_count", without["metrics"])
        self.assertNotEqual(without["trace_hash"], self.flown(numbers(compute_us=4000))["trace_hash"])

    def test_a_planner_has_the_same_bits_as_library_program_and_process(self):
        keys = numbers(compute_us=100, intervals=8, horizon_s=0.5) + slow(9)
        library = self.flown(keys, "--client", f"library:{NMPC}")
        metrics = library["metrics"]
        self.assertGreater(metrics["timing.deadline_missed_count"], 5)
        self.assertEqual(metrics["timing.firmware_missed_count"], 0, "the shifted plan flies")
        for flags in (["--client", f"program:{CLIENTS / 'nmpc_program'}"], ["--client", f"library:{NMPC}", "--distributed=socket"]):
            other = self.flown(keys, *flags)
            self.assertEqual((other["trace_hash"], other["metrics"]), (library["trace_hash"], metrics), flags)

    def test_numbers_that_no_firmware_takes(self):
        self.assertIn("the build 'paper' takes no numbers; `firmware: lqr` takes compute_us",
                      self.refusal(numbers(compute_us=1), lqr="paper"))
        self.assertIn("the build lqr takes compute_us, the time of one step of its law, from 0 to 1000000; here is gain: 1",
                      self.refusal(numbers(gain=1)))
        self.assertIn("here is compute_us: -1", self.refusal(numbers(compute_us=-1)))
        self.assertIn("refused.yaml:9:12: name: 'a' is taken already on line 8",
                      self.refusal(numbers(a=1) + "\n  - {name: a, value: 2}"))
        for keys, problem in (({"tilt_max_rad": 2}, "out of range: tilt_max_rad is a number from 0.05 to 1.4"),
                              ({"intervals": 2.5}, "out of range: intervals is a whole number from 2.0 to 200.0"),
                              ({"speed": 1}, "this firmware has no speed; it has intervals horizon_s iterations")):
            path = self.scenario("refused", LINE, KEYS=numbers(**keys))
            code, out, err = self.tiltproof("run", path, "--client", f"library:{NMPC}")
            self.assertEqual(code, 3, out + err)
            self.assertIn("firmware_parameters: " + problem, " ".join((out + err).split()))

    def test_faults_on_computing_that_nothing_states(self):
        text = self.refusal(slow(2))
        self.assertIn("refused.yaml:9:21: fault 'hot' ", text)
        self.assertIn("(device.slow_cpu) stretches the computing time that a firmware states, and the build 'lqr' states none "
                      "here: give `firmware: lqr` a number compute_us among `firmware_parameters`", text)
        self.assertIn("in real time computing takes what it takes", self.refusal(numbers(compute_us=5) + slow(2), "--mode", "realtime"))
        self.assertIn("and this client states none", self.refusal(numbers(compute_us=5) + slow(2), "--client", "clocked:true"))
        # A library of the user's that states none is not seen before it flies: nothing is stretched.
        result = self.flown(slow(2), "--client", f"library:{MINIMAL}")
        self.assertEqual((result["verdict"], result["reason"]),
                         ("inconclusive", "fault 'hot' never activated: the firmware states no computing time that it could stretch (docs/nmpc.md)"))
        faster = self.flown(numbers(compute_us=5) + slow(1), name="faster")
        self.assertEqual(faster["reason"], "fault 'hot' never activated")

    def test_a_script_cannot_stretch_what_the_build_does_not_state(self):
        path = self.scenario("steered", LINE, KEYS="")
        _, out, err = self.tiltproof("session", path, "--no-report",
                                     stdin=b'{"inject": {"type": "device.slow_cpu", "parameters": {"factor": 2}}}\n{"stop": true}\n')
        self.assertIn("the build 'lqr' states none here", out, err)

    def test_a_campaign_does_not_draw_it_for_a_firmware_that_states_none(self):
        types = "types: [device.slow_cpu, device.reset]"
        for name, client, drawn in (("none", f"library:{MINIMAL}", False), ("program", f"program:{PROGRAM.parent / 'lib/minimal_program'}", False),
                                    ("planner", f"library:{NMPC}", True)):
            file = self.folder / f"{name}.yaml"
            file.write_text(f"campaign: {name}\nscenarios: [{self.scenario('base', LINE, KEYS=numbers(compute_us=100) if drawn else '')}]\n"
                            f"runs_count: 6\ndraw: {{{types}}}\n")
            code, out, err = self.tiltproof("campaign", file, "--client", client, "--out", name, "--no-report")
            self.assertIn(code, (0, 1), out + err)
            self.assertEqual("device.slow_cpu" in err, not drawn, err)
            _, again, told = self.tiltproof("campaign", "--resume", name, "--no-report")
            self.assertEqual("device.slow_cpu" in told, not drawn, told)
            frame = json.loads((self.folder / name / "campaign.json").read_text())
            self.assertEqual("device.slow_cpu" in json.dumps(frame), drawn)
        file.write_text(file.read_text().replace(", device.reset", ""))
        code, out, err = self.tiltproof("campaign", file, "--client", f"library:{MINIMAL}", "--out", "nothing")
        self.assertEqual(code, 2, out + err)
        self.assertIn("device.slow_cpu stretches the computing time that a firmware states, and this one states none", " ".join(err.split()))
    def test_searches_do_not_say_that_such_a_firmware_survives_it(self):
        path = self.scenario("margin", LINE, KEYS=slow(2))
        for client in (f"library:{MINIMAL}", f"program:{PROGRAM.parent / 'lib/minimal_program'}"):
            code, out, err = self.tiltproof("margin", path, "--fault", "hot", "--client", client)
            self.assertEqual(code, 2, out + err)
            self.assertIn("margin.yaml:9:21: fault 'hot' (device.slow_cpu) stretches the computing time that a firmware states, and this one states none",
                          " ".join(err.split()))
        base = self.scenario("base", LINE, KEYS="\nfaults: [{id: f, type: harness.null, start_s: 0.2, end_s: 0.5}]")
        code, out, err = self.tiltproof("envelope", base, "--types", "device.slow_cpu,device.task_delay", "--client", f"library:{MINIMAL}", "--no-report")
        self.assertIn(code, (0, 1), out + err)
        found = json.loads((self.folder / "results/envelope/envelope.json").read_text())
        self.assertEqual([(other["type"], "states none" in other["reason"]) for other in found["not_applicable"]], [("device.slow_cpu", True)])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
