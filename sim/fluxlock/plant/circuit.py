# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Circuit: which legs conduct, and what follows at an instant. Kernel code: see `build.py` for its rules.

Conducting leg x: v_x = rail_x vdc + V_x - r_x i_x (switch: V = 0, r = R_on; lower diode: V = -Vd; upper: rail
= 1, V = +Vd). Star-connected machine: v_x = R_x i_x + sum_y L_xy di_y/dt + e_x + v_N, sum of currents 0.
Eliminating v_N over the conducting legs gives di/dt = G u with u_x = v_x - R_x i_x - e_x and a symmetric G
whose rows sum to zero. In a salient machine e_x also holds omega sum_y (dL_xy/dtheta) i_y.

A leg with both gates off and i = 0 is open while its terminal stays within [-Vd, vdc + Vd]. With one
conducting leg no current flows and it fixes the star point; with none the equal sense resistors put it where
the terminals sum to zero, unless a lower diode clamps the lowest terminal.

A broken leg never conducts; its sense resistor hangs on the winding. A switch that is stuck on conducts whatever its
gate says; when the other gate of its leg turns on, the driver sees the short, blocks that switch and pulls the fault
pin.

PHASES and FIELD are constants of a compiled kernel (`build.py`): FIELD is True for a machine that is described by its
flux linkages (`flux.py`), whose currents any set of conducting legs may share.
"""

from __future__ import annotations

from . import layout as L
from .emf import row_times, theta_unwrapped
from .vector import Vector

PHASES = 3
FIELD = False


def set_mode(s: Vector, x: int, mode: int) -> None:
    """Connect leg x."""
    s[L.MODE + x] = mode
    s[L.RAIL + x] = 1.0 if mode == L.HIGH or mode == L.DIODE_HIGH else 0.0
    if mode == L.OPEN:
        s[L.V_LEG + x] = 0.0
        s[L.R_LEG + x] = 0.0
    elif mode == L.HIGH or mode == L.LOW:
        s[L.V_LEG + x] = 0.0
        s[L.R_LEG + x] = s[L.R_ON]
    elif mode == L.DIODE_LOW:
        s[L.V_LEG + x] = -s[L.DIODE_V]
        s[L.R_LEG + x] = s[L.DIODE_R]
    else:
        s[L.V_LEG + x] = s[L.DIODE_V]
        s[L.R_LEG + x] = s[L.DIODE_R]


def eliminate(s: Vector) -> None:
    """Set G_FULL, CONDUCTING and REFERENCE for the present MODEs and LM.

    With the currents of all conducting legs but the first as unknowns, P di/dt = u - u_first, P_ab = L_ab - L_a,first -
    L_first,b + L_first,first: symmetric and positive definite, inverted in place without a search for pivots.
    """
    legs = 0
    for x in range(PHASES):
        if s[L.MODE + x] != L.OPEN:
            s[L.LIST + legs] = x
            legs += 1
    s[L.CONDUCTING] = legs
    s[L.REFERENCE] = s[L.LIST] if legs > 0 else -1.0
    for k in range(PHASES * PHASES):
        s[L.G_FULL + k] = 0.0
    if legs < 2:
        return
    first = int(s[L.LIST])
    last = s[L.LM + PHASES * first + first]
    n = legs - 1
    for a in range(n):
        x = int(s[L.LIST + a + 1])
        for b in range(n):
            y = int(s[L.LIST + b + 1])
            entry = s[L.LM + PHASES * x + y] - s[L.LM + PHASES * x + first] - s[L.LM + PHASES * first + y] + last
            s[L.PIVOT + L.LEGS * a + b] = entry
    for p in range(n):
        pivot = 1.0 / s[L.PIVOT + L.LEGS * p + p]
        s[L.PIVOT + L.LEGS * p + p] = 1.0
        for b in range(n):
            s[L.PIVOT + L.LEGS * p + b] = s[L.PIVOT + L.LEGS * p + b] * pivot
        for a in range(n):
            if a != p:
                f = s[L.PIVOT + L.LEGS * a + p]
                s[L.PIVOT + L.LEGS * a + p] = 0.0
                for b in range(n):
                    s[L.PIVOT + L.LEGS * a + b] = s[L.PIVOT + L.LEGS * a + b] - f * s[L.PIVOT + L.LEGS * p + b]
    total = 0.0
    for a in range(n):
        x = int(s[L.LIST + a + 1])
        row = 0.0
        for b in range(n):
            y = int(s[L.LIST + b + 1])
            g = 0.5 * (s[L.PIVOT + L.LEGS * a + b] + s[L.PIVOT + L.LEGS * b + a])
            s[L.G_FULL + PHASES * x + y] = g
            row += g
        s[L.G_FULL + PHASES * x + first] = -row
        s[L.G_FULL + PHASES * first + x] = -row
        total += row
    s[L.G_FULL + PHASES * first + first] = total


def couple(s: Vector) -> None:
    """Set G, CONDUCTING, FLOATING and REFERENCE for the present MODEs."""
    if FIELD:
        mask = 0
        for x in range(PHASES):
            if s[L.MODE + x] != L.OPEN:
                mask += 1 << x
        if s[L.G_MASK] != mask:
            s[L.G_MASK] = mask
            eliminate(s)
        return
    a = s[L.MODE] != L.OPEN
    b = s[L.MODE + 1] != L.OPEN
    c = s[L.MODE + 2] != L.OPEN
    mask = (1 if a else 0) + (2 if b else 0) + (4 if c else 0)
    if s[L.G_MASK] == mask:
        return
    s[L.G_MASK] = mask
    for k in range(6):
        s[L.G + k] = 0.0
    s[L.REFERENCE] = 0 if a else 1 if b else 2 if c else -1
    s[L.FLOATING] = -1
    if mask == 7:
        s[L.CONDUCTING] = 3
        lcc = s[L.LM + 8]
        paa = s[L.LM] - 2.0 * s[L.LM + 2] + lcc
        pab = s[L.LM + 1] - s[L.LM + 2] - s[L.LM + 5] + lcc
        pbb = s[L.LM + 4] - 2.0 * s[L.LM + 5] + lcc
        det = paa * pbb - pab * pab
        s[L.G] = pbb / det
        s[L.G + 1] = -pab / det
        s[L.G + 3] = paa / det
        s[L.G + 2] = -s[L.G] - s[L.G + 1]
        s[L.G + 4] = -s[L.G + 1] - s[L.G + 3]
        s[L.G + 5] = -s[L.G + 2] - s[L.G + 4]
    elif mask == 3:
        s[L.CONDUCTING] = 2
        s[L.FLOATING] = 2
        g = 1.0 / (s[L.LM] - 2.0 * s[L.LM + 1] + s[L.LM + 4])
        s[L.G] = g
        s[L.G + 1] = -g
        s[L.G + 3] = g
    elif mask == 5:
        s[L.CONDUCTING] = 2
        s[L.FLOATING] = 1
        g = 1.0 / (s[L.LM] - 2.0 * s[L.LM + 2] + s[L.LM + 8])
        s[L.G] = g
        s[L.G + 2] = -g
        s[L.G + 5] = g
    elif mask == 6:
        s[L.CONDUCTING] = 2
        s[L.FLOATING] = 0
        g = 1.0 / (s[L.LM + 4] - 2.0 * s[L.LM + 5] + s[L.LM + 8])
        s[L.G + 3] = g
        s[L.G + 4] = -g
        s[L.G + 5] = g
    elif mask == 0:
        s[L.CONDUCTING] = 0
    else:
        s[L.CONDUCTING] = 1


def link_now(s: Vector) -> None:
    """Set IDC and, without a capacitor, the link voltage for the present MODEs and currents."""
    idc = s[L.RAIL] * s[L.I]
    for x in range(1, PHASES):
        idc += s[L.RAIL + x] * s[L.I + x]
    s[L.IDC] = idc
    if s[L.LINK_C_INV] == 0.0:
        s[L.VDC] = s[L.VALUE + L.SUPPLY] - s[L.SUPPLY_R] * s[L.IDC]


def emf_now(s: Vector, x: int) -> float:
    """EMF of phase x, with what a turning inductance induces."""
    if FIELD:
        return s[L.OMEGA] * s[L.FLUX_SLOPE + x]
    e = -s[L.PSI + x] * s[L.OMEGA] * s[L.SHAPE + x]
    if s[L.SALIENT] != 0.0:
        e += s[L.OMEGA] * row_times(s, L.L_SLOPE + 3 * x, s[L.I], s[L.I + 1], s[L.I + 2])
    return e


def voltage_behind(s: Vector, x: int) -> float:
    """Return u of a conducting leg now: leg voltage less resistive drop and EMF."""
    return s[L.RAIL + x] * s[L.VDC] + s[L.V_LEG + x] - (s[L.R + x] + s[L.R_LEG + x]) * s[L.I + x] - emf_now(s, x)


def voltages_behind(s: Vector) -> None:
    """Set U of all legs; that of an open one has no meaning and no effect."""
    for x in range(PHASES):
        s[L.U + x] = voltage_behind(s, x)


def slope_of(s: Vector, x: int) -> float:
    """Return di/dt of leg x from U."""
    if FIELD:
        total = 0.0
        for y in range(PHASES):
            total += s[L.G_FULL + PHASES * x + y] * s[L.U + y]
        return total
    if x == 0:
        return s[L.G] * s[L.U] + s[L.G + 1] * s[L.U + 1] + s[L.G + 2] * s[L.U + 2]
    if x == 1:
        return s[L.G + 1] * s[L.U] + s[L.G + 3] * s[L.U + 1] + s[L.G + 4] * s[L.U + 2]
    return s[L.G + 2] * s[L.U] + s[L.G + 4] * s[L.U + 1] + s[L.G + 5] * s[L.U + 2]


def terminals_now(s: Vector) -> None:
    """Set VT for the present MODEs."""
    star = 0.0
    flowing = False
    if s[L.CONDUCTING] == 0:
        total = emf_now(s, 0)
        low = 0.0 if s[L.LEG_FAULT] == L.BROKEN else total
        s[L.STAR_CLAMP] = 0
        for x in range(1, PHASES):
            e = emf_now(s, x)
            total += e
            if e < low and s[L.LEG_FAULT + x] != L.BROKEN:
                low = e
                s[L.STAR_CLAMP] = x
        star = -total / PHASES
        if star < -s[L.DIODE_V] - low:
            star = -s[L.DIODE_V] - low
        else:
            s[L.STAR_CLAMP] = -1
    else:
        r = int(s[L.REFERENCE])
        star = voltage_behind(s, r)
        if s[L.CONDUCTING] > 1:
            flowing = True
            voltages_behind(s)
            for y in range(PHASES):
                star = star - s[L.LM + PHASES * r + y] * slope_of(s, y)
    for x in range(PHASES):
        if s[L.MODE + x] == L.OPEN:
            v = star + emf_now(s, x)
            if flowing:
                for y in range(PHASES):
                    v += s[L.LM + PHASES * x + y] * slope_of(s, y)
            s[L.VT + x] = v
        else:
            s[L.VT + x] = s[L.RAIL + x] * s[L.VDC] + s[L.V_LEG + x] - s[L.R_LEG + x] * s[L.I + x]


def log_event(s: Vector, cycle: float, kind: int, x: int) -> int:
    """Append an event row."""
    if s[L.EVENT_COUNT] >= s[L.EVENT_ROWS]:
        return L.FAULT_RECORDS_FULL
    p = int(s[L.EVENT_AT]) + L.EVENT_COLUMNS * int(s[L.EVENT_COUNT])
    s[p] = cycle
    s[p + 1] = kind
    s[p + 2] = x
    s[p + 3] = theta_unwrapped(s)
    s[L.EVENT_COUNT] = s[L.EVENT_COUNT] + 1.0
    return L.OK


def pair_turn_on(s: Vector) -> bool:
    """No leg conducts: connect the two diodes that the largest line EMF forces on, if any."""
    top = -1
    low = -1
    for x in range(PHASES):
        if s[L.LEG_FAULT + x] == L.BROKEN:
            continue
        if top < 0:
            top = x
            low = x
            continue
        if emf_now(s, x) > emf_now(s, top):
            top = x
        if emf_now(s, x) < emf_now(s, low):
            low = x
    if top == low:
        return False
    excess = emf_now(s, top) - emf_now(s, low) - s[L.VDC] - 2.0 * s[L.DIODE_V]
    if excess <= L.TOLERANCE_V:
        return False
    set_mode(s, top, L.DIODE_HIGH)
    set_mode(s, low, L.DIODE_LOW)
    return True


def settle_diodes(s: Vector, free: int) -> int:
    """Find the state of the currentless off-legs (bits of `free`): a linear complementarity problem.

    Principal pivoting by least index, which ends because the matrix of the problem is positive definite.
    """
    for _ in range(64):
        couple(s)
        if s[L.CONDUCTING] == 0:
            if pair_turn_on(s):
                continue
            terminals_now(s)
            return L.OK
        terminals_now(s)
        voltages_behind(s)
        changed = False
        for x in range(PHASES):
            if (free >> x) & 1 == 0 or changed:
                continue
            mode = s[L.MODE + x]
            if mode == L.OPEN:
                if s[L.VT + x] < -s[L.DIODE_V] - L.TOLERANCE_V:
                    set_mode(s, x, L.DIODE_LOW)
                    changed = True
                elif s[L.VT + x] > s[L.VDC] + s[L.DIODE_V] + L.TOLERANCE_V:
                    set_mode(s, x, L.DIODE_HIGH)
                    changed = True
            else:
                slope = slope_of(s, x)
                if (slope <= 0.0) if mode == L.DIODE_LOW else (slope >= 0.0):
                    set_mode(s, x, L.OPEN)
                    changed = True
        if not changed:
            return L.OK
    return L.FAULT_TOPOLOGY


def stuck_gates(s: Vector, x: int, g: int) -> int:
    """Gates of leg x as its stuck switch leaves them; sets the fault pin if the other switch is asked for."""
    stuck = 1 if s[L.LEG_FAULT + x] == L.STUCK_HIGH else 2
    if g == 3 - stuck:
        s[L.FAULT_PIN] = 1.0
    return stuck


def connect(s: Vector, gates: int) -> int:
    """Set MODE and what follows from it for the gates and the present currents; log diodes that turn on."""
    free = 0
    before = 0
    for x in range(PHASES):
        g = (gates >> (2 * x)) & 3
        if g == 3:
            return L.FAULT_SHOOT_THROUGH
        if s[L.LEG_FAULT + x] > L.BROKEN:
            g = stuck_gates(s, x, g)
        if s[L.LEG_FAULT + x] == L.BROKEN:
            mode = L.OPEN
        elif g == 1:
            mode = L.HIGH
        elif g == 2:
            mode = L.LOW
        elif s[L.I + x] > 0.0:
            mode = L.DIODE_LOW
        elif s[L.I + x] < 0.0:
            mode = L.DIODE_HIGH
        else:
            mode = L.OPEN
            free += 1 << x
            before += int(s[L.MODE + x]) << (3 * x)
        if s[L.MODE + x] != mode:
            set_mode(s, x, mode)
    link_now(s)
    if free == 0:
        couple(s)
        return L.OK
    code = settle_diodes(s, free)
    for x in range(PHASES):
        mode = int(s[L.MODE + x])
        if code == L.OK and (free >> x) & 1 == 1 and mode != L.OPEN and (before >> (3 * x)) & 7 != mode:
            code = log_event(s, s[L.T_BASE], L.DIODE_ON, x)
    return code
