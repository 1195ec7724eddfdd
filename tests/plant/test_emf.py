# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""EMF shapes, torque sign, floating voltages and freewheeling against closed forms of the specification."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluxlock.plant import Plant
from fluxlock.plant import layout as L
from tests.plant.drives import CLOCK_S, motor_1

OMEGA = 6283.0
PSI = 1e-3


def running(gates: int, theta_rad: float, emf: str = "sinusoidal", **changes: object) -> Plant:
    """Motor-I at imposed speed with the given gates from an angle on."""
    defaults = {
        "machine__emf": emf,
        "mechanics__mode": "imposed",
        "mechanics__omega_m_rad_s": OMEGA,
        "mechanics__theta_e_rad": theta_rad,
        "inverter__supply_r_ohm": 0.0,
        "inverter__r_on_ohm": 0.0,
    }
    params = motor_1(**{**defaults, **changes})
    plant = Plant(params, seed=1, mode="py")
    plant.set_gates(gates)
    return plant


def expected_emf(emf: str, prime_deg: np.ndarray) -> np.ndarray:
    """Phase A's EMF over psi * omega, in the angle theta' = theta + 180 deg of the specification."""
    if emf == "sinusoidal":
        return np.sin(np.radians(prime_deg))
    return np.interp(prime_deg % 360, [0, 30, 150, 210, 330, 360], [0, 1, 1, -1, -1, 0])


@pytest.mark.parametrize("emf", ["sinusoidal", "trapezoidal"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_open_circuit_emf(emf: str, direction: float) -> None:
    """Line voltages with all gates off are the EMF: e_A = psi omega sin(theta'), B and C lag.

    Verifies: PLANT-11
    """
    plant = running(0, 0.3, emf, mechanics__omega_m_rad_s=direction * OMEGA)
    for t in range(700, 60_000, 700):
        plant.advance(t)
        prime = math.degrees(plant.theta_e_rad) + 180.0
        e = direction * PSI * OMEGA * expected_emf(emf, prime - np.array([0.0, 120.0, 240.0]))
        v = plant.terminals_v
        assert np.allclose(v - v.mean(), e - e.mean(), atol=1e-9)
        # Equal sense resistors: no mean, unless a lower diode clamps the lowest terminal.
        assert v.mean() == pytest.approx(max(0.0, -0.7 - (e - e.mean()).min()), abs=1e-9)
        assert v.min() >= -0.7 - 1e-9
    assert len(plant.events()) == 0


def test_torque_sign_and_size() -> None:
    """T = p sum(psi_x g_x i_x): DC current through A and B at the angle of greatest torque.

    Verifies: PLANT-11
    """
    plant = running(0b001001, math.radians(60.0 + 180.0), mechanics__mode="locked", machine__pole_pairs=3)
    plant.advance(1000)
    i = plant.currents_a[0]
    assert i > 10.0
    assert plant.state[L.TORQUE] == pytest.approx(3 * PSI * math.sqrt(3) * i, rel=1e-12)


@pytest.mark.parametrize(("emf", "slope"), [("sinusoidal", 1.5), ("trapezoidal", 1.0)])
def test_floating_terminal(emf: str, slope: float) -> None:
    """v_O = Vdc/2 + slope * e_O in PWM-on with equal inductances (around its zero crossing).

    Verifies: PLANT-03, PLANT-11
    """
    plant = running(0b001001, math.radians(45.0 + 180.0), emf)  # sector I: A+ B-, C floats and falls through zero at 60
    for t in range(500, 4000, 250):
        plant.advance(t)
        prime = math.degrees(plant.theta_e_rad) - 180.0
        e_c = PSI * OMEGA * float(expected_emf(emf, np.array(prime - 240.0)))
        assert plant.terminals_v[2] == pytest.approx(12.5 + slope * e_c, abs=1e-9)


def test_unequal_inductance_shifts_the_floating_terminal() -> None:
    """The star point shifts by half of (L_H - L_L)/(L_H + L_L) of the driving voltage.

    Verifies: PLANT-03
    """
    lh, ll = 27e-6, 22e-6
    plant = running(0b001001, math.radians(60.0 + 180.0), machine__l_h=(lh, ll, 22e-6), machine__r_ohm=(0.0,) * 3)
    plant.advance(1)
    e_h, e_l = PSI * OMEGA * math.sin(math.radians(60)), -PSI * OMEGA * math.sin(math.radians(60))
    shift = -0.5 * (lh - ll) / (lh + ll) * (25.0 - (e_h - e_l))
    assert plant.terminals_v[2] == pytest.approx(12.5 + shift, abs=2e-3)


@pytest.mark.parametrize(("emf", "drop"), [("sinusoidal", None), ("trapezoidal", 2 / 3)])
def test_freewheel_of_the_outgoing_phase(emf: str, drop: float | None) -> None:
    """After II -> III the outgoing phase A decays as L di/dt = -Vdc/3 + e(t) - R i through its lower diode.

    e = -psi omega sin(150 deg + omega t), trapezoid -2/3 psi omega at the commutation (ideal diodes).

    Verifies: PLANT-02, PLANT-11
    """
    commutation = math.radians(150.0 - 180.0)
    plant = running(0b100001, commutation - OMEGA * 40e-6, emf, inverter__diode_drop_v=0.0)  # A+ C-
    plant.advance(2000)
    i0 = float(plant.currents_a[0])
    assert i0 > 10.0
    plant.set_gates(0b100100)  # B+ C-: A freewheels
    plant.advance(2000 + 1)
    di = (plant.currents_a[0] - i0) / CLOCK_S
    e = -PSI * OMEGA * (drop if drop else math.sin(math.radians(150.0)))
    assert di == pytest.approx((-25.0 / 3 + e - 0.02 * i0) / 22e-6, rel=1e-3)
    plant.advance(20_000)
    first = plant.events()[0]
    assert (first["kind"], first["phase"]) == (L.EXTINCTION, 0)
    if drop is None:
        t, i, h = 0.0, i0, 1e-9
        while i > 0:
            i += h / 22e-6 * (-25.0 / 3 - PSI * OMEGA * math.sin(math.radians(150.0) + OMEGA * (t + h / 2)) - 0.02 * i)
            t += h
        assert (first["t_cycle"] - 2000) * CLOCK_S == pytest.approx(t, abs=3e-9)
        assert first["theta_e"] == pytest.approx(commutation + OMEGA * t, abs=3e-5)


def test_regeneration_through_the_diodes() -> None:
    """All gates off above the speed where the line EMF exceeds the link: current flows back, braking.

    Verifies: PLANT-02
    """
    plant = Plant(motor_1(mechanics__omega_m_rad_s=20_000.0), seed=1, mode="jit")
    plant.configure_recording(1)
    for k in range(1, 2001):
        plant.sample(50 * k)
    r = plant.records()
    assert r["idc"].min() < -1.0 and r["idc"].max() < 1e-9
    assert r["torque_nm"].mean() < 0.0
    assert plant.omega_e_rad_s < 20_000.0
    for phase in "abc":
        assert r["v" + phase].max() < r["vdc"].max() + 0.7 + 1e-6
        assert r["v" + phase].min() > -0.7 - 1e-6
