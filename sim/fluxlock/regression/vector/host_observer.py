# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's regulator, EMF observer and phase-locked loop on this computer, closed over the exact model."""

from __future__ import annotations

import cmath
import math
from ctypes import byref

from fluxlock.analysis.vector.model import Sampling, SmoothMachine, coefficients, emf
from fluxlock.firmware.vector_library import (
    Complex,
    ComplexRegulator,
    Machine,
    Observer,
    Pll,
    RegulatorDesign,
    RegulatorGains,
    from_complex,
    model_at,
    observer_gains,
    pll_gains,
    real_gain,
    to_complex,
    vector_library,
)

CLOCK_HZ = 50e6
FULL_SCALE_A, FULL_SCALE_V = 50.0, 30.0
Q30, Q32, Q36 = 2**30, 2**32, 2**36
ORDER_C, GAMMA, POLE, PLL_POLE = 2, 0.35, 0.7, 0.95
SAMPLES, TAIL = 600, 50
MINIMUM_V_Q25 = 10_000  # of the EMF


def _firmware_machine(machine: SmoothMachine, period_cycles: int, delay: float) -> Machine:
    """Machine with a delay (over T_s) in the firmware's units, held inverse Park."""
    rate, period_s = machine.r_ohm / machine.l_h, period_cycles / CLOCK_HZ
    admittance = period_s * FULL_SCALE_V / (machine.l_h * FULL_SCALE_A)
    gains = real_gain(admittance), real_gain(1.0 / admittance)
    return Machine(round(rate * period_s * Q30), round(delay * Q30), *gains, period_cycles, 1, 0)


def host_errors_deg(
    machine: SmoothMachine, period_cycles: int, delay: float, believed: float, speed_hz: float, current: complex
) -> list[float]:
    """Angle errors (deg) of the last samples at a constant electrical speed (Hz, signed) and current (A, d + jq).

    delay: of the plant over T_s; believed: what regulator and observer are told.
    """
    lib = vector_library()
    omega, speed_q36 = 2 * math.pi * speed_hz, round(speed_hz / CLOCK_HZ * Q36)
    plant = coefficients(machine, omega, Sampling.at(CLOCK_HZ / period_cycles, delay, "held"))
    back = complex(emf(machine, omega))
    unit_a, unit_v = 2**17 / FULL_SCALE_A, 2**25 / FULL_SCALE_V
    told = _firmware_machine(machine, period_cycles, believed)
    gains, design = RegulatorGains(), RegulatorDesign(ORDER_C, 0, round(GAMMA * Q30))
    model = model_at(lib, told, speed_q36)
    assert lib.regulator_design(byref(gains), byref(design), byref(told), byref(model))
    u = complex(-plant.gamma_e * back / plant.gamma)
    regulator, observer, pll, loop = ComplexRegulator(), Observer(), Pll(), pll_gains(PLL_POLE, period_cycles)
    lib.complex_regulator_preset(byref(regulator), from_complex(u, unit_v), Complex(0, 0))
    lib.emf_observer_preset(byref(observer), Complex(0, 0), from_complex(back, unit_v), from_complex(u, unit_v))
    lib.pll_preset(byref(pll), 0, speed_q36)
    reference, i, exact, errors = from_complex(current, unit_a), 0j, 0.0, []
    for _ in range(SAMPLES):
        ahead = (lib.pll_angle_turn_q32(byref(pll)) / Q32 - exact + 0.5) % 1.0 - 0.5
        errors.append(360.0 * ahead)
        turn = cmath.exp(2j * math.pi * ahead)
        measured = from_complex(i / turn, unit_a)
        lib.complex_regulator_step(byref(regulator), byref(gains), reference, measured, 2**17 - 1)
        observing = observer_gains(lib, told, lib.pll_speed_turn_q36(byref(pll)), POLE, POLE)
        lib.emf_observer_step(byref(observer), byref(observing), measured)
        lib.emf_observer_voltage(byref(observer), byref(observing), regulator.voltage_v_q25)
        error = lib.pll_error_q30(observer.emf_v_q25, lib.pll_speed_turn_q36(byref(pll)), MINIMUM_V_Q25)
        lib.pll_step(byref(pll), byref(loop), period_cycles, error)
        before, u = u, to_complex(regulator.voltage_v_q25, unit_v) * turn
        i = complex(plant.phi * i + plant.gamma1 * u + plant.gamma2 * before + plant.gamma_e * back)
        exact = (exact + speed_q36 * period_cycles / Q36) % 1.0
    return errors[-TAIL:]
