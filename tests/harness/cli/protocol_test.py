#!/usr/bin/env python3
"""Flights with protocol files: the same bytes give the same flight, without the file, too. Usage: protocol_test.py TILTPROOF SOURCE_DIR"""
import pathlib
import sys
import unittest

from command_line import SHORT_HOVER, CommandLineTest

PAPER = (pathlib.Path(sys.argv[2]).resolve() / "link/protocols/paper.yaml").read_text()
# The paper's bytes; the names of protocol and messages are others.
MINE = PAPER.replace("protocol: paper", "protocol: mine").replace("name: reply", "name: states").replace("reply: reply", "reply: states")
STREAM = """\
protocol: stream
control_period_ms: 12
framing: {type: cobs, check: crc16_ibm_sdlc}
exchange: stream
start: {first: motors}
messages:
  - {name: imu, id: 1, from: server, period_ms: 12, fields: [{signal: wx_rad_s, type: f32}, {signal: wz_rad_x, type: f32}]}
  - name: motors
    from: client
    fields:
      - {signal: f_r_n, type: f32}
      - {signal: f_l_n, type: f32}
      - {signal: tau_r_nm, type: f32}
  - {name: reference, line: reference, from: server, fields: [{signal: x_m, type: f32}]}
"""


class ProtocolTest(CommandLineTest):
    def setUp(self):
        super().setUp()
        (self.folder / "mine.yaml").write_text(MINE)

    def hashes(self):
        return {result["name"]: result["trace_hash"] for result in self.results()["scenarios"]}

    def fly(self, *arguments):
        code, out, err = self.tiltproof("run", *arguments, "--no-report")
        self.assertEqual(code, 0, out + err)
        return self.hashes()

    def test_the_papers_bytes_under_another_name_are_the_same_flight(self):
        fault = ("faults: [{id: lost, type: frame.drop, target: to_client, message: MESSAGE, start_s: 0.2, end_s: 0.3, "
                 "parameters: {probability: 0.5}}]\n")
        (self.folder / "protocols").mkdir()
        (self.folder / "mine.yaml").rename(self.folder / "protocols/mine.yaml")
        self.scenario("paper", SHORT_HOVER + fault.replace("MESSAGE", "reply"), folder="flights")
        self.scenario("mine", SHORT_HOVER + fault.replace("MESSAGE", "states") + "link: {protocol: ../protocols/mine.yaml}\n", folder="flights")
        flown = self.fly("flights")
        self.assertEqual(flown["paper"], flown["mine"])
        self.assertEqual(self.fly("flights/mine.yaml", "--distributed"), {"mine": flown["mine"]})
        # A run holds its protocol: the file may change, or go.
        (self.folder / "protocols/mine.yaml").unlink()
        code, out, err = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 0, out + err)
        self.assertIn(flown["mine"], out)
        self.assertRegex((self.latest() / "mine/scenario.resolved.yaml").read_text(), r'protocol: "?mine')

    def test_a_folder_of_scenarios_may_hold_their_protocols(self):
        self.scenario("hover", SHORT_HOVER + "link: {protocol: mine.yaml}\n")
        code, out, err = self.tiltproof("check", ".")
        self.assertEqual(code, 0, out + err)
        code, out, err = self.tiltproof("check", "mine.yaml")
        self.assertEqual(code, 2)
        self.assertIn("mine.yaml:3:1: this is a protocol file, not a scenario", err)

    def test_mistakes_have_their_places(self):
        def refused(more, *errors):
            self.scenario("hover", SHORT_HOVER + more)
            code, out, err = self.tiltproof("check", "hover.yaml")
            self.assertEqual(code, 2, out)
            for error in errors:
                self.assertIn(error, err)

        refused("link: {protocol: papre}\n", "hover.yaml:7:18: protocol: unknown value", "did you mean 'paper'?")
        refused("link: {protocol: nothing.yaml}\n", "hover.yaml:7:18: protocol: ", "nothing.yaml: no such file")
        refused("link: {protocol: mine.yaml}\nfaults: [{id: a, type: frame.drop, target: to_client, message: state, parameters: {probability: 1}}]\n",
                "message: the protocol 'mine' has no message 'state'; did you mean 'states'?")
        (self.folder / "mine.yaml").write_text(MINE.replace("type: f32}", "type: f33}", 1))
        refused("link: {protocol: mine.yaml}\n", "mine.yaml:", ": type: unknown value 'f33'")
        (self.folder / "mine.yaml").write_text(PAPER)
        refused("link: {protocol: mine.yaml}\n", "'paper' is the name of a protocol that tiltproof ships")
        (self.folder / "mine.yaml").write_text(MINE.replace("control_period_ms: 12", "control_period_ms: 10"))
        refused("link: {protocol: mine.yaml}\n", "step_s: 0.004, the default, does not divide the control period of 0.01 s")

    def test_a_message_that_does_not_suit_the_vehicle_is_refused(self):
        (self.folder / "stream.yaml").write_text(STREAM)
        self.scenario("hover", SHORT_HOVER + "link: {protocol: stream.yaml}\n")
        code, out, err = self.tiltproof("check", "hover.yaml")
        self.assertEqual(code, 2, out)
        self.assertRegex(err, r"hover\.yaml:7:18: protocol: .*/stream\.yaml:7:\d+: signal: .*wz_rad_x")
        self.assertIn("tau_l_nm", err)

    def test_what_a_field_cannot_carry_is_a_warning_with_its_place(self):
        # The paper's messages; the heading of the reference is an integer that ends at 3.2767 rad.
        head, reference = MINE.split("  - name: reference")
        self.assertIn("{signal: yaw_rad, type: f32}", reference)
        (self.folder / "mine.yaml").write_text(
            head + "  - name: reference" + reference.replace("{signal: yaw_rad, type: f32}", "{signal: yaw_rad, type: i16, scale: 0.0001}"))
        place = next(f":{number}:{text.index('yaw_rad') + 1}" for number, text in enumerate((self.folder / "mine.yaml").read_text().splitlines(), 1)
                     if "scale: 0.0001" in text)
        yaw = "name: NAME\nduration_s: 1\nreference: {type: hover, at_m: [0, 0, 2], yaw_rad: YAW}\nlink: {protocol: mine.yaml}\n"
        self.scenario("wide", yaw.replace("YAW", "4"))
        self.scenario("within", yaw.replace("YAW", "3.2"))
        code, out, err = self.tiltproof("check", "wide.yaml", "--client", "serial:/dev/null,/dev/null")
        self.assertEqual(code, 0, out + err)
        self.assertIn(f"warning: wide.yaml:3:12: reference: yaw_rad = 4 at 0 s is beyond the range -3.2768 to 3.2767 of the message 'reference' "
                      f"({self.folder}/mine.yaml{place}): it is sent as 3.2767", err)
        self.assertNotIn("warning", self.tiltproof("check", "within.yaml", "--client", "serial:/dev/null,/dev/null")[2])

    def test_a_line_that_is_too_slow_is_a_warning_with_its_place(self):
        # From the server in each period of 12 ms: two flags, 64 bytes and a check of two, in characters of 10 bits.
        line = "link: {protocol: mine.yaml, baud: 56000}\n"
        self.scenario("slow", SHORT_HOVER + line)
        self.scenario("fast", SHORT_HOVER + line.replace("56000", "115200"))
        code, out, err = self.tiltproof("check", "slow.yaml")
        self.assertEqual(code, 0, out + err)
        self.assertRegex(err, r"warning: slow\.yaml:7:7: at 56000 baud the messages to_client of the protocol 'mine' take 12\.\d+ ms, "
                              r"longer than its control period of 12 ms: raise `baud`, or send less\n")
        self.assertNotIn("warning", self.tiltproof("check", "fast.yaml")[2])

    def test_the_shipped_firmware_speaks_only_shipped_protocols(self):
        (self.folder / "mine.yaml").write_text(MINE.replace("fletcher16", "crc16_ibm_sdlc"))
        self.scenario("hover", SHORT_HOVER + "link: {protocol: mine.yaml}\n")
        code, out, err = self.tiltproof("run", "hover.yaml", "--strict")
        self.assertEqual(code, 2, out)
        self.assertIn("the build 'paper' does not speak the protocol 'mine'", out + err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
