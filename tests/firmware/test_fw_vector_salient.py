# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Vector control of a salient machine: observer with L_q, least current for the torque. Machine in flux, integrated."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from scipy.optimize import brentq

from fluxlock.config.machine import Machine
from fluxlock.firmware.block import Value, gain
from tests.firmware.machines import inverter, motor
from tests.firmware.vector_bench import VectorBench, VectorSettings

L_D_H, L_Q_H = 0.2e-3, 0.4e-3
MOTOR = motor(
    pole_pairs=4,
    resistance_ohm=0.12,
    inductance_h=L_D_H,
    inductance_q_h=L_Q_H,
    psi_vs=14.5e-3,
    inertia_kgm2=8e-5,
    rated_current_a=10.0,
    max_speed_rpm=4_000,
)
SCALES = {"voltage_full_scale_v": 60.0, "current_full_scale_a": 25.0}
INVERTER = inverter(supply_v=48.0, on_resistance_ohm=0.0, phase_current_a=22.0, dc_current_a=22.0, **SCALES)
IPM = Machine.of(MOTOR, INVERTER)
RATIO_A = IPM.psi_vs / IPM.saliency_h
SETTINGS = VectorSettings(
    mtpa_ratio_a=RATIO_A,
    start_a=4.0,
    start_rise_a_per_s=200.0,
    start_hz_per_s=100.0,
    handover_hz=40.0,
    back_hz=25.0,
    fade_a_per_s=200.0,
    pll_pole=0.984,  # 200 Hz
    speed_bandwidth_hz=20.0,
    encoder_lines=1024,
    encoder_offset_turn=0.3,
)
VALUES: dict[str, Value] = {"current_limit_ma": 15_000, "accel_rpm_s": 10_000}


def best_current_a(torque_nm: float) -> complex:
    """Current vector of the least amplitude for a torque (the analytic condition, solved for the torque)."""

    def at(i_q: float) -> complex:
        return complex(RATIO_A / 2 - math.sqrt(RATIO_A**2 / 4 + i_q**2), i_q)

    def torque(i_q: float) -> float:
        return 1.5 * MOTOR.pole_pairs * (IPM.psi_vs - IPM.saliency_h * at(i_q).real) * i_q

    return at(float(brentq(lambda i_q: torque(i_q) - torque_nm, 0.0, 50.0)))


@pytest.mark.parametrize("sensored", [False, True])
@pytest.mark.parametrize("load_nm", [0.4, 0.8])
def test_least_current_for_the_torque(load_nm: float, sensored: bool) -> None:
    """True i_d at the torque that flows within 2 % of the optimum, by observed and by encoder angle.

    Verifies: VC-18
    """
    bench = VectorBench(replace(SETTINGS, sensored=sensored), MOTOR, INVERTER, VALUES, fan_nm=load_nm, fan_rpm=2_000.0)
    bench.start(2_000, 3.0)
    bench.run(0.9)
    assert bench.rpm == pytest.approx(2_000, rel=0.01)
    best = best_current_a(bench.torque_nm)
    print(
        f"sensored {sensored}, {bench.torque_nm:.3f} Nm: i {bench.i:.3f}, best {best:.3f}, {bench.error_deg:+.2f} deg"
    )
    assert bench.torque_nm == pytest.approx(load_nm, rel=0.02)
    assert bench.i.real == pytest.approx(best.real, rel=0.02)


def test_observer_with_another_inductance_turns_by_its_current() -> None:
    """L_q in the observer: no steady error; the mean of the axes: (L_q - L) i_q over the active flux.

    Verifies: VC-18
    """
    found = {}
    resistance, tick_s = IPM.resistance_ohm, SETTINGS.sample_cycles / 50e6
    admittance = tick_s * SCALES["voltage_full_scale_v"] / (IPM.inductance_h * SCALES["current_full_scale_a"])
    mean: dict[str, Value] = {
        "vector_observer_resistance_q30": round(resistance / IPM.inductance_h * tick_s * 2**30),
        "vector_observer_admittance": gain(admittance),
        "vector_observer_impedance": gain(1.0 / admittance),
        "vector_cross_q16": 0,
    }
    for name, values in (("L_q", {}), ("mean", mean)):
        bench = VectorBench(SETTINGS, MOTOR, INVERTER, {**VALUES, **values}, fan_nm=0.6, fan_rpm=2_000.0)
        bench.start(2_000, 3.0)
        bench.run(0.7)
        bench.record.clear()
        bench.run(0.05)
        found[name] = sum(s.error_deg for s in bench.record) / len(bench.record)
        active = IPM.psi_vs - IPM.saliency_h * bench.i.real
        expected = math.degrees(math.atan((L_Q_H - IPM.inductance_h) * bench.i.imag / active))
        print(f"{name}: {found[name]:+.2f} deg, of the mean expected {expected:.2f}")
    assert abs(found["L_q"]) < 0.3
    assert abs(found["mean"]) == pytest.approx(expected, rel=0.1)
