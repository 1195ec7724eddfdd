# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over the averaged model: current loop and torque mode."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.config import Inverter, Load, Motor
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import OTHERS, Bench


def line_current_a(bench: Bench) -> float:
    """Current of the conducting pair as the drive sees it."""
    return float(bench.fw.command("get line_a")[0].split()[1])


def mean_torque_nm(bench: Bench, steps: int = 300) -> float:
    """Mean of the machine's torque."""
    total = 0.0
    for _ in range(steps):
        bench.step()
        total += float(bench.model.s[am.TORQUE])
    return total / steps


CURRENT_LOOP = machines.drive(current_loop=True, accel_rpm_per_s=150_000.0)


@pytest.mark.parametrize("direction", [1, -1])
def test_current_loop_holds_the_speed(direction: int) -> None:
    """With the current loop: speed within 0.5 %, load step below 4 %, the measured current is the machine's.

    Verifies: FW-25
    """
    bench = Bench(drive=CURRENT_LOOP)
    bench.start(60_000 * direction)
    bench.run(0.8)
    assert bench.model.rpm == pytest.approx(direction * 60_000, rel=0.005)
    assert line_current_a(bench) == pytest.approx(float(bench.model.s[am.I_LINE]), rel=0.05)
    bench.model.set_load(Load(fan_torque_nm=25e-3, fan_speed_rpm=60_000))
    dip = 60_000.0
    for _ in range(800):
        bench.step()
        dip = min(dip, abs(bench.model.rpm))
    assert dip > 57_600
    assert bench.model.rpm == pytest.approx(direction * 60_000, rel=0.005)


@pytest.mark.parametrize(("motor", "inverter", "load", "rpm"), OTHERS)
def test_current_loop_follows_from_the_motor_file(motor: Motor, inverter: Inverter, load: Load, rpm: int) -> None:
    """The machines of the files hold their speed with the current loop too.

    Verifies: FW-25
    """
    bench = Bench(motor, inverter, machines.drive(carrier_hz=30e3, current_loop=True), load)
    bench.start(rpm, 2.0)
    bench.run(2.0)
    assert bench.model.rpm == pytest.approx(rpm, rel=0.005)


@pytest.mark.parametrize("change", [{}, {"psi_vs": 0.9e-3}, {"resistance_ohm": 30e-3}, {"inductance_h": 30e-6}])
def test_current_loop_bounds_the_current(change: dict[str, float]) -> None:
    """Far too steep a ramp, also with wrong parameters: the current stays at its limit, no windup after it.

    Verifies: FW-25, FW-17
    """
    drive = machines.drive(current_loop=True, accel_rpm_per_s=2e6, current_limit_a=15.0)
    bench = Bench(drive=drive, model_motor=machines.motor(**change))
    bench.start(60_000)
    peak_rpm, currents = 0.0, []
    for _ in range(6000):
        bench.step()
        peak_rpm = max(peak_rpm, bench.model.rpm)
        if 15_000 < bench.model.rpm < 45_000:
            currents.append(float(bench.model.s[am.I_LINE]))
    assert np.mean(currents[len(currents) // 4 :]) == pytest.approx(15.0, rel=0.12)
    assert max(currents) < 19.0
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)
    assert peak_rpm < 61_200


def test_current_loop_obeys_dc_and_duty_limits() -> None:
    """The DC-link limit holds the mean DC current; at the duty limit nothing winds up.

    Verifies: FW-25, FW-17
    """
    bench = Bench(drive=CURRENT_LOOP)
    assert bench.until_state("ready", 0.1)
    assert bench.fw.command("set dc_limit_a 4") == ["ok"]
    bench.start(60_000)
    bench.run(1.2)
    mean = [bench.model.s[am.IDC_MEAN] for _ in range(500) if bench.step() is None]
    assert np.mean(mean) == pytest.approx(4.0, rel=0.05)
    assert bench.fw.command("get limit") == ["limit current", "ok"]
    drive = CURRENT_LOOP.model_copy(update={"duty_max": 0.9})
    bench = Bench(inverter=machines.inverter(supply_v=12.0), drive=drive)
    bench.start(60_000)
    bench.run(1.0)
    assert bench.fw.command("get duty") == ["duty 0.9000", "ok"]
    assert bench.fw.command("get limit") == ["limit duty_max", "ok"]
    bench.fw.command("set speed_rpm 30000")
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


def test_current_loop_ramps_down_without_braking() -> None:
    """Only the fan slows the rotor, the current stops conducting: at most 3 % undershoot, then held.

    Verifies: FW-25
    """
    bench = Bench(drive=CURRENT_LOOP)
    bench.start(60_000)
    bench.run(0.6)
    bench.fw.command("set speed_rpm 20000")
    assert bench.run(1.5, lambda: bench.model.rpm < 20_400)
    speeds = []
    for _ in range(2000):
        bench.step()
        speeds.append(bench.model.rpm)
    assert min(speeds) > 19_400
    assert speeds[-1] == pytest.approx(20_000, rel=0.005)


def test_torque_mode_gives_the_torque() -> None:
    """Set torque is made within 5 % at any speed between the limits, with a flux 10 % off within 12 %.

    Verifies: FW-26
    """
    for flux, tolerance in ((1.0e-3, 0.05), (0.9e-3, 0.12)):
        bench = Bench(drive=CURRENT_LOOP, model_motor=machines.motor(psi_vs=flux))
        bench.start(80_000)
        assert bench.fw.command("set torque_mnm 12.5") == ["ok"]
        assert bench.fw.command("get torque_mnm") == ["torque_mnm 12.500", "ok"]
        assert bench.fw.command("set mode torque") == ["ok"]
        bench.run(1.0)
        assert mean_torque_nm(bench) == pytest.approx(12.5e-3, rel=tolerance)
        # The fan takes 20 mN*m at 60 000 r/min.
        assert bench.model.rpm == pytest.approx(60_000 * (12.5 / 20.0) ** 0.5, rel=0.07)
        assert bench.fw.command("set torque_mnm 6") == ["ok"]
        bench.run(0.05)
        assert mean_torque_nm(bench, 50) == pytest.approx(6e-3, rel=1.5 * tolerance)


def test_torque_mode_keeps_the_speed_limits() -> None:
    """More torque than the load takes ends at the target speed, less at the stop speed; back to speed without a jump.

    Verifies: FW-26
    """
    bench = Bench(drive=CURRENT_LOOP)
    bench.start(30_000)
    assert bench.fw.command("set current_ma 15000") == ["ok"]
    assert bench.fw.command("get current_ma") == ["current_ma 15000", "ok"]
    assert bench.fw.command("set mode torque") == ["ok"]
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.06)
    assert bench.fw.command("set current_ma 0") == ["ok"]
    bench.run(3.0)
    assert bench.fw.state == "running"
    assert bench.model.rpm == pytest.approx(bench.block.number("stop_rpm"), rel=0.25)
    bench.fw.command("set current_ma 8000")
    bench.run(0.05)
    before = bench.model.rpm
    bench.fw.command("set mode speed")
    bench.run(0.002)
    assert bench.model.rpm == pytest.approx(before, rel=0.05)
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)
    assert bench.fw.command("set current_ma 60000") == ["error: value out of range"]


def test_torque_mode_needs_the_current_loop() -> None:
    """Neither can be had without the other.

    Verifies: FW-26
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    assert bench.fw.command("set mode torque") == ["error: value out of range"]
    assert bench.fw.command("set current_loop 1") == ["ok"]
    assert bench.fw.command("set mode torque") == ["ok"]
    assert bench.fw.command("set current_loop 0") == ["error: value out of range"]


def test_current_loop_switches_while_running() -> None:
    """From one regulator to the other and back: the speed moves by less than 1 %.

    Verifies: FW-25
    """
    bench = Bench()
    bench.start(50_000)
    bench.run(1.0)
    for value in (1, 0, 1):
        assert bench.fw.command(f"set current_loop {value}") == ["ok"]
        for _ in range(1000):
            bench.step()
            assert bench.model.rpm == pytest.approx(50_000, rel=0.01)
