#!/usr/bin/env python3
"""Images that cannot fly: those that the harness refuses to load, and those that crash, hang or never send. Each message must say what is wrong and where.

Usage: broken_images_test.py TILTPROOF SOURCE-FOLDER
"""
import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:3])
del sys.argv[1:3]
EXAMPLE = SOURCE / "firmware/examples/minimal_c"
REALTIME_ATTEMPTS_MAX = 3  # other tests may have the processors meanwhile
CORTEX_M4F = ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]

SCENARIO = """\
name: flight
duration_s: 4
start_within_s: 0.1
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""

# Without a line of ours. Main() is what a test is about.
SKELETON = """\
#include <stdint.h>
#define REGISTER(address) (*(volatile uint32_t*)(address))
extern uint32_t _estack;
%(code)s
#ifndef IN_HANDLER
#define IN_HANDLER
#endif
void HardFault_Handler(void) {
  IN_HANDLER
  for (;;) {
    __asm volatile(".rept 200\\n\\tnop\\n\\t.endr"); /* a loop of long blocks is emulated in much less time */
  }
}
void Reset_Handler(void) {
  REGISTER(0xE000ED88) |= 0xFu << 20;
  REGISTER(0xE000ED24) |= 7u << 16; /* bus, usage and memory faults on */
  Main();
  for (;;) __asm volatile("wfi");
}
__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    [0] = (void (*)(void)) & _estack, [1] = Reset_Handler,      [2] = HardFault_Handler,
    [3] = HardFault_Handler,          [4] = HardFault_Handler,  [5] = HardFault_Handler,
    [6] = HardFault_Handler,
};
"""


def line_of(code, words):
    """The line of the first of these words in the file that holds the code."""
    text = SKELETON % {"code": code}
    return text[: text.index(words)].count("\n") + 1


class Images(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls._folder.name)
        cls.scenario = cls.root / "scenario.yaml"
        cls.scenario.write_text(SCENARIO)

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def image(self, code="static void Main(void) {}", cpu=CORTEX_M4F, script=None, flags=()):
        folder = self.root / self.id().split(".")[-1]
        folder.mkdir(exist_ok=True)
        (folder / "main.c").write_text(SKELETON % {"code": code})
        elf = folder / f"image{len(list(folder.glob('*.elf')))}.elf"
        if script is None:
            script = EXAMPLE / "stm32f4.ld"
        subprocess.run(["arm-none-eabi-gcc", "-std=c11", "-Og", "-g", "-fno-builtin", *cpu, "-mthumb", "--specs=nano.specs", "-nostartfiles", *flags,
                        "-T", script, folder / "main.c", "-o", elf], check=True)
        return elf

    def run_tiltproof(self, elf, *flags, scenario=None, environment=None):
        out = self.root / f"out-{self.id().split('.')[-1]}-{elf.stem}"
        done = subprocess.run([str(TILTPROOF), "run", str(scenario or self.scenario), "--client", f"qemu:{elf}", "--out", str(out), "--no-progress", *flags],
                              capture_output=True, text=True, timeout=120, env=environment)
        return done, out / "latest"

    def refusal(self, elf):
        done, _ = self.run_tiltproof(elf)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertIn(str(elf), done.stderr)
        self.assertNotIn("crashed", done.stderr)
        print(f"\n    {done.stderr.strip()}", file=sys.stderr)
        return done.stderr

    def fly(self, code, flags=(), realtime=False, environment=None):
        elf = self.image(code, flags=flags)
        for _ in range(REALTIME_ATTEMPTS_MAX if realtime else 1):
            done, folder = self.run_tiltproof(elf, *(["--mode", "realtime"] if realtime else []), environment=environment)
            self.assertTrue(folder.exists(), done.stdout + done.stderr)
            [result] = json.loads((folder / "results.json").read_text())["scenarios"]
            if result["cause"] != "too_busy":
                break
        log = "".join(file.read_text() for file in folder.glob("**/firmware.log"))
        print(f"\n    {result['reason']}", file=sys.stderr)
        return result, log


class WrongFiles(Images):
    def test_a_truncated_image(self):
        elf = self.image()
        whole = elf.read_bytes()
        for part in (0.2, 0.9):
            elf.write_bytes(whole[:int(part * len(whole))])
            self.assertRegex(self.refusal(elf), rf"truncated: by its header it ends at byte {len(whole)}, the file at byte {int(part * len(whole))}")
        elf.write_bytes(whole[:20])
        self.assertIn("truncated: it ends within its header", self.refusal(elf))
        elf.write_bytes(b"")
        self.assertIn("empty", self.refusal(elf))

    def test_an_image_for_another_processor(self):
        elf = self.root / "host.elf"
        elf.write_bytes(pathlib.Path("/proc/self/exe").read_bytes())
        self.assertIn("for another processor", self.refusal(elf))
        m7 = self.image(cpu=["-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard"])
        self.assertRegex(self.refusal(m7), "Cortex-M7.*-mcpu=cortex-m4")
        m33 = self.image(cpu=["-mcpu=cortex-m33", "-mfloat-abi=soft"])
        self.assertIn("ARMv8-M", self.refusal(m33))
        self.assertIn("Cortex-A", self.refusal(self.image(cpu=["-mcpu=cortex-a9", "-mfloat-abi=soft"])))

    def test_smaller_processors_of_the_family_will_do(self):
        for cpu in (["-mcpu=cortex-m3"], ["-mcpu=cortex-m4"]):
            done, _ = self.run_tiltproof(self.image(cpu=[*cpu, "-mfloat-abi=soft"]))
            self.assertNotEqual(done.returncode, 2, done.stderr)

    def test_an_image_at_a_wrong_address(self):
        script = (EXAMPLE / "stm32f4.ld").read_text()
        for name, address, words in [("loader", "0x08010000", "it begins at 0x08010000.*behind a boot loader"), ("h7", "0x24000000", "outside the board's flash")]:
            file = self.root / f"{name}.ld"
            file.write_text(script.replace("0x08000000", address))
            self.assertRegex(self.refusal(self.image(script=file)), f"linked at a wrong address.*{words}")

    def test_an_image_whose_vectors_are_not_first(self):
        file = self.root / "late.ld"
        file.write_text((EXAMPLE / "stm32f4.ld").read_text().replace("KEEP(*(.vectors)) *(.text .text.*)", "*(.text .text.*) KEEP(*(.vectors))"))
        self.assertIn("no vector table", self.refusal(self.image(script=file)))

    def test_an_even_reset_vector(self):
        elf = self.image()
        data = bytearray(elf.read_bytes())
        at = data.index(struct.pack("<I", 0x20020000)) + 4
        struct.pack_into("<I", data, at, struct.unpack_from("<I", data, at)[0] & ~1)
        elf.write_bytes(data)
        self.assertIn("must be odd", self.refusal(elf))

    def test_a_file_made_from_the_image(self):
        elf = self.image()
        for kind, words in [("binary", "a raw binary"), ("ihex", "an Intel HEX file"), ("srec", "a file of S-records")]:
            file = self.root / f"image.{kind}"
            subprocess.run(["arm-none-eabi-objcopy", "-O", kind, elf, file], check=True)
            self.assertRegex(self.refusal(file), f"{words}.*give the ELF file")
        file.write_text("firmware")
        self.assertIn("not an ELF file", self.refusal(file))


class Regions(Images):
    """Memory by name in an image whose linker script has no symbols of ours."""
    CODE = """static uint32_t counts[64] = {1};
static const uint32_t table[4] = {1, 2, 3, 4};
static void Main(void) { REGISTER(0x20018000) = (uint32_t)counts + (uint32_t)table; }"""

    def region(self, name, code=CODE, script=None, more=()):
        scenario = self.root / "flip.yaml"
        scenario.write_text(SCENARIO + f"faults: [{{id: f, type: device.bit_flip, start_s: 1, parameters: {{region: '{name}'}}}}]\n")
        done, _ = self.run_tiltproof(self.image(code, script=script, flags=more), scenario=scenario)
        return done

    def test_sections_bound_regions(self):
        script = self.root / "foreign.ld"
        script.write_text(re.sub(r"_[se](data|bss) = \.;", "", (EXAMPLE / "stm32f4.ld").read_text()))
        for name in ("data", "stack", "counts"):
            self.assertNotEqual(self.region(name, script=script).returncode, 2, name)
        self.assertIn("it has no section .bss in RAM, or it is empty", self.region("bss", script=script).stderr)

    def test_constants_and_ambiguous_names_are_refused(self):
        self.assertIn("'table' is a constant in flash (16 bytes at 0x0800", self.region("table").stderr)
        other = self.root / "other.c"
        other.write_text("static int counts[2] = {1};\nint Other(void) { return counts[0]++; }\n")
        done = self.region("counts", more=[other])
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"'counts' is ambiguous, there are 2 variables of that name: 0x[0-9a-f]{8} \((main|other)\.c\), 0x[0-9a-f]{8} \((main|other)\.c\)")
        self.assertNotEqual(self.region("other.c:counts", more=[other]).returncode, 2)


class Faults(Images):
    def test_a_bus_fault(self):
        code = """static uint32_t ReadSensor(uint32_t address) {
  return REGISTER(address); /* here */
}
static void Main(void) { ReadSensor(0x60000000); }"""
        result, log = self.fly(code, flags=["-fno-inline"])
        self.assertIn(f"bus fault: precise data access to 0x60000000 (no memory) by ReadSensor (main.c:{line_of(code, 'return REGISTER')})", result["reason"])
        self.assertIn("LR in Main (main.c", result["reason"])
        self.assertRegex(log, "CFSR 0x00008200, HFSR 0x00000000, MMFAR 0x[0-9a-f]{8}, BFAR 0x60000000")
        self.assertIn("R00=", log)

    def test_an_undefined_instruction(self):
        code = 'static void Main(void) { __asm volatile("udf #1"); }'
        result, _ = self.fly(code)
        self.assertIn(f"usage fault: undefined instruction by Main (main.c:{line_of(code, 'udf')})", result["reason"])

    def test_a_jump_to_0(self):
        code = """static void (*volatile callback)(void);
static void Main(void) { callback(); }"""
        result, _ = self.fly(code)
        self.assertRegex(result["reason"], rf"invalid state.*by a jump to 0x00000000, LR in Main \(main.c:{line_of(code, 'callback();')}\)")

    def test_a_stack_overflow(self):
        code = """int Recurse(int depth) {
  volatile int room[64] = {depth};
  return Recurse(depth + 1) + room[0];
}
static void Main(void) { Recurse(0); }"""
        result, _ = self.fly(code, flags=["-O0"])
        self.assertRegex(result["reason"], r"the stack pointer, 0x1fff[0-9a-f]{4}, lies outside RAM: the stack has overflowed \(the last call: Recurse \(main\.c:\d+\)\)")
        self.assertNotEqual(result["verdict"], "error")

    def test_a_fault_on_the_process_stack(self):
        code = """static uint32_t stack[64] __attribute__((aligned(8)));
static void Task(void) {
  REGISTER(0x60000000) = 1;
}
static void Main(void) {
  __asm volatile("msr psp, %0\\n\\tmovs r0, #2\\n\\tmsr control, r0\\n\\tisb" ::"r"(&stack[64]) : "r0");
  Task();
}"""
        result, log = self.fly(code, flags=["-fno-inline"])
        self.assertRegex(result["reason"], rf"to 0x60000000 \(no memory\) by Task \(main\.c:{line_of(code, 'REGISTER(0x60000000)')}\), LR in Main")
        self.assertRegex(log, r"LR 0xfffffffd\n|LR 0xffffffed\n")

    def test_an_access_that_the_mpu_forbids(self):
        code = """static void Main(void) {
  REGISTER(0xE000ED9C) = 0x20010000 | 1u << 4;        /* region 0 */
  REGISTER(0xE000EDA0) = 0u << 24 | 11u << 1 | 1u;    /* 4 KB, no access */
  REGISTER(0xE000ED94) = 5;                           /* on, with the default map behind it */
  __asm volatile("dsb\\n\\tisb");
  REGISTER(0x20010010) = 1; /* here */
}"""
        result, _ = self.fly(code)
        self.assertIn(f"memory management fault: data access that the MPU forbids to 0x20010010 (RAM) by Main (main.c:{line_of(code, 'REGISTER(0x20010010)')})",
                      result["reason"])

    def test_a_fault_in_the_handler_of_a_fault_locks_up(self):
        code = """#define IN_HANDLER REGISTER(0x70000000) = 2;
static void Main(void) { REGISTER(0x60000000) = 1; }"""
        result, log = self.fly(code)
        self.assertRegex(result["reason"], r"the firmware crashed at 0\.000 s after power-on: the processor locked up at HardFault_Handler \(main\.c:\d+\), "
                                           r"in the hard fault's handler: .*to 0x70000000 .*by HardFault_Handler.*in the bus fault's handler, "
                                           rf"which followed a fault by Main \(main\.c:{line_of(code, 'static void Main')}\)")
        self.assertIn("Lockup", log)
        self.assertIn("CFSR", log)

    def test_a_stack_pointer_below_ram(self):
        code = """static void Main(void) {
  __asm volatile("mov r0, %0\\n\\tmsr msp, r0" ::"r"(0x20000004) : "r0");
  REGISTER(0x60000000) = 1;
}"""
        result, _ = self.fly(code)
        self.assertIn("the stack pointer, 0x1fffffe0, lies outside RAM", result["reason"])


class Hangs(Images):
    def test_an_endless_loop(self):
        code = """static void Spin(void) {
  for (;;) {
  }
}
static void Main(void) { Spin(); }"""
        result, log = self.fly(code)
        self.assertRegex(result["reason"], r"for 2 s, since 0\.000 s after power-on, it has neither slept nor sent a byte; it is in Spin \(main\.c:\d+\)")
        self.assertIn("USART2 (main line) has no clock (RCC_APB1ENR, bit 17)", result["reason"])
        self.assertIn("no fault", log)

    def test_a_register_that_never_gets_ready(self):
        code = """static void WaitForRandom(void) {
  while ((REGISTER(0x50060804) & 1) == 0) {
  }
}
static void Main(void) { WaitForRandom(); }"""
        result, _ = self.fly(code)
        self.assertRegex(result["reason"], r"WaitForRandom \(main\.c:\d+\).*reads RNG_SR again and again \(0x50060804, now 0x00000000\)")
        self.assertIn("the emulated board does not have", result["reason"])

    def test_a_variable_that_never_changes(self):
        code = """static volatile uint32_t tick_count;
static void Main(void) {
  while (tick_count == 0) {
  }
}"""
        result, _ = self.fly(code)
        self.assertIn("reads the variable tick_count again and again", result["reason"])

    def test_the_begin_of_a_hang_is_told(self):
        code = """static void Main(void) {
  REGISTER(0x40023840) = 1u << 17;
  REGISTER(0x40004408) = 16000000 / 921600;
  REGISTER(0x4000440C) = 1u << 13 | 1u << 3;
  for (volatile int i = 0; i < 4000000; ++i) {
  }
  REGISTER(0x40004404) = 'x';
  for (;;) {
  }
}"""
        result, _ = self.fly(code)
        self.assertRegex(result["reason"], r"since 0\.[1-9]\d* s after power-on,")
        self.assertRegex(result["reason"], r"USART2 \(main line\) has sent 1 byte, 9\d{5} baud, transmitter on, receiver off")

    def test_a_firmware_that_sleeps_before_it_has_sent(self):
        code = """static void Main(void) {
  REGISTER(0x40023840) = 1u << 17;
  REGISTER(0x40023844) = 1u << 5;
  REGISTER(0x40011408) = 84000000 / 921600;
  REGISTER(0x4001140C) = 1u << 13 | 1u << 3;
  REGISTER(0x40011404) = 'x';
}"""
        result, log = self.fly(code)
        self.assertIn("no `start`", result["reason"])
        self.assertIn("it sleeps (WFI) in Reset_Handler (main.c:", result["reason"])
        self.assertIn("USART2 (main line) is off; USART6 (not connected) has sent 1 byte", result["reason"])


# Ends half a second after its sockets are closed, as the emulator may on a busy machine.
LATE_END = """#!/bin/sh
case "$*" in *--version*) exec "{qemu}" "$@" ;; esac
"{qemu}" "$@" &
exec 3>&- 4>&- 5>&-
wait $!
sleep 0.5
kill -ABRT $$
"""


class RealTime(Images):
    LOCKS_UP = """static void Main(void) { __asm volatile("udf #1\\n\\tnop"); }
#define IN_HANDLER __asm volatile("udf #2");"""

    def test_a_lock_up_is_told_when_the_emulator_ends_behind_its_sockets(self):
        late = self.root / "late/qemu-system-arm"
        late.parent.mkdir(exist_ok=True)
        late.write_text(LATE_END.format(qemu=shutil.which("qemu-system-arm")))
        late.chmod(0o755)
        result, _ = self.fly(self.LOCKS_UP, realtime=True, environment={**os.environ, "PATH": f"{late.parent}:{os.environ['PATH']}"})
        self.assertEqual(result["verdict"], "fail", result["reason"])
        self.assertIn("the processor locked up at HardFault_Handler", result["reason"])

    def test_a_lock_up_and_a_firmware_that_never_starts_are_told_with_their_lines(self):
        result, _ = self.fly(self.LOCKS_UP, realtime=True)
        self.assertRegex(result["reason"], r"the processor locked up at HardFault_Handler \(main\.c:\d+\), in the hard fault's handler: "
                                           r"usage fault: undefined instruction by HardFault_Handler")
        result, _ = self.fly("static void Main(void) { for (;;) {} }", realtime=True)
        # On a busy machine the flight is over before 2 s of the emulator's own time are.
        self.assertRegex(result["reason"], r"(for 2 s, since 0\.\d+ s after power-on, it has neither slept nor sent a byte; it|no `start`.*at the end it) is in Main \(main\.c:\d+\), "
                                           r"LR in Reset_Handler.*"
                                           r"USART2 \(main line\) has no clock \(RCC_APB1ENR, bit 17\)")
        result, _ = self.fly("static void Main(void) {}", realtime=True)
        self.assertRegex(result["reason"], r"no `start`.*it sleeps \(WFI\) in Reset_Handler \(main\.c:\d+\).*USART2 \(main line\) has no clock \(RCC_APB1ENR, bit 17\)")


if __name__ == "__main__":
    unittest.main(verbosity=2)
