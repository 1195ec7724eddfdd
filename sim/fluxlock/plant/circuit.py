"""Circuit: which legs conduct, and what follows at an instant. Kernel code: see `build.py` for its rules.

Conducting leg x: v_x = rail_x vdc + V_x - r_x i_x (switch: V = 0, r = R_on; lower diode: V = -Vd; upper: rail
= 1, V = +Vd). Star-connected machine: v_x = R_x i_x + sum_y L_xy di_y/dt + e_x + v_N, sum of currents 0.
Eliminating v_N over the conducting legs gives di/dt = G u with u_x = v_x - R_x i_x - e_x and a symmetric G
whose rows sum to zero. In a salient machine e_x also holds omega sum_y (dL_xy/dtheta) i_y.

A leg with both gates off and i = 0 is open while its terminal stays within [-Vd, vdc + Vd]. With one
conducting leg no current flows and it fixes the star point; with none the equal sense resistors put it where
the terminals sum to zero, unless a lower diode clamps the lowest terminal.
"""

from __future__ import annotations

from . import layout as L
from .emf import row_times, theta_unwrapped
from .vector import Vector


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


def couple(s: Vector) -> None:
    """Set G, CONDUCTING, FLOATING and REFERENCE for the present MODEs."""
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
    s[L.IDC] = s[L.RAIL] * s[L.I] + s[L.RAIL + 1] * s[L.I + 1] + s[L.RAIL + 2] * s[L.I + 2]
    if s[L.LINK_C_INV] == 0.0:
        s[L.VDC] = s[L.VALUE + L.SUPPLY] - s[L.SUPPLY_R] * s[L.IDC]


def emf_now(s: Vector, x: int) -> float:
    """EMF of phase x, with what a turning inductance induces."""
    e = -s[L.PSI + x] * s[L.OMEGA] * s[L.SHAPE + x]
    if s[L.SALIENT] != 0.0:
        e += s[L.OMEGA] * row_times(s, L.L_SLOPE + 3 * x, s[L.I], s[L.I + 1], s[L.I + 2])
    return e


def voltage_behind(s: Vector, x: int) -> float:
    """Return u of a conducting leg now: leg voltage less resistive drop and EMF."""
    return s[L.RAIL + x] * s[L.VDC] + s[L.V_LEG + x] - (s[L.R + x] + s[L.R_LEG + x]) * s[L.I + x] - emf_now(s, x)


def slope_of(s: Vector, x: int, ua: float, ub: float, uc: float) -> float:
    """Return di/dt of leg x."""
    if x == 0:
        return s[L.G] * ua + s[L.G + 1] * ub + s[L.G + 2] * uc
    if x == 1:
        return s[L.G + 1] * ua + s[L.G + 3] * ub + s[L.G + 4] * uc
    return s[L.G + 2] * ua + s[L.G + 4] * ub + s[L.G + 5] * uc


def terminals_now(s: Vector) -> None:
    """Set VT for the present MODEs."""
    star = 0.0
    da = 0.0
    db = 0.0
    dc = 0.0
    if s[L.CONDUCTING] == 0:
        ea = emf_now(s, 0)
        eb = emf_now(s, 1)
        ec = emf_now(s, 2)
        star = -(ea + eb + ec) / 3.0
        low = ea
        s[L.STAR_CLAMP] = 0
        if eb < low:
            low = eb
            s[L.STAR_CLAMP] = 1
        if ec < low:
            low = ec
            s[L.STAR_CLAMP] = 2
        if star < -s[L.DIODE_V] - low:
            star = -s[L.DIODE_V] - low
        else:
            s[L.STAR_CLAMP] = -1
    else:
        r = int(s[L.REFERENCE])
        star = voltage_behind(s, r)
        if s[L.CONDUCTING] > 1:
            ua = voltage_behind(s, 0)
            ub = voltage_behind(s, 1)
            uc = voltage_behind(s, 2)
            da = slope_of(s, 0, ua, ub, uc)
            db = slope_of(s, 1, ua, ub, uc)
            dc = slope_of(s, 2, ua, ub, uc)
            star = star - s[L.LM + 3 * r] * da - s[L.LM + 3 * r + 1] * db - s[L.LM + 3 * r + 2] * dc
    for x in range(3):
        if s[L.MODE + x] == L.OPEN:
            m = L.LM + 3 * x
            s[L.VT + x] = star + emf_now(s, x) + s[m] * da + s[m + 1] * db + s[m + 2] * dc
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
    top = 0
    low = 0
    for x in range(1, 3):
        if emf_now(s, x) > emf_now(s, top):
            top = x
        if emf_now(s, x) < emf_now(s, low):
            low = x
    excess = emf_now(s, top) - emf_now(s, low) - s[L.VDC] - 2.0 * s[L.DIODE_V]
    if excess <= L.TOLERANCE_V:
        return False
    set_mode(s, top, L.DIODE_HIGH)
    set_mode(s, low, L.DIODE_LOW)
    return True


def settle_diodes(s: Vector, free_a: bool, free_b: bool, free_c: bool) -> int:
    """Find the state of the currentless off-legs ("free"): a linear complementarity problem.

    Principal pivoting by least index, which ends because the matrix of the problem is positive definite.
    """
    for _ in range(32):
        couple(s)
        if s[L.CONDUCTING] == 0:
            if pair_turn_on(s):
                continue
            terminals_now(s)
            return L.OK
        terminals_now(s)
        ua = voltage_behind(s, 0)
        ub = voltage_behind(s, 1)
        uc = voltage_behind(s, 2)
        changed = False
        for x in range(3):
            free = free_a if x == 0 else free_b if x == 1 else free_c
            if not free or changed:
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
                slope = slope_of(s, x, ua, ub, uc)
                if (slope <= 0.0) if mode == L.DIODE_LOW else (slope >= 0.0):
                    set_mode(s, x, L.OPEN)
                    changed = True
        if not changed:
            return L.OK
    return L.FAULT_TOPOLOGY


def connect(s: Vector, gates: int) -> int:
    """Set MODE and what follows from it for the gates and the present currents; log diodes that turn on."""
    before_a = s[L.MODE]
    before_b = s[L.MODE + 1]
    before_c = s[L.MODE + 2]
    free_a = False
    free_b = False
    free_c = False
    for x in range(3):
        g = (gates >> (2 * x)) & 3
        if g == 3:
            return L.FAULT_SHOOT_THROUGH
        if g == 1:
            mode = L.HIGH
        elif g == 2:
            mode = L.LOW
        elif s[L.I + x] > 0.0:
            mode = L.DIODE_LOW
        elif s[L.I + x] < 0.0:
            mode = L.DIODE_HIGH
        else:
            mode = L.OPEN
            if x == 0:
                free_a = True
            elif x == 1:
                free_b = True
            else:
                free_c = True
        if s[L.MODE + x] != mode:
            set_mode(s, x, mode)
    link_now(s)
    if not (free_a or free_b or free_c):
        couple(s)
        return L.OK
    code = settle_diodes(s, free_a, free_b, free_c)
    if code == L.OK and free_a and s[L.MODE] != L.OPEN and before_a != s[L.MODE]:
        code = log_event(s, s[L.T_BASE], L.DIODE_ON, 0)
    if code == L.OK and free_b and s[L.MODE + 1] != L.OPEN and before_b != s[L.MODE + 1]:
        code = log_event(s, s[L.T_BASE], L.DIODE_ON, 1)
    if code == L.OK and free_c and s[L.MODE + 2] != L.OPEN and before_c != s[L.MODE + 2]:
        code = log_event(s, s[L.T_BASE], L.DIODE_ON, 2)
    return code
