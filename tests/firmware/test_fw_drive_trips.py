# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Trips and automatic restarts on the host: what a lost lock explains is started over, all else has its name."""

from __future__ import annotations

import pytest

from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import FAN_1, Bench, fault_of

PHASE, DC, PIN, LOST, OVER_VOLTAGE, UNDER_VOLTAGE, DEADLINE = 1, 2, 4, 8, 16, 32, 128


def running(rpm: int = 20_000, seconds: float = 0.3, **drive: object) -> Bench:
    """A drive at speed, with some friction."""
    bench = Bench(load=FAN_1.model_copy(update={"coulomb_nm": 1e-3}), drive=machines.drive(**drive))
    bench.start(rpm)
    bench.run(seconds)
    return bench


def trips_in(bench: Bench, phase: str, causes: int, seconds: float = 5.0) -> int:
    """Trips at every tick of a phase of the start with gates on, until the drive gives up or runs; how many."""
    before = bench.trips

    def ended() -> bool:
        if bench.get("safety.guard") & 1 and bench.fw.state == "starting" and bench.fw.phase == phase:
            bench.trip(causes)
        return bench.fw.state in ("fault", "running")

    assert bench.run(seconds, ended), bench.fw.command("status")
    return bench.trips - before


def logged(bench: Bench) -> list[str]:
    """Names in the fault log, the newest first."""
    return [line.split()[1] for line in bench.fw.command("faults") if line.startswith("fault ")]


def test_over_current_of_a_start_is_excused_once() -> None:
    """Before the lock is there: the first over-current starts over, the second one is a fault; so after every command.

    Verifies: FW-18, FW-20
    """
    bench = Bench(load=FAN_1.model_copy(update={"coulomb_nm": 1e-3}))
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    for commands in (1, 2):
        bench.fw.command("start")
        bench.run(0.0002)
        assert trips_in(bench, "lock", PHASE) == 2
        assert (bench.fw.state, fault_of(bench)) == ("fault", "phase_over_current")
        assert logged(bench) == ["phase_over_current"] * 2 * commands
        bench.fw.command("clear")
        assert bench.until_state("ready", 0.1)


@pytest.mark.parametrize(("cause", "name"), [(PHASE, "phase_over_current"), (DC, "dc_over_current")])
def test_over_current_of_the_restart_is_excused_once(cause: int, name: str) -> None:
    """After a lost lock, at each precharge: gates turn on into it twice, then it has its own name.

    Verifies: FW-18, FW-20
    """
    bench = running(start={"catch": False})
    bench.trip(LOST)
    bench.run(0.0003)
    assert trips_in(bench, "precharge", cause) == 2
    assert (bench.fw.state, fault_of(bench)) == ("fault", name)
    assert logged(bench) == [name, name, "lost_lock"]


def test_crossings_that_stay_away_from_a_turning_rotor() -> None:
    """Caught and driven against the EMF without crossings: the over-current is excused once, then a fault.

    Verifies: FW-18, FW-20
    """
    bench = running()
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("fault", 1.0)
    assert (fault_of(bench), bench.trips) == ("phase_over_current", 2)
    assert logged(bench) == ["phase_over_current", "lost_lock", "phase_over_current"]


def test_a_second_of_running_renews_the_excuse() -> None:
    """An over-current is excused again when the drive has run for a second, as restarts are allowed again then.

    Verifies: FW-20
    """
    bench = running(start={"catch": False})
    for _ in range(2):
        bench.trip(LOST)
        assert bench.run(5.0, lambda: bench.fw.phase == "precharge")
        bench.trip(PHASE)
        bench.run(0.0003)
        assert (bench.fw.state, bench.fw.phase) == ("starting", "coast")
        assert bench.until_state("running", 5.0)
        bench.run(1.1)
    assert logged(bench) == ["phase_over_current", "lost_lock"] * 2


@pytest.mark.parametrize(
    ("later", "monitor", "name"),
    [
        (PIN, 0, "fault_pin"),
        (OVER_VOLTAGE, 0, "over_voltage"),
        (DEADLINE, 0, "deadline"),
        (DEADLINE, 1 << 2, "settings_changed"),
    ],
)
def test_restart_clears_only_what_it_explains(later: int, monitor: int, name: str) -> None:
    """A trip behind a lost lock, gone again before anybody looked, is a fault by its own name, not a restart.

    Verifies: FW-18, FW-20
    """
    bench = running()
    bench.trip(LOST)
    bench.trip(later)
    bench.put("safety.monitor", monitor)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", name)
    assert bench.get("safety.guard") & 1 == 0
    assert bench.get("safety.trip") & 0xFF == LOST | later, "nothing is cleared"


def test_lost_lock_explains_what_follows_from_it() -> None:
    """A link that falls, or the rotor's current, behind a lost lock: the drive starts again, the current is logged.

    Verifies: FW-20
    """
    for later, names in ((UNDER_VOLTAGE, ["lost_lock"]), (PHASE, ["lost_lock", "phase_over_current"])):
        bench = running()
        bench.trip(LOST)
        bench.trip(later)
        bench.run(0.0003)
        assert bench.fw.state == "starting"
        assert bench.until_state("running", 1.0)
        assert logged(bench) == names


def test_excused_over_current_hides_no_other_trip() -> None:
    """An over-current after missed crossings, the driver's fault behind it: the latter is the fault, both are logged.

    Verifies: FW-18, FW-20
    """
    bench = running()
    bench.model.s[am.TIMEOUTS] += 2
    bench.trip(PHASE)
    bench.trip(PIN)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "fault_pin")
    assert logged(bench) == ["fault_pin", "phase_over_current"]


@pytest.mark.parametrize(
    ("cause", "monitor", "name"),
    [(PIN, 0, "fault_pin"), (PHASE, 0, "phase_over_current"), (DEADLINE, 1, "watchdog")],
)
@pytest.mark.parametrize("masked", [UNDER_VOLTAGE, LOST])
def test_ready_names_what_comes_behind_a_masked_trip(masked: int, cause: int, monitor: int, name: str) -> None:
    """With gates off a low link and a lost lock mean nothing; what is latched behind them does.

    Verifies: FW-18
    """
    bench = Bench()
    assert bench.until_state("ready", 0.1)
    bench.trip(masked, now=masked)
    bench.run(0.002)
    assert (bench.fw.state, fault_of(bench)) == ("ready", "none")
    bench.trip(cause)
    bench.put("safety.monitor", monitor)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", name)


def test_over_current_while_stopping_is_a_fault() -> None:
    """Missed crossings or not: nothing starts again, so that there is nothing to excuse.

    Verifies: FW-18
    """
    bench = running()
    bench.fw.command("stop")
    bench.run(0.001)
    bench.model.s[am.TIMEOUTS] += 2
    bench.trip(PHASE)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench), logged(bench)) == ("fault", "phase_over_current", ["phase_over_current"])


@pytest.mark.parametrize(("cause", "state"), [(PIN, "fault"), (PHASE, "starting")])
def test_jammed_rotor_hides_no_trip(cause: int, state: str) -> None:
    """A trip in the very tick in which the speed becomes impossible is not cleared unseen by the restart.

    Verifies: FW-18, FW-20
    """

    def jammed() -> Bench:
        bench = Bench(drive=machines.drive(start={"retries": 1}))
        bench.start(8_000, 0.35)
        bench.run(1.1)
        bench.model.m[am.M_LOCKED] = 1.0
        bench.model.m[am.M_GHOST] = 400e-6
        return bench

    alone = jammed()
    assert alone.until_state("starting", 0.05)
    bench = jammed()
    while bench.ticks < alone.ticks - 1:
        bench.step()
    assert bench.fw.state == "running"
    bench.trip(cause)
    bench.step()
    assert bench.fw.state == state
    assert logged(bench) == {PIN: ["fault_pin"], PHASE: ["lost_lock", "phase_over_current"]}[cause]
