"""Faults on a device or a clock that a script injects, and flights with several clients: each is that of a file."""

from __future__ import annotations

import json
import pathlib
import subprocess
import textwrap

import pytest

import tiltproof
from conftest import IMAGE, PROGRAM, CLIMB

DUPLEX = """\
name: duplex
duration_s: 4
reference: {type: hover, at_m: [0, 0, 2]}
clients: [{id: a, firmware: paper}, {id: b, firmware: tolerant}]
arbiter: {type: primary_backup, order: [a, b], timeout_ms: 36}
criteria:
  - {name: stays-near, stl: "always(position_error_m <= 2)"}
"""


def hash_of_a_file(text: str, *clients: str) -> str:
    """Of the flight that `run` flies."""
    pathlib.Path("whole.yaml").write_text(text, encoding="utf-8")
    flags = [flag for client in clients for flag in ("--client", client)]
    subprocess.run(
        [tiltproof.find_program(), "run", "whole.yaml", "--no-report", "--out", "run", *flags], stdout=subprocess.DEVNULL, check=False
    )
    (verdict,) = pathlib.Path("run/latest").glob("*/verdict.json")
    return str(json.loads(verdict.read_text(encoding="utf-8"))["trace_hash"])


@pytest.fixture(params=["host", "program"])
def called(request: pytest.FixtureRequest) -> str:
    """A client that acts when it is called."""
    if request.param == "program" and not PROGRAM.is_file():
        pytest.skip("the example of a program is not built")
    return "host" if request.param == "host" else f"program:{PROGRAM}"


def test_faults_on_the_device_and_its_clock(scenario: pathlib.Path, called: str) -> None:
    with tiltproof.fly(scenario, client=called, seed=1, report=False) as flight:
        flight.advance(1.2)
        flight.inject("clock.drift", id="drift", node="client", ppm=3000, duration_s=2)
        flight.advance(0.6)
        flight.inject("clock.jump", id="jump", node="client", jump_ms=7, duration_s=1)
        flight.advance(0.6)
        flight.inject("device.task_delay", id="task", delay_ms=3, every_ms=25, duration_s=1)
        flight.advance(0.6)
        flight.inject("device.reset", id="reset", boot_ms=30)
    result = flight.result
    assert min(result.activations.values()) > 0, result.activations
    assert result.replays()


def test_an_image_takes_those_on_the_processor(scenario: pathlib.Path) -> None:
    if not IMAGE.is_file():
        pytest.skip("no images are built")
    with tiltproof.fly(scenario, client=f"qemu:{IMAGE}", report=False) as flight:
        flight.advance(1.2)
        flight.inject("device.stall", id="stall", duration_s=0.05)
        flight.advance(0.6)
        flight.inject("device.task_delay", id="task", delay_ms=3, every_ms=25, duration_s=1)
        flight.advance(0.6)
        flight.inject("device.bit_flip", id="flip", region="stack", bit_count=1)
        flight.advance(0.6)
        flight.inject("device.reset", id="reset", boot_ms=5)
        with pytest.raises(tiltproof.RequestError, match="put it into the scenario"):
            flight.inject("clock.drift", ppm=100)
        with pytest.raises(tiltproof.RequestError, match="no_such_object"):
            flight.inject("device.bit_flip", region="no_such_object", bit_count=1)
    result = flight.result
    assert min(result.activations.values()) > 0, result.activations
    assert result.replays()


def test_what_has_no_place_in_virtual_time(scenario: pathlib.Path) -> None:
    with tiltproof.fly(scenario, report=False) as flight:
        for type, keys, message in (
            ("node.pause", {"node": "plant", "duration_s": 1}, "realtime"),
            ("clock.drift", {"node": "plant", "ppm": 10}, "realtime"),
            ("device.stall", {"duration_s": 1}, "emulated board"),
        ):
            with pytest.raises(tiltproof.RequestError, match=message):
                flight.inject(type, **keys)
        reset = flight.inject("device.reset", boot_ms=5)
        with pytest.raises(tiltproof.RequestError, match="on the device"):
            flight.remove(reset)
        flight.stop()


def test_several_clients_on_one_vehicle(scenario: pathlib.Path) -> None:
    scenario.write_text(DUPLEX, encoding="utf-8")
    with tiltproof.fly(scenario, seed=2) as flight:
        flight.advance(0.6)
        assert flight["sensed_a_z_m"] == pytest.approx(2, abs=0.1)
        flight.inject("sensor.bias", client="b", id="bias", signal="z_m", offset=0.5)
        flight.advance(0.3)
        assert flight["sensed_b_z_m"] - flight["sensed_a_z_m"] == pytest.approx(0.5)
        flight.inject("device.reset", client="a", id="reset", boot_ms=120)
        flight.until("arbiter_selected > 0", timeout_s=1)
        flight.inject("frame.drop", target="to_plant", client="b", id="loss", probability=0.2, duration_s=1)
        flight.advance(0.3)
        with pytest.raises(tiltproof.RequestError, match="there is no client 'c'"):
            flight.inject("device.reset", client="c", boot_ms=5)
    result = flight.result
    assert result.activations["reset"] == 1 and result.activations["loss"] > 0
    assert "timing.b.firmware_missed_count" in result.metrics
    assert (pathlib.Path(flight.folder).parent / "report.html").is_file()
    assert result.replays()


def test_each_client_is_what_it_is_named(scenario: pathlib.Path) -> None:
    if not PROGRAM.is_file():
        pytest.skip("the example of a program is not built")
    scenario.write_text(DUPLEX, encoding="utf-8")
    clients = {"a": "host", "b": f"program:{PROGRAM}"}
    with tiltproof.fly(scenario, client=clients, report=False) as flight:
        flight.advance(0.6)
        flight.inject("frame.delay", target="to_client", client="b", id="late", mean_ms=4, duration_s=1)
    whole = DUPLEX + textwrap.dedent("""\
        faults:
          - {id: late, type: frame.delay, target: to_client, client: b, start_s: 0.6, end_s: 1.6, parameters: {mean_ms: 4}}
        """)
    assert hash_of_a_file(whole, *(f"{id}={client}" for id, client in clients.items())) == flight.result.trace_hash
