#!/usr/bin/env python3
"""The suite for firmware of others, scenarios/acceptance: what it covers, and that a sound controller which is not
ours passes its mild half.

Usage: acceptance_test.py TILTPROOF SOURCE_DIR
"""
import json
import pathlib
import re
import sys
import unittest

from command_line import PROGRAM, CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()
SUITE = SOURCE / "scenarios/acceptance"
# Scenarios that no library can fly. tests/emulator/acceptance_test.py flies the first two, and
# tests/system/realtime/acceptance_test.py the others.
ELSEWHERE = {f"acceptance-mild-{name}" for name in ("uart-overrun", "device-stall", "node-pause", "dds-loss")}
LIBRARY = pathlib.Path(PROGRAM).resolve().parent / "lib/minimal_firmware.so"


class AcceptanceTest(CommandLineTest):
    def test_every_layer_of_the_catalogue_has_a_mild_and_a_hard_level(self):
        catalogue = self.tiltproof("faults")[1]
        layers = set(re.findall(r"^## ([a-z]+)\.", catalogue, re.M)) - {"harness"}
        self.assertGreater(len(layers), 9)
        for level in ("mild", "hard"):
            found = set()
            for file in (SUITE / level).glob("*.yaml"):
                found |= set(re.findall(r"type: ([a-z]+)\.", file.read_text()))
            self.assertEqual(found, layers, level)

    def test_both_levels_have_the_same_faults(self):
        def faults(level):
            return {file.name: re.findall(r"type: ([a-z_.]+)", file.read_text())[1:] for file in (SUITE / level).glob("*.yaml")}
        mild = faults("mild")
        self.assertEqual(mild.pop("no-fault.yaml"), [])
        self.assertEqual(mild, faults("hard"))

    def flights(self, *arguments):
        _, out, err = self.tiltproof("run", *arguments, "--out", self.folder / "results", "-j", "2", "--keep", "verdicts")
        results = json.loads((self.folder / "results/latest/results.json").read_text())
        return {flight["name"]: flight["verdict"] for flight in results["scenarios"]}, {flight["name"] for flight in results["not_applicable"]}

    def test_a_sound_controller_passes_every_mild_level(self):
        flights, not_applicable = self.flights(SUITE / "mild", "--client", f"library:{LIBRARY}")
        self.assertEqual({name: verdict for name, verdict in flights.items() if verdict != "pass"}, {})
        self.assertEqual(not_applicable, ELSEWHERE)

    def test_a_sound_controller_passes_every_sound_flight(self):
        flights, not_applicable = self.flights(SUITE / "sound", "--client", f"library:{LIBRARY}")
        self.assertEqual({name: verdict for name, verdict in flights.items() if verdict != "pass"}, {})
        self.assertEqual((len(flights), not_applicable), (len(list((SUITE / "sound").glob("*.yaml"))), set()))

    def test_the_shipped_firmware_flies_them_but_for_large_headings(self):
        for firmware, red in (("tolerant", set()), ("paper", {"acceptance-sound-references-of-no-number", "acceptance-sound-references-of-no-velocity", "acceptance-sound-absurd-references"})):
            flights, not_applicable = self.flights(SUITE / "sound", "--firmware", firmware)
            self.assertEqual({name for name, verdict in flights.items() if verdict != "pass"}, red)
            self.assertEqual(not_applicable, {f"acceptance-sound-{name}" for name in ("heading-half-turn", "heading-circle", "heading-sideways", "heading-turns", "turn-left", "turn-right")})

    def test_an_unsound_one_does_not(self):
        # The paper's firmware believes a position that is not a number.
        file = (SUITE / "mild/frame-not-a-number.yaml").read_text().replace("firmware: tolerant", "firmware: paper")
        (self.folder / "nan.yaml").write_text(file)
        self.assertEqual(set(self.flights(self.folder / "nan.yaml")[0].values()), {"fail"})


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
