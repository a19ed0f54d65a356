#!/usr/bin/env python3
"""The program as a user runs it. Usage: cli_test.py TILTPROOF SOURCE_DIR CLIENTS_DIR"""
import collections
import json
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import time
import unittest
import xml.etree.ElementTree

from command_line import CommandLineTest, PROGRAM, SHORT_HOVER

_, SOURCE, CLIENTS = (pathlib.Path(a).resolve() for a in sys.argv[1:4])


OWN_PROTOCOL = """\
protocol: own
control_period_ms: 12
framing: {type: cobs, check: crc16_ibm_3740}
start: {message: start}
messages:
  - {name: start, id: 1, from: client}
  - {name: request, id: 2, from: client, reply: reply}
  - {name: reply, id: 4, from: server, fields: [{signal: z_m, type: f32}]}
  - name: actuators
    id: 3
    from: client
    fields:
      - {signal: f_r_n, type: u16, scale: 0.001, min: 0, max: 30}
      - {signal: tau_r_nm, type: i32, scale: 0.001}
      - {signal: sequence, type: u8}
"""


class CliTest(CommandLineTest):
    # frame encode, frame decode

    def test_frame_encode_and_decode(self):
        self.assertEqual(self.tiltproof("frame", "encode", "7e7d01"), (0, "7e7d5e7d5d01fc777e\n", ""))
        code, out, _ = self.tiltproof("frame", "decode", stdin=bytes.fromhex("7e7d5e7d5d01fc777e" "557e" "7e7e" "010203"))
        self.assertEqual([json.loads(line) for line in out.splitlines()],
                         [{"offset": 0, "status": "ok", "payload": "7e7d01"},
                          {"offset": 8, "status": "too_short", "payload": "55"},
                          {"offset": 12, "status": "aborted", "payload": "010203"}])
        self.assertEqual(code, 1)

    def test_frames_of_a_protocol_file(self):
        """COBS and CRC-16/IBM-3740, encoded by hand: a request with the id 2, a command with integers of 1 mN."""
        (self.folder / "own.yaml").write_text(OWN_PROTOCOL)

        def crc(data):
            value = 0xFFFF
            for byte in data:
                value ^= byte << 8
                for _ in range(8):
                    value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
            return value.to_bytes(2, "big")

        def cobs(data):
            return b"".join(bytes([len(part) + 1]) + part for part in data.split(b"\0")) + b"\0"

        command = struct.pack("<BHiB", 3, 12345, -500, 7)
        stream = cobs(b"\x02" + crc(b"\x02")) + cobs(command + crc(command))
        code, out, err = self.tiltproof("frame", "decode", "--protocol", "own.yaml", stdin=stream)
        self.assertEqual((code, err), (0, ""))
        first, second = (json.loads(line) for line in out.splitlines())
        self.assertEqual(first["messages"], [{"message": "request", "direction": "to_plant", "status": "ok", "values": {}}])
        self.assertEqual(second["payload"], command.hex())
        values = second["messages"][0]["values"]
        self.assertEqual((second["messages"][0]["message"], values["sequence"]), ("actuators", 7))
        self.assertAlmostEqual(values["f_r_n"], 12.345)
        self.assertAlmostEqual(values["tau_r_nm"], -0.5)
        self.assertEqual(self.tiltproof("frame", "encode", "--protocol", "own.yaml", command.hex()),
                         (0, cobs(command + crc(command)).hex() + "\n", ""))
        # The same command again, one that is older, one ahead: a receiver refuses the first two.
        ahead = [struct.pack("<BHiB", 3, 12345, -500, number) for number in (7, 7, 250, 8)]
        code, out, _ = self.tiltproof("frame", "decode", "--protocol", "own.yaml", stdin=b"".join(cobs(one + crc(one)) for one in ahead))
        self.assertEqual([json.loads(line)["messages"][0]["status"] for line in out.splitlines()], ["ok", "stale", "stale", "ok"])
        damaged = stream[:-3] + bytes([stream[-3] ^ 1]) + stream[-2:]
        code, out, _ = self.tiltproof("frame", "decode", "--protocol", "own.yaml", stdin=damaged)
        self.assertEqual((code, json.loads(out.splitlines()[1])["status"]), (1, "bad_checksum"))
        code, _, err = self.tiltproof("frame", "decode", "--protocol", "none.yaml", stdin=b"")
        self.assertEqual((code, "--protocol none.yaml: no such protocol or file" in err), (2, True), err)

    def test_a_fault_that_the_framing_does_not_have(self):
        (self.folder / "own.yaml").write_text(OWN_PROTOCOL)
        for fault, text in (
                ("{id: a, type: frame.dangling_escape, target: to_client, parameters: {probability: 0.1}}",
                 "type: frame.dangling_escape needs frames with escaped bytes; the protocol 'own' has the framing 'cobs' without: use one of "
                 "frame.flag_loss, frame.flag_forgery, frame.truncate"),
                ("{id: a, type: frame.wrong_id, target: to_client, parameters: {probability: 0.1, id: 300}}",
                 "parameters.id: the ids of the protocol 'own' are u8: must be a whole number from 0 to 255")):
            file = self.scenario("hover", **{"seed: 3": f"seed: 3\nlink: {{protocol: own.yaml}}\nfaults:\n  - {fault}"})
            for command in ("check", "run"):
                code, _, err = self.tiltproof(command, file)
                self.assertEqual(code, 2, err)
                self.assertIn(text, err)
                self.assertRegex(err, r"hover\.yaml:\d+:\d+: ")

    def test_frame_decode_of_good_frames_is_green(self):
        self.assertEqual(self.tiltproof("frame", "decode", stdin=bytes.fromhex("7e7d5e7d5d01fc777e"))[0], 0)

    def test_frame_mistakes_are_usage(self):
        for arguments in (["frame", "encode", "7"], ["frame", "encode", "zz"], ["frame", "encode", "00" * 300], ["frame", "decode", "missing.bin"],
                          ["frame"], ["nonsense"], []):
            self.assertEqual(self.tiltproof(*arguments)[0], 2, arguments)
        code, out, err = self.tiltproof("frame", "decode", self.folder)
        self.assertEqual((code, out), (2, ""))
        self.assertIn("is a folder", err)

    def test_a_frame_holds_what_its_length_counts(self):
        text = "\n".join([
            "protocol: short", "control_period_ms: 4", "framing: {type: length_prefixed, sync: [0xAA], length: u8, check: crc16_ibm_sdlc}",
            "exchange: request_reply", "start: {first: ask}", "messages:", "  - {name: ask, id: 1, from: client, reply: state}",
            "  - {name: state, id: 2, from: server, fields: [{signal: z_m, type: f32}]}",
            "  - {name: motors, id: 3, from: client, fields: [{signal: f_r_n, type: f32}]}", ""])
        (self.folder / "short.yaml").write_text(text)
        self.assertEqual(self.tiltproof("frame", "encode", "--protocol", "short.yaml", "01" * 255)[0], 0)
        code, out, err = self.tiltproof("frame", "encode", "--protocol", "short.yaml", "01" * 256)
        self.assertEqual((code, out), (2, ""))
        self.assertIn("HEX: 256 bytes; a payload has at most 255", err)

    # new, schema

    def test_new_writes_a_scenario_that_flies_green(self):
        self.assertEqual(self.tiltproof("new", "first.yaml"), (0, "wrote first.yaml, and tiltproof.schema.json for editors\n", ""))
        text = (self.folder / "first.yaml").read_text()
        self.assertEqual(text.splitlines()[0], "# yaml-language-server: $schema=tiltproof.schema.json")
        self.assertEqual((self.folder / "tiltproof.schema.json").read_text(), self.tiltproof("schema")[1])
        self.assertEqual(self.tiltproof("check", ".")[:2], (0, "1 scenario in order\n"))
        for firmware in ("paper", "tolerant"):
            code, out, err = self.tiltproof("run", "first.yaml", "--firmware", firmware)
            self.assertEqual((code, err), (0, ""), out)
        (entry,) = self.results()["scenarios"]
        self.assertEqual((entry["name"], entry["verdict"]), ("first", "pass"))
        self.assertGreater(entry["faults"][0]["activations"], 10)

    def test_new_changes_nothing_that_is_there(self):
        (self.folder / "mine.yaml").write_text("mine")
        (self.folder / "nowhere.yaml").symlink_to("missing")
        for file, word in (("mine.yaml", "is there already"), ("nowhere.yaml", "is there already"), ("deep/a.yaml", "no folder deep"),
                           ("a.json", "ends in .yaml"), ("a b.yaml", "'a b' must be letters"), ("", "ends in .yaml"), ("run.json.yaml", "name of a file")):
            code, out, err = self.tiltproof("new", file)
            self.assertEqual((code, out), (2, ""), file)
            self.assertIn(word, err)
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), ["mine.yaml", "nowhere.yaml"])
        self.assertEqual((self.folder / "mine.yaml").read_text(), "mine")

    def test_new_quotes_names_that_are_no_text(self):
        for stem in ("10", "yes", "1e3", "true"):
            self.assertEqual(self.tiltproof("new", f"{stem}.yml")[0], 0)
            self.assertIn(f'name: "{stem}"', (self.folder / f"{stem}.yml").read_text())
        self.assertEqual(self.tiltproof("check", ".")[0], 0)

    def test_new_uses_the_schema_of_the_repository(self):
        for folder in ("repository/.git", "repository/suites/deep", "elsewhere/deep"):
            (self.folder / folder).mkdir(parents=True)
        self.assertEqual(self.tiltproof("new", "repository/a.yaml")[0], 0)
        code, out, _ = self.tiltproof("new", "repository/suites/deep/b.yaml")
        self.assertEqual((code, out), (0, "wrote repository/suites/deep/b.yaml\n"))
        first = (self.folder / "repository/suites/deep/b.yaml").read_text().splitlines()[0]
        self.assertEqual(first, "# yaml-language-server: $schema=../../tiltproof.schema.json")
        (self.folder / "repository/tiltproof.schema.json").write_text("{}")
        code, out, _ = self.tiltproof("new", "repository/suites/c.yaml")
        self.assertIn("is of another version: tiltproof schema > ", out)
        self.assertEqual((self.folder / "repository/tiltproof.schema.json").read_text(), "{}")
        # Elsewhere, a schema further up may belong to another project.
        (self.folder / "elsewhere/tiltproof.schema.json").write_text("{}")
        self.assertEqual(self.tiltproof("new", "elsewhere/deep/d.yaml")[0], 0)
        self.assertTrue((self.folder / "elsewhere/deep/tiltproof.schema.json").is_file())

    # run

    def test_run_writes_every_file(self):
        code, out, err = self.tiltproof("run", self.scenario("hover"))
        self.assertEqual((code, err), (0, ""), out)
        self.assertIn("PASS", out)
        self.assertIn("1 of 1 green", out)
        for file in ("run.json", "results.json", "junit.xml", "events.jsonl", "hover/scenario.resolved.yaml", "hover/verdict.json", "hover/trace.csv",
                     "hover/faults.jsonl", "hover/link.bin", "hover/firmware.log", "hover/flight.json"):
            self.assertTrue((self.latest() / file).is_file(), file)
        entry = self.results()["scenarios"][0]
        for key in ("name", "verdict", "expected", "green", "seed", "trace_hash", "wall_s", "real_time_factor", "metrics", "criteria", "faults", "replay"):
            self.assertIn(key, entry)
        self.assertEqual(xml.etree.ElementTree.parse(self.latest() / "junit.xml").getroot()[0].get("tests"), "1")
        rows = (self.latest() / "hover/trace.csv").read_text().splitlines()
        self.assertEqual(len(rows), 1 + 51)
        self.assertEqual(rows[0].split(",")[0], "t_s")
        self.assertFalse(list(self.latest().rglob("*.part")))

    def test_verdicts_become_exit_codes(self):
        impossible = {"position_error_m <= 0.5": "position_error_m < 0"}
        undecided = {"always(position": "always[0,9](position"}
        self.scenario("good")
        self.assertEqual(self.tiltproof("run", "good.yaml")[0], 0)
        self.scenario("bad", **impossible)
        code, out, _ = self.tiltproof("run", "bad.yaml")
        self.assertEqual(code, 1)
        self.assertRegex(out, r"FAIL +bad")
        self.assertIn("near", out)
        self.assertRegex(out, r"again: \S*tiltproof replay results/")
        self.scenario("expected", **impossible, **{"seed: 3": "seed: 3\nexpect: fail"})
        self.assertEqual(self.tiltproof("run", "expected.yaml")[0], 0)
        self.scenario("short", **undecided)
        self.assertEqual(self.tiltproof("run", "short.yaml")[0], 4)
        code, out, _ = self.tiltproof("run", ".", "--format", "jsonl")
        self.assertEqual(code, 1)
        self.assertEqual({e["name"]: e["verdict"] for e in map(json.loads, out.splitlines())},
                         {"good": "pass", "bad": "fail", "expected": "fail", "short": "inconclusive"})

    def test_nothing_selected(self):
        self.scenario("hover")
        self.assertEqual(self.tiltproof("run", ".", "-k", "nothing")[0], 4)
        self.assertEqual(self.tiltproof("run", ".", "--tag", "nothing")[0], 4)

    def test_usage_mistakes(self):
        self.scenario("hover")
        for arguments in (["--client", "nonsense"], ["--client", "library:missing.so"], ["--client", "serial:/dev/ttyUSB0"],
                          ["--client", "process:./a"], ["--mode", "x"], ["-k", "and and"], ["-j", "0"], ["--repeat", "0"]):
            code, out, err = self.tiltproof("run", ".", *arguments)
            self.assertEqual(code, 2, arguments)
            self.assertEqual(out, "", arguments)
            self.assertTrue(err, arguments)
        self.assertEqual(self.tiltproof("run", "missing.yaml")[0], 2)
        self.assertFalse((self.folder / "results").exists())

    def test_check_looks_for_the_firmwares_file(self):
        path = self.scenario("hover")
        for client in ("library:missing.so", "qemu:missing.elf"):
            code, out, err = self.tiltproof("check", path, "--client", client)
            self.assertEqual((code, out), (2, ""), client)
            self.assertRegex(err, rf"--client {client.split(':')[0]}:\S*missing\.\w+: .*missing")

    def test_check_refuses_what_the_client_cannot_take(self):
        path = self.scenario("board", **{"seed: 3": "seed: 3\nfaults:\n  - {id: noise, type: uart.noise_error, target: to_client, parameters: {probability: 0.01}}"})
        self.scenario("plain")
        self.assertEqual(self.tiltproof("check", path)[0], 0)
        code, out, err = self.tiltproof("check", path, "--client", "host")
        self.assertEqual((code, out), (2, ""))
        self.assertEqual(err, self.tiltproof("run", path, "--client", "host")[2])
        self.assertRegex(err, r"board\.yaml:\d+:\d+: .*noise.* needs an emulated board")
        code, out, err = self.tiltproof("check", ".", "--client", "host")
        self.assertEqual((code, out), (0, "1 scenario in order, 1 not applicable\n"))
        self.assertIn("not applicable: board: ", err)

    def test_check_names_the_place(self):
        path = self.scenario("hover", duration_s="duraton_s")
        code, _, err = self.tiltproof("check", path)
        self.assertEqual(code, 2)
        self.assertRegex(err, r"hover\.yaml:2:1: .*duraton_s.*duration_s")
        path = self.scenario("formula", position_error_m="positon_error_m")
        code, _, err = self.tiltproof("check", path)
        self.assertEqual(code, 2)
        self.assertRegex(err, r"formula\.yaml:6:\d+: .*position_error_m")

    def test_hashes_do_not_depend_on_workers_or_repetition(self):
        for i in range(3):
            self.scenario(f"s{i}", **{"seed: 3": "seed: 3\nfaults:\n  - {id: noise, type: wire.bit_error, target: both, parameters: {ber: 0.001}}"})
        hashes = set()
        for arguments in (["-j", "1"], ["-j", "2"], ["-j", "3"], ["-j", "1"]):
            self.tiltproof("run", ".", *arguments)
            hashes.add(tuple(e["trace_hash"] for e in self.results()["scenarios"]))
        self.assertEqual(len(hashes), 1)

    def test_repeat_flies_seeds_in_a_row(self):
        self.tiltproof("run", self.scenario("hover"), "--repeat", "3", "--seed", "10")
        self.assertEqual([e["seed"] for e in self.results()["scenarios"]], [10, 11, 12])

    def test_dry_run_lists_the_flights_as_they_would_be(self):
        self.scenario("a")
        self.scenario("b")
        self.assertEqual(self.tiltproof("run", ".", "--dry-run"), (0, "a\nb\n", ""))
        code, out, err = self.tiltproof("run", ".", "--dry-run", "--repeat", "2", "-k", "a")
        self.assertEqual((code, out, err), (0, "a-seed3\na-seed4\n", ""))
        code, out, err = self.tiltproof("run", ".", "--dry-run", "--format", "jsonl", "--repeat", "2", "--seed", "8")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual([(e["name"], e["scenario"], e["seed"]) for e in map(json.loads, out.splitlines())],
                         [(f"{name}-seed{seed}", name, seed) for name in "ab" for seed in (8, 9)])
        self.assertFalse((self.folder / "results").exists())
        # The names are those of the folders.
        self.tiltproof("run", "a.yaml", "--repeat", "2")
        self.assertTrue((self.latest() / "a-seed3").is_dir() and (self.latest() / "a-seed4").is_dir())

    def test_a_latest_that_is_no_link_is_left_alone(self):
        path = self.scenario("hover")
        (self.folder / "results").mkdir()
        latest = self.folder / "results/latest"
        latest.write_text("mine")
        code, out, err = self.tiltproof("run", path)
        self.assertEqual(code, 0, out + err)
        self.assertRegex(err, r"warning: results/latest is not a link.* results/\d+T")
        self.assertEqual(latest.read_text(), "mine")
        latest.unlink()
        latest.mkdir()
        self.assertIn("warning: results/latest is not a link", self.tiltproof("run", path)[2])
        self.assertEqual(list(latest.iterdir()), [])

    def test_a_replay_by_another_build_says_so(self):
        self.tiltproof("run", self.scenario("hover"))
        info = self.latest() / "run.json"
        build = json.loads(info.read_text())["build"]
        self.assertRegex(build, "^[0-9a-f]{16}$")
        self.assertNotIn("another build", self.tiltproof("replay", self.latest())[1])
        info.write_text(info.read_text().replace(build, "0" * 16))
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 0, out)
        self.assertIn(f"another build: {'0' * 16} then, {build} now", out)
        # An older version's run does not say by which build it was flown.
        info.write_text(info.read_text().replace(f'"build": "{"0" * 16}",', ""))
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 0, out)
        self.assertNotIn("another build", out)

    def test_a_replay_leaves_nothing_that_it_does_not_name(self):
        temporary = self.folder / "tmp"
        temporary.mkdir()

        def replay(run):
            done = subprocess.run([PROGRAM, "replay", run], capture_output=True, cwd=self.folder, timeout=120, check=False, text=True,
                                  env={**os.environ, "TMPDIR": str(temporary)})
            return done.returncode, done.stdout, done.stderr

        self.tiltproof("run", self.scenario("hover"))
        run = self.latest()
        self.assertEqual(replay(run)[0], 0)
        self.assertEqual(list(temporary.iterdir()), [])
        # A scenario that can no longer be read.
        resolved = run / "hover/scenario.resolved.yaml"
        text = resolved.read_text()
        resolved.write_text("name: [")
        self.assertEqual(replay(run)[0], 2)
        self.assertEqual(list(temporary.iterdir()), [])
        # A firmware that can no longer be loaded: the flight's folder is kept and named.
        resolved.write_text(text)
        info = run / "run.json"
        info.write_text(info.read_text().replace('"client": "host"', f'"client": "library:{info}"'))
        code, out, _ = replay(run)
        self.assertEqual(code, 3, out)
        self.assertIn("0 of 1 equal", out)
        kept, = temporary.iterdir()
        self.assertIn(f"{kept}/hover", out)

    def test_replay_and_score(self):
        self.tiltproof("run", self.scenario("hover"))
        run = self.latest()
        code, out, err = self.tiltproof("replay", run)
        self.assertEqual(code, 0, out + err)
        self.assertIn("1 of 1 equal", out)
        self.assertEqual(self.tiltproof("replay", run / "hover")[0], 0)
        before = json.loads((run / "hover/verdict.json").read_text())
        code, out, err = self.tiltproof("score", run, "--format", "jsonl")
        self.assertEqual(code, 0, err)
        self.assertEqual(json.loads(out)["metrics"], before["metrics"])
        self.assertEqual(json.loads(out)["trace_hash"], before["trace_hash"])
        # A changed file is noticed.
        verdict = run / "hover/verdict.json"
        sound = verdict.read_text()
        verdict.write_text(sound.replace(before["trace_hash"], "0" * 16))
        for command in ("replay", "score", "export"):
            code, out, err = self.tiltproof(command, run, *(("--to", "csv") if command == "export" else ()))
            self.assertEqual(code, 4 if command == "replay" else 3)
            self.assertRegex(out + err, r"verdict\.json: has changed since the flight: its hash is \w{16}, and `hash` in it \w{16}")
        self.assertIn("verdict.json: has changed since the flight", self.tiltproof("report", run)[2])
        self.forget_hashes(run / "hover")
        code, out, _ = self.tiltproof("replay", run)
        self.assertEqual(code, 1)
        self.assertIn("DIFFERENT", out)
        # An edited scenario is named, and scored by.
        verdict.write_text(sound)
        resolved = run / "hover/scenario.resolved.yaml"
        resolved.write_text(resolved.read_text() + "# edited\n")
        code, out, err = self.tiltproof("score", run)
        self.assertEqual((code, "scenario.resolved.yaml has changed since the flight" in err), (0, True), out + err)
        self.assertEqual(self.tiltproof("replay", self.folder)[0], 2)
        self.assertEqual(self.tiltproof("score", "nowhere")[0], 2)

    def test_what_was_changed_in_a_flights_folder_is_noticed(self):
        self.tiltproof("run", self.scenario("hover"))
        run, flight = self.latest(), self.latest() / "hover"
        for name, commands in (("trace.csv", ("score", "replay", "report", "export")), ("flight.json", ("score", "replay", "export")), ("link.bin", ("replay", "report", "export"))):
            whole = (flight / name).read_bytes()
            at = whole.index(b"\n", len(whole) // 2) - 1
            (flight / name).write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1:])
            for command in commands:
                code, out, err = self.tiltproof(command, flight, *(("--to", "csv", "--out", "flight") if command == "export" else ()))
                self.assertRegex(out + err, f"{name} has changed since the flight: its hash is", (command, name))
                self.assertEqual(code == 0, command == "report", (command, name))  # whose page shows what is left
            (flight / name).write_bytes(whole)
        self.assertEqual(self.tiltproof("replay", flight)[0], 0)
        results = run / "results.json"
        results.write_text(results.read_text().replace('"tracking.rmse_m": 0.0', '"tracking.rmse_m": 0.1'))
        code, out, err = self.tiltproof("report", run)
        self.assertIn("results.json: it has changed since it was written", err)
        self.assertEqual(self.tiltproof("score", run)[0], 0)
        code, out, err = self.tiltproof("report", run)
        self.assertEqual((code, err), (0, ""))

    def test_link_dump(self):
        self.tiltproof("run", self.scenario("hover"))
        code, out, _ = self.tiltproof("link-dump", self.latest() / "hover/link.bin")
        self.assertEqual(code, 0)
        lines = out.splitlines()
        self.assertRegex(lines[1], r"^ *-0\.0000868\d+ to_plant +sent +ok +4 0000803f  = start$")
        self.assertRegex(out, r"\n +[\d.]+ to_plant +sent +ok +20 00004040[0-9a-f]{32}  = actuators f_r_n=[\d.]+ f_l_n=[\d.]+ tau_r_nm=")
        # A log without its scenario has plain numbers, and --protocol names them again.
        alone = self.folder / "alone.bin"
        alone.write_bytes((self.latest() / "hover/link.bin").read_bytes())
        self.assertRegex(self.tiltproof("link-dump", alone)[1].splitlines()[1], r" 0000803f  = 1$")
        self.assertEqual(self.tiltproof("link-dump", alone, "--protocol", "paper")[1], out)
        self.assertEqual(self.tiltproof("link-dump", alone, "--protocol", "papr")[::2],
                         (2, "--protocol papr: no such protocol or file; did you mean 'paper'?\n"))
        self.assertTrue(any("to_client" in line and " ok " in line and " 64 " in line for line in lines))
        damaged = self.folder / "damaged.bin"
        damaged.write_bytes((self.latest() / "hover/link.bin").read_bytes()[:-1])
        self.assertEqual(self.tiltproof("link-dump", damaged)[0], 2)

    def test_link_dump_says_which_messages_the_receiver_refused(self):
        faults = "\n".join(f"  - {{id: {kind}, type: frame.{kind}, target: to_client, start_s: 0.3, end_s: 0.8, parameters: {parameters}}}"
                           for kind, parameters in (("replay_stale", "{probability: 0.2, age_count: 3}"),
                                                    ("short", "{probability: 0.1, bytes_count: 3}"),
                                                    ("semantic", "{probability: 0.2, field: z_m, kind: nan}")))
        self.tiltproof("run", self.scenario("hover", **{"seed: 3": f"seed: 3\nlink: {{protocol: hardened}}\nfaults:\n{faults}"}), "--no-report")
        flight = self.latest() / "hover"
        lines = self.tiltproof("link-dump", flight / "link.bin")[1].splitlines()[1:]
        delivered = [line for line in lines if line.split()[1:4] == ["to_client", "delivered", "ok"]]
        dumped = collections.Counter(match[1] if (match := re.search(r"  = .*\bstatus=(\w+)$", line)) else "ok" for line in delivered)
        events = [json.loads(line) for line in (self.latest() / "events.jsonl").read_text().splitlines()]
        rejected = collections.Counter(event["text"].removeprefix("to_client: ") for event in events
                                       if event["kind"] == "rejected" and event["text"].startswith("to_client: "))
        self.assertTrue({"stale"} < set(rejected), rejected)
        accepted = dumped.pop("ok")
        self.assertGreater(accepted, 20)
        self.assertEqual(dumped, rejected)

    def test_a_null_fault_changes_nothing(self):
        null = {"seed: 3": "seed: 3\nfaults:\n  - {id: nothing, type: harness.null}"}
        self.scenario("with", **null)
        self.scenario("without")
        self.tiltproof("run", ".")
        rows = {name: [line.split(",") for line in (self.latest() / name / "trace.csv").read_text().splitlines()] for name in ("with", "without")}
        about_faults = ("faults_active_count", "active_nothing")
        kept = {name: [i for i, column in enumerate(rows[name][0]) if column not in about_faults] for name in rows}
        for a, b in zip(rows["with"], rows["without"], strict=True):
            self.assertEqual([a[i] for i in kept["with"]], [b[i] for i in kept["without"]])
        self.assertEqual((self.latest() / "with/link.bin").read_bytes(), (self.latest() / "without/link.bin").read_bytes())

    def test_faults_that_the_client_cannot_have_are_refused_with_their_place(self):
        faults = ("  - {id: still, type: device.stall, start_s: 0.1, end_s: 0.2}\n"
                  "  - {id: again, type: device.reset, start_s: 0.3, parameters: {boot_ms: 1}}\n"
                  "  - {id: odd, type: clock.jump, start_s: 0.1, parameters: {node: plant, jump_ms: 1}}\n")
        self.scenario("board", SHORT_HOVER + "faults:\n" + faults)
        self.assertEqual(self.tiltproof("check", "board.yaml")[0], 0)
        code, out, err = self.tiltproof("run", "board.yaml")
        self.assertEqual((code, out), (2, ""))
        first, second = err.splitlines()
        self.assertEqual(first, "board.yaml:8:23: fault 'still' (device.stall) needs an emulated board: fly it with --client qemu")
        self.assertRegex(second, r"board.yaml:10:21: fault 'odd' \(clock.jump\) .* in lockstep there is one clock for all but the client")
        self.assertFalse((self.folder / "results").exists())

    def test_many_paths_make_a_short_folder_name(self):
        paths = [self.scenario(f"a-rather-long-name-{i}") for i in range(20)]
        self.assertEqual(self.tiltproof("run", *paths)[0], 0)

    def test_an_ignored_sigchld_does_not_hang_the_pool(self):
        done = subprocess.run(["sh", "-c", "trap '' CHLD; exec \"$0\" run hover.yaml", PROGRAM], cwd=self.scenario("hover").parent,
                              capture_output=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_seeds_that_no_file_can_hold_are_refused(self):
        self.scenario("hover")
        for arguments in (["--seed", "-1"], ["--seed", str(2**53)], ["--seed", str(2**53 - 1), "--repeat", "2"], ["--client", "library:"]):
            self.assertEqual(self.tiltproof("run", "hover.yaml", *arguments)[0], 2, arguments)

    def test_a_cut_trace_is_not_scored(self):
        self.tiltproof("run", self.scenario("hover"))
        trace = self.latest() / "hover/trace.csv"
        trace.write_text("".join(trace.read_text().splitlines(keepends=True)[:20]))
        code, _, err = self.tiltproof("score", self.latest())
        self.assertEqual(code, 3)
        self.assertIn("trace.csv has changed since the flight", err)

    def test_a_flight_without_verdict_does_not_block_the_replay_of_others(self):
        self.scenario("one")
        self.scenario("two")
        self.tiltproof("run", ".")
        (self.latest() / "one/verdict.json").unlink()
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 4)
        self.assertIn("1 of 1 equal", out)

    def test_names_of_results_files_are_taken(self):
        path = self.scenario("taken", **{"name: taken": "name: run.json"})
        self.assertEqual(self.tiltproof("check", path)[0], 2)

    def test_texts_of_a_scenario_reach_the_terminal_without_control_characters(self):
        path = self.scenario("hostile", **{"duration_s": r'"\e[2Jduration\u009b\u202e_s"'})
        code, out, err = self.tiltproof("check", path)
        self.assertEqual((code, out), (2, ""))
        self.assertIn(r"\x1b[2Jduration\xc2\x9b\xe2\x80\xae_s", err)
        self.assertEqual([c for c in err if not c.isprintable() and c != "\n"], [])

    # trouble

    def test_interrupt_before_the_first_flight_is_130_and_leaves_nothing_half(self):
        self.scenario("long")
        for repeats in ("1000000", "3"):
            with subprocess.Popen([PROGRAM, "run", "long.yaml", "--repeat", repeats], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
                # As soon as the program catches it.
                status = pathlib.Path(f"/proc/{process.pid}/status")
                deadline = time.monotonic() + 30
                while time.monotonic() < deadline and not int(re.search(r"SigCgt:\s*(\w+)", status.read_text())[1], 16) & 1 << signal.SIGINT - 1:
                    pass
                process.send_signal(signal.SIGINT)
                _, err = process.communicate(timeout=60)
            self.assertEqual(process.returncode, 130, err)
            if (self.folder / "results").exists():  # it was quick
                self.assertTrue(self.results()["interrupted"])
            else:
                self.assertIn(b"interrupted before the first flight", err)
                self.assertEqual([file.name for file in self.folder.iterdir()], ["long.yaml"])

    def test_interrupt_leaves_valid_partial_results(self):
        self.scenario("long1", duration_s="duration_s: 3000 #")
        self.scenario("long2", duration_s="duration_s: 3000 #")
        with subprocess.Popen([PROGRAM, "run", "."], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            deadline = time.monotonic() + 30
            while not list(self.folder.glob("results/*/long1/scenario.resolved.yaml")) and time.monotonic() < deadline:
                time.sleep(0.02)
            # Written just before take-off; the partial trace needs some flight. The whole flight takes seconds.
            time.sleep(0.5)
            process.send_signal(signal.SIGINT)
            out, _ = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, out)
        results = self.results()
        self.assertTrue(results["interrupted"])
        self.assertEqual([(e["name"], e["verdict"]) for e in results["scenarios"]], [("long1", "inconclusive"), ("long2", "error")])
        self.assertEqual(results["scenarios"][1]["reason"], "not flown: the run was interrupted")
        self.assertGreater(len((self.latest() / "long1/trace.csv").read_text().splitlines()), 10)
        xml.etree.ElementTree.parse(self.latest() / "junit.xml")
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 4)
        self.assertIn("interrupted", out)

    def test_a_results_folder_that_cannot_be_made_is_an_error(self):
        (self.folder / "results").write_text("a file")
        code, _, err = self.tiltproof("run", self.scenario("hover"))
        self.assertEqual(code, 3)
        self.assertIn("results", err)

    def test_two_runs_at_once_keep_apart(self):
        path = self.scenario("hover")
        processes = [subprocess.Popen([PROGRAM, "run", path], cwd=self.folder, stdout=subprocess.DEVNULL) for _ in range(4)]
        self.assertEqual([p.wait(timeout=60) for p in processes], [0] * 4)
        self.assertEqual(len(list(self.folder.glob("results/*/results.json"))), 4 + 1, "four runs, and latest")

    # the rest

    def test_list_signals(self):
        """Of the shipped vehicle, and of a scenario; criteria may name each of them."""
        code, out, err = self.tiltproof("list", "--signals")
        self.assertEqual((code, err), (0, ""))
        for name in ("x_m", "alpha_r_rad_s", "position_error_m", "tilt_rad"):
            self.assertIn(name, out.splitlines())
        self.scenario("hover")
        shown = self.tiltproof("list", "--signals", "hover.yaml")[1].splitlines()
        self.assertEqual(len(shown), len(set(shown)))
        self.scenario("all", **{"criteria:\n": "criteria:\n" + "".join(f'  - {{name: s{i}, stl: "always({name} < 1e9)"}}\n' for i, name in enumerate(shown))})
        self.assertEqual(self.tiltproof("check", "all.yaml")[0], 0)
        self.scenario("bad", **{"position_error_m <= 0.5": "pos_err <= 0.5"})
        self.assertIn("unknown signal 'pos_err'; did you mean 'position_error_m'? all signals: tiltproof list --signals", self.tiltproof("check", "bad.yaml")[2])

    def test_list_faults_schema(self):
        self.scenario("hover")
        self.assertIn("hover", self.tiltproof("list", ".")[1])
        code, out, _ = self.tiltproof("faults")
        self.assertEqual(code, 0)
        for fault in ("wire.gilbert_elliott", "frame.delay", "sensor.freeze", "actuator.loss_of_effectiveness", "harness.canary"):
            self.assertIn(fault, out)
        self.assertEqual(json.loads(self.tiltproof("schema")[1])["type"], "object")

    def test_integrity_prints_rates_of_any_framing_and_check(self):
        code, out, _ = self.tiltproof("integrity", "--errors", "swap,burst", "--framing", "hdlc,cobs", "--check", "sum8", "--frames", "20000", "--format", "json")
        self.assertEqual(code, 0)
        rows = json.loads(out)["rows"]
        self.assertEqual({(row["framing"], row["errors"]) for row in rows}, {(f, e) for f in ("hdlc", "cobs") for e in ("swap", "burst")})
        for row in rows:
            self.assertLessEqual(row["low"], row["rate"])
            self.assertLessEqual(row["rate"], row["high"])
            self.assertLessEqual(row["delivered_wrong"], row["passed_length"])
            self.assertLessEqual(row["passed_length"], row["passed_check"])
            self.assertEqual(row["hamming_distance"], 2)
        # A sum does not see that bytes changed places.
        self.assertGreater(min(row["passed_check_rate"] for row in rows if row["errors"] == "swap"), 0.5)
        code, out, _ = self.tiltproof("integrity", "--errors", "stuck", "--frames", "20000", "--page", "integrity.html")
        self.assertEqual(code, 0)
        self.assertRegex(out.splitlines()[0], "^paper, hdlc, fletcher16, (sensors|reply): wrong frames delivered per frame sent$")
        page = (self.folder / "integrity.html").read_text()
        data = json.loads(page.split('id="integrity">')[1].split("</script>")[0])
        self.assertEqual([row["level"] for row in data["rows"]], [1, 2, 4, 8])
        (self.folder / "own.yaml").write_text("protocol: own\ncontrol_period_ms: 10\nframing: {type: length_prefixed, sync: [0xB5], length: u16, check: sum8}\n"
            "start: {message: start}\nmessages:\n  - {name: start, id: 1, from: client}\n  - {name: request, id: 2, from: client, reply: state}\n"
            "  - {name: state, id: 3, from: server, fields: [{signal: z_m, type: i16, scale: 0.01}]}\n"
            "  - {name: thrust, id: 4, from: client, fields: [{signal: f_r_n, type: u8, min: 0, max: 30}]}\n"
            "  - {name: reference, id: 5, from: server, line: reference, fields: [" + ", ".join(f"{{signal: {name}, type: f32}}" for name in ("x_m", "y_m", "z_m", "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s")) + "]}\n")
        code, out, err = self.tiltproof("integrity", "--protocol", "own.yaml", "--errors", "enumerate", "--format", "json")
        self.assertEqual(code, 0, err)
        rows = json.loads(out)["rows"]
        # A frame has a mark, a length of two bytes, an id, two bytes of height and a check: 56 bits.
        self.assertEqual([(row["protocol"], row["framing"], row["check"], row["message"], row["frames"]) for row in rows], [("own", "length_prefixed", "sum8", "state", n) for n in (56, 1540, 27720)])
        self.assertGreater(rows[1]["passed_check"], 0)
        for words, advice in ((("--check", "crc8"), "valid: fletcher16, crc16_ibm_3740"), (("--errors", "noise"), "valid: ber, burst"), (("--protocol", "mavlink"), "no such protocol or file"),
                              (("--framing", "slip"), "valid: hdlc, cobs"), (("--message", "nothing"), "'paper' has: start, request")):
            code, _, err = self.tiltproof("integrity", *words)
            self.assertEqual(code, 2, words)
            self.assertIn(advice, err)

    def test_design_lqr(self):
        code, out, err = self.tiltproof("design-lqr", "tiltrotor", "--csv", "gain.csv")
        self.assertEqual((code, err), (0, ""))
        self.assertIn("spectral radius", out)
        self.assertIn("delay margin", out)
        ours = [[float(v) for v in line.split(",")] for line in (self.folder / "gain.csv").read_text().splitlines()]
        published = [[float(v) for v in line.split(",")] for line in (SOURCE / "tests/golden/dlqr_gain_published.csv").read_text().splitlines()]
        self.assertEqual([len(row) for row in ours], [20] * 4)
        for mine, theirs in zip(ours, published):
            for a, b in zip(mine, theirs):
                self.assertLessEqual(abs(a - b), 2e-3 * abs(b))
        code, _, err = self.tiltproof("design-lqr", SOURCE / "tests/golden/vant_2.sdf")
        self.assertEqual(code, 2)
        self.assertIn("servodir", err)
        self.assertEqual(self.tiltproof("design-lqr", "nonsense")[0], 2)

    def test_the_example_firmware_in_c_flies(self):
        library = CLIENTS.parent.parent / "lib/minimal_firmware.so"
        code, out, err = self.tiltproof("run", SOURCE / "scenarios/paper", "-k", "hover", "--client", f"library:{library}")
        self.assertEqual(code, 0, out + err)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=1)
