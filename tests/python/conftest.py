"""Where the tests of the Python module fly: in a folder of their own, with the program under test."""

from __future__ import annotations

import os
import pathlib

import pytest

import tiltproof

BUILD = pathlib.Path(tiltproof.find_program()).resolve().parent
IMAGE = pathlib.Path(os.environ.get("TILTPROOF_IMAGES", BUILD / "firmware/stm32f4")) / "executive-paper.elf"
CLIENTS = ["host", "image", "program"]
PROGRAM = BUILD / "lib/minimal_program"

CLIMB = """\
name: climb
duration_s: 8
reference: {type: waypoints, points_m: [[0, 0, 1], [0, 0, 4]], speed_m_s: 1}
criteria:
  - {name: stays-near, stl: "always(position_error_m <= 2)"}
"""


@pytest.fixture
def scenario(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    """The path of a scenario that climbs from 1 m to 4 m, in the present folder."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "climb.yaml"
    file.write_text(CLIMB, encoding="utf-8")
    return file


@pytest.fixture(params=CLIENTS)
def client(request: pytest.FixtureRequest) -> str:
    """Each client in turn, as --client takes it."""
    if request.param == "image":
        if not IMAGE.is_file():
            pytest.skip("no images are built")
        return f"qemu:{IMAGE}"
    if request.param == "program":
        if not PROGRAM.is_file():
            pytest.skip("the example of a program is not built")
        return f"program:{PROGRAM}"
    return "host"
