#!/usr/bin/env python3
"""What the firmware needs of an STM32F4, against limits: instructions, memory, stacks.

Usage: budgets_test.py FOLDER-OF-IMAGES PLUGIN    prints the table of docs/measurements.md, "Budgets"; exit 1 when a limit is broken.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

from emulator import Emulator, floats

# Executed instructions, counted by budgets.elf. Limits leave some tenths for another compiler. A period of 12 ms at 168 MHz
# has room for 1,008,000 of two cycles each.
INSTRUCTIONS = {
    "control_step": (600, "control step"),
    "decode_plain": (900, "decode a 64-byte payload, nothing escaped"),
    "decode_escaped": (2400, "decode a 64-byte payload, everything escaped"),
    "encode_plain": (1150, "encode a 64-byte payload, nothing escaped"),
    "encode_escaped": (1150, "encode a 64-byte payload, everything escaped"),
    "cycle_plain": (30_000, "whole period, byte by byte, nothing escaped"),
    "cycle_escaped": (45_000, "whole period, byte by byte, everything escaped"),
    "cycle_hardened": (36_000, "the same in the protocol hardened, nothing escaped"),
    "cycle_hardened_escaped": (52_000, "the same in the protocol hardened, everything escaped"),
    "model_step": (5_000, "model of the vehicle, one step of 4 ms"),
    "lag_hypotheses": (200_000, "a sample that does not fit: all lags examined"),
    "tolerant_good": (60_000, "tolerant, a good period"),
    "tolerant_hardened": (66_000, "tolerant, a good period in the protocol hardened"),
    "failover_good": (75_000, "failover, a good period of the standby, with a heartbeat each way"),
    "tolerant_missed": (40_000, "tolerant, no reply: commands at 2, 6 and 10 ms"),
    "tolerant_late": (80_000, "tolerant, a reply at 5 ms: commands at 2, 5, 6 and 10 ms"),
    "tolerant_belief": (150_000, "tolerant, a rotor weakens: the belief about it changes"),
    "tolerant_worst": (400_000, "tolerant, four replies; a sensor lies, a rotor is weak, commands late"),
    "tolerant_burst": (900_000, "tolerant, the same with eleven replies"),
}
# Bytes of flash and of RAM (stacks included).
MEMORY = {
    "executive": (48 * 1024, 24 * 1024),
    "freertos": (56 * 1024, 32 * 1024),
}
STACK_USE_MAX = 0.75  # of its size

MUTE = range(20, 40)  # requests without reply: the fail-safe and its log lines are the deepest calls


# A crystal with which timer 2 counts at 1 GHz (times 336 / 8 / 2, by two): its counts are nanoseconds.
HSE_HZ = 95_238_095


def count_instructions(image, plugin):
    """Lines `name value` of the image, with one nanosecond an instruction."""
    with tempfile.TemporaryDirectory() as folder:
        console = pathlib.Path(folder, "console")
        qemu = subprocess.Popen(["qemu-system-arm", "-M", "netduinoplus2", "-display", "none", "-monitor", "none",
                                 "-icount", "shift=0", "-plugin", f"{plugin},realtime=on,hse={HSE_HZ}", "-serial", f"file:{console}", "-kernel", str(image)],
                                stdin=subprocess.DEVNULL)
        try:
            for _ in range(600):
                try:
                    qemu.wait(0.1)
                except subprocess.TimeoutExpired:
                    pass
                text = console.read_text() if console.exists() else ""
                if "done" in text or qemu.returncode is not None:
                    break
        finally:
            qemu.kill()
            qemu.wait()
    if "done" not in text:
        sys.exit(f"{image.name} did not come to its end; it said:\n{text}")
    return {name: int(value) for name, value in re.findall(r"^(\w+) (\d+)\r?$", text, re.MULTILINE)}


def sizes(image):
    text, data, bss = subprocess.check_output(["arm-none-eabi-size", image], text=True).splitlines()[1].split()[:3]
    return int(text) + int(data), int(data) + int(bss)


def stack_uses(image, plugin):
    """{stack: (used, size)} after a second of traffic with all that makes the firmware call deep."""
    reply = floats(2, 0, 0.5, *[0] * 13)
    with Emulator(image, plugin, answers=lambda n: None if n in MUTE else reply) as board:
        for _ in board.messages(until=lambda board: "busy for" in board.console and board.request_count > MUTE.stop + 20):
            board.send_reference(2, 0, 0.5, 0, 0, 0, 0)
        lines = re.findall(r"stack (\w+) (\d+) of (\d+) bytes", board.console)
    return {name: (int(used), int(size)) for name, used, size in lines}


def main():
    folder, plugin = (pathlib.Path(argument) for argument in sys.argv[1:3])
    broken = []
    rows = []

    def check(what, value, limit, unit):
        rows.append(f"| {what} | {value} {unit} | {limit} {unit} |")
        if value > limit:
            broken.append(f"{what}: {value} {unit}, limit {limit}")

    counts = count_instructions(folder / "budgets.elf", plugin)
    for name, (limit, what) in INSTRUCTIONS.items():
        if name not in counts:
            sys.exit(f"budgets.elf does not measure {name}")
        check(what, counts[name], limit, "instructions")
    if counts["tolerant_belief"] < counts["lag_hypotheses"] or counts["tolerant_worst"] < 3 * counts["lag_hypotheses"]:
        broken.append("the flights of budgets.elf do not examine the lags: the dearest periods are not measured")
    for prefix, (flash_max, ram_max) in MEMORY.items():
        images = sorted(folder.glob(f"{prefix}-*.elf"))
        if not images:
            print(f"not measured: there are no images {prefix}-*.elf", file=sys.stderr)
            continue
        flash, ram = (max(column) for column in zip(*map(sizes, images)))
        check(f"{prefix}: flash", flash, flash_max, "bytes")
        check(f"{prefix}: RAM", ram, ram_max, "bytes")
        uses = stack_uses(folder / f"{prefix}-tolerant.elf", plugin)
        if "main" not in uses:
            sys.exit(f"{prefix}-tolerant.elf reported no stack")
        for stack, (used, size) in uses.items():
            check(f"{prefix}: stack {stack}, of {size} bytes", used, int(STACK_USE_MAX * size), "bytes")

    print("| what | measured | limit |", "|---|---|---|", *rows, sep="\n")
    if broken:
        sys.exit("over the limit:\n" + "\n".join(broken))


if __name__ == "__main__":
    main()
