#!/usr/bin/env python3
"""Lines between boards, as a user flies them. Usage: lines_test.py TILTPROOF CLIENTS_DIR"""
import json
import pathlib
import re
import sys
import unittest

from command_line import CommandLineTest

CLIENTS = pathlib.Path(sys.argv[2]).resolve()
LIBRARY = f"library:{CLIENTS / 'libtalking_client.so'}"
PROGRAM = f"program:{CLIENTS / 'talking_program'}"

FLIGHT = """\
name: NAME
seed: 5
duration_s: 1
reference: {type: hover, at_m: [0, 0, 2]}
clients: [{id: a}, {id: b}]
lines: LINES
FAULTS
criteria:
  - {name: near, stl: "always(position_error_m <= 1.0)"}
"""
CROSS = "[{id: cross, between: [a, b], baud: 115200}]"


class LinesTest(CommandLineTest):
    def write(self, name, lines=CROSS, faults=""):
        return self.scenario(name, FLIGHT, LINES=lines, FAULTS=faults)

    def fly(self, name, *flags, client=LIBRARY):
        done, out, err = self.tiltproof("run", self.folder / f"{name}.yaml", "--no-progress", "--client", client, *flags)
        self.assertEqual(done, 0, out + err)
        return json.loads((self.latest() / name / "verdict.json").read_text())

    def heard(self, name, client):
        """What the client says it has received: (bytes, wrong, time in ns) of each row."""
        log = (self.latest() / name / f"firmware.{client}.log").read_text()
        return [tuple(map(int, row)) for row in re.findall(r"line 2: (\d+) bytes, (-?\d+) wrong, at (\d+) ns", log)]

    def test_every_byte_arrives_once_at_its_time_in_every_way_to_fly(self):
        self.write("clean")
        first = self.fly("clean")
        heard = [self.heard("clean", client) for client in "ab"]
        # 24 bytes of 10 bits, every 5 ms from power-on.
        arrivals_ns = [5_000_000 * (row + 1) + (place + 1) * 10 * 10**9 // 115200 for row in range(300) for place in range(24)]
        for rows in heard:
            self.assertGreater(rows[-1][0], 24 * 190)
            for count, wrong, at_ns in rows:
                self.assertEqual((count, wrong), (sum(arrival <= at_ns for arrival in arrivals_ns), 0), at_ns)
        content = (self.latest() / "clean" / "link.bin").read_bytes()
        for flags, client in (((), LIBRARY), (("-j", "2"), PROGRAM), (("--distributed=socket",), LIBRARY), (("--distributed=dds",), LIBRARY),
                              (("--distributed=socket",), PROGRAM)):
            again = self.fly("clean", *flags, client=client)
            self.assertEqual(again["trace_hash"], first["trace_hash"], (flags, client))
            self.assertEqual([self.heard("clean", client) for client in "ab"], heard, (flags, client))
            self.assertEqual((self.latest() / "clean" / "link.bin").read_bytes(), content, (flags, client))

    def test_faults_act_on_the_way_they_name_and_replay(self):
        self.write("noisy", faults="faults: [{id: noise, type: wire.bit_error, target: cross_to_a, start_s: 0.2, parameters: {ber: 0.002}}]")
        verdict = self.fly("noisy")
        self.assertGreater(self.heard("noisy", "a")[-1][1], 10)
        self.assertEqual(self.heard("noisy", "b")[-1][1], 0)
        heard = self.heard("noisy", "a")
        self.assertGreater(verdict["faults"][0]["activations"], 10)
        for flags in ((), ("--distributed=socket",)):
            self.fly("noisy", *flags)
            self.assertEqual(self.heard("noisy", "a"), heard)
        done, out, err = self.tiltproof("replay", self.latest() / "noisy")
        self.assertEqual(done, 0, out + err)

    def steer(self, name, *requests):
        """The answers to these requests, without the greeting."""
        text = "".join(json.dumps(request) + "\n" for request in requests)
        _, out, err = self.tiltproof("session", self.folder / f"{name}.yaml", "--no-report", "--client", LIBRARY, stdin=text.encode())
        answers = [json.loads(line) for line in out.splitlines()]
        self.assertEqual(len(answers), len(requests) + 1, out + err)
        return answers[1:]

    def test_a_session_injects_and_ends_them_as_a_file_has_them(self):
        self.write("steered")
        noise = {"id": "noise", "type": "wire.bit_error", "target": "cross_to_a", "duration_s": 0.3, "parameters": {"ber": 0.002}}
        cut = {"id": "cut", "type": "link.silence", "target": "cross_to_b"}
        _, began, unknown, whole, _, silent, _, removed, ended = self.steer(
            "steered", {"advance_s": 0.4}, {"inject": noise}, {"inject": {**cut, "target": "cross_to_c"}}, {"inject": {**noise, "type": "frame.drop"}},
            {"advance_s": 0.2}, {"inject": cut}, {"advance_s": 0.1}, {"remove": "cut"}, {"finish": True})
        self.assertIn("target: unknown value 'cross_to_c'", unknown["error"]["message"])
        self.assertIn("acts on whole frames, and the line carries bytes as they are", whole["error"]["message"])
        # A line that is busy makes them wait for its bytes.
        for answer, at_s, key in ((began, 0.408, "start_s"), (silent, 0.612, "start_s"), (removed, 0.72, "end_s")):
            self.assertTrue(at_s <= answer[key] < at_s + 0.003, answer)
        heard = {client: self.heard("steered", client) for client in "ab"}
        self.assertGreater(heard["a"][-1][1], 10)
        self.assertLess(heard["b"][-1][0], heard["a"][-1][0], "bytes were lost")
        self.assertTrue(all(fault["activations"] > 0 for fault in ended["result"]["faults"]), ended)
        code, out, err = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 0, out + err)
        self.write("filed", faults="faults:\n"
                   f"  - {{id: noise, type: wire.bit_error, target: cross_to_a, start_s: {began['start_s']}, end_s: {began['start_s'] + 0.3:.9f}, parameters: {{ber: 0.002}}}}\n"
                   f"  - {{id: cut, type: link.silence, target: cross_to_b, start_s: {silent['start_s']}, end_s: {removed['end_s']}}}")
        self.assertEqual(self.fly("filed")["trace_hash"], ended["result"]["trace_hash"])
        self.assertEqual({client: self.heard("filed", client) for client in "ab"}, heard)

    def test_the_dump_names_line_and_way(self):
        self.write("dumped", faults="faults: [{id: cut, type: link.silence, target: cross_to_b, start_s: 0.5}]")
        self.fly("dumped")
        done, out, err = self.tiltproof("link-dump", self.latest() / "dumped" / "link.bin")
        self.assertEqual(done, 0, err)
        rows = [line.split() for line in out.splitlines() if " cross " in line]
        ways = {(row[2], row[3]) for row in rows}
        self.assertEqual(ways, {("to_a", "sent"), ("to_a", "delivered"), ("to_b", "sent"), ("to_b", "delivered")})
        for row in rows:
            self.assertEqual((row[4], row[5], len(row[6])), ("bytes", "24", 48))
            self.assertFalse(row[2:4] == ["to_b", "delivered"] and float(row[0]) >= 0.5, row)

    def test_mistakes_have_their_place(self):
        def check(lines=CROSS, faults="", clients="[{id: a}, {id: b}]"):
            self.scenario("wrong", FLIGHT.replace("[{id: a}, {id: b}]", clients), LINES=lines, FAULTS=faults)
            done, out, err = self.tiltproof("check", "wrong.yaml")
            self.assertEqual(done, 2, out + err)
            return err

        fault = "faults: [{id: f, type: TYPE, target: TARGET, parameters: {}}]"

        def target(text, type="link.silence"):
            return check(faults=fault.replace("TARGET", text).replace("TYPE", type))

        self.assertIn("wrong.yaml:6:34: between: there is no client 'c'", check("[{id: cross, between: [a, c]}]"))
        self.assertIn("both ends are 'a'", check("[{id: cross, between: [a, a]}]"))
        self.assertIn("a line has two ends, and there are 1", check("[{id: cross, between: [a]}]"))
        self.assertIn("a line has two ends, and there are 0", check("[{id: cross, between: []}]"))
        self.assertIn("a line has two ends, and there are 3", check("[{id: cross, between: [a, b, a]}]"))
        self.assertIn("baud: 100 is ", check("[{id: cross, between: [a, b], baud: 100}]"))
        self.assertIn("id: 'a' is a client", check("[{id: a, between: [a, b]}]"))
        self.assertIn("id: 'x' is taken already", check("[{id: x, between: [a, b]}, {id: x, between: [b, a]}]"))
        self.assertIn("the target 'x_to_a' of faults already means the line 'x'", check("[{id: x, between: [a, b]}, {id: x_to_a, between: [b, a]}]"))
        self.assertIn("already means every client's own lines", check("[{id: both, between: [a, b]}]"))
        self.assertIn("wrong.yaml:6:8: lines: a line is between two of several `clients`, and there is one", check(clients="[{id: a}]"))
        self.assertIn("wrong.yaml:7:46: target: unknown value 'cros'", target("cros"))
        self.assertIn("cross", target("cros"))
        self.assertIn("target: unknown value 'cross_to_c'", target("cross_to_c"))
        self.assertIn("wrong.yaml:7:24: type: frame.drop acts on whole frames, and the line carries bytes as they are", target("cross", "frame.drop"))
        self.assertIn("`target: cross_to_a` is one way", check(faults="faults: [{id: f, type: link.silence, target: cross, client: a}]"))
        self.assertIn("protocol: ", check("[{id: cross, between: [a, b], protocol: papr}]"))

    def test_what_cannot_have_a_line_is_refused(self):
        self.write("refused")
        for flags, text in ((("--mode", "realtime", "--client", "serial:/dev/x"), "the board of client 'b' has no device for it: add ,cross=DEV to --client"),
                            (("--client", "clocked:true"), "which has two ports only")):
            done, out, err = self.tiltproof("run", "refused.yaml", "--no-progress", *flags)
            self.assertEqual(done, 2, out + err)
            self.assertIn("refused.yaml:6:14: lines: 'cross': ", err)
            self.assertIn(text, err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
