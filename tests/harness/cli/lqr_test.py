#!/usr/bin/env python3
"""Vehicles of all kinds, flown by the build `lqr`: paths, headings, faults, and the files of its gain. Usage: lqr_test.py TILTPROOF SOURCE_DIR"""
import csv
import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

from command_line import CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()
PAPER = (SOURCE / "link/protocols/paper.yaml").read_text()
MINIMAL = pathlib.Path(sys.argv[1]).resolve().parent / "lib/minimal_firmware.so"
HIT = "<collision name='c'><geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision>"


def link(name, pose, mass_kg, moments, hit=""):
    moments = "".join(f"<i{axis * 2}>{moment}</i{axis * 2}>" for axis, moment in zip("xyz", moments))
    return f"<link name='{name}'><pose>{pose}</pose><inertial><mass>{mass_kg}</mass><inertia>{moments}</inertia></inertial>{hit}</link>"


def fixed(child):
    return f"<joint name='to_{child}' type='fixed'><parent>body</parent><child>{child}</child></joint>"


def vehicle(bodies, elements):
    return (f"<sdf version='1.9'><model name='vehicle'>{bodies}<tiltproof:vehicle xmlns:tiltproof='urn:tiltproof:vehicle:1'>"
            f"<tiltproof:base link='body'/>{elements}</tiltproof:vehicle></model></sdf>")


def multirotor(count, mass_kg=1.5, arm_m=0.25):
    bodies = link("body", "0 0 0 0 0 0", mass_kg, (0.25 * mass_kg * arm_m**2,) * 2 + (0.45 * mass_kg * arm_m**2,), HIT)
    elements = ""
    for i in range(count):
        angle = (i + 0.5) * 2 * math.pi / count
        bodies += link(f"m{i}", f"{arm_m * math.cos(angle)} {arm_m * math.sin(angle)} 0.02 0 0 0", 0.01 * mass_kg, (1e-6 * mass_kg,) * 3) + fixed(f"m{i}")
        elements += (f"<tiltproof:thruster name='m{i}' link='m{i}' direction='{1 if i % 2 else -1}' drag_ratio_m='{0.06 * arm_m}' "
                     f"force_max_n='{2.2 * mass_kg * 9.81 / count}'/>")
    return vehicle(bodies, elements)


def bicopter():
    bodies, elements = link("body", "0 0 0 0 0 0", 1.2, (0.02, 0.015, 0.025), HIT), ""
    for name, y, direction in (("starboard", -0.25, 1), ("port", 0.25, -1)):
        bodies += link(name, f"0 {y} 0.08 0 0 0", 0.1, (2e-4,) * 3)
        bodies += (f"<joint name='tilt_{name}' type='revolute'><parent>body</parent><child>{name}</child>"
                   "<axis><xyz>0 1 0</xyz><limit><lower>-1.2</lower><upper>1.2</upper></limit></axis></joint>")
        elements += f"<tiltproof:thruster name='{name}' link='{name}' direction='{direction}' drag_ratio_m='0.016' force_max_n='16'/>"
        elements += f"<tiltproof:servo joint='tilt_{name}' torque_max_nm='1'/>"
    return vehicle(bodies, elements)


VEHICLES = {"quad": multirotor(4), "hexa": multirotor(6), "tiny": multirotor(4, 0.03, 0.046), "large": multirotor(8, 30, 0.9), "bi": bicopter()}

FLIGHT = """\
name: NAME
model: VEHICLE.sdf
firmware: lqr
duration_s: DURATION
reference: REFERENCE
criteria:
  - {name: on-path, stl: "always(position_error_m <= BOUND)"}
"""


def eight(time_s, turn_rad=0.0, yaw_of=lambda t: 0.0):
    """A figure of eight of 4 m x 2 m in 20 s, turned about z: rows of a recorded reference."""
    rows, cosine, sine = [], math.cos(turn_rad), math.sin(turn_rad)
    for i in range(int(time_s / 0.05) + 1):
        t = 0.05 * i
        phase = 2 * math.pi * t / 20
        x, y = 2 * math.sin(phase), math.sin(2 * phase)
        vx, vy = 2 * math.cos(phase) * 2 * math.pi / 20, 2 * math.cos(2 * phase) * 2 * math.pi / 20
        rows.append((t, cosine * x - sine * y, sine * x + cosine * y, 2.0, yaw_of(t) + turn_rad,
                     cosine * vx - sine * vy, sine * vx + cosine * vy, 0.0))
    return rows


class LqrTest(CommandLineTest):
    def setUp(self):
        super().setUp()
        for name, text in VEHICLES.items():
            (self.folder / f"{name}.sdf").write_text(text)

    def flight(self, name, vehicle_name="quad", reference="{type: hover, at_m: [0, 0, 2]}", duration=4, bound=0.5, more=""):
        text = FLIGHT.replace("VEHICLE", vehicle_name).replace("REFERENCE", reference).replace("DURATION", str(duration)).replace("BOUND", str(bound))
        return self.scenario(name, text + more)

    def recorded(self, name, rows):
        with open(self.folder / f"{name}.csv", "w", encoding="ascii", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["t_s", "x_m", "y_m", "z_m", "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s"])
            writer.writerows(rows)
        return f"{{type: recorded, file: {name}.csv}}"

    def trace(self, name):
        with open(self.latest() / name / "trace.csv", encoding="ascii") as file:
            return list(csv.DictReader(file))

    def fly(self, *names, options=()):
        code, out, err = self.tiltproof("run", *[f"{name}.yaml" for name in names], "--no-report", *options)
        return code, out + err

    def test_vehicles_of_all_kinds_and_sizes_hover_and_fly_paths(self):
        names = []
        for kind in VEHICLES:
            self.flight(f"{kind}-hover", kind, more="initial: {position_m: [0.3, -0.2, 2]}\n", duration=12,
                        bound=0.4)
            self.flight(f"{kind}-spiral", kind, "{type: spiral, turns_count: 2, radius_m: 2, height_m: 3, start_m: [0, 0, 2], time_s: 40}", 40, 0.6)
            self.flight(f"{kind}-eight", kind, "{type: eight, width_m: 4, period_s: 20, start_m: [0, 0, 2]}", 40, 0.6)
            names += [f"{kind}-{path}" for path in ("hover", "spiral", "eight")]
        code, output = self.fly(*names, options=("-j", "2"))
        self.assertEqual(code, 0, output)
        for kind in VEHICLES:
            last = self.trace(f"{kind}-hover")[-1]
            self.assertLess(math.hypot(float(last["x_m"]), float(last["y_m"]), float(last["z_m"]) - 2), 0.01, kind)

    def test_the_same_path_turned_is_flown_the_same(self):
        turns = {"east": 0.0, "north": math.pi / 2, "west": math.pi, "south": -math.pi / 2, "odd": 0.7}
        for kind in ("quad", "bi"):
            for name, turn in turns.items():
                reference = self.recorded(f"{kind}-{name}-path", eight(30, turn))
                self.flight(f"{kind}-{name}", kind, reference, 30, 1.0, f"initial: {{position_m: [0, 0, 2], attitude_rad: [0, 0, {turn}]}}\n")
            code, output = self.fly(*[f"{kind}-{name}" for name in turns], options=("-j", "2"))
            self.assertEqual(code, 0, output)
            first = self.trace(f"{kind}-east")
            for name, turn in turns.items():
                furthest = 0.0
                for a, b in zip(first, self.trace(f"{kind}-{name}")):
                    x, y = float(a["x_m"]), float(a["y_m"])
                    turned = (math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y)
                    furthest = max(furthest, math.dist((*turned, float(a["z_m"])), (float(b["x_m"]), float(b["y_m"]), float(b["z_m"]))))
                self.assertLess(furthest, 2e-3, f"{kind} {name}")

    def test_the_heading_turns_through_half_a_turn(self):
        for kind in ("quad", "hexa", "bi"):
            reference = self.recorded(f"{kind}-turning", eight(40, yaw_of=lambda t: 0.3 * t))
            self.flight(f"{kind}-turns", kind, reference, 40, 0.6)
        code, output = self.fly("quad-turns", "hexa-turns", "bi-turns")
        self.assertEqual(code, 0, output)
        for kind in ("quad", "hexa", "bi"):
            rows = self.trace(f"{kind}-turns")
            self.assertGreater(max(float(row["yaw_rad"]) for row in rows), 3)
            self.assertLess(min(float(row["yaw_rad"]) for row in rows), -3)
            for row in rows:
                if float(row["t_s"]) > 20:
                    error = math.remainder(float(row["yaw_rad"]) - 0.3 * float(row["t_s"]), 2 * math.pi)
                    self.assertLess(abs(error), 0.25, f"{kind} at {row['t_s']} s")

    def test_the_rates_may_be_about_other_axes(self):
        for rates in ("body", "euler"):
            self.flight(f"quad-{rates}", "quad", "{type: eight, width_m: 4, period_s: 20, start_m: [0, 0, 2]}", 30, 0.6,
                        f"angular_rates: {rates}\ninitial: {{attitude_rad: [0, 0, 2]}}\n")
        code, output = self.fly("quad-body", "quad-euler")
        self.assertEqual(code, 0, output)

    def test_faults_replays_and_processes_are_those_of_any_flight(self):
        faults = """\
faults:
  - {id: loss, type: frame.drop, target: to_client, start_s: 1, end_s: 3, parameters: {probability: 0.2}}
  - {id: weak, type: actuator.loss_of_effectiveness, start_s: 2, end_s: 5, parameters: {actuator: f_m1, factor: 0.9}}
  - {id: noise, type: sensor.noise, start_s: 0, parameters: {signal: z_m, std: 0.01}}
"""
        self.flight("faulty", more=faults, duration=6)
        code, output = self.fly("faulty")
        self.assertEqual(code, 0, output)
        self.assertEqual(self.tiltproof("replay", "results/latest")[0], 0)
        alone = (self.latest() / "faulty/trace.csv").read_bytes()
        code, output = self.fly("faulty", options=("--distributed",))
        self.assertEqual(code, 0, output)
        self.assertEqual((self.latest() / "faulty/trace.csv").read_bytes(), alone)

    def test_a_gain_comes_from_a_file(self):
        self.assertEqual(self.tiltproof("design-lqr", "quad.sdf", "--csv", "gain.csv")[0], 0)
        self.flight("designed", more="initial: {position_m: [0.3, 0, 2]}\n")
        self.flight("from-file", more="initial: {position_m: [0.3, 0, 2]}\ngain: gain.csv\n")
        self.flight("by-name", more="initial: {position_m: [0.3, 0, 2]}\ngain: design\n")
        code, output = self.fly("designed", "from-file", "by-name")
        self.assertEqual(code, 0, output)
        for name in ("from-file", "by-name"):
            self.assertEqual((self.latest() / name / "trace.csv").read_bytes(), (self.latest() / "designed/trace.csv").read_bytes())
        # The resolved scenario has the file's place, and flies again.
        self.assertIn(f'gain: "{self.folder.resolve() / "gain.csv"}"', (self.latest() / "from-file/scenario.resolved.yaml").read_text())
        self.assertEqual(self.tiltproof("replay", "results/latest")[0], 0)

    def test_a_wrong_gain_has_its_place(self):
        (self.folder / "gain.csv").write_text("1,2\n")
        self.flight("wrong", more="gain: gain.csv\n")
        code, _, err = self.tiltproof("check", "wrong.yaml")
        self.assertEqual(code, 2)
        self.assertIn("gain.csv:1:1: 2 numbers, and the vehicle needs 16", err)
        self.flight("missing", more="gain: nowhere.csv\n")
        code, _, err = self.tiltproof("check", "missing.yaml")
        self.assertEqual(code, 2)
        self.assertRegex(err, r"missing\.yaml:8:7: gain: there is no file .*nowhere\.csv; `tiltproof design-lqr MODEL --csv FILE` writes one")

    def test_a_gain_that_no_firmware_takes_is_refused(self):
        self.flight("unused", "tiltrotor", more="gain: design\n")
        path = self.folder / "unused.yaml"
        path.write_text(path.read_text().replace("tiltrotor.sdf", "tiltrotor").replace("firmware: lqr\n", ""))
        for command in ("check", "run"):
            code, _, err = self.tiltproof(command, "unused.yaml")
            self.assertEqual(code, 2)
            self.assertIn("unused.yaml: gain: the build 'paper' does not take a gain; `firmware: lqr` does", err)
        for taken in (("--firmware", "lqr"), ("--client", f"library:{MINIMAL}")):
            self.assertEqual(self.tiltproof("run", "unused.yaml", "--no-report", *taken)[0], 0, taken)

    def test_a_vehicle_that_no_gain_stabilises_is_refused(self):
        (self.folder / "quad.sdf").write_text(VEHICLES["quad"].replace("drag_ratio_m='0.015'", "drag_ratio_m='0'"))
        self.flight("no-yaw")
        for command in ("check", "run"):
            code, _, err = self.tiltproof(command, "no-yaw.yaml")
            self.assertEqual(code, 2)
            self.assertIn("no-yaw.yaml: firmware: lqr: ", err)
            self.assertIn("its inputs cannot control yaw_rad", err)
        self.assertIn("cannot control yaw_rad", self.tiltproof("design-lqr", "quad.sdf")[2])

    def protocol(self, name, *changes):
        text = re.sub(r"      - {signal: (alpha|tau)_.*\n", "", PAPER.replace("protocol: paper", f"protocol: {name}"))
        inputs = "".join(f"      - {{signal: f_m{i}_n, type: f32}}\n" for i in range(4))
        text = re.sub("(      - {signal: f_._n, type: f32}\n)+", inputs, text)
        for old, new in changes:
            self.assertIn(old, text)
            text = text.replace(old, new)
        (self.folder / f"{name}.yaml").write_text(text)
        return f"link: {{protocol: {name}.yaml}}\n"

    def test_what_no_reference_message_carries_is_held_and_said(self):
        level = self.protocol("level", ("      - {signal: z_m, type: f32}\n      - {signal: yaw_rad, type: f32}\n      - {signal: vx_m_s", "      - {signal: vx_m_s"))
        self.flight("holds", reference="{type: circle, radius_m: 0.5, period_s: 8, start_m: [0.5, 0, 2]}", bound=1.5, more=level)
        self.flight("climbs", reference="{type: hover, at_m: [0, 0, 4]}", bound=3, more="initial: {position_m: [0, 0, 2]}\n" + level)
        code, text = self.fly("holds", "climbs")
        self.assertEqual(code, 0, text)
        self.assertNotIn("holds.yaml:", text)
        self.assertIn("warning: climbs.yaml:5:12: reference: it changes z_m, and no reference message of the protocol 'level' carries that: "
                      "a firmware does not hear of it", text)
        self.assertTrue(all(abs(float(row["z_m"]) - 2) < 0.05 for row in self.trace("climbs")))

    def test_a_vehicle_that_leaves_the_range_of_a_field_is_named_beside_the_failure(self):
        level = self.protocol("level", ("{signal: roll_rad, type: f32}", "{signal: roll_rad, type: f32, min: -0.2, max: 0.2}"))
        push = "faults: [{id: up, type: plant.thrust, start_s: 1, end_s: 1.2, parameters: {rotor: m0, factor: 0.3}}]\n"
        self.flight("pushed", duration=8, more=level + push)
        self.flight("pushed-far", duration=8, bound=5, more=push)
        code, text = self.fly("pushed", "pushed-far")
        self.assertEqual(code, 1, text)
        self.assertRegex(text, r"before, at 1\.\d+ s, the message 'reply' carries roll_rad = -?0\.2\d*, beyond the range -0\.2 to 0\.2: a client may refuse it; "
                               r"widen the field's `min` and `max` if the vehicle may go there")
        self.assertEqual([result["verdict"] for result in self.results()["scenarios"]], ["fail", "pass"])

    def test_other_builds_and_protocols_are_refused_with_the_place(self):
        self.flight("paper")
        path = self.folder / "paper.yaml"
        path.write_text(path.read_text().replace("firmware: lqr\n", ""))
        code, _, err = self.tiltproof("check", "paper.yaml")
        self.assertEqual(code, 2)
        self.assertIn("paper.yaml: firmware: the build 'paper' holds the gain of the tilt-rotor", err)
        self.assertIn("`firmware: lqr` flies any vehicle", err)
        self.assertEqual(self.tiltproof("check", "paper.yaml", "--client", f"library:{MINIMAL}")[0], 0)
        self.flight("provant", more="link: {dialect: provant}\n")
        code, _, err = self.tiltproof("check", "provant.yaml")
        self.assertEqual(code, 2)
        self.assertIn("provant.yaml:8:17: protocol: the protocol 'provant' does not suit the vehicle: its messages carry f_r_n, f_l_n, tau_r_nm, tau_l_nm, ", err)
        self.assertIn("which this vehicle does not have", err)
        self.assertIn("does not carry this vehicle's f_m0_n, f_m1_n, f_m2_n, f_m3_n", err)
        self.flight("emulated")
        code, _, err = self.tiltproof("run", "emulated.yaml", "--client", "qemu")
        self.assertEqual(code, 2)
        self.assertIn("there is no image of the build lqr", err)

    def test_it_flies_the_tilt_rotor_in_both_dialects(self):
        for dialect in ("paper", "provant"):
            self.flight(f"tilt-{dialect}", "tiltrotor", "{type: eight, width_m: 4, period_s: 20, start_m: [0, 0, 2]}", 30, 0.6,
                        f"link: {{dialect: {dialect}}}\ninitial: {{attitude_rad: [0, 0, 3]}}\n")
            path = self.folder / f"tilt-{dialect}.yaml"
            path.write_text(path.read_text().replace("tiltrotor.sdf", "tiltrotor"))
        code, output = self.fly("tilt-paper", "tilt-provant")
        self.assertEqual(code, 0, output)

    def test_the_example_in_c_flies_any_vehicle(self):
        for kind in ("quad", "hexa", "bi"):
            self.flight(f"{kind}-c", kind, "{type: eight, width_m: 4, period_s: 20, start_m: [0, 0, 2]}", 30, 0.6, "initial: {attitude_rad: [0, 0, 2]}\n")
        code, output = self.fly("quad-c", "hexa-c", "bi-c", options=("--client", f"library:{MINIMAL}"))
        self.assertEqual(code, 0, output)

    def test_the_example_in_python_computes_the_same_commands(self):
        """From what the sensors said in a flight, with the gain of a file and with that of the parameters."""
        sys.path.insert(0, str(SOURCE / "firmware/examples/python"))
        import hover  # noqa: PLC0415
        self.assertEqual(self.tiltproof("design-lqr", "quad.sdf", "--csv", "gain.csv")[0], 0)
        self.flight("python", more="initial: {position_m: [0.3, -0.2, 2], attitude_rad: [0, 0, 2]}\n", duration=6)
        code, output = self.fly("python")
        self.assertEqual(code, 0, output)
        rows = self.trace("python")
        sensors = [name[len("sensed_"):] for name in rows[0] if name.startswith("sensed_")]
        inputs = [name for name in rows[0] if name.startswith("commanded_")]
        gain = hover.read_gain(self.folder / "gain.csv", {"inputs": inputs, "signals": sensors})
        parameters = {"signals": [{"name": name, "hover": 0.0} for name in sensors], "angular_rates": "world", "gain": gain,
                      "inputs": [{"hover": 1.56 * 9.81 / 4, "min": 0.0, "max": 2.2 * 1.5 * 9.81 / 4}] * 4}
        (self.folder / "parameters.json").write_text(json.dumps(parameters))
        for source in (self.folder / "gain.csv", self.folder / "parameters.json", "design"):
            controller = hover.Controller(source, parameters)
            for before, row in zip(rows, rows[1:]):
                sensed = [float(row[f"sensed_{name}"]) for name in sensors]
                if any(map(math.isnan, sensed)):
                    continue
                for name, value in zip(inputs, controller.step(sensed, (0, 0, 2, 0, 0, 0, 0))):
                    if abs(float(row["yaw_rad"])) < 0.45:  # the build limits larger errors of heading
                        self.assertAlmostEqual(float(row[name]), value, delta=0.35, msg=f"{name} at {row['t_s']} s")

    def test_the_header_compiles_and_holds_the_gain(self):
        self.assertEqual(self.tiltproof("design-lqr", "bi.sdf", "--header", "gain.h", "--csv", "gain.csv")[0], 0)
        (self.folder / "main.c").write_text("""
#include "gain.h"
#include <stdio.h>
int main(void) {
  for (int i = 0; i < LQR_INPUTS; ++i)
    for (int j = 0; j < LQR_STATES + LQR_INTEGRALS; ++j) printf("%.9g%c", (double)lqr_gain[i][j], j + 1 == LQR_STATES + LQR_INTEGRALS ? '\\n' : ',');
  printf("%s %s %.9g %.9g %.9g %.9g\\n", lqr_state_names[6], lqr_input_names[2], (double)lqr_period_s, (double)lqr_input_min[2], (double)lqr_input_max[0],
         (double)(lqr_hover_input[0] + lqr_hover_input[1] + lqr_hover_state[0]));
  return 0;
}
""")
        warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror"]
        for compiler in (["cc", "-std=c99"], ["c++", "-std=c++11", "-x", "c++"]):
            subprocess.run([*compiler, *warnings, "main.c", "-o", "main"], cwd=self.folder, check=True)
        shown = subprocess.run(["./main"], cwd=self.folder, check=True, capture_output=True, text=True).stdout.splitlines()
        for line, row in zip(shown, (self.folder / "gain.csv").read_text().splitlines()):
            for a, b in zip(line.split(","), row.split(","), strict=True):
                self.assertAlmostEqual(float(a), float(b), delta=1e-6 * max(abs(float(b)), 1e-3))
        names = shown[-1].split()
        self.assertEqual(names[:2], ["alpha_starboard_rad", "tau_starboard_nm"])
        self.assertEqual([float(value) for value in names[2:5]], [0.0120000001, -1, 16])
        self.assertAlmostEqual(float(names[5]), 1.4 * 9.81, delta=1e-3)
        (self.folder / "gain.c").write_text('#include "gain.h"\nconst float* first(void);\nconst float* first(void) { return lqr_gain[0]; }\n')
        if shutil.which("arm-none-eabi-gcc"):
            subprocess.run(["arm-none-eabi-gcc", "-std=c99", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", *warnings,
                            "-ffreestanding", "-x", "c", "-c", "gain.c", "-o", "gain.o"], cwd=self.folder, check=True)

    def test_weights_have_names(self):
        def gain(*options):
            code, _, err = self.tiltproof("design-lqr", "quad.sdf", "--csv", "gain.csv", *options)
            self.assertEqual(code, 0, err)
            return (self.folder / "gain.csv").read_text()

        usual = gain()
        (self.folder / "same.csv").write_text("x_m,50\nintegral_z_m_s,20\n")
        by_csv = gain("--weights", "same.csv")
        (self.folder / "same.yaml").write_text("x_m: 50\nintegral_z_m_s: 20\n")
        self.assertEqual(gain("--weights", "same.yaml"), by_csv)
        self.assertNotEqual(by_csv, usual)
        self.assertNotEqual(gain("--period_ms", "4"), usual)
        for file, text, problem in (
                ("w.yaml", "x_m: 5\nf_m9_n: 1\n", r"w\.yaml:2:1: unknown name 'f_m9_n'; did you mean 'f_m\d_n'\?; the names of this vehicle are x_m, "),
                ("w.yaml", "x_m: -5\n", r"w\.yaml:1:6: x_m: expected a number above 0 and up to 1e\+12, found the number -5"),
                ("w.yaml", "- 5\n", r"w\.yaml:1:1: expected names and their weights"),
                ("w.yaml", "x_m: [\n", r"w\.yaml:\d+:\d+: "),
                ("w.csv", "x_m,5\ny_m;5\n", r"w\.csv:2:1: expected a name, a comma and a number"),
                ("w.csv", "x_m,five\n", r"w\.csv:1:5: x_m: expected a number above 0"),
                ("w.csv", "x_m,5\nx_m,6\n", r"w\.csv:2:1: the name 'x_m' is there already")):
            (self.folder / file).write_text(text)
            code, _, err = self.tiltproof("design-lqr", "quad.sdf", "--weights", file)
            self.assertEqual(code, 2, text)
            self.assertRegex(err, problem)
        self.assertIn("--weights nowhere.yaml: cannot be read", self.tiltproof("design-lqr", "quad.sdf", "--weights", "nowhere.yaml")[2])

    def test_an_envelope_takes_the_vehicles_own_parts(self):
        """Not the example's of a fault type, and no fault of a hinge where there is none."""
        probe = "faults: [{id: probe, type: harness.null, start_s: 1, end_s: 2}]\n"
        self.flight("probed", duration=3, more=probe)
        code, out, err = self.tiltproof("envelope", "probed.yaml", "--types", "plant.thrust,plant.servo_jam", "--out", "margins")
        self.assertNotIn("error", out + err)
        self.assertEqual(code, 0, err)
        rows = json.loads((self.folder / "margins/envelope.json").read_text())["rows"]
        self.assertEqual([row["type"] for row in rows], ["plant.thrust"])
        self.flight("weak", duration=6, more="faults: [{id: weak, type: plant.thrust, start_s: 1, parameters: {rotor: m2, factor: 0.9}}]\n")
        self.assertEqual(self.tiltproof("run", "weak.yaml", "--no-report")[0], 0)

    def test_reports_and_exports_show_rotors_on_the_body(self):
        self.flight("shown", duration=1)
        self.assertEqual(self.tiltproof("run", "shown.yaml")[0], 0)
        self.assertTrue((self.latest() / "report.html").is_file())
        code, _, err = self.tiltproof("export", "results/latest", "--to", "mcap")
        self.assertEqual(code, 0, err)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=1)
