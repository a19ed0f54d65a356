"""Images of firmware/examples/minimal_c with mistakes.

    elf = build(source_folder, folder, [("kPeriodNs = 12000000", "kPeriodNs = 6000000")])
"""
import subprocess

FLAGS = ["-std=c11", "-O2", "-g", "-ffp-contract=off", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard",
         "--specs=nano.specs", "-nostartfiles"]


def build(source, folder, replacements, script=None):
    """`source`: of the project. `folder` is made, and gets the changed sources and the image. `replacements`: old and new texts. `script`: the
    linker's, instead of the example's."""
    example = source / "firmware/examples/minimal_c"
    folder.mkdir()
    missing = {old for old, _ in replacements}
    for file in ("stm32f4.c", "minimal_firmware.c"):
        text = (example / file).read_text()
        for old, new in replacements:
            if old in text:
                missing.discard(old)
                text = text.replace(old, new)
        (folder / file).write_text(text)
    if missing:
        raise AssertionError(f"no text of the example: {missing}")
    elf = folder / "image.elf"
    subprocess.run(["arm-none-eabi-gcc", *FLAGS, "-I", source, "-T", script or example / "stm32f4.ld", *sorted(folder.glob("*.c")), "-o", elf], check=True)
    return elf
