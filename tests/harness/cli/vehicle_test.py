#!/usr/bin/env python3
"""Vehicles with other rotors than two that tilt. Usage: vehicle_test.py TILTPROOF"""
import re
import sys
import unittest

from command_line import CommandLineTest


def link(name, pose, mass_kg, moment_kg_m2):
    moments = "".join(f"<i{axis}{axis}>{moment_kg_m2}</i{axis}{axis}>" for axis in "xyz")
    return (f"<link name='{name}'><pose>{pose}</pose><inertial><mass>{mass_kg}</mass><inertia>{moments}</inertia></inertial>"
            "<collision name='c'><geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision></link>")


def joint(child):
    return f"<joint name='to_{child}' type='fixed'><parent>body</parent><child>{child}</child></joint>"


def thruster(name, direction):
    return f"<tiltproof:thruster link='{name}' direction='{direction}' drag_ratio_m='0.016' force_max_n='10'/>"


def quadrotor(force_max_n=10):
    arms = {"front_left": (1, 1), "front_right": (1, -1), "rear_left": (-1, 1), "rear_right": (-1, -1)}
    return ("<sdf version='1.9'><model name='quadrotor'>" + link("body", "0 0 0 0 0 0", 1, 0.01) +
            "".join(link(name, f"{0.2 * x} {0.2 * y} 0.05 0 0 0", 0.05, 0.0001) + joint(name) for name, (x, y) in arms.items()) +
            "<tiltproof:vehicle xmlns:tiltproof='urn:tiltproof:vehicle:1'><tiltproof:base link='body'/>" +
            "".join(thruster(name, x * y) for name, (x, y) in arms.items()).replace("'10'", f"'{force_max_n}'") +
            "</tiltproof:vehicle></model></sdf>")


# The thrusts: 0.716 kg * 9.81 m/s^2 / 4, of 8.54858e-6 kg m * (838 rad/s)^2.
QUADROTOR = """\
quadrotor: 0.716 kg, 4 rotors and 0 hinges

rotor       on      x_m    y_m   z_m   ax   ay   az turns drag_m
front_left  base  0.120  0.120 0.010 0.00 0.00 1.00    cw 0.0160
front_right base  0.120 -0.120 0.010 0.00 0.00 1.00   ccw 0.0160
back_right  base -0.120 -0.120 0.010 0.00 0.00 1.00    cw 0.0160
back_left   base -0.120  0.120 0.010 0.00 0.00 1.00   ccw 0.0160

input           least hover  most share rises_s falls_s speed_rad_s
f_front_left_n  0.000 1.756 6.003  29 %  0.0125  0.0250           -
f_front_right_n 0.000 1.756 6.003  29 %  0.0125  0.0250           -
f_back_right_n  0.000 1.756 6.003  29 %  0.0125  0.0250           -
f_back_left_n   0.000 1.756 6.003  29 %  0.0125  0.0250           -

states   x_m y_m z_m roll_rad pitch_rad yaw_rad vx_m_s vy_m_s vz_m_s wx_rad_s
         wy_rad_s wz_rad_s
sensors  every state, and acc_x_m_s2 acc_y_m_s2 acc_z_m_s2 gyro_x_rad_s
         gyro_y_rad_s gyro_z_rad_s mag_x_t mag_y_t mag_z_t pressure_pa
         gnss_lat_deg gnss_lon_deg gnss_alt_m gnss_vn_m_s gnss_ve_m_s
         gnss_vd_m_s
hover    roll 0.0000 pitch 0.0000 rad

It can hover.
"""


class VehicleTest(CommandLineTest):
    def setUp(self):
        super().setUp()
        (self.folder / "quadrotor.sdf").write_text(quadrotor())

    def test_a_controller_is_designed_for_a_quadrotor(self):
        code, out, err = self.tiltproof("design-lqr", "quadrotor.sdf", "--csv", "gain.csv")
        self.assertEqual(code, 0, err)
        self.assertNotIn("collision", err)
        lines = out.splitlines()
        self.assertEqual(lines[0], "model            quadrotor (1.2000 kg)")
        self.assertRegex(lines[1], r"^hover            roll -?0\.000000  pitch -?0\.000000 rad$")
        # 1.2 kg * 9.81 m/s^2 / 4.
        self.assertEqual(lines[2], "                 f_front_left 2.94300  f_front_right 2.94300  f_rear_left 2.94300  f_rear_right 2.94300 N")
        self.assertIn("rows f_front_left f_front_right f_rear_left f_rear_right", out)
        rows = [line.split(",") for line in (self.folder / "gain.csv").read_text().splitlines()]
        self.assertEqual([len(row) for row in rows], [16] * 4)

    def test_the_tilt_rotors_design_is_printed_with_its_names(self):
        lines = self.tiltproof("design-lqr", "tiltrotor")[1].splitlines()
        self.assertEqual(lines[1], "hover            roll -0.000039  pitch -0.011689  alpha_r 0.011673  alpha_l 0.011615 rad")
        self.assertRegex(lines[2], r"^                 f_r 10\.27118  f_l 10\.28035 N  tau_r -?0\.00000  tau_l -?0\.00000 N m$")
        self.assertIn("rows f_r f_l tau_r tau_l", "\n".join(lines))

    def test_the_firmware_has_no_place_for_its_gain(self):
        code, out, err = self.tiltproof("design-lqr", "quadrotor.sdf", "--firmware-table", "kGain")
        self.assertEqual((code, out), (2, ""))
        self.assertIn("takes a gain of 4 x 20", err)
        self.assertIn("this vehicle's is 4 x 16", err)

    def test_the_builds_for_the_tilt_rotor_do_not_fly_it(self):
        scenario = self.scenario("quad")
        scenario.write_text(scenario.read_text() + "model: quadrotor.sdf\n")
        for command in ("check", "run"):
            code, out, err = self.tiltproof(command, "quad.yaml")
            self.assertEqual((code, out), (2, ""), command)
            self.assertIn("quad.yaml: firmware: the build 'paper' holds the gain of the tilt-rotor and cannot fly the vehicle of ", err)
            self.assertIn("; `firmware: lqr` flies any vehicle", err)
        self.assertEqual(self.tiltproof("run", "quad.yaml", "--firmware", "lqr")[0], 0)

    def test_one_that_is_too_weak_is_refused(self):
        (self.folder / "quadrotor.sdf").write_text(quadrotor(force_max_n=2.9))
        code, _, err = self.tiltproof("design-lqr", "quadrotor.sdf")
        self.assertEqual(code, 2)
        self.assertIn("the vehicle cannot hover: its front_left rotor has to give 2.943 N, and its limits are 0 to 2.9 N", err)

    def test_one_that_is_too_weak_is_printed_with_the_reason(self):
        (self.folder / "quadrotor.sdf").write_text(quadrotor(force_max_n=2.9))
        code, out, err = self.tiltproof("vehicle", "quadrotor.sdf")
        self.assertEqual(code, 2)
        self.assertIn("f_rear_right_n  0.000 2.943 2.900 101 %\n", out)
        self.assertNotIn("It can hover", out)
        self.assertEqual(len(re.findall(r"quadrotor\.sdf:1: the vehicle cannot hover: its \w+ rotor has to give 2\.943 N, and its limits are 0 to 2\.9 N\n", err)), 4)

    def test_one_without_any_hover_is_printed_with_the_reason(self):
        """All thrusts push sideways."""
        (self.folder / "quadrotor.sdf").write_text(quadrotor().replace("force_max_n", "axis='1 0 0' force_max_n"))
        scenario = self.scenario("quad")
        scenario.write_text(scenario.read_text() + "model: quadrotor.sdf\n")
        for command in ("vehicle", "check", "run"):
            code, out, err = self.tiltproof(command, "quadrotor.sdf" if command == "vehicle" else "quad.yaml")
            self.assertEqual(code, 2)
            self.assertIn("quadrotor.sdf:1: vehicle 'quadrotor' has no hover: its rotors cannot hold it still in the air", err)
            self.assertEqual(re.findall(r"^f_front_left_n .*", out, re.MULTILINE), ["f_front_left_n  0.000     - 10.000     -"] if command == "vehicle" else [])

    def test_a_vehicle_is_printed(self):
        code, out, err = self.tiltproof("vehicle", "quadrotor")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(out, QUADROTOR)

    def test_every_shipped_vehicle_fits_a_terminal(self):
        for name in ("quadrotor", "hexarotor", "quad_tilt", "tiltrotor", "tiltrotor_drag", "tiltrotor_published"):
            code, out, err = self.tiltproof("vehicle", name)
            self.assertEqual((code, err), (0, ""), name)
            self.assertTrue(out.endswith("\nIt can hover.\n"))
            self.assertLessEqual(max(map(len, out.splitlines())), 80, name)

    def test_hinges_are_printed(self):
        out = self.tiltproof("vehicle", "tiltrotor")[1]
        self.assertIn("\nleft  hinge_left  0.000  0.278 0.056 0.00 1.00  0.09 -1.50   1.50\n", out)
        self.assertIn("\nhover    roll 0.0000 pitch -0.0117 right 0.0117 left 0.0116 rad\n", out)

    def test_a_file_of_another_format_gets_its_conversion(self):
        (self.folder / "quad.sdf.jinja").write_text(quadrotor().replace("quadrotor", "{{ name }}"))
        (self.folder / "quad.yaml").write_text("name: q\nmodel: quad.sdf.jinja\nfirmware: lqr\nduration_s: 1\nreference: {type: hover, at_m: [0, 0, 1]}\n"
                                               "criteria: [{name: c, stl: always(z_m > 0)}]\n")
        for command in ("vehicle", "quad.sdf.jinja"), ("check", "quad.yaml"):
            code, _, err = self.tiltproof(*command)
            self.assertEqual(code, 2)
            self.assertIn("a jinja template, not SDF. Convert it", err)
        self.assertIn("no file quad.urdf; give a path ending in .sdf", self.tiltproof("vehicle", "quad.urdf")[2])

    def test_an_impossible_inertia_is_printed_when_it_is_allowed(self):
        (self.folder / "flat.sdf").write_text(quadrotor().replace("<izz>0.01</izz>", "<izz>0.03</izz>", 1))
        code, _, err = self.tiltproof("vehicle", "flat.sdf")
        self.assertEqual(code, 2)
        self.assertIn("to fly it anyway: --allow-invalid-inertia", err)
        code, out, err = self.tiltproof("vehicle", "flat.sdf", "--allow-invalid-inertia")
        self.assertEqual(code, 0, err)
        self.assertIn("impossible inertia", err)
        self.assertIn("It can hover.", out)

    def test_a_mapping_is_written_once(self):
        """ArduPilot's way: a controlled joint whose propeller's numbers are nowhere."""
        (self.folder / "bare.sdf").write_text(re.sub(r"<tiltproof:vehicle.*</tiltproof:vehicle>", "", quadrotor()))
        code, out, err = self.tiltproof("vehicle", "bare.sdf", "--mapping")
        self.assertEqual(code, 0, err)
        self.assertRegex(out, r"bare\.tiltproof\.xml: replace FILL_IN by a number, \d+ times\n$")
        text = (self.folder / "bare.tiltproof.xml").read_text()
        self.assertIn("FILL_IN", text)
        code, _, err = self.tiltproof("vehicle", "bare.sdf", "--mapping")
        self.assertEqual(code, 2)
        self.assertIn("bare.tiltproof.xml: is there already; nothing was changed", err)
        self.assertEqual((self.folder / "bare.tiltproof.xml").read_text(), text)

    def test_in_a_folder_a_vehicle_of_another_build_is_left_out(self):
        self.scenario("tilt", folder="suite")
        quad = self.scenario("quad", folder="suite")
        quad.write_text(quad.read_text() + "model: quadrotor\nfirmware: lqr\n")
        code, out, err = self.tiltproof("run", "suite", "--firmware", "tolerant", "--no-progress")
        self.assertEqual(code, 0, out + err)
        self.assertIn("the build 'tolerant' holds the gain of the tilt-rotor and cannot fly the vehicle of", out + err)
        self.assertEqual([flight["name"] for flight in self.results()["scenarios"] if flight["verdict"] == "pass"], ["tilt"])
        code, _, err = self.tiltproof("run", "suite/quad.yaml", "--firmware", "tolerant")
        self.assertEqual(code, 2)
        self.assertIn("quad.yaml: firmware: the build 'tolerant' holds the gain", err)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
