#!/usr/bin/env python3
"""Vehicles with other rotors than two that tilt. Usage: vehicle_test.py TILTPROOF"""
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

    def test_the_protocol_does_not_carry_its_signals(self):
        scenario = self.scenario("quad")
        scenario.write_text(scenario.read_text() + "model: quadrotor.sdf\n")
        for command in ("check", "run"):
            code, out, err = self.tiltproof(command, "quad.yaml")
            self.assertEqual((code, out), (2, ""), command)
            self.assertIn("quad.yaml: model: the protocol 'paper' does not suit the vehicle: its messages carry f_r_n, f_l_n, tau_r_nm, tau_l_nm, ", err)
            self.assertIn("which this vehicle does not have", err)
            self.assertIn("does not carry this vehicle's f_front_left_n, f_front_right_n, f_rear_left_n, f_rear_right_n", err)

    def test_one_that_is_too_weak_is_refused(self):
        (self.folder / "quadrotor.sdf").write_text(quadrotor(force_max_n=2.9))
        code, _, err = self.tiltproof("design-lqr", "quadrotor.sdf")
        self.assertEqual(code, 2)
        self.assertIn("the vehicle cannot hover: its front_left rotor has to give 2.943 N, and its limits are 0 to 2.9 N", err)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
