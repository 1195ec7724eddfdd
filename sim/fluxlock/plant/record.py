# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Waveform records and energy account. Kernel code: see `build.py` for its rules."""

from __future__ import annotations

import math

from . import layout as L
from .circuit import terminals_now
from .emf import quadratic, theta_unwrapped
from .series import series_at
from .vector import Vector

PHASES = 3
FIELD = False
# Gauss-Legendre nodes and weights on 0 .. 1, exact to degree 7.
NODE_0, NODE_1 = 0.06943184420297371, 0.33000947820757187
WEIGHT_0, WEIGHT_1 = 0.17392742256872692, 0.32607257743127307


def write_row(s: Vector, at: int, gates: int) -> None:
    """Write one waveform row at index `at`."""
    terminals_now(s)
    s[at] = s[L.T_CYCLE]
    s[at + 1] = theta_unwrapped(s)
    s[at + 2] = s[L.OMEGA]
    for x in range(PHASES):
        s[at + 3 + x] = s[L.I + x]
        s[at + 3 + PHASES + x] = s[L.VT + x]
    at += 3 + 2 * PHASES
    s[at] = s[L.VDC]
    s[at + 1] = s[L.IDC]
    s[at + 2] = s[L.TORQUE]
    s[at + 3] = gates


def record_wave(s: Vector, gates: int) -> int:
    """Record each WAVE_EVERY-th call."""
    if s[L.WAVE_EVERY] == 0.0:
        return L.OK
    s[L.WAVE_PHASE] = s[L.WAVE_PHASE] + 1.0
    if s[L.WAVE_PHASE] < s[L.WAVE_EVERY]:
        return L.OK
    s[L.WAVE_PHASE] = 0.0
    if s[L.WAVE_COUNT] >= s[L.WAVE_ROWS]:
        return L.FAULT_RECORDS_FULL
    write_row(s, int(s[L.WAVE_AT]) + (L.WAVE_COLUMNS + 2 * PHASES) * int(s[L.WAVE_COUNT]), gates)
    s[L.WAVE_COUNT] = s[L.WAVE_COUNT] + 1.0
    return L.OK


def in_zoom(s: Vector) -> bool:
    """Whether the present event lies in a zoom window."""
    for k in range(int(s[L.ZOOM_N])):  # noqa: SIM110 - no generators in a kernel
        if s[L.ZOOM_T0 + k] <= s[L.T_CYCLE] <= s[L.ZOOM_T1 + k]:
            return True
    return False


def record_zoom(s: Vector, gates: int) -> int:
    """Record a row in the zoom buffer."""
    if s[L.ZOOM_COUNT] >= s[L.ZOOM_ROWS]:
        return L.FAULT_RECORDS_FULL
    write_row(s, int(s[L.ZOOM_AT]) + (L.WAVE_COLUMNS + 2 * PHASES) * int(s[L.ZOOM_COUNT]), gates)
    s[L.ZOOM_COUNT] = s[L.ZOOM_COUNT] + 1.0
    return L.OK


def reluctance_power(s: Vector, order: int, x: float, h: float) -> float:
    """Power that dL/dtheta of a salient machine turns into work at x of a step of h seconds."""
    a = series_at(s, L.SERIES_I, order, x)
    b = series_at(s, L.SERIES_I + L.NK, order, x)
    c = series_at(s, L.SERIES_I + 2 * L.NK, order, x)
    angle = 2.0 * s[L.OMEGA] * h * x
    slope = math.cos(angle) * quadratic(s, L.L_SLOPE, a, b, c)
    return s[L.OMEGA] * (0.5 * slope - math.sin(angle) * quadratic(s, L.L_WAVE, a, b, c))


def flux_power(s: Vector, order: int, x: float) -> float:
    """Shaft power of a machine by its flux linkages at x of a step."""
    total = 0.0
    for plane in range(PHASES // 2):
        d = plane * 2 * L.NK
        q = d + L.NK
        force = series_at(s, L.SERIES_FLUX + d, order, x) * series_at(s, L.SERIES_ROTOR + q, order, x)
        force -= series_at(s, L.SERIES_FLUX + q, order, x) * series_at(s, L.SERIES_ROTOR + d, order, x)
        total += (1.0 + 2.0 * plane) * force
    return 0.5 * PHASES * s[L.OMEGA] * total


def add_power(s: Vector, order: int, x: float, h: float, weight: float) -> None:
    """Add the powers at x of a step of h seconds, times a weight and h, to the energies."""
    weight = weight * h
    d = series_at(s, L.SERIES_D, order, x)
    idc = 0.0
    copper = 0.0
    switch = 0.0
    diode = 0.0
    shaft = 0.0
    if FIELD:
        shaft = flux_power(s, order, x)
    elif s[L.SALIENT] != 0.0:
        shaft = reluctance_power(s, order, x, h)
    for p in range(PHASES):
        i = series_at(s, L.SERIES_I + p * L.NK, order, x)
        idc += s[L.RAIL + p] * i
        copper += s[L.R + p] * i * i
        if not FIELD:
            shaft += series_at(s, L.SERIES_E + p * L.NK, order, x) * i
        mode = s[L.MODE + p]
        if mode == L.HIGH or mode == L.LOW:
            switch += s[L.R_LEG + p] * i * i
        elif mode != L.OPEN:
            diode += s[L.DIODE_V] * abs(i) + s[L.R_LEG + p] * i * i
    supply = s[L.VALUE + L.SUPPLY]
    source = idc
    if s[L.LINK_C_INV] != 0.0:
        source = (supply - d) * s[L.SUPPLY_G] * s[L.SOURCE_ON]
    s[L.ENERGY + L.E_SUPPLY] = s[L.ENERGY + L.E_SUPPLY] + weight * supply * source
    s[L.ENERGY + L.E_SOURCE_R] = s[L.ENERGY + L.E_SOURCE_R] + weight * s[L.SUPPLY_R] * source * source
    s[L.ENERGY + L.E_COPPER] = s[L.ENERGY + L.E_COPPER] + weight * copper
    s[L.ENERGY + L.E_SWITCH] = s[L.ENERGY + L.E_SWITCH] + weight * switch
    s[L.ENERGY + L.E_DIODE] = s[L.ENERGY + L.E_DIODE] + weight * diode
    chopper = d * d * s[L.CHOPPER_G] * s[L.CHOPPER_ON]
    s[L.ENERGY + L.E_CHOPPER] = s[L.ENERGY + L.E_CHOPPER] + weight * chopper
    s[L.ENERGY + L.E_SHAFT] = s[L.ENERGY + L.E_SHAFT] + weight * shaft


def add_energies(s: Vector, order: int, h: float) -> None:
    """Integrate the powers over a sub-interval of h seconds."""
    add_power(s, order, NODE_0, h, WEIGHT_0)
    add_power(s, order, NODE_1, h, WEIGHT_1)
    add_power(s, order, 1.0 - NODE_1, h, WEIGHT_1)
    add_power(s, order, 1.0 - NODE_0, h, WEIGHT_0)
