# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over the averaged model: named faults, trips, lost locks and restarts."""

from __future__ import annotations

import pytest

from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import FAN_1, Bench, fault_of


def test_wrong_offset_is_a_named_fault() -> None:
    """A current sensor far off its mid-scale does not come to ready; clear measures again.

    Verifies: FW-14, FW-18
    """
    bench = Bench()
    bench.fw.auto_zero_offsets[4] = 1700 * 16
    bench.run(0.005)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "current_offset")
    bench.fw.auto_zero_offsets[4] = 2050 * 16
    assert bench.fw.command("clear") == ["ok"]
    assert bench.until_state("ready", 0.005)
    assert fault_of(bench) == "none"


@pytest.mark.parametrize(
    ("cause", "name"),
    [
        (1, "phase_over_current"),
        (2, "dc_over_current"),
        (4, "fault_pin"),
        (16, "over_voltage"),
        (32, "under_voltage"),
        (64, "software_trip"),
        (1 | 4, "phase_over_current"),
    ],
)
def test_trips_have_names_and_can_be_cleared(cause: int, name: str) -> None:
    """Every trip opens the gates and names its first cause; clear, then a new start runs again.

    Verifies: FW-18
    """
    bench = Bench()
    bench.start(30_000)
    bench.run(0.2)
    bench.trip(cause)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", name)
    assert bench.get("safety.guard") & 1 == 0
    assert bench.fw.command("start") == ["error: not ready"]
    assert any(line.startswith(f"fault {name} ") for line in bench.fw.command("faults"))
    assert bench.fw.command("clear") == ["ok"]
    assert bench.until_state("ready", 0.01)
    bench.start(30_000, 5.0)


def test_cause_still_present_is_a_fault_again() -> None:
    """Clearing does not help while the cause persists.

    Verifies: FW-18
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    bench.trip(4, now=4)
    bench.run(0.001)
    assert fault_of(bench) == "fault_pin"
    bench.fw.command("clear")
    bench.run(0.01)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "fault_pin")


def test_real_over_current_in_the_model_trips() -> None:
    """A rotor that stops dead drives the current into the trip; the fault is named.

    Verifies: FW-18
    """
    bench = Bench(drive=machines.drive(start={"restart_retries": 0}))
    bench.start(60_000)
    bench.run(0.6)
    bench.model.m[am.M_LOCKED] = 1.0
    assert bench.until_state("fault", 0.5)
    assert fault_of(bench) in ("phase_over_current", "lost_lock")
    assert bench.get("safety.guard") & 1 == 0


def test_lost_lock_restarts_by_itself() -> None:
    """Crossings vanish for a while: gates open, the rotor coasts, the drive starts anew and comes back to speed.

    Verifies: FW-20
    """
    bench = Bench(load=FAN_1.model_copy(update={"coulomb_nm": 1e-3}))
    bench.start(20_000)
    bench.run(0.3)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("starting", 0.1)
    assert bench.get("safety.guard") & 1 == 0
    bench.model.m[am.M_BLIND] = 0.0
    assert bench.until_state("running", 5.0)
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(20_000, rel=0.005)
    assert bench.fw.command("get lost_locks") == ["lost_locks 1", "ok"]


def test_restarts_are_limited() -> None:
    """Without crossings every attempt fails: after the retries a named fault, gates off.

    Verifies: FW-20
    """
    bench = Bench(
        load=FAN_1.model_copy(update={"coulomb_nm": 1e-3}), drive=machines.drive(start={"retries": 2, "catch": False})
    )
    bench.start(20_000)
    bench.run(0.2)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("fault", 10.0)
    assert fault_of(bench) == "start_failed"
    bench = Bench(drive=machines.drive(start={"restart_retries": 0}))
    bench.start(20_000)
    # Sooner it would be a lock that never was: a start that failed.
    bench.run(1.1)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("fault", 1.0)
    assert fault_of(bench) == "lost_lock"


def test_unseen_rotor_shorted_by_the_precharge_of_a_restart() -> None:
    """Voltage channels that hide the EMF let the precharge short a turning rotor: open, wait longer, start again.

    Verifies: FW-20
    """
    bench = Bench(load=FAN_1.model_copy(update={"coulomb_nm": 1e-3}), drive=machines.drive(start={"catch": False}))
    bench.start(20_000)
    bench.run(0.3)
    bench.trip(8)  # lost lock: an over-current before would have used up the excuse
    assert bench.until_state("starting", 0.1)
    assert bench.run(5.0, lambda: bench.fw.phase == "precharge")
    bench.trip(1)
    bench.run(0.0003)
    assert (bench.fw.state, bench.fw.phase) == ("starting", "coast")
    assert bench.get("safety.guard") & 1 == 0
    assert bench.until_state("running", 5.0)


def test_locked_rotor_fails_to_start_by_name() -> None:
    """A rotor that cannot turn: start_failed after the retries, current bounded by the start current.

    Verifies: FW-20
    """
    bench = Bench(drive=machines.drive(start={"retries": 1, "current_a": 6.0}))
    bench.model.m[am.M_LOCKED] = 1.0
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    assert bench.until_state("fault", 3.0)
    assert fault_of(bench) == "start_failed"
    assert bench.model.s[am.I_PEAK] < 45.0


def test_voltage_outside_of_its_range_refuses_to_start() -> None:
    """Start at a wrong supply is a named fault.

    Verifies: FW-18
    """
    for supply, name in ((12.0, "under_voltage"), (29.9, "over_voltage")):
        bench = Bench()
        bench.model.m[am.M_VDC] = supply
        bench.until_state("ready", 0.1)
        bench.fw.command("set speed_rpm 20000")
        bench.fw.command("start")
        bench.run(0.05)
        assert (bench.fw.state, fault_of(bench)) == ("fault", name)


def test_silent_converter_is_a_fault() -> None:
    """No new samples for three ticks while running.

    Verifies: FW-18
    """
    bench = Bench()
    bench.start(20_000)
    bench.sampling = False
    bench.run(0.001)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "no_samples")


@pytest.mark.parametrize(("share", "fault"), [(0.6, "none"), (0.4, "no_samples"), (0.02, "no_samples")])
def test_slow_converter_is_a_fault(share: float, fault: str) -> None:
    """A share of the samples of a tick, before any gate is on: with less than half of them no drive starts.

    Verifies: FW-18
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    bench.tick_samples = round(share * bench.tick_samples)
    bench.run(0.001)
    assert (bench.fw.state, fault_of(bench)) == ("ready" if fault == "none" else "fault", fault)


@pytest.mark.parametrize(("driven", "after_s"), [(True, 0.2), (False, 5.2)])
def test_main_loop_that_does_not_come_round(driven: bool, after_s: float) -> None:
    """An active drive stops after the window of its main loop; an idle one has the time in which the flash is written.

    Verifies: FW-93
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    if driven:
        bench.start(20_000)
    app = bench.fw.lib.fl_host_app()
    bench.fw.lib.app_watch(app, 1)
    state = bench.fw.state
    begin = bench.now
    assert not bench.run(after_s - 0.01, lambda: bench.fw.state != state)
    assert bench.run(0.02, lambda: bench.fw.state == "fault")
    assert after_s - 1e-3 < bench.now - begin < after_s + 1e-3
    app.works = 0
    assert fault_of(bench) == "main_loop"


def test_over_current_after_scattered_misses_is_a_lost_lock() -> None:
    """Crossings missed now and then, never two in a row: an over-current then restarts; one without misses is a fault.

    Verifies: FW-20
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    for _ in range(2):
        bench.model.s[am.TIMEOUTS] += 1
        bench.run(0.002)
    bench.trip(1)
    bench.run(0.0003)
    assert bench.fw.state == "starting"
    assert bench.until_state("running", 0.05)
    bench.run(0.1)
    bench.trip(1)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "phase_over_current")


@pytest.mark.parametrize("value_q17", [131071, 30_000, 0])
def test_stuck_voltage_channel_is_named(value_q17: int) -> None:
    """A channel that keeps its value while the rotor turns is named after 50 ms; gone, the drive starts.

    Verifies: FW-34
    """
    bench = Bench(speed_rpm=50_000.0)
    bench.stuck = {0: value_q17}
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 50000")
    bench.fw.command("start")
    assert bench.until_state("fault", 0.06)
    assert fault_of(bench) == "voltage_channel"
    assert bench.get("safety.guard") & 1 == 0
    bench.stuck = {}
    bench.fw.command("clear")
    bench.until_state("ready", 0.1)
    bench.fw.command("start")
    assert bench.until_state("running", 0.05)
