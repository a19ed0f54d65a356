#!/usr/bin/env python3
"""The commands margin and envelope, on flights whose limits are known.

Usage: margin_test.py TILTPROOF SOURCE_DIR
"""
import fcntl
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest

from command_line import PROGRAM, CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()
DRIFT = SOURCE / "scenarios/sensor/drift-survive.yaml"

SHORT = """\
name: NAME
duration_s: 2
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: probe, type: TYPE, start_s: 0.5WINDOW}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
  - {name: upright, stl: "always(tilt_rad <= 0.6)"}
"""

WHOLE = []  # the envelope of two builds, flown once for all tests


class MarginTest(CommandLineTest):
    def margin(self, *arguments, code=0):
        found, out, err = self.tiltproof("margin", *arguments, "--format", "jsonl")
        self.assertEqual(found, code, err)
        return [json.loads(line) for line in out.splitlines()]

    def short(self, fault, parameters="", window="", duration="2"):
        window += f", parameters: {{{parameters}}}" if parameters else ""
        return self.scenario("short", SHORT.replace("duration_s: 2", f"duration_s: {duration}"), TYPE=fault, WINDOW=window)

    def test_the_margin_of_a_drift(self):
        *levels, margin = self.margin(DRIFT, "--fault", "drift", "--tolerance", "0.05", "-j", "2")
        self.assertLessEqual(margin["survives"], 0.0356)
        self.assertGreaterEqual(margin["fails"], 0.0354)
        self.assertLessEqual(margin["fails"] - margin["survives"], 0.05 * margin["fails"])
        self.assertEqual({key: margin[key] for key in ("fault", "type", "parameter", "unit", "first_criterion")},
                         {"fault": "drift", "type": "sensor.drift", "parameter": "rate_per_s", "unit": "m/s", "first_criterion": "stays-on-path"})
        self.assertEqual(margin["runs"], sum(level["runs"] for level in levels))
        answers = {level["level"]: level["survived"] for level in levels}
        self.assertTrue(answers[margin["survives"]])
        self.assertFalse(answers[margin["fails"]])
        for level in levels:
            self.assertEqual(level["runs"], 1, "nothing is drawn at random: one flight stands for all seeds")

    def test_the_page_shows_what_is_printed(self):
        page = (SOURCE / "docs/margins.md").read_text()
        command, shown = re.search(r"tiltproof (margin scenarios/\S+ [^\n]*)\n.*?```text\n(.*?)```", page, re.S).groups()
        out = self.tiltproof(*command.replace("scenarios/", f"{SOURCE}/scenarios/").split())[1]
        self.assertIn(shown, out)

    def test_a_fault_that_never_acts_has_no_margin(self):
        """Its condition never holds: every flight is one without the fault."""
        scenario = self.short("frame.drop", "probability: 0.5", ", when: z_m > 100, target: to_client", "0.7")
        code, out, err = self.tiltproof("margin", scenario, "--fault", "probe", "--tolerance", "0.2")
        self.assertEqual(code, 4, err)
        self.assertIn("margin: no margin: fault 'probe': it never acted at any of the", err)
        self.assertNotIn("survives", out)

    def test_levels_at_which_the_fault_never_acts_are_named(self):
        """A rate of 1e-8 changes no bit of a short flight."""
        scenario = self.short("wire.bit_error", "ber: 0.00001", ", target: to_client", "1")
        flags = (scenario, "--fault", "probe", "--repeats", "1", "--low", "1e-8", "--high", "2e-4")
        margin = self.margin(*flags)[-1]
        self.assertEqual((margin["survives"], margin["fails"]), (2e-4, None))
        self.assertLess(max(margin["idle_levels"]), 2e-4)
        self.assertLess(min(margin["idle_levels"]), 2e-8)
        out = self.tiltproof("margin", *flags)[1]
        self.assertIn(f"  the fault never acted at {len(margin['idle_levels'])} of these levels, the last of which is ", out)

    def test_a_limit_is_before_every_pocket(self):
        """On this spiral a lag of one servo is survived at 18 ms and not at 15.2 ms: a search that only climbs and bisects finds a limit of 25 ms."""
        text = (SOURCE / "scenarios/envelope/spiral.yaml").read_text()
        text = text.replace("duration_s: 25", "duration_s: 20")
        scenario = self.scenario("spiral", text.replace("harness.null", "actuator.lag").replace("end_s: 15", "end_s: 15, parameters: {actuator: tau_r, time_constant_s: 0.01}"))
        code, out, err = self.tiltproof("margin", scenario, "--fault", "probe", "--firmware", "tolerant")
        self.assertEqual(code, 0, err)
        self.assertRegex(out, r"\n  fails at 0\.015\d* s, and survives 0\.\d+ s again\n")
        self.assertRegex(out, r"\n  survives all \d+ levels that were flown below the limit, where nothing is drawn at random\n")
        margin = self.margin(scenario, "--fault", "probe", "--firmware", "tolerant")[-1]
        self.assertLess(margin["fails"], 0.0155)
        self.assertEqual(margin["pockets"][0][0], margin["fails"])
        levels = [level for level, _ in margin["levels"]]
        self.assertEqual(levels, sorted(set(levels)))
        self.assertTrue(all(survived for level, survived in margin["levels"] if level <= margin["survives"]))
        self.assertGreaterEqual(sum(level <= margin["survives"] for level in levels), 32)
        self.assertEqual((margin["seeds"], margin["sure_share"]), (1, 1.0))

    def test_each_seed_of_a_random_fault_is_flown_and_jobs_change_nothing(self):
        scenario = self.short("frame.drop", "probability: 0.5", ", target: both")
        runs = [self.margin(scenario, "--fault", "probe", "--repeats", "3", "--tolerance", "0.1", "-j", jobs) for jobs in (1, 4)]
        self.assertEqual(*runs)
        *levels, margin = runs[0]
        for level in levels:
            self.assertTrue(level["runs"] == 3 if level["survived"] else 1 <= level["runs"] <= 3, level)
        self.assertGreater(margin["survives"], 0.0)
        self.assertEqual(margin["seeds"], 3)
        self.assertAlmostEqual(margin["sure_share"] ** 3, 0.05)
        self.assertTrue(0 < margin["survived_share"] < 1)

    def test_what_a_level_says_is_what_run_says(self):
        scenario = self.short("sensor.bias", "signal: z_m, offset: 0.1")
        margin = self.margin(scenario, "--fault", "probe", "--repeats", "1", "--tolerance", "0.1")[-1]
        for level, code in ((margin["survives"], 0), (margin["fails"], 1)):
            text = scenario.read_text().replace("offset: 0.1", f"offset: {level!r}")
            self.scenario("again", text.replace("name: short", "name: again"))
            self.assertEqual(self.tiltproof("run", "again.yaml")[0], code)

    def test_other_sides_and_parameters(self):
        scenario = self.short("sensor.bias", "signal: z_m, offset: 0.1")
        below = self.margin(scenario, "--fault", "probe", "--repeats", "1", "--low", "-2")[-1]
        self.assertLess(below["fails"], below["survives"])
        self.assertLess(below["survives"], 0)
        window = self.margin(scenario, "--fault", "probe", "--repeats", "1", "--parameter", "window_s")[-1]
        self.assertEqual((window["parameter"], window["survives"], window["fails"], window["first_criterion"]), ("window_s", 1.5, None, None))

    def test_null_where_even_the_mildest_level_fails(self):
        text = SHORT.replace("position_error_m <= 0.5", "position_error_m <= 0.0")
        scenario = self.scenario("never", text, TYPE="sensor.bias", WINDOW=", parameters: {signal: z_m, offset: 1}")
        margin = self.margin(scenario, "--fault", "probe")[-1]
        self.assertEqual((margin["survives"], margin["fails"], margin["first_criterion"]), (None, 0.0, "near"))

    def test_mistakes(self):
        scenario = self.short("sensor.bias", "signal: z_m, offset: 0.1")
        for arguments, message in (
                (("--fault", "prob"), "--fault prob: .*; did you mean 'probe'"),
                (("--fault", "probe", "--parameter", "ofset"), "has no number 'ofset'; it has: offset, window_s"),
                (("--fault", "probe", "--low", "-1", "--high", "1"), "0 is harmless and lies between -1 and 1"),
                (("--fault", "probe", "--client", "process:true"), "knows no virtual time")):
            code, out, err = self.tiltproof("margin", scenario, *arguments)
            self.assertEqual((code, out), (2, ""), err)
            self.assertRegex(err, message)
        code, _, err = self.tiltproof("margin", self.short("device.stall", window=", end_s: 2"), "--fault", "probe")
        self.assertEqual(code, 2)
        self.assertIn("needs an emulated board", err)

    def test_an_interrupt(self):
        scenario = self.short("frame.drop", "probability: 0.5", ", target: both")
        with subprocess.Popen([PROGRAM, "margin", scenario, "--fault", "probe", "--repeats", "10000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              cwd=self.folder) as running:
            time.sleep(1)
            running.send_signal(signal.SIGINT)
            _, err = running.communicate(timeout=60)
        self.assertEqual(running.returncode, 130)
        self.assertIn(b"no margin is known", err)


class EnvelopeTest(CommandLineTest):
    def envelope(self, *arguments, code=0, text=SHORT, end="1.5"):
        base = self.scenario("base", text, TYPE="harness.null", WINDOW=f", end_s: {end}")
        (self.folder / "out/envelope.json").unlink(missing_ok=True)
        found, out, err = self.tiltproof("envelope", base, "--repeats", "1", "--tolerance", "0.2", "--out", "out", *arguments)
        self.assertEqual(found, code, err)
        return json.loads((self.folder / "out/envelope.json").read_text()), out

    def two_builds(self):
        """The flags of an envelope of two builds that nothing disturbs, and what it wrote. The folder has none of its files."""
        arguments = ("--types", "actuator.offset,actuator.loss*", "--firmware", "paper,tolerant")
        if not WHOLE:
            WHOLE.append(self.envelope(*arguments)[0])
            shutil.rmtree(self.folder / "out")
        return arguments, json.loads(json.dumps(WHOLE[0]))

    def test_a_fault_that_never_acts_is_shown(self):
        """No frame begins within a millisecond. A later --resume does not fly the row again."""
        base = self.scenario("base", SHORT.replace("duration_s: 2", "duration_s: 0.7"), TYPE="harness.null", WINDOW=", end_s: 0.501")
        flags = ("--types", "frame.drop", "--repeats", "1", "--tolerance", "0.2")
        code, out, err = self.tiltproof("envelope", base, *flags, "--out", "out")
        self.assertEqual(code, 0, err)
        self.assertRegex(out, r"frame.drop +to_client +1 +never acted\n")
        file = self.folder / "out/envelope.json"
        before = file.read_text()
        [row] = [row for row in json.loads(before)["rows"] if row["target"] == "to_client"]
        self.assertEqual((row["survives"], row["fails"], row["survived_share"]), (None, None, None))
        self.assertEqual(row["idle_levels"], [level for level, _ in row["levels"]])
        self.assertIn("never acted at any of the", row["error"])
        code, out, err = self.tiltproof("envelope", base, *flags, "--resume", "out")
        self.assertEqual((code, file.read_text()), (0, before), err)

    def test_two_firmwares(self):
        """Both sides of each margin fly again as scenarios: each expects the verdict that it had in the search, with its seed and its criterion."""
        envelope, out = self.envelope("--types", "frame.drop,actuator.loss*,device.*", "--firmware", "paper,tolerant", "-j", "2", "--keep")
        self.assertTrue(envelope["complete"])
        rows = {(row["type"], row.get("target", row.get("actuator", "")), row["client"]): row for row in envelope["rows"]}
        places = [("frame.drop", "to_plant"), ("frame.drop", "to_client"), ("frame.drop", "both"), ("frame.drop", "reference"),
                  ("actuator.loss_of_effectiveness", "f_r"), ("actuator.loss_of_effectiveness", "tau_r"), ("device.reset", ""),
                  ("device.task_delay", "")]
        self.assertEqual(set(rows), {(*place, client) for place in places for client in ("paper", "tolerant")})
        thrust = rows["actuator.loss_of_effectiveness", "f_r", "paper"]
        self.assertEqual((thrust["harmless"], thrust["scale"], thrust["unit"]), (1.0, "linear", "1"))
        self.assertTrue(thrust["fails"] < thrust["survives"] < 1)
        left_out = {(entry["type"], entry["client"]) for entry in envelope["not_applicable"]}
        self.assertIn(("device.stall", "tolerant"), left_out)
        self.assertIn("not applicable: device.stall: needs an emulated board", out)
        self.assertRegex(out, r"frame\.drop +both +1 +[\d.]+\*? +([\d.]+\*?|all)\n")
        for place in ("to_plant", "to_client", "both"):  # the more tolerant one
            paper, tolerant = (rows["frame.drop", place, client] for client in ("paper", "tolerant"))
            self.assertTrue(tolerant["fails"] is None or tolerant["survives"] >= paper["survives"], (paper, tolerant))
        for line in out.splitlines():
            self.assertTrue(len(line) <= 80 or line.startswith("not applicable"), line)
        self.assert_both_sides_fly_again(envelope, out)

    def assert_both_sides_fly_again(self, envelope, out):
        rows = envelope["rows"]
        names = {f'{row["client"]}-{"-".join(filter(None, (row["type"], row.get("target", row.get("actuator")))))}-{side}': (row, side)
                 for row in rows for side in ("survives", "fails") if row[side] is not None}
        self.assertTrue(any(row["fails"] is None for row in rows), "a margin with one side only")
        self.assertEqual({file.stem for file in (self.folder / "out/levels").rglob("*.yaml")}, set(names))
        code, flown, err = self.tiltproof("run", "out/levels", "-j", "2", "--format", "jsonl", "--no-report", "--out", "again")
        self.assertEqual(code, 0, err)
        flown = {flight["name"]: flight for flight in map(json.loads, flown.splitlines())}
        self.assertEqual(set(flown), set(names))
        kept = {}
        for file in (self.folder / "out/flights").rglob("results.json"):
            self.assertTrue((file.parent / "report.html").exists())
            kept.update((flight["name"], flight) for flight in json.loads(file.read_text())["scenarios"])
        self.assertIn(f"{len(names)} flights on the sides of the margins are in out/flights\n", out)
        for name, (row, side) in names.items():
            self.assertEqual((flown[name]["verdict"], flown[name]["seed"]), ("pass", envelope["seed"]) if side == "survives" else ("fail", row["seed"]), name)
            self.assertEqual(flown[name]["trace_hash"], kept[name]["trace_hash"], name)
            if side == "fails":
                self.assertEqual(flown[name]["reason"], row["reason"])
        self.assertIn("1 of 1 equal", self.tiltproof("replay", self.folder / "out/flights/paper/frame.drop/paper-frame.drop-both-fails")[1])

    def test_the_page_of_an_envelope(self):
        out = self.envelope("--types", "device.reset")[1]
        self.assertIn("report: out/envelope.html\n", out)
        page = self.folder / "out/envelope.html"
        first = page.read_text()
        page.unlink()
        self.assertEqual(self.tiltproof("report", "out")[:2], (0, "report: out/envelope.html\n"))
        self.assertEqual(page.read_text(), first)
        page.unlink()
        self.assertNotIn("report: ", self.envelope("--types", "device.reset", "--no-report")[1])
        self.assertFalse(page.exists())
        for arguments, what in ((("out", "out"), "give its folder alone"), (("out", "--baseline", "out"), "--baseline is for runs")):
            code, _, err = self.tiltproof("report", *arguments)
            self.assertEqual(code, 2)
            self.assertIn(what, err)

    def test_both_sides_and_the_reference_line(self):
        # The rows follow from the places and not from the flights, so that these may be short.
        envelope, out = self.envelope("--types", "sensor.bias,frame.truncate", text=SHORT.replace("duration_s: 2", "duration_s: 0.7"), end="0.6")
        rows = [(row["type"], row.get("signal", row.get("target")), row.get("side"), row["mildest"], row["severest"]) for row in envelope["rows"]]
        self.assertEqual(len(rows), 12)
        self.assertIn("reference", [row[1] for row in rows])
        for _, signal_name, side, mildest, severest in rows:
            if side:
                self.assertEqual((mildest, severest > 0), (0, side == "positive"), signal_name)
        self.assertRegex(out, r"sensor\.bias +roll_rad- +rad ")

    def test_an_interrupted_one_goes_on(self):
        arguments, whole = self.two_builds()
        self.scenario("base", SHORT, TYPE="harness.null", WINDOW=", end_s: 1.5")
        cut = dict(whole, complete=False, rows=whole["rows"][1::2])
        file = self.folder / "cut/envelope.json"
        file.parent.mkdir()
        file.write_text(json.dumps(cut))

        def resume(*more, code=0):
            found, out, err = self.tiltproof("envelope", "base.yaml", *arguments, "--tolerance", "0.2", "--resume", "cut", *(more or ("--repeats", "1")))
            self.assertEqual(found, code, err)
            return out, err

        base = (self.folder / "base.yaml").read_text()
        for changed, arguments_now, what in ((base, ("--repeats", "2"), "--repeats was 1 and is 2"), (base, ("--repeats", "1", "--seed", "5"), "the seed was 1"),
                                             (base.replace("0.6)", "0.5)"), ("--repeats", "1"), "the scenario, or the vehicle, of paper was another one")):
            (self.folder / "base.yaml").write_text(changed)
            self.assertIn(what, resume(*arguments_now, code=2)[1])
        (self.folder / "base.yaml").write_text(base)
        out, _ = resume()
        again = json.loads(file.read_text())
        self.assertEqual(again, whole)
        flights = int(re.search(r"(\d+) flights", out)[1])
        self.assertEqual(flights, 2 + sum(row["runs"] for row in whole["rows"][0::2]), "rows that are there are not flown again; each firmware flies once without a fault")
        self.assertIn("0 flights", resume()[0])
        # A narrower selection keeps the other rows, and what is written goes on as the whole.
        half = dict(whole, rows=[row for row in whole["rows"] if row["type"] != "actuator.loss_of_effectiveness" or row["client"] != "paper"])
        file.write_text(json.dumps(half))
        code, out, err = self.tiltproof("envelope", "base.yaml", "--types", "actuator.loss*", "--firmware", "paper", "--tolerance", "0.2", "--repeats", "1", "--resume", "cut")
        self.assertEqual(code, 0, err)
        self.assertIn(f"{len(half['rows'])} rows of an earlier run are not selected now, and stay", out)
        key = lambda row: (row["type"], row.get("signal", row.get("actuator")), row.get("side", ""), row["client"])
        narrow = json.loads(file.read_text())
        self.assertEqual(sorted(narrow["rows"], key=key), sorted(whole["rows"], key=key))
        self.assertEqual((narrow["columns"], narrow["complete"], narrow["clients"]), (whole["columns"], True, whole["clients"]))
        self.assertIn(" 0 flights", resume()[0])
        self.assertEqual(json.loads(file.read_text()), whole)
        file.write_text("{}")
        self.assertIn("not an envelope to continue", resume(code=2)[1])
        damaged = json.loads(json.dumps(whole))
        damaged["rows"][1]["survives"] = "much"
        file.write_text(json.dumps(damaged))
        self.assertRegex(resume(code=2)[1], r"not an envelope to continue: row actuator\.\S+ \S+ .*client \S+: survives: a number is needed")
        damaged["rows"][1] = dict(whole["rows"][1], levels=[[1, "yes"]])
        file.write_text(json.dumps(damaged))
        self.assertRegex(resume(code=2)[1], r"not an envelope to continue: row actuator\.\S+ .*: levels: ")
        del damaged["rows"][1]["survives"]
        file.write_text(json.dumps(damaged))
        self.assertIn("not an envelope to continue", resume(code=2)[1])

    def test_nothing_is_written_over_or_beside(self):
        base = self.scenario("base", SHORT, TYPE="harness.null", WINDOW=", end_s: 1.5")
        arguments = ("envelope", base, "--types", "actuator.loss*", "--repeats", "1", "--out", "out")
        self.assertEqual(self.tiltproof(*arguments)[0], 0)
        before = (self.folder / "out/envelope.json").read_text()
        code, _, err = self.tiltproof(*arguments)
        self.assertEqual(code, 2)
        self.assertIn("out holds an envelope already: continue it (--resume out), or choose another --out", err)
        other = os.open(self.folder, os.O_RDONLY)
        fcntl.flock(other, fcntl.LOCK_EX)
        code, _, err = self.tiltproof("envelope", base, "--out", ".")
        os.close(other)
        self.assertEqual(code, 2)
        self.assertIn("another envelope is being written there", err)
        self.assertEqual((self.folder / "out/envelope.json").read_text(), before)

    def test_rows_without_a_margin_say_why(self):
        base = self.scenario("base", SHORT.replace("error_m <= 0.5", "error_m <= 0"), TYPE="harness.null", WINDOW=", end_s: 1.5")
        code, out, _ = self.tiltproof("envelope", base, "--types", "actuator.loss*", "--repeats", "1", "--out", "out")
        self.assertRegex(out, r"paper: fails without any fault, seed 1: near: always\(position_error_m <= 0\): .*; so it has no margins\n")
        self.assertRegex(out, r"actuator\.loss_of_effectiveness +f_r +1 +none\n")
        self.assertRegex(out, r"\n2 of 2 rows, 1 flight, ")

    def test_it_is_the_margin(self):
        [row] = self.envelope("--types", "plant.force")[0]["rows"]
        scenario = self.scenario("force", SHORT, TYPE="plant.force", WINDOW=", end_s: 1.5, parameters: {force_n: 2, direction: [0, 1, 0]}")
        out = self.tiltproof("margin", scenario, "--fault", "probe", "--repeats", "1", "--tolerance", "0.2", "--format", "jsonl")[1]
        margin = json.loads(out.splitlines()[-1])
        for key in ("survives", "fails", "unit", "first_criterion", "runs"):
            self.assertEqual(row[key], margin[key], key)

    def test_a_map_of_two(self):
        envelope, out = self.envelope("--map", "plant.force", "sensor.bias:z_m", "-j", "2")
        self.assertEqual(len(envelope["rows"]), 2)
        [both] = envelope["map"]
        self.assertEqual((both["x"]["type"], both["y"]["type"], both["y"]["signal"]), ("plant.force", "sensor.bias", "z_m"))
        self.assertEqual((len(both["x"]["levels"]), len(both["y"]["levels"]), len(both["survived"])), (12, 12, 12))
        self.assertTrue(both["survived"][0][0])
        self.assertFalse(any(both["survived"][-1]) or any(row[-1] for row in both["survived"]), "1.2 times what fails alone")
        self.assertEqual(len(re.findall(r" [#.](?= |\n)", out.split("across:")[1])), 144)

    def test_builds_with_a_client(self):
        alone = [row for row in self.two_builds()[1]["rows"] if row["type"] == "actuator.loss_of_effectiveness"]
        with_client = self.envelope("--types", "actuator.loss*", "--firmware", "paper,tolerant", "--client", "host")[0]
        self.assertEqual(with_client["clients"], ["paper", "tolerant"])
        self.assertEqual(with_client["rows"], alone)

    def test_libraries_beside_builds(self):
        """Two files of one name, one of them with a label; both are the shipped firmware, which flies as `paper` in a library."""
        for folder in ("a", "b"):
            (self.folder / folder).mkdir()
            shutil.copy(PROGRAM.parent / "lib/libtiltproof_firmware.so", self.folder / folder / "my_firmware.so")
        envelope, out = self.envelope("--types", "actuator.loss*", "--client", "mine=library:a/my_firmware.so", "--firmware", "paper,tolerant",
                                      "--client", "library:b/my_firmware.so", "-j", "2")
        self.assertEqual(envelope["clients"], ["paper", "tolerant", "mine", "library:b/my_firmware.so"])
        self.assertRegex(out, r"\[4\] library:b/my_firmware\.so\nsurvived up to +where +unit +paper +tolerant +mine +\[4\]\n")
        limits = {client: [row["survives"] for row in envelope["rows"] if row["client"] == client] for client in envelope["clients"]}
        self.assertEqual(limits["mine"], limits["paper"])
        self.assertEqual(limits["library:b/my_firmware.so"], limits["paper"])
        code, out, err = self.tiltproof("envelope", "base.yaml", "--types", "actuator.loss*", "--client", "mine=library:a/my_firmware.so", "--firmware", "paper,tolerant",
                                        "--client", "library:b/my_firmware.so", "--repeats", "1", "--tolerance", "0.2", "--resume", "out")
        self.assertEqual(code, 0, err)
        self.assertIn(" 0 flights", out)

    def test_mistakes(self):
        for arguments, message in ((("--types", "sensors.*"), "matches no fault type"), (("--firmware", "papers"), "did you mean 'paper'"),
                                   (("--map", "frame.drop:up", "plant.force"), "no such place"),
                                   (("--client", "mine=host", "--firmware", "mine"), "no such build"),
                                   (("--client", "a=host", "--client", f"a=library:{PROGRAM.parent}/lib/libtiltproof_firmware.so"), "a is named twice"),
                                   (("--firmware", "paper", "--client", "host", "--client", "qemu"), "--firmware needs one --client")):
            base = self.scenario("base", SHORT, TYPE="harness.null", WINDOW=", end_s: 1.5")
            code, _, err = self.tiltproof("envelope", base, *arguments)
            self.assertEqual(code, 2, err)
            self.assertIn(message, err)
        code, _, err = self.tiltproof("envelope", DRIFT)
        self.assertEqual(code, 2)
        self.assertIn("needs a fault of type harness.null", err)

    def test_wind_is_not_survived_by_a_vehicle_that_does_not_feel_it(self):
        envelope, out = self.envelope("--types", "plant.wind,plant.force")
        self.assertEqual([row["type"] for row in envelope["rows"]], ["plant.force"])
        self.assertEqual([(entry["type"], entry["reason"]) for entry in envelope["not_applicable"]],
                         [("plant.wind", "moves only a vehicle with drag; this one's file has no <tiltproof:drag> (tiltrotor_drag has one)")])
        self.assertIn("plant.wind", out)

    def test_nothing_applies(self):
        base = self.scenario("base", SHORT, TYPE="harness.null", WINDOW=", end_s: 1.5")
        code, out, err = self.tiltproof("envelope", base, "--types", "node.*")
        self.assertEqual(code, 4)
        self.assertIn("node.kill", out)
        self.assertIn("nothing is left to fly", err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
