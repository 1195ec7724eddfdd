# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over machine and pulses: the speed from no load to the limit, braking at its limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluxlock.config import Inverter, Load, Motor
from fluxlock.firmware.design import RESTART_ALWAYS
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import OTHERS, Bench, small_motor, stage

# Machines of the files, a racing motor, a compressor, a mid-drive: speed to hold (r/min), load there that their
# commutation carries (N*m), carrier (Hz).
STRANGERS = [
    (*OTHERS[0][:2], 15_000, 0.16, 30e3),
    (*OTHERS[1][:2], 6_000, 0.22, 30e3),
    (*OTHERS[2][:2], 8_000, 0.08, 30e3),
    (*OTHERS[3][:2], 3_000, 0.55, 30e3),
    (small_motor(7, 0.045, 9e-6, 3.66e-4, 4e-6, 30.0, 29_000), stage(14.8, 20.0, 60.0, 48.0), 18_000, 0.05, 48e3),
    (small_motor(3, 0.045, 60e-6, 5e-3, 2.5e-5, 12.0, 14_000), stage(48.0, 60.0, 50.0, 40.0), 9_000, 0.29, 20e3),
    (small_motor(8, 0.061, 76e-6, 6.2e-3, 2.4e-4, 15.0, 4_500), stage(36.0, 48.0, 60.0, 48.0), 2_400, 1.2, 20e3),
]


def held(bench: Bench, seconds: float = 0.2) -> float:
    """Mean of the true speed."""
    speeds = []
    for _ in range(round(seconds / bench.tick_s)):
        bench.step()
        speeds.append(bench.model.rpm)
    return float(np.mean(speeds))


@pytest.mark.parametrize("share", [0.01, 0.1, 1.0])
@pytest.mark.parametrize(("motor", "inverter", "rpm", "full_nm", "carrier_hz"), STRANGERS)
@pytest.mark.parametrize("current_loop", [False, True])
def test_speed_is_held_from_no_load_to_the_limit(
    motor: Motor, inverter: Inverter, rpm: int, full_nm: float, carrier_hz: float, share: float, current_loop: bool
) -> None:
    """A fan of 1/100, 1/10 and all of the full load: within 0.2 %, with diodes as far as their pulses allow.

    Verifies: FW-70
    """
    drive = machines.drive(carrier_hz=carrier_hz, current_loop=current_loop)
    bench = Bench(motor, inverter, drive, Load(fan_torque_nm=share * full_nm, fan_speed_rpm=rpm))
    bench.start(rpm, 2.0)
    bench.run(2.5, lambda: bench.model.rpm > 0.99 * rpm)
    bench.run(0.5)
    assert held(bench) == pytest.approx(rpm, rel=0.002)
    assert bench.trips == 0


@pytest.mark.parametrize("current_loop", [False, True])
@pytest.mark.parametrize(
    "wrong", [{}, {"psi_vs": 1.07}, {"psi_vs": 0.93}, {"resistance_ohm": 1.25}, {"inductance_h": 0.8}]
)
def test_braking_makes_what_its_limit_permits(current_loop: bool, wrong: dict[str, float]) -> None:
    """9000 to 3000 r/min, steep, machine values off: from 10 ms on at least 80 % of the limit's torque, at most 120 %.

    Verifies: FW-71
    """
    motor, inverter, rpm, _, carrier_hz = STRANGERS[5]
    machine = motor.model_copy(update={k: x * np.asarray(getattr(motor, k)) for k, x in wrong.items()})
    machine = machine.model_copy(update={k: tuple(getattr(machine, k)) for k in wrong})
    drive = machines.drive(carrier_hz=carrier_hz, current_loop=current_loop, sync_rect=True, accel_rpm_per_s=1e6)
    bench = Bench(motor, inverter, drive, Load(coulomb_nm=0.02), model_motor=machine)
    bench.start(rpm, 2.0)
    bench.run(1.0)
    assert bench.fw.command("set speed_rpm 3000") == ["ok"]
    bench.run(0.01)
    torque_nm = []
    while bench.model.rpm > 4000:
        bench.step()
        torque_nm.append(-float(bench.model.s[am.TORQUE]))
        assert bench.now < 5.0
    permitted_nm = bench.block.number("brake_limit_ma") * 1e-3 * motor.torque_per_amp_nm
    assert 0.8 * permitted_nm < np.mean(torque_nm) < 1.2 * permitted_nm
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(3000, rel=0.002)
    assert bench.trips == 0


def test_a_load_that_grew_with_the_ramp_is_forgotten() -> None:
    """A fan to 60 000 r/min in 0.4 s holds the speed below the ramp; from 60 ms after its end on within 0.025 %.

    Verifies: FW-70
    """
    bench = Bench(drive=machines.drive(accel_rpm_per_s=150_000))
    bench.start(60_000)
    bench.run(1.0, lambda: bench.fw.telemetry().reference_rpm_q8 >= 60_000 * 256)
    bench.run(0.02)
    assert bench.model.rpm < 60_000 * (1 - 0.001)
    bench.run(0.04)
    for _ in range(600):
        bench.step()
        assert bench.model.rpm == pytest.approx(60_000, rel=2.5e-4)


# Light and slow, stiff, heavy and soft; light with a sector of 0.4 ms and of a tick.
RAMPED = [
    (small_motor(5, 0.15, 0.7e-3, 0.035, 8e-4, 3.0, 1_400), stage(90.0, 117.0, 12.0, 9.0), 270, 800, 20e3),
    (small_motor(7, 0.6, 3e-3, 0.03, 6e-4, 2.0, 2_000), stage(92.0, 120.0, 8.0, 6.0), 400, 1_200, 20e3),
    (small_motor(4, 0.5, 1.2e-3, 14e-3, 6e-5, 6.0, 4_000), stage(48.0, 60.0, 15.0, 14.4), 800, 2_400, 20e3),
    (small_motor(2, 5.3, 12.4e-3, 5e-3, 1.11e-8, 0.23, 23_224), stage(73.5, 95.5, 0.61, 0.55), 4_645, 13_934, 44.5e3),
    (
        small_motor(7, 8.8e-3, 6.85e-6, 1.5e-3, 7.5e-6, 39.0, 12_977),
        stage(36.7, 47.7, 110.0, 100.0),
        2_595,
        7_786,
        45e3,
    ),
]


@pytest.mark.parametrize("wrong", [{}, {"psi_vs": 1.07}, {"psi_vs": 0.93}])
@pytest.mark.parametrize(("motor", "inverter", "low_rpm", "high_rpm", "carrier_hz"), RAMPED)
def test_target_is_not_overshot(
    motor: Motor, inverter: Inverter, low_rpm: int, high_rpm: int, carrier_hz: float, wrong: dict[str, float]
) -> None:
    """Down, up and braked without a ramp, where crossings are few: beyond a target by at most 5 % of the change.

    Verifies: FW-73
    """
    machine = motor.model_copy(update={k: tuple(x * np.asarray(getattr(motor, k))) for k, x in wrong.items()})
    per_s = 0.3 * motor.rated_torque_nm / motor.inertia_kgm2 * 9.55
    zcd = {"balance": "both"}
    drive = machines.drive(carrier_hz=carrier_hz, sync_rect=True, accel_rpm_per_s=per_s, zcd=zcd)
    load = Load(coulomb_nm=0.03 * motor.rated_torque_nm)
    bench = Bench(motor, inverter, drive, load, speed_rpm=high_rpm, model_motor=machine)
    bench.start(high_rpm)
    bench.run(0.5)
    before = high_rpm
    for target, ramp in ((low_rpm, per_s), (high_rpm, per_s), (low_rpm, 20 * per_s)):
        bench.fw.command(f"set accel_rpm_s {ramp:.0f}")
        bench.fw.command(f"set speed_rpm {target}")
        most = 0.0
        for _ in range(round(1.0 / bench.tick_s)):
            bench.step()
            most = max(most, (bench.model.rpm - target) * np.sign(target - before))
        assert most < 0.05 * abs(target - before), (target, most)
        assert held(bench) == pytest.approx(target, rel=0.005)
        before = target
    assert bench.trips == 0 and bench.fw.state == "running"


def test_a_steeper_slope_is_bound_by_the_current_at_once() -> None:
    """A slope set 20 times as steep with the target, where braking allows 1.5: the ramp does not run ahead meanwhile.

    Verifies: FW-73
    """
    motor, inverter, low_rpm, high_rpm, carrier_hz = RAMPED[0]
    per_s = 0.3 * motor.rated_torque_nm / motor.inertia_kgm2 * 9.55
    drive = machines.drive(carrier_hz=carrier_hz, sync_rect=True, accel_rpm_per_s=per_s, zcd={"balance": "both"})
    bench = Bench(motor, inverter, drive, Load(coulomb_nm=0.03 * motor.rated_torque_nm), speed_rpm=high_rpm)
    bench.start(high_rpm)
    bench.run(0.5)
    brake_nm = bench.block.number("brake_limit_ma") * 1e-3 * motor.torque_per_amp_nm
    for line in (f"set accel_rpm_s {20 * per_s:.0f}", f"set speed_rpm {low_rpm}"):
        assert bench.fw.command(line) == ["ok"]
    bench.run(0.005)
    gone_rpm = high_rpm - bench.fw.telemetry().reference_rpm_q8 / 256
    assert 0 < gone_rpm < 1.3 * brake_nm / motor.inertia_kgm2 * 9.55 * 0.005


# Rotors that a few carriers move: speed to hold (r/min), carrier (Hz).
LIGHT = [
    (small_motor(7, 0.88, 1.93e-3, 0.0256, 7.1e-5, 1.04, 1_970), stage(92.0, 120.0, 2.5, 2.3), 394, 25e3),
    (small_motor(1, 0.06, 0.42e-3, 0.026, 2e-4, 10.0, 8_300), stage(60.0, 78.0, 24.0, 22.0), 1_666, 8e3),
]


@pytest.mark.parametrize("flux", [(1.0, 1.0, 1.0), (1.03, 0.97, 1.0)])
@pytest.mark.parametrize(("motor", "inverter", "rpm", "carrier_hz"), LIGHT)
def test_a_light_rotor_turns_evenly(
    motor: Motor, inverter: Inverter, rpm: int, carrier_hz: float, flux: tuple[float, float, float]
) -> None:
    """Pulses that commutations cut would swing it by 1 to 3 %: with CSC asked for, by at most 1 % peak to peak.

    Phases of unequal flux would swing it twice a turn. It brakes to that speed without a ramp.

    Verifies: FW-74
    """
    zcd = {"balance": "both"}
    machine = motor.model_copy(update={"psi_vs": tuple(np.multiply(flux, motor.psi_vs))})
    drive = machines.drive(carrier_hz=carrier_hz, sync_rect=True, linearity=True, accel_rpm_per_s=400 * rpm, zcd=zcd)
    load = Load(coulomb_nm=0.03 * motor.rated_torque_nm)
    bench = Bench(motor, inverter, drive, load, speed_rpm=3 * rpm, model_motor=machine, cut_pulses=True)
    bench.start(3 * rpm)
    bench.run(0.2)
    assert bench.fw.command(f"set speed_rpm {rpm}") == ["ok"]
    bench.run(1.0)
    speeds = []
    for _ in range(2000):
        bench.step()
        speeds.append(bench.model.rpm)
    assert np.mean(speeds) == pytest.approx(rpm, rel=0.005)
    print(f"{100 * np.ptp(speeds) / rpm:.2f} % peak to peak")
    assert np.ptp(speeds) < 0.01 * rpm and bench.trips == 0


@pytest.mark.parametrize(
    ("inertia", "inductance", "carriers"), [(1.0, 1.0, 0), (1.0, 40.0, 8), (40.0, 1.0, RESTART_ALWAYS)]
)
def test_carriers_run_on_by_the_swing_of_the_rotor_on_its_emf(inertia: float, inductance: float, carriers: int) -> None:
    """A light rotor: always if its swing is damped by a quarter at least, else from some on; a heavy one: never.

    Verifies: FW-74
    """
    light, inverter, _, carrier_hz = LIGHT[0]
    told = {
        "inertia_kgm2": inertia * light.inertia_kgm2,
        "inductance_h": tuple(inductance * np.array(light.inductance_h)),
    }
    motor = light.model_copy(update=told)
    drive = machines.drive(carrier_hz=carrier_hz, sync_rect=False, zcd={"balance": "both"})
    bench = Bench(motor, inverter, drive, Load(coulomb_nm=0.001))
    line_h, line_ohm = 2.0 * motor.inductance_h[0], 2.0 * motor.resistance_ohm[0]
    k_e = math.sqrt(3.0) * motor.psi_vs[0] * motor.pole_pairs
    moved_s = motor.inertia_kgm2 * line_ohm / k_e**2
    damping = 0.5 * math.sqrt(moved_s * line_ohm / line_h)
    print(f"{moved_s * carrier_hz:.1f} carriers, damping {damping:.2f}")
    assert (moved_s * carrier_hz < 150.0, damping > 0.25) == (carriers < RESTART_ALWAYS, carriers != 8)
    assert bench.block.values["restart_carriers"] == carriers
    assert bench.block.values["firm_restart_carriers"] == min(carriers, 8)


def test_carriers_run_on_while_the_line_of_the_emf_alone_holds_the_rotor() -> None:
    """At 11 carriers a sector: restarted as asked, not while the console has the drive brake as well, then again.

    Verifies: FW-74
    """
    bench = Bench(drive=machines.drive(carrier_hz=20e3, zcd={"balance": "both"}), cut_pulses=True)
    assert bench.block.values["restart_carriers"] == RESTART_ALWAYS
    bench.start(18_000)
    bench.run(0.5)
    for sync_rect, restarted in ((0, True), (1, False), (0, True)):
        assert bench.fw.command(f"set sync_rect {sync_rect}") == ["ok"]
        bench.run(0.1)
        assert bool(bench.model.c[am.C_RESTART]) == restarted


def test_flux_that_the_file_understates_leaves_the_highest_speed() -> None:
    """Flux 8 % above the file's, little resistance: the bound of the voltage by the current lets full load to 95 %.

    Verifies: FW-70
    """
    motor = RAMPED[0][0]
    machine = motor.model_copy(update={"psi_vs": tuple(1.08 * np.asarray(motor.psi_vs))})
    load = Load(fan_torque_nm=0.8 * motor.rated_torque_nm, fan_speed_rpm=1_300)
    drive = machines.drive(carrier_hz=20e3, sync_rect=True, current_limit_a=4.5)
    bench = Bench(motor, stage(105.0, 130.0, 12.0, 9.0), drive, load, model_motor=machine)
    bench.start(1_300, 3.0)
    bench.run(2.0)
    assert held(bench) == pytest.approx(1_300, rel=0.005) and bench.trips == 0


@pytest.mark.parametrize(("limit_a", "reached_rpm"), [(15.0, 15_000), (30.0, 20_000)])
def test_throttle_step_is_limited_by_what_commutation_carries(limit_a: float, reached_rpm: int) -> None:
    """Racing motor, 5000 to 26 000 r/min, a slope far too steep and a speed that the link does not give.

    The current keeps to its limit, no crossing comes late on the way, nothing trips; what limit or link give is held.

    Verifies: FW-72
    """
    motor, inverter, *_ = STRANGERS[4]
    drive = machines.drive(carrier_hz=48e3, current_limit_a=limit_a, accel_rpm_per_s=1e7)
    bench = Bench(motor, inverter, drive, Load(fan_torque_nm=0.10, fan_speed_rpm=25_000))
    bench.start(5_000, 2.0)
    bench.run(0.3)
    late = bench.model.s[am.LATE]
    assert bench.fw.command("set speed_rpm 26000") == ["ok"]
    line_a = []
    for _ in range(6000):
        bench.step()
        line_a.append(float(bench.model.s[am.I_LINE]))
        assert bench.model.rpm > reached_rpm or bench.model.s[am.LATE] == late
    assert bench.trips == 0 and bench.fw.state == "running"
    means_a = np.convolve(line_a, np.full(10, 0.1), "valid")
    print(f"current, mean of 1 ms: {means_a.max():.1f} A, {bench.model.rpm:.0f} r/min")
    assert means_a.max() < 1.1 * limit_a
    assert bench.model.rpm > reached_rpm
    assert held(bench) == pytest.approx(bench.model.rpm, rel=0.005)
