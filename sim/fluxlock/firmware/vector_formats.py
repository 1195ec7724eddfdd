# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The vector algorithms of the firmware on the host: their C structures from and to SI units."""

from __future__ import annotations

import math
from typing import NamedTuple

from fluxlock.firmware.binding import constant, new
from fluxlock.firmware.block import gain
from fluxlock.headers import CData


class Complex(NamedTuple):
    """complex_t, as C takes it by value and returns it: d and q, or alpha and beta, in a format of the firmware."""

    re: int
    im: int


def to_complex(z: CData, unit: float = 1.0) -> complex:
    """Value of a complex_t in multiples of `unit`."""
    return complex(z.re, z.im) / unit


def from_complex(z: complex, unit: float = 1.0) -> Complex:
    """Nearest pair of integers, `unit` to 1."""
    return Complex(round(z.real * unit), round(z.imag * unit))


def vector_machine(
    resistance: float, delay: float, admittance: float, period_cycles: int, park: str = "held", harmonic: int = 1
) -> CData:
    """vector_machine_t. resistance: R T_s / L; delay: T_d / T_s; admittance: T_s V / (L I) of the full scales V and I.

    period_cycles: T_s in clocks; park: `held` or `exact`; harmonic: turns of the subspace per turn of the rotor.
    """
    return new(
        "vector_machine_t",
        resistance_q30=round(resistance * 2**30),
        delay_q30=round(delay * 2**30),
        admittance=gain(admittance),
        impedance=gain(1.0 / admittance),
        period_cycles=period_cycles,
        harmonic=harmonic,
        park=constant("PARK", park),
    )


def regulator_design(order: str, bandwidth: float = 0.0, gamma: float = 0.0) -> CData:
    """regulator_design_t of order A, B or C. bandwidth: w T_s, of A; gamma: share of the dead beat, of B and C."""
    return new(
        "regulator_design_t",
        order=constant("REGULATOR", order),
        bandwidth_q30=round(bandwidth * 2**30),
        gamma_q30=round(gamma * 2**30),
    )


def model_at(lib: CData, machine: CData, speed_turn_q36: int) -> CData:
    """The firmware's vector_model_t of a vector_machine_t at a speed (2^-36 turn per clock)."""
    plant, model = new("vector_plant_t"), new("vector_model_t")
    lib.vector_plant(plant, machine)
    lib.vector_model(model, plant, speed_turn_q36)
    return model


def observer_gains(lib: CData, machine: CData, speed_turn_q36: int, pole1: float = 0.7, pole2: float = 0.7) -> CData:
    """The firmware's emf_observer_gains_t for two real poles."""
    gains, model = new("emf_observer_gains_t"), model_at(lib, machine, speed_turn_q36)
    lib.emf_observer_design(gains, machine, model, round(pole1 * 2**30), round(pole2 * 2**30))
    return gains


def pll_gains(pole: float, period_cycles: int, order: int = 2) -> CData:
    """pll_gains_t with all poles at `pole`, order 2 or 3; its speed is limited to 0.45 turns per period."""
    q = 1 - pole
    k_p, k_i, k_a = (2 * q, q**2, 0.0) if order == 2 else (3 * q, 3 * q**2, q**3)
    per_turn = 2**30 / (2 * math.pi) / period_cycles
    return new(
        "pll_gains_t",
        angle=gain(k_p * 2**32 / (2 * math.pi * 2**30)),
        speed=gain(k_i * per_turn),
        acceleration=gain(k_a * per_turn),
        speed_max_turn_q36=round(0.45 / period_cycles * 2**36),
    )
