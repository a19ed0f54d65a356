#!/usr/bin/env python3
"""Stack use of images: bare images whose use is known by construction, to the byte; stacks that overflow; and what the shipped
firmware finds of its own stacks, which it paints.

Usage: stacks_test.py TILTPROOF FOLDER-OF-IMAGES SOURCE-FOLDER
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import minimal_image

TILTPROOF, IMAGES, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:4])
del sys.argv[1:4]

# An image that never starts is looked at, too.
SCENARIO = """\
name: flight
duration_s: {duration_s}
start_within_s: 0.1
reference: {{type: hover, at_m: [0, 0, 2]}}
criteria:
  - {{name: room-on-stacks, metric: firmware.stack_used_share_max, max: {share_max}}}
"""

# The main stack is empty when `body`, assembler code, begins: the processor has set its pointer to its end. The emulator looks at the code
# before the first jump only when it has run.
BARE = """\
.syntax unified
.cpu cortex-m4
.thumb
.section .vectors, "a"
.word _estack, Reset_Handler, Fault, Fault, Fault, Fault, Fault, 0, 0, 0, 0, Fault, Fault, 0, %(pendsv)s, Fault
.text
.thumb_func
.global Reset_Handler
.type Reset_Handler, %%function
Reset_Handler:
  movs r4, #0x11
  ldr r5, =0x12345678
  b begin
begin:
%(body)s
sleep:
  wfi
  b sleep
.thumb_func
Fault:
  b Fault
%(functions)s
.bss
.balign 8
%(variables)s
"""


def stack(name, size_bytes):
    return f".global {name}\n.type {name}, %object\n.size {name}, {size_bytes}\n{name}: .space {size_bytes}\n"


# Takes 8 bytes for each of r0 calls, and writes them.
RECURSE = """\
.thumb_func
.type Recurse, %function
Recurse:
  push {r5, lr}
  subs r0, #1
  beq 1f
  bl Recurse
1:
  pop {r5, pc}
.size Recurse, . - Recurse
"""


class Stacks(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls._folder.name)

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def folder(self):
        folder = self.root / f"{self.id().split('.')[-1]}-{len(list(self.root.iterdir()))}"
        folder.mkdir()
        return folder

    def bare(self, body, functions="", variables="", bounds="", flags=()):
        """`bounds`: more of the linker script, which itself does not say where the stack ends. A function `Handler` is PendSV's."""
        folder = self.folder()
        (folder / "main.s").write_text(BARE % {"body": body, "functions": functions, "variables": variables,
                                             "pendsv": "Handler" if "Handler:" in functions else "Fault"})
        script = (SOURCE / "firmware/examples/minimal_c/stm32f4.ld").read_text()
        self.assertEqual(script.count("_sstack"), 1)
        (folder / "image.ld").write_text(re.sub(r"_sstack = .*;", bounds, script))
        subprocess.run(["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-g", "-nostdlib", "-Wl,--no-warn-rwx-segments", *flags,
                        "-T", folder / "image.ld", folder / "main.s", "-o", folder / "image.elf"], check=True)
        return folder / "image.elf"

    def fly(self, image, *flags, duration_s=0.2, share_max=1):
        """The verdict, {name: its stack}, what the terminal says, and the flight's folder."""
        folder = self.folder()
        (folder / "flight.yaml").write_text(SCENARIO.format(duration_s=duration_s, share_max=share_max))
        done = subprocess.run([str(TILTPROOF), "run", str(folder / "flight.yaml"), "--client", f"qemu:{image}", "--out", str(folder / "out"),
                               "--no-progress", "--no-report", *flags], capture_output=True, text=True, timeout=300)
        flight = folder / "out/latest/flight"
        self.assertTrue((flight / "verdict.json").exists(), done.stdout + done.stderr)
        verdict = json.loads((flight / "verdict.json").read_text())
        [result] = json.loads((flight.parent / "results.json").read_text())["scenarios"]
        self.assertEqual(result["stacks"], verdict["stacks"])
        stacks = {entry["name"]: entry for entry in verdict["stacks"]}
        self.assertEqual(len(stacks), len(verdict["stacks"]))
        share = verdict["metrics"].get("firmware.stack_used_share_max")
        self.assertEqual(share, max((entry["used_bytes_max"] / entry["size_bytes"] for entry in stacks.values()), default=None))
        return verdict, stacks, " ".join(done.stdout.split()), flight

    def used(self, image):
        _, stacks, _, _ = self.fly(image)
        return {name: (entry["used_bytes_max"], entry["size_bytes"]) for name, entry in stacks.items()}


MAIN = "_sstack = 0x2001F000;"
PEND = "  ldr r0, =0xE000ED04\n  ldr r1, =0x10000000\n  str r1, [r0]\n  dsb\n  isb\n"


class KnownUses(Stacks):
    def test_words_that_are_written(self):
        body = "  sub.w sp, sp, #{0}\n  str r5, [sp]\n  add.w sp, sp, #{0}"
        for size in (4, 8, 1000, 4092, 4096):
            self.assertEqual(self.used(self.bare(body.format(size), bounds=MAIN)), {"main": (size, 4096)})

    def test_words_that_are_reserved_and_never_written(self):
        self.assertEqual(self.used(self.bare("  sub.w sp, sp, #1024\n  b 1f\n1:\n  push {r4, r5}\n  sub sp, #40", bounds=MAIN)), {"main": (1072, 4096)})

    def test_words_below_the_pointer_as_an_rtos_stores_registers(self):
        self.assertEqual(self.used(self.bare("  push {r4}\n  mov r1, sp\n  sub.w r1, r1, #600\n  str r5, [r1]", bounds=MAIN)), {"main": (604, 4096)})

    def test_a_pointer_that_a_register_sets(self):
        self.assertEqual(self.used(self.bare("  mov r6, sp\n  sub.w r6, r6, #512\n  mov sp, r6\n  b 1f\n1:\n  push {r4}", bounds=MAIN)), {"main": (516, 4096)})

    def test_the_frame_of_an_exception(self):
        # 32 bytes below 104, of which the handler takes 8 more (ARMv7-M ARM, section B1.5.6). PendSV: ICSR, bit 28.
        body = "  sub sp, #104\n" + PEND
        self.assertEqual(self.used(self.bare(body, functions=".thumb_func\nHandler:\n  push {r5, lr}\n  pop {r5, pc}", bounds=MAIN)), {"main": (144, 4096)})

    def test_symbols_that_end_the_main_stack(self):
        body = "  sub.w sp, sp, #512\n  b 1f\n1:\n  push {r4}"
        for bounds, size in [("__StackLimit = 0x2001FC00;", 1024), ("__stack_limit = 0x2001F800;", 2048), ("_Min_Stack_Size = 0x600;", 0x600),
                             ("__main_stack_base__ = 0x2001FC00;", 1024), (MAIN + " _Min_Stack_Size = 0x600;", 4096)]:
            self.assertEqual(self.used(self.bare(body, bounds=bounds)), {"main": (516, size)}, bounds)
        for bounds in ("", "__StackLimit = 0x20020000;", "_Min_Stack_Size = 0x40000;", "__stack_limit = 0x10000000;"):
            self.assertEqual(self.used(self.bare(body, bounds=bounds)), {}, bounds)

    def test_an_image_without_symbols(self):
        self.assertEqual(self.used(self.bare("  push {r4}", bounds=MAIN, flags=["-s"])), {})


# On a stack of its own, and back.
ON_STACK = """\
  mov r7, sp
  ldr r0, ={0} + {1}
  mov sp, r0
  b 1f
1:
  movs r0, #{2}
  bl Recurse
  mov sp, r7
  b 2f
2:
  push {{r4}}
  pop {{r4}}
"""


class Tasks(Stacks):
    def overflows(self, flight):
        events = [json.loads(row) for row in (flight.parent / "events.jsonl").read_text().splitlines()]
        return [{"time_s": event["time_s"], "text": event["text"]} for event in events if event["kind"] == "stack_overflow"]

    VARIABLES = stack("below", 256) + stack("lower_stack", 256) + stack("upperStack", 256) + stack("stack_of_none", 64) + stack("counts", 64)

    def tasks(self, *uses):
        return self.bare("".join(ON_STACK.format(name, 256, calls).replace("1f", f"{i}1f").replace("1:", f"{i}1:").replace("2f", f"{i}2f").replace("2:", f"{i}2:")
                                 for i, (name, calls) in enumerate(uses, 1)), functions=RECURSE, variables=self.VARIABLES, bounds=MAIN)

    def test_stacks_of_tasks_are_variables_that_are_named_so(self):
        self.assertEqual(self.used(self.tasks(("upperStack", 3), ("lower_stack", 20))), {"main": (4, 4096), "upperStack": (24, 256), "lower_stack": (160, 256)})

    def test_a_full_stack_has_not_overflowed(self):
        verdict, stacks, _, flight = self.fly(self.tasks(("upperStack", 32), ("lower_stack", 1)))
        self.assertEqual({name: (entry["used_bytes_max"], entry["overflowed"]) for name, entry in stacks.items()},
                         {"main": (4, False), "upperStack": (256, False), "lower_stack": (8, False)})
        self.assertEqual(self.overflows(flight), [])

    def test_one_call_more_overflows(self):
        """Into the stack below, whose end is where this one begins."""
        image = self.tasks(("upperStack", 33))
        verdict, stacks, output, flight = self.fly(image)
        self.assertEqual({name for name, entry in stacks.items() if entry["overflowed"]}, {"upperStack"})
        self.assertEqual(stacks["upperStack"]["used_bytes_max"], 256)
        line = (image.parent / "main.s").read_text().split("push {r5, lr}\n  subs")[0].count("\n") + 1
        said = rf"stack 'upperStack' \(256 bytes\) overflowed: the stack pointer is 8 bytes below it in \w+ \(main\.s:{line}\)"
        self.assertRegex(output, said + r", at 0\.000 s")
        self.assertRegex((flight / "firmware.log").read_text(), said)
        [event] = self.overflows(flight)  # once only
        self.assertRegex(event["text"], said)
        self.assertLess(event["time_s"], 0.001)
        self.assertEqual(self.overflows(self.fly(image)[3]), [event])

    def test_registers_that_a_switch_of_tasks_stores(self):
        """Below the frame of the exception, 32 bytes, by a register; their values are 0, as the stack's words are."""
        handler = ".thumb_func\n.type Handler, %function\nHandler:\n  mrs r0, psp\n  isb\n  stmdb r0!, {r4-r11, lr}\n  bx lr\n.size Handler, . - Handler"
        clear = "".join(f"  movs r{number}, #0\n" for number in range(4, 8)) + "".join(f"  mov r{number}, r4\n" for number in range(8, 12))
        for room, used, below in [(8, 76, 0), (184, 252, 0), (192, 256, 4), (216, 256, 28)]:
            body = f"  ldr r0, =lower_stack + 256\n  msr psp, r0\n  movs r0, #2\n  msr control, r0\n  isb\n  sub sp, #{room}\n{clear}{PEND}"
            _, stacks, output, flight = self.fly(self.bare(body, functions=handler, variables=self.VARIABLES, bounds=MAIN))
            self.assertEqual((stacks["lower_stack"]["used_bytes_max"], stacks["lower_stack"]["overflowed"]), (used, below > 0), room)
            self.assertEqual(len(self.overflows(flight)), below > 0)
            self.assertEqual("overflowed" in output, below > 0, output)
            if below:
                self.assertRegex(output, rf"stack 'lower_stack' \(256 bytes\) overflowed: the stack pointer is {below} bytes below it in Handler \(main\.s:\d+\)")

    def test_words_that_are_written_past_the_end_of_a_stack_before_a_reset(self):
        """The stack pointer stays within, and after the reset the stack is cleared."""
        body = """\
  ldr r0, =0x2001E000
  ldr r1, [r0]
  cmp r1, r5
  beq 3f
  str r5, [r0]
  ldr r0, =lower_stack + 256
  mov sp, r0
  b 4f
4:
  push {r4}
  mov r1, sp
  movs r2, #70
5:
  str r5, [r1, #-4]!
  subs r2, #1
  bne 5b
  ldr r0, =0xE000ED0C
  ldr r1, =0x05FA0004
  str r1, [r0]
  dsb
6:
  b 6b
3:
  ldr r0, =lower_stack
  movs r1, #0
  movs r2, #64
7:
  str r1, [r0], #4
  subs r2, #1
  bne 7b
"""
        _, stacks, output, _ = self.fly(self.bare(body, variables=self.VARIABLES, bounds=MAIN))
        self.assertEqual((stacks["lower_stack"]["used_bytes_max"], stacks["lower_stack"]["overflowed"]), (256, False))
        self.assertIn("stack 'lower_stack' is full: all of its 256 bytes were used, so it may have overflowed", output)

    def test_into_a_variable(self):
        _, stacks, output, _ = self.fly(self.tasks(("lower_stack", 35)))
        self.assertTrue(stacks["lower_stack"]["overflowed"])
        self.assertIn("stack 'lower_stack' (256 bytes) overflowed", output)
        self.assertEqual(output.count("overflowed"), 1)

    def test_a_main_stack_that_leaves_its_room(self):
        _, stacks, output, _ = self.fly(self.bare("  ldr r0, =129\n  bl Recurse", functions=RECURSE, bounds="_Min_Stack_Size = 0x400;"))
        self.assertEqual((stacks["main"]["used_bytes_max"], stacks["main"]["overflowed"]), (1024, True))
        self.assertIn("stack 'main' (1024 bytes) overflowed: the stack pointer is 8 bytes below it", output)


class Flights(Stacks):
    IN_FLIGHT = ("    wake_ns = tiltproof_client_grant", "    if (tick_count == 700) Deep(40);\n    wake_ns = tiltproof_client_grant")
    DEEP = ("int main(void) {\n", "__attribute__((noinline)) static int Deep(int depth) {\n  volatile int room[32];\n  for (int i = 0; i < 32; ++i) room[i] = depth;\n"
            "  return depth == 0 ? 0 : Deep(depth - 1) + room[0];\n}\nint main(void) {\n")

    def image(self, replacements=(), bounds=None):
        folder = self.folder()
        script = (SOURCE / "firmware/examples/minimal_c/stm32f4.ld").read_text()
        (folder / "image.ld").write_text(script if bounds is None else re.sub(r"_sstack = .*;", bounds, script))
        return minimal_image.build(SOURCE, folder / "image", replacements, folder / "image.ld")

    def test_an_overflow_is_told_and_fails_what_asks_for_room(self):
        image = self.image([self.IN_FLIGHT, self.DEEP], bounds="_sstack = 0x2001F800;")
        verdict, stacks, output, flight = self.fly(image, duration_s=2)
        self.assertEqual((verdict["verdict"], stacks["main"]["overflowed"], stacks["main"]["used_bytes_max"]), ("pass", True, 2048), output)
        self.assertNotIn("overflowed", output)
        self.assertIn("stack 'main' (2048 bytes) overflowed", (flight / "firmware.log").read_text())
        verdict, _, output, _ = self.fly(image, duration_s=2, share_max=0.9)
        self.assertEqual(verdict["verdict"], "fail")
        self.assertIn("room-on-stacks: firmware.stack_used_share_max = 1, max 0.9", output)
        self.assertRegex(output, r"stack 'main' \(2048 bytes\) overflowed: the stack pointer is \d+ bytes below it in Deep \(stm32f4\.c:\d+\), at 0\.69\d s")

    def test_a_stack_in_all_ram_above_the_variables(self):
        verdict, stacks, output, _ = self.fly(self.image([self.IN_FLIGHT, self.DEEP]), duration_s=2)
        self.assertEqual((verdict["verdict"], stacks["main"]["overflowed"]), ("pass", False), output)
        self.assertGreater(stacks["main"]["size_bytes"], 64 * 1024)
        self.assertGreater(stacks["main"]["used_bytes_max"], 41 * 128)
        self.assertLess(stacks["main"]["used_bytes_max"], 41 * 256)

    def test_measuring_changes_nothing(self):
        """The same flight of the same code with stacks that are watched, and with none."""
        watched, none = self.image(), self.image()
        subprocess.run(["arm-none-eabi-strip", none], check=True)
        (with_stacks, stacks, _, _), (without, no_stacks, _, _) = (self.fly(image, duration_s=4) for image in (watched, none))
        self.assertTrue(stacks and not no_stacks)
        self.assertEqual(with_stacks["trace_hash"], without["trace_hash"])

    def test_processes_of_their_own(self):
        image = self.image()
        alone, spread = self.fly(image, duration_s=1), self.fly(image, "--distributed", duration_s=1)
        self.assertEqual(alone[1], spread[1])
        self.assertTrue(alone[1])

    def test_what_the_shipped_firmware_finds_of_its_own_stacks(self):
        """It paints them, and prints their use 1 s after its start."""
        for name, prefix in [("executive-tolerant", ""), ("freertos-tolerant", "_stack")]:
            image = IMAGES / f"{name}.elf"
            if not image.exists():
                print(f"not run: there is no {image.name}", file=sys.stderr)
                continue
            verdict, stacks, output, flight = self.fly(image, duration_s=1.9)
            self.assertEqual(verdict["verdict"], "pass", output)
            said = {stack: (int(used), int(size)) for stack, used, size in
                    re.findall(r"stack (\w+) (\d+) of (\d+) bytes", (flight / "firmware.log").read_text())}
            measured = {stack: stacks[stack if stack == "main" else stack + prefix] for stack in said}
            self.assertEqual(len(measured), len(stacks))
            for stack, (used, size) in said.items():
                self.assertEqual(measured[stack]["size_bytes"], size, stack)
                # Paint shows what was written; of the rest, compilers reserve a little.
                self.assertGreaterEqual(measured[stack]["used_bytes_max"], used, stack)
                self.assertLessEqual(measured[stack]["used_bytes_max"], used + 128, stack)


if __name__ == "__main__":
    unittest.main(verbosity=2)
