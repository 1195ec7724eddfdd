# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's regulator, EMF observer and phase-locked loop on this computer, closed over the exact model."""

from __future__ import annotations

import cmath
import math

from fluxlock.clock import CLOCK_HZ
from fluxlock.firmware.binding import new, open_library
from fluxlock.firmware.vector_formats import (
    Complex,
    from_complex,
    model_at,
    observer_gains,
    pll_gains,
    regulator_design,
    to_complex,
    vector_machine,
)
from fluxlock.headers import CData
from fluxlock.theory.vector.model import Sampling, SmoothMachine, coefficients, emf

FULL_SCALE_A, FULL_SCALE_V = 50.0, 30.0
Q32, Q36 = 2**32, 2**36
GAMMA, POLE, PLL_POLE = 0.35, 0.7, 0.95
SAMPLES, TAIL = 600, 50
MINIMUM_V_Q25 = 10_000  # of the EMF


def _firmware_machine(machine: SmoothMachine, period_cycles: int, delay: float) -> CData:
    """Machine with a delay (over T_s) as vector_machine_t, held inverse Park."""
    rate, period_s = machine.r_ohm / machine.l_h, period_cycles / CLOCK_HZ
    admittance = period_s * FULL_SCALE_V / (machine.l_h * FULL_SCALE_A)
    return vector_machine(rate * period_s, delay, admittance, period_cycles)


def host_errors_deg(
    machine: SmoothMachine, period_cycles: int, delay: float, believed: float, speed_hz: float, current: complex
) -> list[float]:
    """Angle errors (deg) of the last samples at a constant electrical speed (Hz, signed) and current (A, d + jq).

    delay: of the plant over T_s; believed: what regulator and observer are told.
    """
    lib = open_library()
    omega, speed_q36 = 2 * math.pi * speed_hz, round(speed_hz / CLOCK_HZ * Q36)
    plant = coefficients(machine, omega, Sampling.at(CLOCK_HZ / period_cycles, delay, "held"))
    back = complex(emf(machine, omega))
    unit_a, unit_v = 2**17 / FULL_SCALE_A, 2**25 / FULL_SCALE_V
    told = _firmware_machine(machine, period_cycles, believed)
    gains, design = new("regulator_gains_t"), regulator_design("C", gamma=GAMMA)
    model = model_at(lib, told, speed_q36)
    assert lib.regulator_design(gains, design, told, model)
    u = complex(-plant.gamma_e * back / plant.gamma)
    regulator, observer, pll = new("complex_regulator_t"), new("emf_observer_t"), new("pll_t")
    loop = pll_gains(PLL_POLE, period_cycles)
    lib.complex_regulator_preset(regulator, from_complex(u, unit_v), Complex(0, 0))
    lib.emf_observer_preset(observer, Complex(0, 0), from_complex(back, unit_v), from_complex(u, unit_v))
    lib.pll_preset(pll, 0, speed_q36)
    reference, i, exact, errors = from_complex(current, unit_a), 0j, 0.0, []
    for _ in range(SAMPLES):
        ahead = (lib.pll_angle_turn_q32(pll) / Q32 - exact + 0.5) % 1.0 - 0.5
        errors.append(360.0 * ahead)
        turn = cmath.exp(2j * math.pi * ahead)
        measured = from_complex(i / turn, unit_a)
        lib.complex_regulator_step(regulator, gains, reference, measured, 2**17 - 1)
        observing = observer_gains(lib, told, lib.pll_speed_turn_q36(pll), POLE, POLE)
        lib.emf_observer_step(observer, observing, measured, 0)
        lib.emf_observer_voltage(observer, observing, regulator.voltage_v_q25)
        error = lib.pll_error_q30(observer.emf_v_q25, lib.pll_speed_turn_q36(pll), MINIMUM_V_Q25)
        lib.pll_step(pll, loop, period_cycles, error)
        before, u = u, to_complex(regulator.voltage_v_q25, unit_v) * turn
        i = complex(plant.phi * i + plant.gamma1 * u + plant.gamma2 * before + plant.gamma_e * back)
        exact = (exact + speed_q36 * period_cycles / Q36) % 1.0
    return errors[-TAIL:]
