"""Ten tests as an engineer writes them, with what they prove about the module."""

from __future__ import annotations

import os
import pathlib
import signal
import subprocess
import sys
import textwrap
import time

import pytest

import tiltproof
from conftest import BUILD, CLIMB, IMAGE


def flown_from_a_file(text: str, client: str = "host", seed: int | None = None) -> tiltproof.Result:
    """The same without a script."""
    file = pathlib.Path("whole.yaml")
    file.write_text(text, encoding="utf-8")
    with tiltproof.fly(file, client=client, seed=seed) as flight:
        pass
    # A flight that nobody steers is itself that of `run`.
    done = subprocess.run(
        [tiltproof.find_program(), "run", file, "--client", client, "--no-report", "--out", "run"]
        + ([] if seed is None else ["--seed", str(seed)]),
        stdout=subprocess.DEVNULL, check=False,
    )
    assert done.returncode in (0, 1, 4)
    (verdict,) = pathlib.Path("run/latest").glob("*/verdict.json")
    assert f'"{flight.result.trace_hash}"' in verdict.read_text(encoding="utf-8")
    return flight.result


def test_takes_off(scenario: pathlib.Path, client: str) -> None:
    with tiltproof.fly(scenario, client=client) as flight:
        assert flight["z_m"] == 1
        flight.until("z_m > 2", timeout_s=5)
        assert 2 < flight["z_m"] < 2.1
        # It is the first row of the trace at which this holds.
        reached_s = flight.time_s
        flight.advance(1)
        assert flight["position_error_m"] < 0.5
    trace = flight.result.trace
    assert next(t for t, z in zip(trace["t_s"], trace["z_m"]) if z > 2) == reached_s
    assert flight.result.verdict == "pass" and flight.result.margin is not None and flight.result.margin > 0
    # Without a fault, too, which an emulated board might notice.
    assert flight.result.replays()


def test_a_fault_from_a_script_is_that_of_a_file(scenario: pathlib.Path, client: str) -> None:
    with tiltproof.fly(scenario, client=client, seed=3) as flight:
        flight.inject("wire.bit_error", target="both", id="noise", ber=0.0005)
        flight.advance(2.4)
        flight.inject("frame.delay", target="to_client", id="late", duration_s=2, mean_ms=3, jitter_ms=1, distribution="normal")
        flight.inject("sensor.delay", id="old", signal="z_m", delay_ms=60, duration_s=1.5)
        flight.advance(1.2)
        flight.inject("actuator.rate_limit", id="slow", actuator="f_r", rate_per_s=0.5)
        flight.remove("noise")
    result = flight.result
    assert min(result.activations.values()) > 0, result.activations
    whole = flown_from_a_file(CLIMB + textwrap.dedent("""\
        faults:
          - {id: noise, type: wire.bit_error, target: both, start_s: 0, end_s: 3.6, parameters: {ber: 0.0005}}
          - {id: late, type: frame.delay, target: to_client, start_s: 2.4, end_s: 4.4, parameters: {mean_ms: 3, jitter_ms: 1, distribution: normal}}
          - {id: old, type: sensor.delay, start_s: 2.4, end_s: 3.9, parameters: {signal: z_m, delay_ms: 60}}
          - {id: slow, type: actuator.rate_limit, start_s: 3.6, parameters: {actuator: f_r, rate_per_s: 0.5}}
        """), client, seed=3)
    assert whole.trace_hash == result.trace_hash
    assert whole.activations == result.activations
    assert result.replays()


def test_a_fault_at_the_edge_of_a_condition(scenario: pathlib.Path) -> None:
    with tiltproof.fly(scenario) as flight:
        flight.until("z_m > 1.5 and vz_m_s > 0.2")
        flight.inject("actuator.loss_of_effectiveness", id="weak", actuator="f_r", factor=0.8)
    whole = flown_from_a_file(CLIMB + textwrap.dedent("""\
        faults:
          - {id: weak, type: actuator.loss_of_effectiveness, when: "z_m > 1.5 and vz_m_s > 0.2", edge: rising, parameters: {actuator: f_r, factor: 0.8}}
        """))
    assert whole.trace_hash == flight.result.trace_hash


@pytest.mark.parametrize("mean_ms, survives", [(0.5, True), (4, True), (20, False)])
def test_survives_late_replies(scenario: pathlib.Path, mean_ms: float, survives: bool) -> None:
    with tiltproof.fly(scenario) as flight:
        flight.advance(1)
        flight.inject("frame.delay", target="to_client", mean_ms=mean_ms)
        if survives:
            flight.advance(6)
            assert flight["tilt_rad"] < 0.5
        else:
            with pytest.raises(tiltproof.FlightOver) as lost:
                flight.until("t_s > 7.9")
            assert lost.value.result.verdict == "fail"
    assert (flight.result.verdict == "pass") == survives


def test_two_firmwares_side_by_side(scenario: pathlib.Path) -> None:
    largest = {"paper": 0.0, "tolerant": 0.0}
    flights = {name: tiltproof.fly(scenario, firmware=name, seed=5) for name in largest}
    for flight in flights.values():
        flight.advance(1)
        flight.inject("frame.drop", target="to_client", probability=0.6, duration_s=2)
    for _ in range(25):
        for name, flight in flights.items():
            flight.advance(0.12)
            largest[name] = max(largest[name], flight["position_error_m"])
    results = {name: flight.finish() for name, flight in flights.items()}
    assert largest["tolerant"] < largest["paper"]
    assert results["tolerant"].trace_hash != results["paper"].trace_hash


def test_a_variable_of_the_image(scenario: pathlib.Path) -> None:
    if not IMAGE.is_file():
        pytest.skip("no images are built")
    with tiltproof.fly(scenario, client=f"qemu:{IMAGE}", watch=["tiltproof_status.failsafe_count"]) as flight:
        signal_name = next(name for name in flight.signals if name.startswith("watch_"))
        flight.advance(1)
        before = flight[signal_name]
        flight.inject("sensor.bias", signal="x_m", offset=0.01)
        flight.until(f"{signal_name} >= {before}")
        flight.advance(0.5)
        seen = flight[signal_name], flight.time_s
    trace = flight.result.trace
    assert trace[signal_name][round(seen[1] / flight.period_s)] == seen[0] == before
    assert flight.result.replays()


def test_a_stopped_flight_replays(scenario: pathlib.Path, client: str) -> None:
    with tiltproof.fly(scenario, client=client) as flight:
        flight.advance(0.6)
        fault = flight.inject("frame.drop", target="to_plant", probability=0.3)
        flight.inject("wire.byte_drop", target="to_client", id="never", probability=1)
        flight.remove("never")
        flight.advance(1.2)
        flight.remove(fault)
        flight.advance(0.3)
        result = flight.stop()
        with pytest.raises(tiltproof.FlightOver, match="completed"):
            flight.advance(1)
    assert result is flight.result
    assert result.trace["t_s"][-1] == pytest.approx(flight.time_s) and flight.time_s < 2.2
    assert result.activations[fault] > 0 and result.activations["never"] == 0
    assert result.replays()


def test_a_failing_assertion_says_where(scenario: pathlib.Path) -> None:
    test = pathlib.Path("test_too_strict.py")
    test.write_text(textwrap.dedent("""\
        import tiltproof
        def test_climbs():
            with tiltproof.fly("climb.yaml") as flight:
                flight.advance(1.2)
                assert flight["z_m"] > 3
        """), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", test], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "assert flight[\"z_m\"] > 3" in done.stdout
    folder = next(pathlib.Path("results").resolve().glob("2*/climb"))
    assert f"flight: at 1.2 s of climb; folder: {folder}; again: " in done.stdout
    assert f"replay {folder}" in done.stdout
    assert (folder / "verdict.json").is_file()


def test_mistakes_are_named_and_change_nothing(scenario: pathlib.Path) -> None:
    with pytest.raises(tiltproof.Error, match=r"climb.yaml: .*|no such"):
        tiltproof.fly("climbb.yaml")
    with pytest.raises(tiltproof.Error, match=r"--set.*no_such_key"):
        tiltproof.fly(scenario, set={"no_such_key": 3})
    with tiltproof.fly(scenario) as flight:
        flight.advance(0.5)
        at_s = flight.time_s
        mistakes = {
            "unknown signal 'z'": lambda: flight["z"],
            "until:1:1": lambda: flight.until("hight > 2"),
            "seconds from 0": lambda: flight.advance(-1),
            "frame.drop": lambda: flight.inject("frame.dorp", target="to_client", probability=1),
            "probability": lambda: flight.inject("frame.drop", target="to_client", probability=7),
            "duration_s says for how long": lambda: flight.inject("frame.drop", target="to_client", probability=1, keys={"start_s": 9}),
            "needs an emulated board": lambda: flight.inject("device.stall", duration_s=1),
            "no fault 'lat'": lambda: flight.remove("lat"),
        }
        for message, mistake in mistakes.items():
            with pytest.raises(tiltproof.RequestError) as found:
                mistake()
            assert message in str(found.value), str(found.value)
        with pytest.raises(tiltproof.NotReached, match="'z_m > 9' did not hold from 0.504 s to 1.008 s"):
            flight.until("z_m > 9", timeout_s=0.5)
        assert at_s == pytest.approx(0.504)
    assert flight.result.trace_hash == flown_from_a_file(CLIMB).trace_hash


def test_a_script_that_dies_leaves_no_process(scenario: pathlib.Path) -> None:
    script = subprocess.Popen(
        [sys.executable, "-c", "import tiltproof, sys, time\nf = tiltproof.fly('climb.yaml')\nf.advance(1)\nprint(f._session.pid, flush=True)\ntime.sleep(60)"],
        stdout=subprocess.PIPE, text=True,
    )
    assert script.stdout is not None
    session = int(script.stdout.readline())
    script.send_signal(signal.SIGKILL)
    script.wait()
    deadline = time.monotonic() + 20
    while pathlib.Path(f"/proc/{session}").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not pathlib.Path(f"/proc/{session}").exists()
    (verdict,) = pathlib.Path("results/latest").glob("*/verdict.json")
    assert '"end_reason": "completed"' in verdict.read_text(encoding="utf-8")


def test_a_forked_child_does_not_hold_the_end_up(scenario: pathlib.Path) -> None:
    with tiltproof.fly(scenario) as flight:
        flight.advance(0.1)
        child = os.fork()  # with all open files, the standard input of the session among them
        if child == 0:
            signal.pause()
            os._exit(0)
        try:
            began = time.monotonic()
            assert flight.stop().end_reason == "completed"
            assert time.monotonic() - began < 20
        finally:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def test_a_firmware_that_crashes_does_not_take_the_script_along(scenario: pathlib.Path) -> None:
    library = BUILD / "tests/clients/libmisbehaving_client.so"
    if not library.is_file():
        pytest.skip("the misbehaving client is not built")
    with tiltproof.fly(scenario, client=f"library:{library}", firmware="crash") as flight:
        with pytest.raises(tiltproof.FlightOver):
            flight.advance(5)
    assert flight.result.end_reason == "firmware_crashed"
    assert f"crashed at {flight.time_s:.3f} s" in flight.result.reason and flight.time_s > 0


def test_a_killed_worker_is_an_answer(scenario: pathlib.Path) -> None:
    with tiltproof.fly(scenario) as flight:
        flight.advance(1)
        session = flight._session.pid
        (worker,) = pathlib.Path(f"/proc/{session}/task/{session}/children").read_text(encoding="utf-8").split()
        os.kill(int(worker), signal.SIGKILL)
        with pytest.raises(tiltproof.FlightOver, match="killed by signal 9"):
            flight.advance(1)
    assert flight.result.verdict == "error"


def test_an_exception_inside_a_call_drops_its_answer(scenario: pathlib.Path) -> None:
    class TimeIsUp(Exception):
        pass

    def interrupt(*_: object) -> None:
        raise TimeIsUp

    scenario.write_text(CLIMB.replace("duration_s: 8", "duration_s: 600"), encoding="utf-8")
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with tiltproof.fly(scenario) as flight:
            signal.setitimer(signal.ITIMER_REAL, 0.01)
            with pytest.raises(TimeIsUp):
                while True:
                    flight.advance(0.1)
            at_s = flight.advance(0.5)
            assert flight.read("z_m").keys() == {"z_m"}
            with pytest.raises(tiltproof.NotReached):
                flight.until("z_m > 900", timeout_s=0.5)
            assert flight.time_s == pytest.approx(at_s + 0.5, abs=0.013)
            flight.stop()
        # The flight ends as ever, also when such an exception leaves the block.
        with pytest.raises(TimeIsUp):
            with tiltproof.fly(scenario) as flight:
                signal.setitimer(signal.ITIMER_REAL, 0.01)
                while True:
                    flight.advance(0.1)
        assert 0 < flight.time_s < 600
        assert (pathlib.Path(flight.folder) / "trace.csv").is_file()
    finally:
        signal.signal(signal.SIGALRM, before)


def test_a_flight_that_cannot_be_judged_raises(scenario: pathlib.Path) -> None:
    with pytest.raises(tiltproof.Error, match="no-such-program"):
        with tiltproof.fly(scenario, client="program:exec ./no-such-program"):
            pass


def test_a_killed_session_is_named(scenario: pathlib.Path) -> None:
    with pytest.raises(tiltproof.Error, match="ended without an answer, with code -9"):
        with tiltproof.fly(scenario) as flight:
            flight.advance(1)
            flight._session.kill()
            flight.advance(1)


def test_margins_and_campaigns_are_rows(scenario: pathlib.Path) -> None:
    scenario.write_text(CLIMB + "faults:\n  - {id: late, type: frame.delay, target: to_client, start_s: 1, end_s: 6, parameters: {mean_ms: 1}}\n", encoding="utf-8")
    margin = tiltproof.margin(scenario, "late", tolerance=0.5, high=30, repeats=1)
    assert margin.parameter == "mean_ms" and margin.survives is not None and margin.fails is not None
    assert 0 < margin.survives < margin.fails <= 30
    subprocess.run([tiltproof.find_program(), "campaign", scenario, "--runs", "3", "--out", "camp"], stdout=subprocess.DEVNULL, check=False)
    rows = tiltproof.campaign("camp")
    assert [row["number"] for row in rows] == [0, 1, 2] or [row["number"] for row in rows] == [1, 2, 3]
    assert all(row["verdict"] in ("pass", "fail", "inconclusive") and row["criteria"] for row in rows)
    with pytest.raises(tiltproof.Error, match="campaign.sqlite"):
        tiltproof.campaign("no-such-folder")
