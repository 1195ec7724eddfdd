# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The vector drive with an encoder, against the exact discrete machine: sensored runs, mounting, comparison."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from fluxlock.firmware.block import Value
from tests.firmware.firmware_bench import MOTOR_1
from tests.firmware.vector_bench import VectorBench, VectorSettings
from tests.firmware.vector_float import CLOCK_HZ

ACCEL_RPM_S = 250_000
VALUES: dict[str, Value] = {"current_limit_ma": 30_000, "accel_rpm_s": ACCEL_RPM_S}
LINES = 256
RESOLUTION_DEG = 360.0 / (4 * LINES)
FOUND_S = 0.02  # a lost angle, where there is an EMF to see
# The forced frame leads the rotor on by up to half a turn.
LED_RPM = 60.0 * math.sqrt(VectorSettings().start_hz_per_s)
START_S = 0.2  # what is wrong from the start on
# Twice the voltage of the lost dead time, 0.13 V here.
EMF_SHOWS_RPM = 2500
ASTRAY_S = 0.005
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
    assert abs(bench.rpm) < LED_RPM
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


def test_lost_steps_are_counted_and_a_blind_encoder_is_named() -> None:
    """Invalid changes are shown; an encoder that stands still while the rotor turns ends the run.

    Verifies: ENC-04, ENC-08
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
    assert bench.run(FOUND_S, bench.left_running)
    assert bench.console("fault") == "encoder"


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


@pytest.mark.parametrize("index", [True, False])
def test_turning_rotor_is_taken_over(index: bool) -> None:
    """A turning rotor: the drive takes it at its speed and holds it, without an index by the angle of the EMF.

    Verifies: VC-48
    """
    settings = VectorSettings(sensored=True, encoder_lines=1024, encoder_index=index)
    bench = VectorBench(settings, values={"current_limit_ma": 30_000})
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


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize("rpm", [-30_000, -1000, 1000, 30_000])
def test_exchanged_tracks_are_named_before_they_drive(rpm: int, index: bool) -> None:
    """An encoder that counts backward: named at the start, before the frame has followed it, at any target.

    Verifies: ENC-08
    """
    bench = VectorBench(replace(SENSORED, encoder_inverted=True, encoder_index=index), values=VALUES)
    assert bench.until_state("ready", 0.1)
    bench.fw.command(f"set speed_rpm {rpm}")
    bench.fw.command("start")
    aligned = bench.theta
    assert bench.run(START_S, lambda: bench.fw.state == "fault")
    assert (bench.console("fault"), bench.trips) == ("encoder", 0)
    assert {s.state for s in bench.record} <= {"init", "ready", "starting", "fault"}
    assert math.copysign(1.0, rpm) * (bench.theta - aligned) > -math.pi / 2, "against the target"


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize("theta", [0.3, 1.9, 3.5, 5.1])
def test_exchanged_tracks_of_a_turning_rotor_are_named(theta: float, index: bool) -> None:
    """A rotor that turns at the start is not taken over by an encoder that counts backward, wherever it is.

    Verifies: ENC-08
    """
    bench = VectorBench(replace(SENSORED, encoder_inverted=True, encoder_index=index), values=VALUES, theta=theta)
    bench.omega = 2 * math.pi * 600.0
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 30000")
    bench.fw.command("start")
    assert bench.run(FOUND_S, lambda: bench.fw.state == "fault")
    assert (bench.console("fault"), bench.trips, abs(bench.i)) == ("encoder", 0, 0.0)


def named(settings: VectorSettings, rpm: int, seconds: float) -> tuple[str, float, float]:
    """Start, run until a fault: its name, the largest error and the time since one of 45 degrees."""
    bench = VectorBench(settings, values=VALUES)
    bench.start(rpm, START_S)
    bench.record.clear()
    bench.run(seconds, lambda: bench.fw.state == "fault")
    errors = [(s.time_s, abs(s.error_deg)) for s in bench.record if s.state == "running"]
    far = next((at_s for at_s, error in errors if error > 45.0), errors[-1][0])
    assert bench.trips == 0
    return bench.console("fault"), max(error for _, error in errors), errors[-1][0] - far


@pytest.mark.parametrize("rpm", [1000, 30_000])
@pytest.mark.parametrize(
    "wrong", [{"encoder_told": told} for told in (0.9, 1000 / 1024, 1.024, 1.1)] + [{"encoder_missing_lines": 20}]
)
def test_wrong_counts_beside_an_index_are_named(wrong: dict[str, float], rpm: int) -> None:
    """Lines that the drive is told wrongly, or that are missing: an index that strays turn after turn is named.

    Verifies: ENC-08
    """
    fault, error_deg, _ = named(replace(SENSORED, **wrong), rpm, 1.0)
    assert fault == "encoder"
    assert error_deg < 90.0


@pytest.mark.parametrize(
    "wrong", [{"encoder_told": told} for told in (1000 / 1024, 1.024)] + [{"encoder_missing_lines": 1}]
)
def test_wrong_counts_without_an_index_are_named(wrong: dict[str, float]) -> None:
    """The angle drifts away from that of the EMF: named 20 ms after it is 45 degrees off.

    Verifies: ENC-08
    """
    fault, _, since_s = named(replace(SENSORED, encoder_index=False, **wrong), 30_000, 0.5)
    assert fault == "encoder"
    assert since_s < FOUND_S


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize("rpm", [-1000, 3000, 30_000])
@pytest.mark.parametrize("told", [0.25, 0.5, 2.0, 4.0])
def test_counts_taken_for_lines_are_named(told: float, rpm: int, index: bool) -> None:
    """A factor of two or four in the file, whatever the speed: the rotor swings about a place, or outruns its encoder.

    Below the speed that the EMF shows only the index or the rotor that is held can tell it.

    Verifies: ENC-08
    """
    bench = VectorBench(replace(SENSORED, encoder_told=told, encoder_index=index), values=VALUES)
    assert bench.until_state("ready", 0.1)
    bench.fw.command(f"set speed_rpm {rpm}")
    bench.fw.command("start")
    bench.run(START_S + (1.0 if abs(rpm) < EMF_SHOWS_RPM else 0.5), lambda: bench.fw.state == "fault")
    log = [line.split()[1] for line in bench.fw.command("faults") if line.startswith("fault ")]
    assert log and set(log) <= ({"encoder", "stalled"}), (log, bench.rpm)
    assert log[0] == "encoder" or not index
    assert bench.trips == 0


@pytest.mark.parametrize("rpm", [-1000, 1000])
@pytest.mark.parametrize("told", [0.98, 1.02])
def test_a_drift_below_the_emf_does_not_run_away(told: float, rpm: int) -> None:
    """Without index, load or EMF nothing shows the angle: it drifts. As the EMF appears, the drive is off in 5 ms.

    Verifies: ENC-08
    """
    bench = VectorBench(replace(SENSORED, encoder_index=False, encoder_told=told), values=VALUES)
    bench.start(rpm, START_S)
    bench.record.clear()
    assert bench.run(2.0, lambda: bench.left_running())
    full_rad_s2 = 1.5 * MOTOR_1.psi_vs[0] * 30.0 / MOTOR_1.inertia_kgm2
    assert max(abs(s.rpm) for s in bench.record) < EMF_SHOWS_RPM + ASTRAY_S * full_rad_s2 * 30.0 / math.pi


def test_an_index_corrects_a_lost_line() -> None:
    """A line that the encoder loses each turn, 1.4 degrees, is set right by the index.

    Verifies: ENC-08
    """
    bench = VectorBench(replace(SENSORED, encoder_missing_lines=1), values=VALUES)
    bench.start(30_000, START_S)
    bench.run(0.4)
    assert worst_deg(bench, 0.1) < 5 * RESOLUTION_DEG
    assert bench.console("fault") == "none"


@pytest.mark.parametrize("told", [0.5, 0.9, 1.1, 2.0])
def test_a_rotor_that_its_encoder_holds_is_named(told: float) -> None:
    """Counts so wrong that the current pulls the rotor to a place and holds it there, too slow for an EMF: a stall.

    Verifies: ENC-08
    """
    bench = VectorBench(replace(SENSORED, encoder_index=False, encoder_told=told), values=VALUES)
    bench.start(30_000, START_S)
    assert bench.run(START_S, lambda: bench.fw.state != "running")
    assert {line.split()[1] for line in bench.fw.command("faults") if line.startswith("fault ")} <= {
        "stalled",
        "encoder",
    }


@pytest.mark.parametrize("proven", [False, True])
def test_a_blocked_rotor_is_a_stall(proven: bool) -> None:
    """Before an EMF has agreed with the encoder the drive starts again; afterwards it holds, and the log says it.

    Verifies: ENC-08
    """
    bench = VectorBench(SENSORED, values=VALUES)
    if proven:
        bench.start(30_000, START_S)
        bench.run(0.3)
        bench.omega, bench.locked = 0.0, True
    else:
        bench.locked = True
        bench.start(30_000, START_S)
    bench.run(START_S, None if proven else bench.left_running)
    assert "fault stalled" in " ".join(bench.fw.command("faults"))
    assert (bench.fw.state == "running") == proven
