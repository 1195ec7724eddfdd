# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over the averaged model: speed, its limits, stop, carrier."""

from __future__ import annotations

import time

import numpy as np
import pytest

from fluxlock.config import Load
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import MOTOR_1, Bench


def longest_period(bench: Bench) -> int:
    """Carrier period that leaves six pulses in the sectors of the last turn."""
    sixth = bench.get("comm.snap_period") // 36
    return max(1250, min(bench.block.number("carrier_longest_cycles"), sixth))


def test_load_step_and_ramp_follow_the_settings() -> None:
    """+25 % load: less than 4 % dip, back within 0.5 % after 60 ms; ramps have the set acceleration.

    Verifies: FW-16
    """
    bench = Bench(drive=machines.drive(accel_rpm_per_s=150_000.0))
    bench.start(60_000)
    bench.run(0.7)
    bench.model.set_load(Load(fan_torque_nm=25e-3, fan_speed_rpm=60_000))
    dip = 60_000.0
    for _ in range(600):
        bench.step()
        dip = min(dip, bench.model.rpm)
    assert dip > 57_600
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)
    bench.fw.command("set accel_rpm_s 100000")
    bench.fw.command("set speed_rpm 40000")
    before = bench.model.rpm
    bench.run(0.1)
    assert before - bench.model.rpm == pytest.approx(10_000, rel=0.1)
    bench.run(0.4)
    assert bench.model.rpm == pytest.approx(40_000, rel=0.005)


@pytest.mark.parametrize(("accel_rpm_s", "lighter"), [(4e6, 10), (5.5e6, 20)])
def test_ramps_of_any_slope_are_kept(accel_rpm_s: float, lighter: int) -> None:
    """A rotor of little inertia keeps to 400 and 550 r/min in a control tick.

    A step stopped at 256 r/min, and above 512 r/min the ramp asked for all of the current limit.

    Verifies: FW-16
    """
    light = machines.motor(inertia_kgm2=MOTOR_1.inertia_kgm2 / lighter)
    bench = Bench(motor=light, drive=machines.drive(accel_rpm_per_s=accel_rpm_s, sync_rect=True))
    bench.start(30_000)
    bench.run(0.6)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)
    bench.fw.command("set speed_rpm 60000")
    bench.run(0.004)
    reference_rpm = bench.fw.telemetry().reference_rpm_q8 / 256
    assert reference_rpm == pytest.approx(30_000 + accel_rpm_s * 0.004, rel=0.02)
    # The fan takes more with the speed, which the integral has to learn.
    bench.run(0.4)
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)


def test_current_limit_binds_without_windup() -> None:
    """Far too steep a ramp: the current settles at its limit within 15 %, then no overshoot above 2 %.

    Verifies: FW-17
    """
    bench = Bench(drive=machines.drive(accel_rpm_per_s=2e6, current_limit_a=15.0))
    bench.start(60_000)
    peak_rpm, currents = 0.0, []
    for _ in range(6000):
        bench.step()
        peak_rpm = max(peak_rpm, bench.model.rpm)
        if 15_000 < bench.model.rpm < 45_000:
            currents.append(float(bench.model.s[am.I_LINE]))
    assert np.mean(currents[len(currents) // 4 :]) == pytest.approx(15.0, rel=0.15)
    assert max(currents) < 20.0
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)
    assert peak_rpm < 61_200


def test_dc_limit_binds() -> None:
    """A DC-link current limit below what the load wants holds the mean DC current there, at a lower speed.

    Verifies: FW-17
    """
    bench = Bench()
    assert bench.until_state("ready", 0.1)
    assert bench.fw.command("set dc_limit_a 4") == ["ok"]
    bench.start(60_000)
    bench.run(1.2)
    mean = [bench.model.s[am.IDC_MEAN] for _ in range(500) if bench.step() is None]
    assert np.mean(mean) == pytest.approx(4.0, rel=0.05)
    assert 40_000 < bench.model.rpm < 58_000
    assert bench.fw.command("get limit") == ["limit current", "ok"]


def test_duty_limit_binds_and_releases() -> None:
    """At 12 V supply 60 000 r/min are out of reach: full duty, no windup when the target falls.

    Verifies: FW-17
    """
    bench = Bench(
        inverter=machines.inverter(supply_v=12.0), drive=machines.drive(duty_max=0.9, accel_rpm_per_s=200_000.0)
    )
    bench.start(60_000)
    bench.run(1.0)
    assert bench.fw.command("get duty") == ["duty 0.9000", "ok"]
    assert bench.fw.command("get limit") == ["limit duty_max", "ok"]
    bench.fw.command("set speed_rpm 30000")
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


def test_stop_and_stop_now() -> None:
    """`stop` ramps down before the gates open, `stop now` opens them at once; both end ready and can start again.

    Verifies: FW-19
    """
    bench = Bench()
    bench.start(30_000)
    bench.run(0.4)
    assert bench.fw.command("stop") == ["ok"]
    assert bench.until_state("stopping", 0.01)
    assert bench.until_state("ready", 2.0)
    assert bench.model.rpm < 7_000
    assert bench.get("safety.guard") & 1 == 0
    bench.start(30_000, 4.0)
    bench.run(0.4)
    assert bench.fw.command("stop now") == ["ok"]
    bench.run(0.0002)
    assert bench.fw.state == "ready"
    assert bench.get("safety.guard") & 1 == 0


def test_ramp_down_does_not_undershoot() -> None:
    """Without braking (fan alone slows the rotor) the speed falls at most 3 % below its target.

    Verifies: FW-16
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    bench.fw.command("set speed_rpm 20000")
    assert bench.run(1.0, lambda: bench.model.rpm < 20_400)
    speeds = []
    for _ in range(2000):
        bench.step()
        speeds.append(bench.model.rpm)
    assert min(speeds) > 19_400
    assert speeds[-1] == pytest.approx(20_000, rel=0.005)


def test_freeze_holds_every_setting() -> None:
    """Frozen, every committed register stays as it is whatever the machine does; released, control goes on.

    Verifies: FW-21
    """
    bench = Bench()
    bench.start(40_000)
    bench.run(0.6)
    assert bench.fw.command("set freeze 1") == ["ok"]
    bench.step()
    names = (
        "pwm.control",
        "pwm.period",
        "pwm.duty",
        "comm.control",
        "comm.delay",
        "comm.timeout",
        "zcd.control",
    )
    held = [bench.get(name) for name in names]
    bench.model.set_load(Load(fan_torque_nm=24e-3, fan_speed_rpm=60_000))
    bench.fw.command("set advance_q16 1000")
    bench.fw.command("set speed_rpm 50000")
    for _ in range(500):
        bench.step()
        assert [bench.get(name) for name in names] == held
    assert abs(bench.model.rpm - 40_000) > 200
    bench.fw.command("set freeze 0")
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(50_000, rel=0.005)


def test_long_carrier_at_low_duty_only() -> None:
    """Pulses keep the on-time floor at low speed by a longer carrier; at speed the carrier is the wanted one.

    Verifies: FW-08
    """
    bench = Bench()
    bench.start(60_000)
    floor = bench.block.number("on_time_floor_cycles")
    while bench.model.rpm < 55_000:
        bench.step()
        pulse, period = bench.get("pwm.duty") / 256, bench.get("pwm.period")
        longest = longest_period(bench)
        assert 1250 <= period <= longest
        assert pulse > floor - 2 or period == longest
        assert period == 1250 or pulse < floor + 2
    assert bench.get("pwm.period") == 1250


def test_coasting_keeps_enough_pulses_in_a_sector() -> None:
    """Far too steep a ramp down: the least duty binds, pulses stay long enough and six or more in a sector.

    Verifies: FW-08
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    bench.fw.command("set accel_rpm_s 2000000")
    bench.fw.command("set speed_rpm 10000")
    bound = 0
    for _ in range(3000):
        bench.step()
        assert bench.get("pwm.period") <= longest_period(bench)
        assert bench.get("pwm.duty") / 256 >= bench.block.number("least_on_cycles") - 12
        bound += bench.fw.telemetry().limit == bench.fw.lib.LIMIT_DUTY_MIN
    assert bound > 100
    assert bench.model.rpm < 45_000
    assert bench.fw.state == "running"


def test_host_runs_faster_than_real_time() -> None:
    """The drive on the host over the averaged model: more than a second a second, even on a busy machine.

    Verifies: FW-22
    """
    bench = Bench()
    bench.start(30_000)
    begin = time.process_time()
    bench.run(1.0)
    assert time.process_time() - begin < 1.0


@pytest.mark.parametrize("linearity", [True, False])
def test_linearity_makes_the_voltage_the_wanted_one(linearity: bool) -> None:
    """At 3.4 carriers a sector the machine gets the voltage that the drive asks for; without, 5 % more at least.

    Verifies: FW-27
    """
    bench = Bench(drive=machines.drive(carrier_hz=20e3, linearity=linearity), cut_pulses=True)
    bench.start(59_000)
    bench.run(1.0)
    asked, got = [], []
    for _ in range(200):
        bench.step()
        asked.append(bench.fw.telemetry().u_v_q25 / 2**25 * 30.0)
        duty = float(bench.model.c[am.C_DUTY])
        got.append(duty * 25.0 - (1.0 - duty) * 0.7)
    ratio = float(np.mean(got) / np.mean(asked))
    assert (ratio == pytest.approx(1.0, abs=0.01)) if linearity else (ratio > 1.05)
    assert bench.model.rpm == pytest.approx(59_000, rel=0.005)


def test_advance_follows_speed_and_current() -> None:
    """Base, speed and current add up in the register, limited to 30 degrees; the model's timer obeys.

    Verifies: FW-29
    """
    drive = machines.drive(advance_deg=1.0, advance_deg_at_max_speed=6.0, advance_deg_at_rated_current=4.0)
    bench = Bench(drive=drive)
    bench.start(50_000)
    bench.run(1.0)
    current = float(bench.model.s[am.I_LINE])

    def advance_deg() -> float:
        raw = bench.get("comm.delay") >> 16
        return ((raw ^ 0x8000) - 0x8000) / 65536 * 60.0

    wanted = 1.0 + 6.0 * 50_000 / MOTOR_1.max_speed_rpm + 4.0 * current / MOTOR_1.rated_dc_current_a
    assert advance_deg() == pytest.approx(wanted, abs=0.1)
    bench.fw.command("set advance_speed_q16 32767")
    bench.fw.command("set advance_q16 30000")
    # Eight groups of the schedule, of which crossings of every second tick hold off some.
    bench.run(0.004)
    assert advance_deg() == pytest.approx(30.0, abs=0.01)
    bench.fw.command("set advance_q16 -32768")
    bench.fw.command("set advance_speed_q16 -32768")
    bench.run(0.004)
    assert advance_deg() == pytest.approx(-30.0, abs=0.01)
