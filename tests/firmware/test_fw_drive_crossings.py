# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over the averaged model: settings of the crossings and adaptive thresholds."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.config import Load
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import Bench

MOTOR_2 = machines.motor(
    resistance_ohm=0.0397, inductance_h=27.8e-6, psi_vs=1.27e-3, rated_current_a=11.03, max_speed_rpm=60_000.0
)
INVERTER_2 = machines.inverter(
    supply_v=15.0, voltage_full_scale_v=18.0, current_full_scale_a=20.0, phase_current_a=19.4, dc_current_a=19.4
)
FAN_2 = Load(fan_torque_nm=8e-3, fan_speed_rpm=54_000)


def thresholds_of(bench: Bench) -> list[float]:
    """Thresholds as the console shows them."""
    return [float(word) for word in bench.fw.command("get threshold_pu")[0].split()[1:]]


def interval_spread_deg(bench: Bench) -> float:
    """Largest deviation of a sector's interval from 60 degrees."""
    ring = bench.model.s[am.RING_FIRST : am.RING_FIRST + 6]
    return float(np.max(np.abs(ring / ring.mean() - 1.0)) * 60.0)


@pytest.mark.parametrize("direction", [1, -1])
def test_balance_learns_dividers_and_inductances(direction: int) -> None:
    """Motor-II with divider gains 1.10, 1.00, 0.90 at 20 000 r/min: vertical takes most, both nearly all of it.

    Verifies: FW-28
    """
    bench = Bench(MOTOR_2, INVERTER_2, machines.drive(accel_rpm_per_s=20_000.0), FAN_2)
    bench.start(direction * 20_000, 3.0)
    bench.run(0.8)
    mean = (27.5 + 27.2 + 28.6) / 3
    bench.model.m[am.M_UNEQUAL : am.M_UNEQUAL + 3] = (27.5 / mean, 27.2 / mean, 28.6 / mean)
    bench.model.m[am.M_DIVIDER : am.M_DIVIDER + 3] = (1.10, 1.00, 0.90)
    bench.run(0.3)
    spread = interval_spread_deg(bench)
    assert spread > 10.0
    assert bench.fw.command("set balance vertical") == ["ok"]
    bench.run(0.3)
    vertical = interval_spread_deg(bench)
    assert vertical < 0.5 * spread
    assert bench.fw.command("set balance both") == ["ok"]
    bench.run(0.3)
    assert interval_spread_deg(bench) < 0.5
    got = thresholds_of(bench)
    # Sectors I..VI float C, B, A, C, B, A.
    assert (got[2] + got[5]) / 2 == pytest.approx(0.55, abs=0.004)
    assert (got[1] + got[4]) / 2 == pytest.approx(0.50, abs=0.004)
    assert (got[0] + got[3]) / 2 == pytest.approx(0.45, abs=0.004)
    assert bench.model.rpm == pytest.approx(direction * 20_000, rel=0.005)
    # Through a ramp to 54 000 r/min in 3 s the intervals stay within 59 to 61 degrees.
    bench.fw.command("set accel_rpm_s 12000")
    bench.fw.command(f"set speed_rpm {direction * 54_000}")
    worst = 0.0
    for _ in range(30_000):
        bench.step()
        worst = max(worst, interval_spread_deg(bench))
    assert abs(bench.model.rpm) > 52_000
    assert worst < 1.0
    assert bench.fw.command("set balance none") == ["ok"]
    bench.run(0.01)
    assert thresholds_of(bench) == [0.5] * 6


def test_balance_rests_in_transients() -> None:
    """On a healthy machine a steep ramp moves no threshold by more than 0.2 %.

    Verifies: FW-28
    """
    bench = Bench(drive=machines.drive(accel_rpm_per_s=400_000.0, zcd={"balance": "both"}))
    bench.start(80_000)
    worst = 0.0
    for _ in range(6000):
        bench.step()
        if bench.ticks % 10 == 0:
            worst = max(worst, max(abs(t - 0.5) for t in thresholds_of(bench)))
    assert worst < 0.002


@pytest.mark.parametrize(("emf", "factor"), [("sinusoidal", 1.5), ("trapezoidal", 1.0)])
def test_crossing_settings_reach_the_registers(emf: str, factor: float) -> None:
    """Options come from parameters and console, the amplitude follows speed and signal, the wait half of the delay.

    Verifies: FW-32
    """
    drive = machines.drive(
        zcd={"method": "averaged", "source": "star_point", "compute_back": True, "correction_a": True}
    )
    bench = Bench(motor=machines.motor(emf=emf), drive=drive)
    assert bench.until_state("ready", 0.1)
    bench.step()
    assert bench.get("zcd.amplitude") == 0

    def options() -> tuple[int, int, int, int, int]:
        zcd = bench.get("zcd.control")
        return (zcd >> 1) & 3, (zcd >> 3) & 1, (zcd >> 6) & 1, (zcd >> 8) & 3, (bench.get("comm.control") >> 5) & 1

    def peak() -> float:
        return factor * 1e-3 * bench.model.rpm * np.pi / 30.0 / 30.0 * 2**17

    linear = int(emf == "trapezoidal")
    assert bench.fw.command("set speed_rpm 50000") == ["ok"]
    assert bench.fw.command("start") == ["ok"]
    # The rotor may lead the forced field by more than can be computed back.
    assert bench.run(2.0, lambda: bench.fw.phase == "ramp")
    assert options() == (2, 0, linear, 1, 1)
    assert bench.until_state("running", 2.0)
    assert options() == (2, 1, linear, 1, 1)
    bench.run(0.5)
    assert bench.get("zcd.amplitude") == pytest.approx(peak() / 3.0, rel=0.005)
    assert bench.get("zcd.wait_limit") == 0x40
    for line in ("zcd_method first", "zcd_source terminal", "compute_back 0", "correction_a 0", "advance_q16 16384"):
        assert bench.fw.command(f"set {line}") == ["ok"]
    bench.step()
    assert options() == (0, 0, linear, 0, 0)
    assert bench.get("zcd.amplitude") == pytest.approx(peak(), rel=0.005)
    assert bench.get("zcd.wait_limit") == 0x20
    assert bench.fw.command("set zcd_source mean") == ["ok"]
    assert bench.fw.command("stop now") == ["ok"]
    bench.run(0.001)
    assert bench.get("zcd.amplitude") == 0


@pytest.mark.parametrize("source", ["terminal", "mean"])
def test_balance_learns_from_computed_back_crossings(source: str) -> None:
    """Overridden crossings stop the learning unless they are computed back; another signal starts anew.

    Verifies: FW-32, FW-28
    """
    bench = Bench(drive=machines.drive(zcd={"source": source, "compute_back": True, "balance": "both"}))
    bench.start(40_000)
    bench.run(0.5)
    bench.model.m[am.M_DIVIDER : am.M_DIVIDER + 3] = (1.03, 1.0, 0.98)

    def run(back: bool) -> float:
        for _ in range(2000):
            bench.overridden += 1
            bench.computed_back += int(back)
            bench.step()
        return max(abs(t - 0.5) for t in thresholds_of(bench))

    assert run(back=False) < 0.002
    assert run(back=True) > 0.01
    assert bench.fw.command(f"set zcd_source {'mean' if source == 'terminal' else 'terminal'}") == ["ok"]
    bench.step()
    assert thresholds_of(bench) == [0.5] * 6


def samples_before(bench: Bench) -> int:
    """Unclamped samples that one must follow to count."""
    return (bench.get("zcd.control") >> 10) & 15


@pytest.mark.parametrize(
    ("settle_us", "samples"), [(0, 1), (1.9, 1), (2.2, 1), (3, 2), (7, 6), (7.5, 6), (16, 15), (40, 15)]
)
def test_a_diode_that_lets_go_is_waited_for(settle_us: float, samples: int) -> None:
    """A clamp's end is an edge without a gate: samples of 1 us wait the settle time after it, less the clamped one.

    One sample after it, whatever the dividers' pole, made a crossing of their answer: a 48 V board with a pole of 1 us
    commutated 40 degrees early and tripped on its current.

    Verifies: FRONT-95
    """
    bench = Bench(drive=machines.drive(zcd={"settle_us": settle_us}))
    assert bench.until_state("ready", 0.1)
    assert bench.get("sense.period") == 50
    assert samples_before(bench) == samples


def test_sampling_once_a_carrier_while_running_only() -> None:
    """Start, standstill and coasting need continuous samples; a lone sample of a pulse has none before it.

    Verifies: FW-35
    """
    bench = Bench(drive=machines.drive(zcd={"sampling": "carrier"}))

    def sampling() -> tuple[int, int]:
        return bench.get("sense.scheduler") & 3, samples_before(bench)

    assert bench.until_state("ready", 0.1)
    assert sampling() == (1, 1)
    assert bench.fw.command("set speed_rpm 40000") == ["ok"]
    assert bench.fw.command("start") == ["ok"]
    while bench.fw.state != "running":
        assert sampling() == (1, 1)
        bench.step()
    bench.step()
    assert sampling() == (3, 0)
    assert bench.fw.command("stop now") == ["ok"]
    bench.run(0.001)
    assert sampling() == (1, 1)
