# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Taylor series of the circuit's solution in x = t / h, 0 <= x <= 1. Kernel code: rules in `build.py`.

Between events the circuit is linear with the EMF as an analytic input, so its series converges for any step;
h is short enough for the last of at most ORDER terms to be below rounding. The same polynomials serve for the
state, the diode instants, the divider filter and the energies.

A salient machine's inductance is a series too: with L_WAVE = W, L_SLOPE = S and d = omega h x the angle of the step,
L = mean + W cos(2 d) + S/2 sin(2 d). Of (L i)' = v - R i - e each power gives the next one of i with the inverse G
of the first of L alone; what the other powers of L contribute stands beside the EMF. With two conducting legs the
inductance of the pair has zeros at complex angles, so the series converges for steps of
2 omega h < arcosh((L_q + L_d) / |L_q - L_d|) only: the step is halved until its terms vanish.
"""

from __future__ import annotations

import types
from collections.abc import Callable

from . import layout as L
from .emf import row_times
from .vector import Vector

PHASES = 3
FIELD = False
TURNING = False  # True in `build_turning_series`: as a constant it costs other machines nothing


def inductance_series(s: Vector, h: float) -> None:
    """Set SERIES_L: L_SLOPE (odd powers) or L_WAVE (even) times entry j is power j >= 1 of the inductance, over h."""
    term = 2.0 * s[L.OMEGA]
    angle = term * h
    for j in range(1, L.ORDER + 2):
        sign = 1.0 if j % 4 < 2 else -1.0
        s[L.SERIES_L + j] = 0.5 * sign * term if j % 2 == 1 else sign * term
        term = term * angle / (j + 1)


def rotation(s: Vector, k: int) -> None:
    """Set ROTATION: power k of the voltage that the turning inductance induces, from powers 0 to k of the currents."""
    oa = 0.0
    ob = 0.0
    oc = 0.0
    ea = 0.0
    eb = 0.0
    ec = 0.0
    for j in range(1, k + 2):
        f = (k + 1) * s[L.SERIES_L + j]
        i = L.SERIES_I + k + 1 - j
        if j % 2 == 1:
            oa += f * s[i]
            ob += f * s[i + L.NK]
            oc += f * s[i + 2 * L.NK]
        else:
            ea += f * s[i]
            eb += f * s[i + L.NK]
            ec += f * s[i + 2 * L.NK]
    for x in range(3):
        row = 3 * x
        s[L.ROTATION + x] = row_times(s, L.L_SLOPE + row, oa, ob, oc) + row_times(s, L.L_WAVE + row, ea, eb, ec)


def build_series(s: Vector, h: float) -> int:
    """Fill SERIES_I, _V, _E, _D for a step h (s) from now; return their order, 0 if h is too long."""
    ia = s[L.I]
    ib = s[L.I + 1]
    ic = s[L.I + 2]
    ra = s[L.RAIL]
    rb = s[L.RAIL + 1]
    rc = s[L.RAIL + 2]
    omega = s[L.OMEGA]
    ea = -s[L.PSI] * omega * s[L.SHAPE]
    eb = -s[L.PSI + 1] * omega * s[L.SHAPE + 1]
    ec = -s[L.PSI + 2] * omega * s[L.SHAPE + 2]
    wh = omega * h
    fa = -s[L.PSI] * omega * wh * s[L.SLOPE]
    fb = -s[L.PSI + 1] * omega * wh * s[L.SLOPE + 1]
    fc = -s[L.PSI + 2] * omega * wh * s[L.SLOPE + 2]
    curvature = 0.0 if s[L.TRAPEZOID] != 0.0 else -wh * wh
    rta = s[L.R] + s[L.R_LEG]
    rtb = s[L.R + 1] + s[L.R_LEG + 1]
    rtc = s[L.R + 2] + s[L.R_LEG + 2]
    gaa = s[L.G]
    gab = s[L.G + 1]
    gac = s[L.G + 2]
    gbb = s[L.G + 3]
    gbc = s[L.G + 4]
    gcc = s[L.G + 5]
    conducting = s[L.CONDUCTING]
    floating = int(s[L.FLOATING])
    reference = int(s[L.REFERENCE])
    clamp = int(s[L.STAR_CLAMP])
    c_inv = s[L.LINK_C_INV]
    supply = s[L.VALUE + L.SUPPLY]
    source_g = s[L.SUPPLY_G] * s[L.SOURCE_ON]
    leak_g = source_g + s[L.CHOPPER_G] * s[L.CHOPPER_ON]
    if TURNING:
        inductance_series(s, h)
    d = s[L.VDC]
    constant = 1.0
    scale_i = 0.0
    scale_d = (abs(d) + 1.0) * L.CONVERGED
    converged = 0
    k = 0
    while k <= L.ORDER:
        idc = ra * ia + rb * ib + rc * ic
        if c_inv == 0.0:
            d = constant * supply - s[L.SUPPLY_R] * idc
        va = ra * d + constant * s[L.V_LEG]
        vb = rb * d + constant * s[L.V_LEG + 1]
        vc = rc * d + constant * s[L.V_LEG + 2]
        ja = 0.0
        jb = 0.0
        jc = 0.0
        if conducting > 1:
            ua = va - rta * ia - ea
            ub = vb - rtb * ib - eb
            uc = vc - rtc * ic - ec
            if TURNING:
                s[L.SERIES_I + k] = ia
                s[L.SERIES_I + L.NK + k] = ib
                s[L.SERIES_I + 2 * L.NK + k] = ic
                rotation(s, k)
                ua -= s[L.ROTATION]
                ub -= s[L.ROTATION + 1]
                uc -= s[L.ROTATION + 2]
            ja = gaa * ua + gab * ub + gac * uc
            jb = gab * ua + gbb * ub + gbc * uc
            jc = gac * ua + gbc * ub + gcc * uc
            va -= s[L.R_LEG] * ia
            vb -= s[L.R_LEG + 1] * ib
            vc -= s[L.R_LEG + 2] * ic
            if floating >= 0:
                m = L.LM + 3 * reference
                n = L.LM + 3 * floating
                u = ua if reference == 0 else ub
                u += (s[n] - s[m]) * ja + (s[n + 1] - s[m + 1]) * jb + (s[n + 2] - s[m + 2]) * jc
                if TURNING:
                    u += s[L.ROTATION + floating]
                if floating == 0:
                    va = u + ea
                elif floating == 1:
                    vb = u + eb
                else:
                    vc = u + ec
        else:
            if conducting == 0:
                star = -(ea + eb + ec) / 3.0
                if clamp == 0:
                    star = -constant * s[L.DIODE_V] - ea
                elif clamp == 1:
                    star = -constant * s[L.DIODE_V] - eb
                elif clamp == 2:
                    star = -constant * s[L.DIODE_V] - ec
            elif reference == 0:
                star = va - ea
            elif reference == 1:
                star = vb - eb
            else:
                star = vc - ec
            if reference != 0:
                va = star + ea
            if reference != 1:
                vb = star + eb
            if reference != 2:
                vc = star + ec
        s[L.SERIES_I + k] = ia
        s[L.SERIES_I + L.NK + k] = ib
        s[L.SERIES_I + 2 * L.NK + k] = ic
        s[L.SERIES_V + k] = va
        s[L.SERIES_V + L.NK + k] = vb
        s[L.SERIES_V + 2 * L.NK + k] = vc
        s[L.SERIES_E + k] = ea
        s[L.SERIES_E + L.NK + k] = eb
        s[L.SERIES_E + 2 * L.NK + k] = ec
        s[L.SERIES_D + k] = d
        if converged == 1:
            return k
        f = h / (k + 1)
        ia = f * ja
        ib = f * jb
        ic = f * jc
        if c_inv != 0.0:
            d = f * c_inv * (constant * supply * source_g - leak_g * d - idc)
        if k == 0:
            scale_i = abs(s[L.I]) + abs(s[L.I + 1]) + abs(ia) + abs(ib) + abs(ic)
            if TURNING:
                # The inductance that turns is not the same in all legs: what rounding leaves of voltages that cancel
                # drives a current.
                scale_i += h * (gaa + gbb + gcc) * (abs(d) + 1.0)
            scale_i = (scale_i + L.LEAST_A) * L.CONVERGED
        ga = curvature * ea / ((k + 1) * (k + 2))
        gb = curvature * eb / ((k + 1) * (k + 2))
        gc = curvature * ec / ((k + 1) * (k + 2))
        ea = fa
        eb = fb
        ec = fc
        fa = ga
        fb = gb
        fc = gc
        constant = 0.0
        k += 1
        # The term after a negligible one is kept as well: every other term of a series may be zero.
        if (
            k >= 2
            and abs(ia) + abs(ib) + abs(ic) <= scale_i
            and (c_inv == 0.0 or abs(d) <= scale_d)
            and abs(ea) + abs(eb) + abs(ec) <= scale_d
        ):
            converged = 1
    return 0


# The same function for salient machines.
build_turning_series: Callable[[Vector, float], int] = types.FunctionType(
    build_series.__code__, {**globals(), "TURNING": True}, "build_turning_series"
)


def stretch(s: Vector, order: int, x: float) -> None:
    """Rescale all series to the shorter step x * h."""
    f = x
    for k in range(1, order + 1):
        for p in range(PHASES):
            s[L.SERIES_I + p * L.NK + k] = f * s[L.SERIES_I + p * L.NK + k]
            s[L.SERIES_V + p * L.NK + k] = f * s[L.SERIES_V + p * L.NK + k]
            s[L.SERIES_E + p * L.NK + k] = f * s[L.SERIES_E + p * L.NK + k]
        s[L.SERIES_D + k] = f * s[L.SERIES_D + k]
        if FIELD:
            for axis in range(PHASES - 1):
                s[L.SERIES_ROTOR + axis * L.NK + k] = f * s[L.SERIES_ROTOR + axis * L.NK + k]
                s[L.SERIES_FLUX + axis * L.NK + k] = f * s[L.SERIES_FLUX + axis * L.NK + k]
        f = f * x


def series_end(s: Vector, base: int, order: int) -> float:
    """Value of a series at x = 1, small terms first."""
    total = 0.0
    for k in range(order, -1, -1):
        total += s[base + k]
    return total


def series_at(s: Vector, base: int, order: int, x: float) -> float:
    """Value of a series at x."""
    total = 0.0
    for k in range(order, -1, -1):
        total = total * x + s[base + k]
    return total
