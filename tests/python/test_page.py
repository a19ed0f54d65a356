"""The examples of docs/python.md, as a reader types them."""

from __future__ import annotations

import pathlib
import re
import sys

import pytest

import tiltproof
from conftest import BUILD
from test_devices_and_clients import DUPLEX

PAGE = (pathlib.Path(__file__).resolve().parents[2] / "docs/python.md").read_text(encoding="utf-8")
LIBRARY = f"library:{BUILD / 'lib/minimal_firmware.so'}"
HOVER = """\
name: hover
duration_s: 12
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


def example(word: str) -> str:
    """The only one that has this word."""
    (found,) = (block for block in re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S) if word in block)
    return str(found).replace("library:my_firmware.so", LIBRARY)


@pytest.fixture
def hover(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hover.yaml").write_text(HOVER, encoding="utf-8")


@pytest.mark.usefixtures("hover")
def test_the_test_in_ten_lines() -> None:
    text = example("def test_survives_a_late_link")
    assert len([line for line in text.splitlines() if line.strip()]) <= 10
    names: dict[str, object] = {"tiltproof": tiltproof}
    exec(text, names)
    names["test_survives_a_late_link"]()  # type: ignore[operator]
    (verdict,) = pathlib.Path("results/latest").glob("*/verdict.json")
    assert '"verdict": "pass"' in verdict.read_text(encoding="utf-8")


@pytest.mark.usefixtures("hover")
def test_two_firmwares_side_by_side() -> None:
    exec(example('for build in ("paper", "tolerant")'), {"tiltproof": tiltproof})


def test_two_clients_on_one_vehicle(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "duplex.yaml").write_text(DUPLEX, encoding="utf-8")
    exec(example('tiltproof.fly("duplex.yaml"'), {"tiltproof": tiltproof})


@pytest.mark.usefixtures("hover")
def test_the_controller() -> None:
    pathlib.Path("controller.py").write_text(example("from tiltproof.program import"), encoding="utf-8")
    with tiltproof.fly("hover.yaml", client=f"program:{sys.executable} controller.py", report=False) as flight:
        flight.advance(2)
        flight.inject("wire.bit_error", id="noise", target="both", ber=2e-4, duration_s=1)
        flight.advance(2)
        flight.inject("device.reset", id="reset", boot_ms=20)
        flight.advance(1)
        flight.inject("plant.force", id="push", force_n=0.5, direction=[1, 0, 0])
    result = flight.result
    assert result.verdict == "pass", result
    assert min(result.activations.values()) > 0, result.activations
    assert result.replays()
