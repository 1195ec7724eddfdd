# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over the averaged model: boot, start, hand-over, other machines."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.config import Inverter, Load, Motor
from fluxlock.firmware.design import Design
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import FAN_1, OTHERS, Bench


def test_boot_measures_offsets_with_gates_off() -> None:
    """From reset to ready in less than 2 ms, offsets measured, gates disabled all the time.

    Verifies: FW-14
    """
    bench = Bench()
    bench.fw.auto_zero_offsets[3:6] = (2048 * 16 + 40, 2048 * 16 - 64, 2048 * 16 + 7)
    assert bench.fw.state == "init"
    for _ in range(20):
        bench.step()
        assert bench.get("safety.guard") & 1 == 0
    assert bench.fw.state == "ready"
    assert [bench.get("sense.offset", 3 + x) for x in range(3)] == [
        2048 * 16 + 40,
        2048 * 16 - 64,
        2048 * 16 + 7,
    ]


@pytest.mark.parametrize("theta_rad", [0.0, 1.1, 2.2, 3.141592653589793, 4.4, 5.5])
def test_starts_from_any_angle_and_holds_60000(theta_rad: float) -> None:
    """Standstill to 60 000 r/min within 0.3 s + ramp; held within 0.5 %; the measured speed is the true one.

    Verifies: FW-15, FW-16
    """
    bench = Bench(theta_rad=theta_rad)
    bench.start(60_000, 0.3)
    bench.run(0.8)
    speeds = []
    for _ in range(1000):
        bench.step()
        speeds.append(bench.model.rpm)
        assert bench.fw.telemetry().speed_rpm_q8 / 256 == pytest.approx(bench.model.rpm, rel=2e-3)
    assert np.max(np.abs(np.array(speeds) / 60_000 - 1)) < 0.005
    assert bench.trips == 0


def test_start_sequence_uses_the_right_vectors() -> None:
    """All low, leg A high, leg B high, then six-step forced from sector index 4, then crossings.

    Verifies: FW-15
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    seen: list[tuple[int, tuple[int, ...], int]] = []
    while bench.fw.state != "running" and bench.now < 1.0:
        bench.step()
        manual, control = bench.get("pwm.manual"), bench.get("pwm.control")
        legs = tuple(manual >> (4 * x) & 7 for x in range(3)) if control & 3 == 1 else ()
        entry = (control & 3, legs, bench.get("comm.control") & 3)
        if not seen or seen[-1] != entry:
            seen.append(entry)
            if entry == (2, (), 1):
                assert control >> 16 & 7 == 4
    assert seen == [
        (0, (), 0),
        (1, (2, 2, 2), 0),
        (1, (3, 2, 2), 0),
        (1, (2, 3, 2), 0),
        (2, (), 1),
        (2, (), 2),
    ]


@pytest.mark.parametrize(
    "change",
    [
        {"inertia_kgm2": 1e-6},
        {"inertia_kgm2": 2.5e-7},
        {"psi_vs": 0.85e-3},
        {"psi_vs": 1.15e-3},
        {"resistance_ohm": 14e-3},
        {"resistance_ohm": 28e-3},
        {"inductance_h": 15e-6},
        {"inductance_h": 31e-6},
    ],
)
def test_start_tolerates_wrong_parameters(change: dict[str, float]) -> None:
    """The machine differs from its file by half in inertia, 15 % in flux, 40 % in R or L: it starts at once.

    Verifies: FW-15
    """
    bench = Bench(model_motor=machines.motor(**change))
    bench.start(40_000, 0.35)
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(40_000, rel=0.005)
    assert bench.trips == 0


@pytest.mark.parametrize("coulomb_nm", [1e-3, 3e-3])
def test_start_against_friction(coulomb_nm: float) -> None:
    """Coulomb friction up to 30 % of the start torque.

    Verifies: FW-15
    """
    bench = Bench(load=FAN_1.model_copy(update={"coulomb_nm": coulomb_nm}))
    bench.start(30_000, 1.0)
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


@pytest.mark.parametrize(("motor", "inverter", "load", "rpm"), OTHERS)
@pytest.mark.parametrize("direction", [1, -1])
def test_other_machines_run_from_their_files(
    motor: Motor, inverter: Inverter, load: Load, rpm: int, direction: int
) -> None:
    """2, 4 and 7 pole pairs, 15 to 48 V, to mH, trapezoidal, both directions: start, hold within 0.5 %.

    Verifies: FW-13, FW-15, FW-16
    """
    bench = Bench(motor, inverter, machines.drive(carrier_hz=30e3), load)
    bench.start(direction * rpm, 2.0)
    bench.run(2.0)
    assert bench.model.rpm == pytest.approx(direction * rpm, rel=0.005)


def test_start_waits_for_a_spinning_rotor() -> None:
    """A rotor at 40 000 r/min coasts with open gates until its EMF is small; then it is aligned and started.

    Verifies: FW-15
    """
    bench = Bench(
        speed_rpm=40_000.0,
        load=Load(fan_torque_nm=20e-3, fan_speed_rpm=20_000, coulomb_nm=3e-3),
        drive=machines.drive(start={"catch": False}),
    )
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    while bench.fw.phase == "coast" and bench.now < 5.0:
        assert bench.get("safety.guard") & 1 == 0
        bench.step()
    assert bench.model.rpm < 6_500
    assert bench.until_state("running", 1.0)
    assert bench.trips == 0


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("phase", ["align_first", "align_second"])
def test_alignment_lets_go_of_a_driven_rotor(direction: int, phase: str) -> None:
    """A load stronger than the alignment turns the rotor: gates off within 12 ms, then it is caught and runs.

    The standing voltage would brake it at growing current up to the trip.

    Verifies: FW-52
    """
    bench = Bench()
    assert bench.until_state("ready", 0.1)
    bench.fw.command(f"set speed_rpm {direction * 40_000}")
    bench.fw.command("start")
    assert bench.run(1.0, lambda: bench.fw.phase == phase)
    bench.run(0.02)
    bench.model.set_load(FAN_1.model_copy(update={"constant_nm": -direction * 50e-3}))
    assert bench.run(0.012, lambda: bench.fw.phase == "coast")
    assert bench.get("safety.guard") & 1 == 0
    assert abs(bench.model.rpm) < 7_000
    assert bench.until_state("running", 0.2)
    assert np.sign(bench.model.rpm) == direction
    assert bench.trips == 0


@pytest.mark.parametrize(
    "change",
    [{}, {"inertia_kgm2": 1e-6}, {"inertia_kgm2": 2.5e-7}, {"psi_vs": 1.15e-3}, {"resistance_ohm": 14e-3}],
)
def test_alignment_keeps_a_rotor_that_swings(change: dict[str, float]) -> None:
    """From any angle, also beside the dead point of either vector, and with a wrong file: one alignment, no second one.

    Verifies: FW-52
    """
    for theta_rad in (*np.arange(0.0, 6.3, 0.5), 3.1, 3.14, 1.06, 5.2, 5.24):
        bench = Bench(theta_rad=float(theta_rad), model_motor=machines.motor(**change))
        assert bench.until_state("ready", 0.1)
        bench.fw.command("set speed_rpm 20000")
        bench.fw.command("start")
        seen = ["coast"]
        while seen[-1] != "ramp" and bench.now < 0.5:
            bench.step()
            phase = bench.fw.phase
            if phase != seen[-1]:
                seen.append(phase)
        expected = ["coast", "precharge", "align_first", "align_second", "ramp"]
        assert seen == expected, f"theta {theta_rad:.2f} rad: phases {seen}"


def test_attempt_without_crossings_fails_without_a_trip() -> None:
    """The rotor stands as the crossings are to commutate: the attempt ends by itself, the next one runs.

    Verifies: FW-15
    """
    bench = Bench()
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    assert bench.run(1.0, lambda: bench.fw.phase == "lock")
    bench.model.m[am.M_LOCKED] = 1.0
    assert bench.run(0.5, lambda: bench.fw.phase == "coast")
    assert bench.get("safety.guard") & 1 == 0
    bench.model.m[am.M_LOCKED] = 0.0
    assert bench.run(0.5, lambda: bench.fw.phase == "ramp") and bench.run(0.5, lambda: bench.fw.phase == "lock")
    assert bench.model.s[am.CROSSINGS] >= 2, "the second ramp waits for crossings of its own"
    assert bench.until_state("running", 1.0)
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(20_000, rel=0.005)
    assert bench.trips == 0
    assert bench.fw.command("get lost_locks") == ["lost_locks 0", "ok"]


@pytest.mark.parametrize("flux", [0.85, 1.0, 1.15])
@pytest.mark.parametrize("share", [0.33, 1.0, 3.0])
def test_ramp_hands_over_whatever_the_inertia(share: float, flux: float) -> None:
    """Inertia wrong by three, flux by 15 %: locked by the first or second attempt, without a trip; then at its speed.

    Verifies: FW-11, FW-15
    """
    machine = machines.motor(inertia_kgm2=share * machines.motor().inertia_kgm2, psi_vs=flux * 1e-3)
    bench = Bench(model_motor=machine)
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 40000")
    bench.fw.command("start")
    phases = [bench.fw.phase]

    def running() -> bool:
        if bench.fw.phase != phases[-1]:
            phases.append(bench.fw.phase)
        return bench.fw.state == "running"

    assert bench.run(2.0, running)
    assert phases.count("ramp") <= 2, phases
    assert bench.run(3.0, lambda: bench.model.rpm > 39_600)
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(40_000, rel=0.005)
    assert bench.trips == 0


def test_last_failed_attempt_is_named_by_its_phase() -> None:
    """A rotor that stands from the hand-over on: after the last attempt `phase` and `faults` say where it failed.

    Verifies: FW-20
    """
    bench = Bench(drive=machines.drive(start={"retries": 0}))
    assert bench.until_state("ready", 0.1)
    assert bench.fw.command("get phase") == ["phase none", "ok"]
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    assert bench.run(1.0, lambda: bench.fw.phase == "lock")
    bench.model.m[am.M_LOCKED] = 1.0
    assert bench.until_state("fault", 0.5)
    assert bench.fw.command("get phase") == ["phase lock", "ok"]
    assert bench.fw.command("faults")[:2] == ["now start_failed", "phase lock"]
    bench.fw.command("clear")
    assert bench.until_state("ready", 0.1)
    assert bench.fw.command("get phase") == ["phase none", "ok"]


@pytest.mark.parametrize(("share", "patience"), [(1.0, 1.5), (0.9, 1.5), (0.8, 3.0), (0.55, 3.0), (0.45, 6.0)])
def test_patience_with_a_crossing_follows_the_mean_interval(share: float, patience: float) -> None:
    """Slow crossings: after an interval that is short beside the mean one the drive waits for more of them.

    Verifies: FW-20
    """
    bench = Bench()
    bench.start(8_000)
    bench.run(1.0)
    s, c = bench.model.s, bench.model.c
    assert c[am.C_TIMEOUT] == 1.5
    # A tick or two after a crossing: the next one is far away.
    crossings = s[am.CROSSINGS]
    assert bench.run(0.01, lambda: s[am.CROSSINGS] > crossings)
    s[am.INTERVAL] *= share
    bench.step()
    bench.step()
    assert s[am.CROSSINGS] == crossings + 1
    assert c[am.C_TIMEOUT] == patience


@pytest.mark.parametrize("gain", [0.93, 1.07])
def test_patience_is_there_as_a_sector_begins(gain: float) -> None:
    """Sectors of five ticks, a divider that is off: each commutation begins with a patience beyond the next crossing.

    Verifies: FW-20
    """
    bench = Bench(drive=machines.drive(zcd={"balance": "none"}))
    bench.start(20_000)
    bench.run(0.5)
    bench.model.m[am.M_DIVIDER + 1] = gain
    bench.run(0.1)
    s, patience, intervals = bench.model.s, [], set()
    commutations = s[am.COMMUTATIONS]
    for _ in range(600):
        bench.step()
        intervals.add(round(1e6 * s[am.INTERVAL]))
        if s[am.COMMUTATIONS] != commutations:
            commutations = s[am.COMMUTATIONS]
            patience.append(s[am.PATIENCE] / s[am.RING_FIRST : am.RING_FIRST + 6].mean())
    assert min(intervals) < 0.8 * max(intervals), "the intervals are even"
    assert min(patience) > 1.3
    assert bench.trips == 0


def test_ramp_yields_where_little_resistance_lets_much_flow() -> None:
    """A load holds the rotor of a motor that one volt turns fast: the ramp's voltage grows, not so the current.

    Verifies: FW-15
    """
    bench = Bench()
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    assert bench.run(1.0, lambda: bench.fw.phase == "ramp")
    bench.model.m[am.M_LOCKED] = 1.0
    largest_a = 0.0
    while bench.fw.phase in ("ramp", "lock"):
        bench.step()
        largest_a = max(largest_a, abs(bench.model.s[am.I_LINE]))
    start_a = Design(bench.scenario).start_a
    assert start_a < largest_a < 2.0 * start_a
