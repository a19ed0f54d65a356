#!/usr/bin/env python3
"""Lines between emulated boards, and between one and a library: every byte arrives once, and every flight is the same.

Usage: lines_test.py TILTPROOF SOURCE-FOLDER CLIENTS_DIR
"""
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, SOURCE, CLIENTS = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
del sys.argv[1:4]
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from minimal_image import FLAGS  # noqa: E402

EXAMPLE = SOURCE / "firmware/examples/minimal_c"
LIBRARY = f"library:{CLIENTS / 'libtalking_client.so'}"

# The example's board with USART6 (PC6, PC7) as UART 2.
BOARD = [
    ("#define USART3 0x40004800\n", "#define USART3 0x40004800\n#define USART6 0x40011400\n#define GPIO_C 0x40020800\n#define NVIC_ISER2 REGISTER(0xE000E108)\n"),
    ("static Ring rings[2];", "static Ring rings[3];"),
    ("void SysTick_Handler", "void USART6_IRQHandler(void) { Receive(&rings[2], USART6); }\nvoid SysTick_Handler"),
    ("Send(USART2, bytes, count);", "Send(USART2, bytes, count);\n  if (uart == 2) Send(USART6, bytes, count);"),
    ("static _Alignas(8) uint8_t memory[4096];", "static _Alignas(8) uint8_t memory[2][4096];"),
    ("static bool taken;", "static int taken;"),
    ("if (taken || count * size > sizeof(memory)) return NULL;", "if (taken == 2 || count * size > sizeof(memory[0])) return NULL;"),
    ("  taken = true;\n  return memory;", "  return memory[taken++];"),
    ("BIT(0) | BIT(1) | BIT(3);", "BIT(0) | BIT(1) | BIT(2) | BIT(3);"),
    ("RCC_APB2ENR |= BIT(4);", "RCC_APB2ENR |= BIT(4) | BIT(5);"),
    ("  GPIO_AFRL(GPIO_B) |= 7u << 24;", "  GPIO_AFRL(GPIO_C) |= 8u << 24 | 8u << 28;\n  GPIO_MODER(GPIO_C) |= 2u << 12 | 2u << 14;\n  GPIO_AFRL(GPIO_B) |= 7u << 24;"),
    ("  USART_CR1(USART1) =", "  USART_BRR(USART6) = (kApb2Hz + kLineBaud / 2) / kLineBaud;\n  USART_CR1(USART6) = BIT(13) | BIT(3) | BIT(2) | BIT(5);\n  "
                             "NVIC_ISER2 = BIT(71 - 64);\n  USART_CR1(USART1) ="),
    ("return rings[0].written != rings[0].read ||", "return rings[2].written != rings[2].read || rings[0].written != rings[0].read ||"),
    ("uart < 2; ++uart", "uart < 3; ++uart"),
    ("vectors[16 + 40]", "vectors[16 + 72]"),
    ("[16 + 39] = USART3_IRQHandler,", "[16 + 39] = USART3_IRQHandler,\n    [16 + 71] = USART6_IRQHandler,"),
]

SCENARIO = """\
name: flight
duration_s: 0.6
reference: {type: hover, at_m: [0, 0, 2]}
clients: [{id: a}, {id: b}]
lines: [{id: cross, between: [a, b]}]
WATCH
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""


def build(folder):
    board = (EXAMPLE / "stm32f4.c").read_text()
    for old, new in BOARD:
        if old not in board:
            raise AssertionError(f"no text of the example: {old}")
        board = board.replace(old, new)
    (folder / "board.c").write_text(board)
    elf = folder / "image.elf"
    subprocess.run(["arm-none-eabi-gcc", *FLAGS, "-I", SOURCE, "-T", EXAMPLE / "stm32f4.ld", folder / "board.c",
                    SOURCE / "tests/harness/cli/talking_client.c", "-o", elf], check=True)
    return elf


class Lines(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls._folder.name)
        cls.image = f"qemu:{build(cls.root)},cross=usart6"

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def run_tiltproof(self, a, b, *flags, watch=""):
        (self.root / "flight.yaml").write_text(SCENARIO.replace("WATCH", watch))
        return subprocess.run([TILTPROOF, "run", self.root / "flight.yaml", "--out", self.root / "out", "--no-progress", "--client", f"a={a}", "--client", f"b={b}",
                               *flags], capture_output=True, text=True, timeout=300)

    def fly(self, a, b, *flags, watch=""):
        done = self.run_tiltproof(a, b, *flags, watch=watch)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return self.root / "out" / "latest" / "flight"

    def test_two_boards_hear_every_byte_in_every_way_to_fly(self):
        watch = "watch: [talk_received, talk_wrong]"
        folder = self.fly(self.image, self.image, watch=watch)
        with open(folder / "trace.csv", newline="") as file:
            last = list(csv.DictReader(file))[-1]
        for client in "ab":
            self.assertEqual(float(last[f"watch_{client}_talk_wrong"]), 0)
            # 24 bytes every 5 ms, or 6 where a tick is missed.
            self.assertGreater(float(last[f"watch_{client}_talk_received"]), 24 * 90)
        first = json.loads((folder / "verdict.json").read_text())["trace_hash"]
        content = (folder / "link.bin").read_bytes()
        for flags in ((), ("--distributed=socket",)):
            again = self.fly(self.image, self.image, *flags, watch=watch)
            self.assertEqual(json.loads((again / "verdict.json").read_text())["trace_hash"], first, flags)
            self.assertEqual((again / "link.bin").read_bytes(), content, flags)

    def test_a_board_and_a_library_hear_each_other(self):
        folder = self.fly(self.image, LIBRARY)
        rows = re.findall(r"line 2: (\d+) bytes, (\d+) wrong", (folder / "firmware.b.log").read_text())
        self.assertEqual(rows[-1][1], "0")
        self.assertGreater(int(rows[-1][0]), 24 * 90)

    def test_an_image_without_a_usart_for_its_line_is_refused(self):
        plain = self.image.replace(",cross=usart6", "")
        done = self.run_tiltproof(plain, LIBRARY)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("the image of client 'a' has no USART for it: add ,cross=usartN to --client", done.stderr)
        done = self.run_tiltproof(self.image + ",other=usart4", LIBRARY)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("the client 'a' has no line 'other' in the scenario flight", done.stderr)
        done = self.run_tiltproof(plain + ",cross=usart2", LIBRARY)
        self.assertIn("need a USART each; both are on 2", done.stderr)


if __name__ == "__main__":
    unittest.main()
