#!/usr/bin/env python3
"""What .ci/run leaves behind of a run that passes, fails, or takes no picture. Usage: ci_run_test.py SOURCE_DIR"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
PAGE_TEST = "mkdir -p build/release/page-test/inner && cd build/release/page-test && touch new.png inner/deep.png page.html\n"


class CiRunTest(unittest.TestCase):
    def ci(self, test, **environment):
        """Exit code and pictures, with this in place of ./test."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-ci-"))
        self.addCleanup(shutil.rmtree, folder)
        (folder / ".ci").mkdir()
        shutil.copy(SOURCE / ".ci/run", folder / ".ci/run")
        # Pictures of an earlier run.
        for old in ("build/release/page-test", "ci-artefacts/page-test"):
            (folder / old).mkdir(parents=True)
            (folder / old / "old.png").touch()
        (folder / "test").write_text('#!/bin/sh\n[ "$*" = all ] || exit 9\n' + test)
        (folder / "test").chmod(0o755)
        code = subprocess.run([folder / ".ci/run"], cwd="/", env={**os.environ, **environment}, check=False, stderr=subprocess.DEVNULL).returncode
        kept = folder / environment.get("CI_ARTEFACTS", "ci-artefacts") / "page-test"
        return code, sorted(file.name for file in kept.iterdir())

    def test_pictures_are_kept(self):
        self.assertEqual(self.ci(PAGE_TEST), (0, ["new.png"]))
        self.assertEqual(self.ci(PAGE_TEST + "exit 1\n"), (1, ["new.png"]))
        self.assertEqual(self.ci("exit 1\n"), (1, []))
        self.assertEqual(self.ci("true\n"), (0, []))

    def test_in_another_folder(self):
        self.assertEqual(self.ci(PAGE_TEST + "exit 3\n", CI_ARTEFACTS="a/b"), (3, ["new.png"]))


if __name__ == "__main__":
    unittest.main()
