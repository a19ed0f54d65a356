#!/usr/bin/env python3
"""`tiltproof protocol`, and docs/protocol.md by it: the page's protocol is checked, its client compiled and flown, its frames
made by the generated C header and by the Python example, which know nothing of each other.
Usage: protocol_command_test.py TILTPROOF SOURCE_DIR"""
import ctypes
import json
import pathlib
import random
import re
import struct
import subprocess
import sys
import tempfile
import textwrap
import unittest

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])
del sys.argv[1:3]
sys.path.insert(0, str(SOURCE / "firmware/examples/python"))
import serial_protocol  # noqa: E402

PAGE = (SOURCE / "docs/protocol.md").read_text()


def blocks(language):
    """Those of the page, in their order."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```$", PAGE, re.MULTILINE | re.DOTALL)
    return [textwrap.dedent(text) for _, text in found]


def run(*arguments, code=0, **more):
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, **more)
    assert done.returncode == code, f"{arguments}: exit code {done.returncode}\n{done.stdout}{done.stderr}"
    return done


def compiled(folder, file, *flags):
    library = folder / file.replace(".c", ".so")
    run("cc", "-std=c99", "-pedantic", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-fPIC", "-shared",
        "-I", SOURCE, "-I", folder, *flags, folder / file, "-o", library)
    return library


ALL_TYPES = """\
protocol: PROTOCOL
control_period_ms: 10
framing: FRAMING
exchange: stream
byte_order: ORDER
id: {type: u16, byte_order: big}
start: {first: actuators}
messages:
  - name: actuators
    id: 126
    from: client
    fields:
      - {signal: sequence, type: u8}
      - {signal: time_us, type: u32}
      - {signal: f_front_left_n, type: u16, scale: 0.001}
      - {signal: f_front_right_n, type: f64}
      - {signal: f_back_right_n, type: i32, scale: 0.0001}
      - {signal: f_back_left_n, type: f32, as: share}
  - name: state
    id: 3
    from: server
    period_ms: 10
    fields:
      - {signal: sequence, type: u16}
      - {signal: x_m, type: i16, scale: 0.01}
      - {signal: y_m, type: i8, byte_order: little}
      - {signal: z_m, type: f64, byte_order: big}
      - {signal: roll_rad, type: f32}
  - {name: reference, line: reference, from: server, fields: [{signal: x_m, type: f32}, {signal: y_m, type: f32}, {signal: z_m, type: f32}]}
"""
FRAMINGS = ["{type: hdlc, check: crc32_iso_hdlc}", "{type: hdlc, check: none}", "{type: cobs, check: crc16_ibm_sdlc}", "{type: cobs, check: sum8}",
            "{type: length_prefixed, sync: [0xAA, 0x55], length: u8, check: crc16_ibm_3740}",
            "{type: length_prefixed, sync: [0xFE], length: u16, check: fletcher16}"]
FRONT_AND_BACK = ("f_front_left_n", "f_front_right_n", "f_back_right_n", "f_back_left_n")
SHIM = """\
#include "PROTOCOL.h"
size_t frame_of(unsigned sequence, uint32_t time_us, float a, double b, double c, float d, uint8_t* frame);
size_t frame_of(unsigned sequence, uint32_t time_us, float a, double b, double c, float d, uint8_t* frame) {
  struct PROTOCOL_msg_actuators message;
  message.sequence = (uint8_t)sequence;
  message.time_us = time_us;
  message.f_front_left_n = a;
  message.f_front_right_n = b;
  message.f_back_right_n = c;
  message.f_back_left_n = d;
  return PROTOCOL_send_actuators(&message, frame);
}
"""


class ProtocolTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "quad.yaml").write_text(blocks("yaml")[0])

    def check(self, *arguments, code=0):
        return run(PROGRAM, "protocol", "check", *arguments, code=code, cwd=self.folder)

    def described(self, *arguments):
        return json.loads(self.check(*arguments, "--format", "json").stdout)

    def test_the_page_from_the_message_on_paper_to_the_first_flight(self):
        self.assertEqual(self.check("quad.yaml", "--model", "quadrotor").stdout, blocks("text")[0])
        run(PROGRAM, "protocol", "header", "quad.yaml", "--out", "quad.h", cwd=self.folder)
        run(PROGRAM, "design-lqr", "quadrotor", "--period_ms", "4", "--header", "lqr_gain.h", cwd=self.folder)
        (self.folder / "quad.c").write_text(blocks("c")[0])
        (self.folder / "first.yaml").write_text(blocks("yaml")[1])
        library = self.folder / "quad.so"
        run("cc", "-std=c11", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden", "-I", SOURCE, "-I", ".", "quad.c", "-o",
            library, cwd=self.folder)
        run(PROGRAM, "run", "first.yaml", "--client", f"library:{library}", "--no-report", cwd=self.folder)
        # Without --model it would be the tilt-rotor's.
        run(PROGRAM, "fuzz", "--protocol", "quad.yaml", "--model", "quadrotor", "--client", f"library:{library}", "--runs", "20", cwd=self.folder)
        # No message of either end was refused.
        metrics = json.loads((self.folder / "results/latest/results.json").read_text())["scenarios"][0]["metrics"]
        for line in ("to_client", "to_plant", "reference"):
            self.assertEqual(metrics[f"link.{line}.frames_rejected_count"], 0, line)
            self.assertGreater(metrics[f"link.{line}.frames_accepted_count"], 2000, line)

    def test_the_frames_of_the_page(self):
        rows = re.findall(r"^\| a 00 ends the frame \| `(.*?)` \|$", PAGE, re.MULTILINE)
        quad = serial_protocol.Protocol(self.described("quad.yaml", "--model", "quadrotor"))
        quad.sent_counts["actuators"] = 256
        thrusts = dict(zip(FRONT_AND_BACK, (2.5, 2.5, 2.56, 2.048)))
        self.assertEqual([quad.frame("actuators", thrusts).hex(" ").upper()], rows)
        [request] = re.findall(r"^\| flags at both ends \| `(.*?)` \|$", PAGE, re.MULTILINE)
        encoded = run(PROGRAM, "frame", "encode", "00000040").stdout.strip()
        self.assertEqual(bytes.fromhex(encoded).hex(" ").upper(), request)
        prefixed = serial_protocol.LengthPrefixed({"sync": [0xAA, 0x55], "length_bytes": 1, "check_bytes": 0}).frame(bytes.fromhex("00000040"))
        self.assertIn(f"`{prefixed.hex(' ').upper()}`", PAGE)

    def test_the_checks_of_the_page(self):
        rows = dict(re.findall(r"^   \| `(\w+)` \| `([0-9A-F ]+)` \|$", PAGE, re.MULTILINE))
        self.assertEqual({name: check(b"123456789").hex(" ").upper() for name, check in serial_protocol.CHECKS.items() if name != "none"}, rows)

    def test_python_and_c_send_the_same_frames(self):
        numbers = random.Random(1)
        for i, framing in enumerate(FRAMINGS):
            name, order = f"mine_{i}", ("little", "big")[i % 2]
            text = ALL_TYPES.replace("PROTOCOL", name).replace("FRAMING", framing).replace("ORDER", order)
            (self.folder / f"{name}.yaml").write_text(text)
            protocol = serial_protocol.Protocol(self.described(f"{name}.yaml", "--model", "quadrotor"))
            run(PROGRAM, "protocol", "header", f"{name}.yaml", "--out", f"{name}.h", cwd=self.folder)
            (self.folder / f"{name}.c").write_text(SHIM.replace("PROTOCOL", name))
            frame_of = ctypes.CDLL(str(compiled(self.folder, f"{name}.c"))).frame_of
            frame_of.argtypes = [ctypes.c_uint, ctypes.c_uint32, ctypes.c_float, ctypes.c_double, ctypes.c_double, ctypes.c_float, ctypes.c_char_p]
            frame_of.restype = ctypes.c_size_t
            receiver = protocol.receiver(sender="client")
            for n in range(300):
                # Numbers that a binary32 holds, with halves of the scale among them.
                thrusts = [struct.unpack("f", struct.pack("f", numbers.choice((2.5, 0.0005, numbers.uniform(0, 5)))))[0] for _ in range(4)]
                frame = protocol.frame("actuators", dict(zip(FRONT_AND_BACK, thrusts)))
                [(name_of, said)] = receiver.feed(frame)
                self.assertEqual((name_of, said["sequence"]), ("actuators", n % 256), framing)
                buffer = ctypes.create_string_buffer(512)
                size = frame_of(n % 256, said["time_us"], *thrusts, buffer)
                self.assertEqual(buffer.raw[:size], frame, (framing, n))

    def test_python_takes_only_what_is_whole_and_newer(self):
        description = self.described("quad.yaml", "--model", "quadrotor")
        server = serial_protocol.Protocol(description)
        receiver = serial_protocol.Protocol(description).receiver()
        state = {field["signal"]: 0.5 for field in server.messages["reply"]["fields"]}

        def taken(count, damage=None):
            server.sent_counts["reply"] = count
            frame = bytearray(server.frame("reply", state))
            if damage is not None:
                frame[damage] ^= 0x10
            return [values["sequence"] for _, values in receiver.feed(bytes(frame))]

        self.assertEqual([taken(count) for count in (65534, 65535, 65536, 65536, 65535, 65537)], [[65534], [65535], [0], [], [], [1]])
        self.assertEqual([taken(2, damage) for damage in range(1, 50)], [[]] * 49)
        self.assertEqual(taken(2), [2])
        state["x_m"] = 2e4  # no vehicle of this size is there
        self.assertEqual(taken(3), [])

    def test_a_protocol_that_does_not_fit_is_refused_with_its_place(self):
        done = self.check("quad.yaml", code=2)  # the tilt-rotor
        self.assertIn("quad.yaml", done.stderr)
        self.assertIn("f_front_left_n", done.stderr)
        done = self.check("quad.yaml", "--model", "quadrotor", "--baud", "9600", code=2)
        self.assertIn("--baud", done.stderr)
        done = self.check("papre", code=2)
        self.assertIn("paper", done.stderr)
        (self.folder / "quad.yaml").write_text(blocks("yaml")[0].replace("id: 2", "id: 1"))
        for command in ("check", "header"):
            self.assertRegex(run(PROGRAM, "protocol", command, "quad.yaml", code=2, cwd=self.folder).stderr, r"^quad.yaml:\d+:\d+: id: ")

    def test_a_rotor_that_cannot_be_told_to_hover_is_a_warning(self):
        (self.folder / "quad.yaml").write_text(blocks("yaml")[0].replace("f_back_right_n, type: u16, scale: 0.001, max: 7", "f_back_right_n, type: u16, scale: 0.001, max: 1.7"))
        line = next(number for number, text in enumerate((self.folder / "quad.yaml").read_text().splitlines(), 1) if "f_back_right_n" in text)
        warnings = self.check("quad.yaml", "--model", "quadrotor").stderr.splitlines()
        self.assertEqual(len(warnings), 1, warnings)
        # 0.716 kg on four rotors.
        self.assertRegex(warnings[0], rf"^warning: quad.yaml:{line}:\d+: f_back_right_n: .* needs 1.75\d*, beyond the range 0 to 1.7 ")
        (self.folder / "quad.yaml").write_text(blocks("yaml")[0])
        self.assertEqual(self.check("quad.yaml", "--model", "quadrotor").stderr, "")

    def test_parity_and_stop_bits_take_their_time(self):
        shares = {}
        for character, bits in (("8N1", 10), ("8E1", 11), ("7O2", 11), ("8N2", 11), ("8E2", 12)):
            described = self.described("paper", "--character", character)
            self.assertEqual(described["character"], character)
            shares[character] = {load["direction"]: load["time_s"] / bits for load in described["load"]}
        for character, share in shares.items():
            for direction, seconds in share.items():
                self.assertAlmostEqual(seconds, shares["8N1"][direction], places=12, msg=character)
        self.assertIn("at 921600 baud (8E1):", self.check("paper", "--character", "8E1").stdout)
        self.assertIn("8N1", self.check("paper", "--character", "9N1", code=2).stderr)

    def test_fuzz_needs_the_vehicle_of_the_protocol(self):
        done = run(PROGRAM, "fuzz", "--protocol", "quad.yaml", "--client", "host", code=2, cwd=self.folder)
        self.assertIn("--protocol quad.yaml: the protocol 'quad' does not suit the vehicle", done.stderr)
        self.assertIn("(--model tiltrotor)", done.stderr)

    def test_the_lengths_of_the_paper(self):
        messages = {message["name"]: message for message in self.described("paper")["messages"]}
        self.assertEqual({name: message["payload_bytes"] for name, message in messages.items()},
                         {"start": 4, "request": 4, "actuators": 20, "reply": 64, "reference": 28})


if __name__ == "__main__":
    unittest.main()
