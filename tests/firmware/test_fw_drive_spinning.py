# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over the averaged model: spinning rotors, braking and reversal."""

from __future__ import annotations

import math

import pytest

from fluxlock.config import Load
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import FAN_1, Bench, fault_of, small_motor, stage


@pytest.mark.parametrize("rpm", [18_000, 20_000, 40_000, 60_000, 77_777, 94_000, 100_000])
@pytest.mark.parametrize("direction", [1, -1])
def test_spinning_rotor_is_caught(rpm: int, direction: int) -> None:
    """At any speed, both directions: locked within 40 ms without a trip, speed dips by less than a fifth, then held.

    Verifies: FW-30
    """
    bench = Bench(
        speed_rpm=direction * rpm,
        theta_rad=0.3 * direction + rpm,
        load=Load(fan_torque_nm=20e-3, fan_speed_rpm=100_000),
    )
    bench.until_state("ready", 0.1)
    bench.fw.command(f"set speed_rpm {direction * rpm}")
    before = abs(bench.model.rpm)
    bench.fw.command("start")
    assert bench.until_state("running", 0.04)
    assert bench.fw.command("get catches") == ["catches 1", "ok"]
    assert bench.fw.command("get lost_locks") == ["lost_locks 0", "ok"]
    assert bench.model.rpm * direction > 0.8 * before
    assert bench.model.s[am.I_PEAK] < 15.0
    bench.run(0.6)
    assert bench.model.rpm == pytest.approx(direction * rpm, rel=0.005)
    assert bench.trips == 0


@pytest.mark.parametrize("hz", [900, 1_800, 2_600])
def test_fast_machine_is_caught(hz: int) -> None:
    """A machine to 3 kHz: caught at a quarter of a turn per control tick too.

    Verifies: FW-30
    """
    motor = small_motor(2, 0.1, 20e-6, 8e-4, 4e-6, 10.0, 90_000)
    rpm = 30 * hz
    bench = Bench(
        motor, stage(36.0, 50.0, 40.0, 36.0), machines.drive(carrier_hz=45e3), Load(coulomb_nm=1e-3), 0.7, rpm
    )
    bench.until_state("ready", 0.1)
    bench.fw.command(f"set speed_rpm {rpm}")
    bench.fw.command("start")
    assert bench.until_state("running", 0.04)
    assert bench.fw.command("get catches") == ["catches 1", "ok"]
    bench.run(0.4)
    assert bench.model.rpm == pytest.approx(rpm, rel=0.005) and bench.trips == 0


@pytest.mark.parametrize("flux", [0.78, 0.8, 1.2])
def test_wrong_flux_is_no_jolt(flux: float) -> None:
    """Flux of the file 20 % off: the voltage that catches is the EMF that was measured, and the current stays small.

    Verifies: FW-30
    """
    bench = Bench(drive=machines.drive(motor_error={"flux": flux}), speed_rpm=90_000)
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 90000")
    bench.fw.command("start")
    assert bench.until_state("running", 0.04)
    assert bench.fw.command("get catches") == ["catches 1", "ok"]
    assert bench.model.s[am.I_PEAK] < 15.0 and bench.trips == 0


@pytest.mark.parametrize("theta_deg", range(0, 60, 10))
@pytest.mark.parametrize("hz", [80, 1_525])
def test_machine_with_little_inductance_is_caught_at_a_sector(theta_deg: int, hz: int) -> None:
    """0.05 per unit of inductance, trapezoidal: wherever the rotor stands, no tick's mean exceeds the rated current.

    Verifies: FW-30
    """
    emf_v, amplitude_a = 8.0, 10.0
    omega = 2 * math.pi * hz
    ohm = 0.04 * emf_v / amplitude_a
    machine = small_motor(2, ohm, 0.05 * emf_v / amplitude_a / omega, emf_v / omega, 1e-3, amplitude_a, 40.0 * hz)
    machine = machine.model_copy(update={"emf": "trapezoidal"})
    bench = Bench(
        machine,
        stage(30.0, 40.0, 40.0, 38.0, on_resistance_ohm=1e-3, noise_lsb=0.0),
        machines.drive(carrier_hz=45e3, sync_rect=True),
        Load(coulomb_nm=1e-3),
        math.radians(theta_deg),
        30.0 * hz,
    )
    bench.until_state("ready", 0.1)
    bench.fw.command(f"set speed_rpm {30 * hz}")
    bench.fw.command("start")
    means: list[float] = []

    def running() -> bool:
        means.append(abs(bench.model.s[am.I_LINE]))
        return bench.fw.state == "running"

    assert bench.run(0.1, running) and bench.trips == 0
    assert max(means) < amplitude_a


@pytest.mark.parametrize("theta_deg", [0, 120, 240])
def test_fast_machine_runs_on_prepared_gains(theta_deg: int) -> None:
    """A sector a tick, with `linearity`: the lock lasts until the gains know a speed, and no tick brakes hard.

    Verifies: FW-30
    """
    omega, emf_v, amplitude_a = 2 * math.pi * 1_750, 16.0, 1.0
    henry = 0.35 * emf_v / amplitude_a / omega
    machine = small_motor(8, 0.3, henry, emf_v / omega, 1e-5, amplitude_a, 20_000)
    bench = Bench(
        machine,
        stage(64.0, 80.0, 5.0, 4.0),
        machines.drive(carrier_hz=45e3, sync_rect=True, linearity=True),
        Load(coulomb_nm=1e-3),
        math.radians(theta_deg),
        13_125.0,
        cut_pulses=True,
    )
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 13125")
    bench.fw.command("start")
    assert bench.until_state("running", 0.1)
    means = []
    bench.run(2e-3, lambda: bool(means.append(bench.model.s[am.I_LINE])))
    assert bench.trips == 0 and min(means) > -0.5 * amplitude_a, min(means)


def test_lost_lock_is_caught_again() -> None:
    """Crossings vanish for 3 ms at 60 000 r/min: back at speed within 50 ms, without standstill.

    Verifies: FW-30, FW-20
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("starting", 0.1)
    bench.model.m[am.M_BLIND] = 0.0
    assert bench.until_state("running", 0.05)
    assert bench.model.rpm > 30_000
    bench.run(0.6)
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)


@pytest.mark.parametrize("sync_rect", [True, False])
@pytest.mark.parametrize("current_loop", [True, False])
def test_rotor_that_spins_backward_is_turned(sync_rect: bool, current_loop: bool) -> None:
    """Caught backward, slowed down (with braking current or by its load), started forward; no trip.

    Verifies: FW-30, FW-31
    """
    drive = machines.drive(sync_rect=sync_rect, current_loop=current_loop, accel_rpm_per_s=200_000.0)
    bench = Bench(speed_rpm=-50_000.0, load=FAN_1.model_copy(update={"coulomb_nm": 2e-3}), drive=drive)
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 40000")
    bench.fw.command("start")
    assert bench.run(3.0, lambda: bench.model.rpm > 39_000)
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(40_000, rel=0.005)
    assert bench.trips == 0
    assert fault_of(bench) == "none"


@pytest.mark.parametrize("current_loop", [True, False])
def test_reversal_brakes_within_its_limit(current_loop: bool) -> None:
    """60 000 r/min to -60 000 and back with 8 A of braking current: kept within 20 %, faster than coasting, no trip.

    Verifies: FW-31
    """
    drive = machines.drive(sync_rect=True, current_loop=current_loop, accel_rpm_per_s=1e6, brake_current_limit_a=8.0)
    bench = Bench(drive=drive)
    bench.start(60_000)
    bench.run(0.6)
    for sign in (-1, 1):
        lowest, begin = 0.0, bench.now
        bench.fw.command(f"set speed_rpm {sign * 60_000}")
        while abs(bench.model.rpm) > 10_000 and bench.now - begin < 1.0:
            bench.step()
            lowest = min(lowest, float(bench.model.s[am.I_LINE]))
        # Fan and 8 A: 13 mN*m and at least as much of the fan at first.
        assert bench.now - begin < 0.2
        assert -9.6 < lowest < -6.0
        assert bench.run(2.0, lambda s=sign: s * bench.model.rpm > 59_000)
        bench.run(0.3)
        assert bench.model.rpm == pytest.approx(sign * 60_000, rel=0.005)
    assert bench.trips == 0


def test_braking_spares_the_dc_link() -> None:
    """A DC link at its limit takes no braking current: the rotor slows by its load alone.

    Verifies: FW-31
    """
    bench = Bench(drive=machines.drive(sync_rect=True, accel_rpm_per_s=1e6, brake_current_limit_a=10.0))
    bench.start(60_000)
    bench.run(0.6)
    bench.model.m[am.M_VDC] = 29.8
    bench.run(0.1)
    bench.fw.command("set speed_rpm 30000")
    lowest = 0.0
    for _ in range(500):
        bench.step()
        lowest = min(lowest, float(bench.model.s[am.I_LINE]))
    assert lowest > -1.5
    bench.model.m[am.M_VDC] = 25.0
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


def reversing(load: Load, sync_rect: bool = True) -> Bench:
    """A drive that runs forward, was told to run backward and has just let its rotor go."""
    bench = Bench(load=load, drive=machines.drive(sync_rect=sync_rect))
    bench.start(30_000)
    bench.run(0.6)
    bench.fw.command("set speed_rpm -30000")
    assert bench.until_state("starting", 5.0)
    assert bench.model.rpm > 0.0
    return bench


def test_rotor_let_go_to_be_reversed_is_not_caught_again() -> None:
    """Hardly any load: it coasts and is braked by the lower switches; one start, no catch, then backward.

    Verifies: FW-30, FW-31
    """
    bench = reversing(Load(coulomb_nm=2e-5))
    braking_a, phases = [0.0], [bench.fw.phase]
    crossings = 0.0

    def backward() -> bool:
        nonlocal crossings
        s = bench.model.s
        if bench.fw.phase != phases[-1]:
            phases.append(bench.fw.phase)
            crossings = s[am.CROSSINGS] if phases[-1] == "lock" else crossings
        if phases[-1] in {"coast", "precharge"}:
            braking_a.append(math.hypot(s[am.I_ALPHA], s[am.I_BETA]))
        return bench.model.rpm < -29_900

    assert bench.run(6.0, backward)
    assert phases == ["coast", "precharge", "align_first", "align_second", "ramp", "lock"]
    assert crossings >= 2, "the ramp waits for crossings of its own"
    assert bench.fw.command("get catches") == ["catches 0", "ok"]
    assert bench.fw.command("get lost_locks") == ["lost_locks 0", "ok"]
    assert bench.trips == 0 and 0.0 < max(braking_a) < bench.scenario.current_limit_a


def test_lock_lost_while_reversing_is_caught() -> None:
    """Crossings vanish on the way down at 20 000 r/min: the rotor is caught as it turns, then reversed.

    Verifies: FW-30, FW-20
    """
    bench = Bench(drive=machines.drive(sync_rect=True, accel_rpm_per_s=100_000.0))
    bench.start(60_000)
    bench.run(0.8)
    bench.fw.command("set speed_rpm -60000")
    assert bench.run(1.0, lambda: bench.model.rpm < 20_000)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("starting", 0.1)
    bench.model.m[am.M_BLIND] = 0.0
    assert bench.until_state("running", 0.1) and bench.model.rpm > 0.0
    assert bench.fw.command("get catches") == ["catches 1", "ok"]
    assert bench.run(3.0, lambda: bench.model.rpm < -59_000)


def test_rotor_that_a_load_turns_is_not_braked_beyond_the_limit() -> None:
    """The lower switches brake a rotor that was let go; one that a load accelerates is let go within 3 ms of the limit.

    Verifies: FW-31, FW-52
    """
    bench = reversing(FAN_1)
    assert bench.run(2.0, lambda: bench.fw.phase == "precharge")
    bench.model.set_load(FAN_1.model_copy(update={"constant_nm": -0.5}))
    limit_a = bench.scenario.current_limit_a
    amplitude_a = []

    def let_go() -> bool:
        amplitude_a.append(math.hypot(bench.model.s[am.I_ALPHA], bench.model.s[am.I_BETA]))
        return bench.fw.phase == "coast"

    assert bench.run(0.5, let_go)
    beyond = [a > limit_a for a in amplitude_a]
    assert any(beyond) and sum(beyond) < 30
    assert bench.trips == 0
