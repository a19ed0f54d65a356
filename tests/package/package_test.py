#!/usr/bin/env python3
"""An installed tiltproof, away from its source tree and build folder: it flies, nothing in it names this machine's folders, and a
project outside the tree builds on it and flies. Usage: package_test.py CMAKE BUILD_DIR SOURCE_DIR"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

CMAKE, BUILD, SOURCE = (pathlib.Path(sys.argv.pop(1)) for _ in range(3))
EXAMPLE = "share/tiltproof/examples/out_of_tree"


def run(*command, cwd, expected=0):
    done = subprocess.run([str(part) for part in command], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode != expected:
        raise AssertionError(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}")
    return done.stdout


class PackageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-package-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        run(CMAKE, "--install", BUILD, "--prefix", cls.folder / "first", cwd=cls.folder)
        # Whatever remembered the prefix does not find it any more.
        cls.prefix = (cls.folder / "first").rename(cls.folder / "moved")
        cls.program = cls.prefix / "bin/tiltproof"

    def verdicts(self, results):
        flights = json.loads((results / "latest/results.json").read_text())["scenarios"]
        return {flight["name"]: flight["verdict"] for flight in flights}

    def test_names_no_folder_of_the_build(self):
        files = [file for file in self.prefix.rglob("*") if file.is_file()]
        self.assertGreater(len(files), 300)
        for file in files:
            content = file.read_bytes()
            for folder in (BUILD, self.folder, *(SOURCE / part for part in ("link", "plant", "firmware", "harness", "docs", "scenarios"))):
                self.assertNotIn(bytes(folder), content, file)

    def test_flies(self):
        out = self.folder / "results"
        run(self.program, "run", self.prefix / "share/tiltproof/scenarios/paper", "-k", "hover", "--out", out, cwd=self.folder)
        self.assertEqual(self.verdicts(out), {"paper-hover": "pass"})
        self.assertTrue((out / "latest/report.html").is_file())
        library = self.prefix / "lib/tiltproof/minimal_firmware.so"
        run(self.program, "run", self.prefix / "share/tiltproof/scenarios/paper", "-k", "hover", "--client", f"library:{library}",
            "--out", out, cwd=self.folder)

    def test_flies_from_python(self):
        hover = self.prefix / "share/tiltproof/scenarios/paper/hover.yaml"
        run("env", f"PYTHONPATH={self.prefix / 'lib/python3/dist-packages'}", f"PATH={self.program.parent}:/usr/bin:/bin", sys.executable, "-B", "-c",
            f"import tiltproof\nwith tiltproof.fly({str(hover)!r}) as flight: flight.advance(1)\nassert flight.result.verdict == 'pass'", cwd=self.folder)

    def test_every_scenario_is_there_and_right(self):
        listed = run(self.program, "list", self.prefix / "share/tiltproof/scenarios", cwd=self.folder)
        self.assertEqual(listed.splitlines(), run(self.program, "list", SOURCE / "scenarios", cwd=self.folder)
                         .replace(str(SOURCE / "scenarios"), str(self.prefix / "share/tiltproof/scenarios")).splitlines())
        run(self.program, "check", self.prefix / "share/tiltproof/scenarios", cwd=self.folder)

    def test_pages_name_the_installed_program(self):
        pages = [*(self.prefix / "share/doc/tiltproof").glob("*.md"), *(self.prefix / "share/doc/tiltproof/docs").glob("*.md")]
        self.assertGreater(len(pages), 20)
        for page in pages:
            self.assertNotIn("build/release/tiltproof", page.read_text(), page)
        # Byte by byte the same but for that.
        first = (self.prefix / "share/doc/tiltproof/docs/first-fault.md").read_text()
        self.assertEqual(first, (SOURCE / "docs/first-fault.md").read_text().replace("build/release/tiltproof", "tiltproof"))

    def test_emulated_board(self):
        images = list((self.prefix / "lib/tiltproof/stm32f4").glob("*.elf"))
        command = (self.program, "run", self.prefix / "share/tiltproof/scenarios/paper", "-k", "hover", "--client", "qemu", "--out",
                   self.folder / "board-results")
        if not images:
            self.assertIn("./setup --images", run(*command, cwd=self.folder, expected=2))
            return
        self.assertIn("executive-paper.elf", [image.name for image in images])
        self.assertNotIn("budgets.elf", [image.name for image in images])
        if not shutil.which("qemu-system-arm"):
            self.skipTest("no qemu-system-arm")
        run(*command, cwd=self.folder)
        self.assertEqual(self.verdicts(self.folder / "board-results"), {"paper-hover": "pass"})

    def test_a_project_outside_the_tree_builds_and_flies(self):
        project, build = self.folder / "my-project", self.folder / "my-build"
        shutil.copytree(self.prefix / EXAMPLE, project)
        run(CMAKE, "-S", project, "-B", build, f"-DCMAKE_PREFIX_PATH={self.prefix}", "-DCMAKE_BUILD_TYPE=Release", cwd=self.folder)
        run(CMAKE, "--build", build, cwd=self.folder)
        # Its own library flies, with the gain that the installed program has designed.
        run(CMAKE.parent / "ctest", "--test-dir", build, "--output-on-failure", "--no-tests=error", cwd=self.folder)
        self.assertEqual(self.verdicts(build / "results"), {"spiral": "pass"})
        record = json.loads((build / "results/latest/run.json").read_text())
        self.assertIn(str(build / "my_firmware.so"), json.dumps(record))
        self.assertTrue((build / "my_gain.inc").read_text().startswith("inline constexpr Gain kMyGain"))

    def test_another_version_is_refused(self):
        project = self.folder / "other-version"
        project.mkdir()
        for version, code in (("0.1", 0), ("0.99", 1), ("1.0", 1)):
            (project / "CMakeLists.txt").write_text(
                f"cmake_minimum_required(VERSION 3.25)\nproject(p LANGUAGES CXX)\nfind_package(tiltproof {version} REQUIRED)\n")
            run(CMAKE, "-S", project, "-B", self.folder / f"version-{version}", f"-DCMAKE_PREFIX_PATH={self.prefix}", cwd=project, expected=code)

    def test_debian_package(self):
        if not shutil.which("dpkg-shlibdeps"):
            self.skipTest("no dpkg-dev")
        run(CMAKE.parent / "cpack", "--config", BUILD / "CPackConfig.cmake", "-B", self.folder / "packages", cwd=self.folder)
        (package,) = (self.folder / "packages").glob("tiltproof_*.deb")
        control = run("dpkg-deb", "--field", package, cwd=self.folder)
        for library in ("libode8", "libsdformat12", "libyaml-cpp0.7", "libddsc0debian", "libc6"):
            self.assertRegex(control, rf"Depends: .*\b{re.escape(library)}\b")
        self.assertNotRegex(control, r"Depends: .*-dev\b")
        self.assertRegex(control, r"Maintainer: .+ <.+@.+>\n")
        self.assertNotIn("@invalid", control)
        run("dpkg-deb", "--extract", package, self.folder / "unpacked", cwd=self.folder)
        unpacked = self.folder / "unpacked/usr"
        self.assertIn("\n    tiltproof run /usr/share/tiltproof/scenarios/paper\n", (unpacked / "share/doc/tiltproof/README.md").read_text())
        self.assertEqual({file.relative_to(unpacked) for file in unpacked.rglob("*")},
                         {file.relative_to(self.prefix) for file in self.prefix.rglob("*")})
        self.assertIn("tiltproof 0.", run(unpacked / "bin/tiltproof", "--version", cwd=self.folder))


if __name__ == "__main__":
    unittest.main()
