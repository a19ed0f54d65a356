#!/usr/bin/env python3
"""Libraries built with sanitizers: they are loaded, and their reports are reasons. Usage: sanitizer_test.py TILTPROOF SOURCE_DIR"""
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

from command_line import CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()
CLIENT = SOURCE / "tests/harness/cli/sanitized_client.c"


def line_of(text):
    return next(number for number, line in enumerate(CLIENT.read_text().splitlines(), 1) if text in line)


class SanitizerTest(CommandLineTest):
    def library(self, compiler, sanitizer, *flags):
        if not shutil.which(compiler):
            self.skipTest(f"no {compiler}")
        file = self.folder / f"{compiler}-{sanitizer}.so"
        subprocess.run([compiler, "-g", "-O0", "-fPIC", "-shared", f"-fsanitize={sanitizer}", *flags, "-I", SOURCE, CLIENT, "-o", file, "-lm"],
                       check=True)
        return file

    def fly(self, library, how, *flags, environment=None):
        self.scenario(how, **{"seed: 3": f"seed: 3\nfirmware: {how}"})
        code, out, err = self.tiltproof("run", f"{how}.yaml", "--client", f"library:{library}", *flags, environment=environment)
        return code, out + err, self.results()["scenarios"][0] if code < 2 else None

    def check_address(self, compiler):
        library = self.library(compiler, "address")
        for how, function, line in (("overflow", "KeepMessage", "kept[i] = bytes[0]"), ("copy", "CopyMessage", "memcpy((")):
            code, text, result = self.fly(library, how)
            self.assertEqual((code, result["verdict"], result["end_reason"]), (1, "fail", "firmware_crashed"), text)
            reason = result["reason"]
            self.assertIn("crashed in tiltproof_client_receive: Aborted: ERROR: AddressSanitizer: heap-buffer-overflow in " + function, reason)
            # clang tells the line only where it finds its symbolizer.
            if compiler != "clang" or shutil.which("llvm-symbolizer"):
                self.assertIn(f"sanitized_client.c:{line_of(line)}", reason)
            # The whole report is kept, and the flight until then.
            log = next((self.latest() / how).glob("firmware*.log")).read_text()
            self.assertRegex(log, "of size 1|WRITE of size|READ of size")
            self.assertGreater(len((self.latest() / how / "trace.csv").read_text().splitlines()), 10)
            # The same words in another process, at other addresses.
            self.assertEqual(self.fly(library, how)[2]["reason"], reason)
        code, text, _ = self.fly(library, "calm")
        self.assertIn(code, (0, 1), text)
        return library

    def test_an_overflow_that_gcc_sees(self):
        library = self.check_address("gcc")
        plain = self.library("gcc", "null", "-fno-sanitize=all")
        self.assertEqual(self.fly(library, "calm")[2]["trace_hash"], self.fly(plain, "calm")[2]["trace_hash"])

    def test_an_overflow_that_clang_sees(self):
        self.check_address("clang")

    def test_undefined_behaviour_that_gcc_sees(self):
        # Without the last flag a report is no end of the program by itself.
        for sanitizer, *flags in (("undefined", "-fno-sanitize-recover=all"), ("undefined",), ("address,undefined",)):
            with self.subTest(sanitizer=sanitizer, flags=flags):
                code, text, result = self.fly(self.library("gcc", sanitizer, *flags), "largest")
                self.assertEqual((code, result["verdict"], result["end_reason"]), (1, "fail", "firmware_crashed"), text)
                self.assertRegex(result["reason"], f"sanitized_client.c:{line_of('++largest')}:[0-9]+: runtime error: signed integer overflow")

    def test_a_sanitizer_that_is_not_there(self):
        library = self.library("gcc", "address")
        data = library.read_bytes()
        self.assertEqual(len(re.findall(rb"libasan\.so\.\d", data)), 1)
        library.write_bytes(re.sub(rb"libasan\.so\.\d", b"libasan.so.X", data))
        code, text, _ = self.fly(library, "calm")
        self.assertEqual(code, 3, text)
        self.assertIn("libasan.so.X cannot be loaded; install it", text)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
