# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The vector drive with an encoder, against the exact discrete machine: sensored runs, mounting, comparison."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from fluxlock.firmware.block import Value
from tests.firmware.vector_bench import VectorBench, VectorSettings
from tests.firmware.vector_float import CLOCK_HZ

ACCEL_RPM_S = 250_000
VALUES: dict[str, Value] = {"current_limit_ma": 30_000, "accel_rpm_s": ACCEL_RPM_S}
LINES = 256
RESOLUTION_DEG = 360.0 / (4 * LINES)
SENSORED = VectorSettings(sensored=True, encoder_lines=LINES, encoder_offset_turn=0.3)


def worst_deg(bench: VectorBench, seconds: float, until: Callable[[], bool] | None = None) -> float:
    """Run; largest angle error on the way."""
    bench.record.clear()
    bench.run(seconds, until)
    return max(abs(s.error_deg) for s in bench.record)


def loop_lag_deg(bench: VectorBench) -> float:
    """Largest lag of a third-order loop with a triple pole: 2/e^2 a / omega^2 for a step a of the acceleration.

    The step is that to the slope of the target, whose current goes ahead. Meanwhile the observed speed lags by less
    than a / omega: the speed regulator adds less than its bandwidth over omega to the acceleration, and as much of
    that.
    """
    s = bench.settings
    omega = (1.0 - s.pll_pole) / (s.sample_cycles * s.tick_samples / CLOCK_HZ)
    slope = ACCEL_RPM_S * math.pi / 30.0 * bench.motor.pole_pairs
    added = 2.0 * math.pi * s.speed_bandwidth_hz / omega
    return math.degrees(2.0 * math.exp(-2.0) * slope / (1.0 - added) / omega**2)


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize(("samples", "cycles"), [(1, 2500), (4, 1250)])
def test_standstill_speed_zero_reversal_and_stop(samples: int, cycles: int, index: bool) -> None:
    """From standstill to 30 000 r/min, through zero to -30 000, held at 0, stopped: never handed back.

    With the index the angle is within a quarter of a line and what the loop lags while accelerating; learnt, the
    alignment adds at most 5 degrees and the same ever after.

    Verifies: ENC-05
    """
    settings = replace(SENSORED, sample_cycles=cycles, tick_samples=samples, encoder_index=index)
    bench = VectorBench(settings, values=VALUES, noise_lsb=1.0)
    bench.start(30_000, 0.2)
    assert abs(bench.rpm) < 2000.0
    bench.run(0.35)
    assert bench.rpm == pytest.approx(30_000, rel=0.01)
    steady = worst_deg(bench, 0.05)
    bench.fw.command("set speed_rpm -30000")
    reversal = worst_deg(bench, 0.5)
    assert bench.fw.state == "running"
    assert bench.rpm == pytest.approx(-30_000, rel=0.01)
    bench.fw.command("set speed_rpm 0")
    bench.run(0.4)
    assert bench.fw.state == "running"
    held = worst_deg(bench, 0.2)
    assert abs(bench.rpm) < 100.0
    bench.fw.command("set speed_rpm 5000")
    bench.run(0.2)
    bench.fw.command("stop")
    assert bench.until_state("ready", 0.5), bench.fw.command("status")
    assert abs(bench.rpm) < 1000.0
    assert (bench.console("fault"), bench.console("lost_locks"), bench.trips) == ("none", "0", 0)
    print(f"index {index}, {samples} a tick: steady {steady:.2f}, reversal {reversal:.2f}, held {held:.2f} deg")
    allowed = RESOLUTION_DEG if index else 5.0
    assert steady < allowed
    assert held < allowed
    assert reversal < allowed + loop_lag_deg(bench)


def test_index_sets_a_wrong_mounting_right() -> None:
    """Before the index the alignment counts, whatever the position was at power-up; after it the file's mounting does.

    Verifies: ENC-05
    """
    bench = VectorBench(SENSORED, values=VALUES)
    bench.start(3_000, 0.2)
    assert worst_deg(bench, 0.01, lambda: bench.indexed) < 8.0
    assert bench.run(0.2, lambda: bench.indexed)
    bench.run(0.05)
    assert worst_deg(bench, 0.1) < RESOLUTION_DEG


def test_lost_steps_are_counted_and_a_blind_encoder_is_a_lost_lock() -> None:
    """Invalid changes are shown; an encoder that stands still while the rotor turns ends the run.

    Verifies: ENC-04
    """
    values: dict[str, Value] = {**VALUES, "restart_retries": 0}
    bench = VectorBench(replace(SENSORED, encoder_index=False), values=values, unprotected=True)
    bench.start(20_000, 0.2)
    bench.run(0.2)
    bench.put("encoder.counters", 3)
    bench.run(0.01)
    assert bench.console("encoder_faults") == "3"
    assert bench.fw.state == "running"
    bench.plant.quarters = 0  # its last position stays
    assert bench.run(0.1, bench.left_running)
    assert bench.console("fault") == "lost_lock"


@pytest.mark.parametrize("sensored", [True, False])
def test_both_angles_are_compared(sensored: bool) -> None:
    """The observed angle beside the encoder's, whichever drives: an inductance 30 % wrong shows as their difference.

    Verifies: ENC-06
    """
    shown = {}
    for factor in (1.0, 1.3):
        bench = VectorBench(replace(SENSORED, sensored=sensored), values=VALUES, fan_nm=0.02, fan_rpm=40_000.0)
        bench.plant.l_d_h = bench.plant.l_q_h = bench.machine.inductance_h * factor
        bench.start(40_000, 0.6)
        bench.run(0.4)
        assert bench.rpm == pytest.approx(40_000, rel=0.01)
        observed, encoder = (float(bench.console(name)) for name in ("observed_ahead_deg", "encoder_ahead_deg"))
        shown[factor] = observed - encoder
        i_q = int(bench.console("iq_ma")) / 1e3
        # The observer takes (L - L') i_q for EMF: the observed angle is ahead where the machine has more of it.
        expected = math.degrees((factor - 1.0) * 22e-6 * i_q / 1e-3)
        print(
            f"sensored {sensored}, L x {factor}: observed - encoder {shown[factor]:+.2f} deg, expected {expected:+.2f}"
        )
        assert abs(abs(shown[factor]) - expected) < 1.0
    assert abs(shown[1.3]) > 2.0


def test_turning_rotor_is_taken_over_by_an_encoder_that_has_seen_its_index() -> None:
    """A rotor that turns at the start: the drive takes it at its speed and holds it.

    Verifies: VC-48
    """
    bench = VectorBench(VectorSettings(sensored=True, encoder_lines=1024), values={"current_limit_ma": 30_000})
    bench.omega = 2 * math.pi * 600.0
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 30000")
    bench.fw.command("start")
    assert bench.until_state("running", 0.1)
    assert bench.console("catches") == "1"
    bench.run(0.3)
    assert float(bench.console("measured_rpm")) == pytest.approx(30_000, rel=0.01)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("off_deg", [60.0, 90.0, -90.0, 150.0, 180.0])
def test_wrong_index_is_a_named_fault(off_deg: float, direction: int) -> None:
    """An index that the file puts elsewhere: the EMF tells it, within 0.2 s of the start; 20 degrees pass.

    Verifies: ENC-07
    """
    for error_deg, fault in ((off_deg, "encoder"), (math.copysign(20.0, off_deg), "none")):
        told: dict[str, Value] = {"encoder_offset_q32": round((0.3 + error_deg / 360.0 + 0.5) % 1.0 * 2**32 - 2**31)}
        bench = VectorBench(SENSORED, values=VALUES | told)
        assert bench.until_state("ready", 0.1)
        assert bench.fw.command(f"set speed_rpm {direction * 30_000}") == ["ok"]
        assert bench.fw.command("start") == ["ok"]
        bench.run(0.2)
        assert bench.console("fault") == fault, (error_deg, bench.fw.command("status"), bench.rpm)
