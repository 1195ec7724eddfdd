# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine by its flux linkages: five phases, saturation. Kernel code: see `build.py` for its rules.

Planes h = 1 and, with five phases, 3 carry all currents of zero sum. With gamma = 2 pi / PHASES, n_x the share of the
turns of phase x that act and theta the d axis against phase A,

    i_dh + j i_qh = 2 / PHASES sum_x n_x i_x exp(-j h (theta - x gamma))
    lambda_x = n_x (L_0 / PHASES sum_y n_y i_y + sum_h Re (lambda_dh + j lambda_qh) exp(j h (theta - x gamma)))

and the flux linkages are the gradient of one co-energy, so that energy is kept:

    lambda_d  = psi_1 + L_d S(i_d) + D'(i_d) F(i_q) + L_13 i_d3      lambda_d3 = psi_3 + L_d3 i_d3 + L_13 i_d
    lambda_q  = L_q i_q + D(i_d) F'(i_q) + L_13 i_q3                 lambda_q3 = L_q3 i_q3 + L_13 i_q
    S' = 1 - a v - b v^2,   D = I v,   v = tanh(i_d / I)

F' = L_dq at i_d = 0, cubic in pieces of equal width; S = i_d and F = 0 without saturation. Torque = PHASES / 2 p
sum_h h (lambda_dh i_qh - lambda_qh i_dh).

v_x = R_x i_x + d(lambda_x)/dt + v_star holds power by power: the power n of lambda is the incremental inductance LM
times that of i, and a rest of the lower powers of the currents and of the angle. The step is halved until the powers
vanish. A step ends where i_q leaves its piece.
"""

from __future__ import annotations

import math

from . import layout as L
from .vector import Vector

PHASES = 3


def log_cosh(x: float) -> float:
    """Logarithm of the hyperbolic cosine."""
    return abs(x) + math.log(0.5 * (1.0 + math.exp(-2.0 * abs(x))))


def saturate(s: Vector) -> None:
    """Put what saturation adds at ROTOR_I into FLUX and L_NOW; choose the PIECE."""
    i_d = s[L.ROTOR_I]
    i_q = s[L.ROTOR_I + 1]
    l_d = s[L.L_AXES]
    piece = math.floor((i_q - s[L.CROSS_EDGE + 1]) / s[L.CROSS_WIDTH]) + 1
    if piece < 0:
        piece = 0
    elif piece > L.CROSS_PIECES - 1:
        piece = L.CROSS_PIECES - 1
    # Rounding of the quotient must not put an edge into the piece that it does not begin.
    if piece > 0 and i_q < s[L.CROSS_EDGE + piece]:
        piece -= 1
    elif piece < L.CROSS_PIECES - 1 and i_q >= s[L.CROSS_EDGE + piece + 1]:
        piece += 1
    s[L.PIECE] = piece
    y = i_q - s[L.CROSS_EDGE + piece]
    c = L.CROSS + 5 * piece
    f = s[c] + y * (s[c + 1] + y * (s[c + 2] / 2.0 + y * (s[c + 3] / 3.0 + y * s[c + 4] / 4.0)))
    l_dq = s[c + 1] + y * (s[c + 2] + y * (s[c + 3] + y * s[c + 4]))
    slope = s[c + 2] + y * (2.0 * s[c + 3] + y * 3.0 * s[c + 4])
    v = math.tanh(i_d / s[L.SAT_I])
    rest = 1.0 - v * v
    bend = i_d - s[L.SAT_I] * v
    s[L.FLUX] = s[L.FLUX] - l_d * (s[L.SAT_A] * s[L.SAT_I] * log_cosh(i_d / s[L.SAT_I]) + s[L.SAT_B] * bend) + rest * f
    s[L.FLUX + 1] = s[L.FLUX + 1] + s[L.SAT_I] * v * l_dq
    s[L.L_NOW] = l_d * (1.0 - v * (s[L.SAT_A] + s[L.SAT_B] * v)) - 2.0 / s[L.SAT_I] * v * rest * f
    s[L.L_NOW + 1] = rest * l_dq
    s[L.L_NOW + 2] = s[L.L_AXES + 1] + s[L.SAT_I] * v * slope


def flux_now(s: Vector) -> None:
    """Set ROTOR_I, FLUX, L_NOW, LM, FLUX_SLOPE and TORQUE for the present angle and currents; G_FULL is stale then."""
    share = 2.0 / PHASES
    for plane in range(PHASES // 2):
        h = 1.0 + 2.0 * plane
        cs = math.cos(h * s[L.THETA])
        sn = math.sin(h * s[L.THETA])
        alpha = 0.0
        beta = 0.0
        for x in range(PHASES):
            alpha += s[L.PHASOR + 2 * plane * L.LEGS + x] * s[L.I + x]
            beta += s[L.PHASOR + (2 * plane + 1) * L.LEGS + x] * s[L.I + x]
        alpha = share * alpha
        beta = share * beta
        s[L.ROTOR_I + 2 * plane] = cs * alpha + sn * beta
        s[L.ROTOR_I + 2 * plane + 1] = cs * beta - sn * alpha
        s[L.SERIES_TURN + 2 * plane * L.NK] = cs
        s[L.SERIES_TURN + (2 * plane + 1) * L.NK] = sn
        s[L.SERIES_STATOR + 2 * plane * L.NK] = alpha
        s[L.SERIES_STATOR + (2 * plane + 1) * L.NK] = beta
    d = s[L.ROTOR_I]
    q = s[L.ROTOR_I + 1]
    s[L.FLUX] = s[L.PSI_1] + s[L.L_AXES] * d
    s[L.FLUX + 1] = s[L.L_AXES + 1] * q
    s[L.L_NOW] = s[L.L_AXES]
    s[L.L_NOW + 1] = 0.0
    s[L.L_NOW + 2] = s[L.L_AXES + 1]
    if s[L.SATURATED] != 0.0:
        saturate(s)
    torque = s[L.FLUX] * q - s[L.FLUX + 1] * d
    # Derivatives of the flux linkages by the angle, in rotor axes: i_d turns into i_q, i_q into -i_d.
    turn_d = s[L.L_NOW] * q - s[L.L_NOW + 1] * d - s[L.FLUX + 1]
    turn_q = s[L.L_NOW + 1] * q - s[L.L_NOW + 2] * d + s[L.FLUX]
    turn_d3 = 0.0
    turn_q3 = 0.0
    if PHASES == 5:
        d3 = s[L.ROTOR_I + 2]
        q3 = s[L.ROTOR_I + 3]
        l_13 = s[L.L_AXES + 4]
        s[L.FLUX] = s[L.FLUX] + l_13 * d3
        s[L.FLUX + 1] = s[L.FLUX + 1] + l_13 * q3
        s[L.FLUX + 2] = s[L.PSI_3] + s[L.L_AXES + 2] * d3 + l_13 * d
        s[L.FLUX + 3] = s[L.L_AXES + 3] * q3 + l_13 * q
        torque = s[L.FLUX] * q - s[L.FLUX + 1] * d + 3.0 * (s[L.FLUX + 2] * q3 - s[L.FLUX + 3] * d3)
        turn_d += l_13 * 2.0 * q3
        turn_q -= l_13 * 2.0 * d3
        turn_d3 = s[L.L_AXES + 2] * 3.0 * q3 + l_13 * q - 3.0 * s[L.FLUX + 3]
        turn_q3 = 3.0 * s[L.FLUX + 2] - s[L.L_AXES + 3] * 3.0 * d3 - l_13 * d
    s[L.TORQUE] = 0.5 * PHASES * s[L.POLE_PAIRS] * torque
    matrices_now(s, turn_d, turn_q, turn_d3, turn_q3)
    s[L.G_MASK] = -1.0


def matrices_now(s: Vector, turn_d: float, turn_q: float, turn_d3: float, turn_q3: float) -> None:
    """Set LM and FLUX_SLOPE from L_NOW and the derivatives of FLUX by the angle."""
    share = 2.0 / PHASES
    c1 = s[L.SERIES_TURN]
    s1 = s[L.SERIES_TURN + L.NK]
    l_d = share * s[L.L_NOW]
    l_dq = share * s[L.L_NOW + 1]
    l_q = share * s[L.L_NOW + 2]
    l_zero = s[L.L_ZERO] / PHASES
    if PHASES == 5:
        c3 = s[L.SERIES_TURN + 2 * L.NK]
        s3 = s[L.SERIES_TURN + 3 * L.NK]
        l_d3 = share * s[L.L_AXES + 2]
        l_q3 = share * s[L.L_AXES + 3]
        l_13 = share * s[L.L_AXES + 4]
    for x in range(PHASES):
        d = c1 * s[L.PHASOR + x] + s1 * s[L.PHASOR + L.LEGS + x]
        q = c1 * s[L.PHASOR + L.LEGS + x] - s1 * s[L.PHASOR + x]
        slope = d * turn_d + q * turn_q
        on_d = l_d * d + l_dq * q
        on_q = l_dq * d + l_q * q
        if PHASES == 5:
            d3 = c3 * s[L.PHASOR + 2 * L.LEGS + x] + s3 * s[L.PHASOR + 3 * L.LEGS + x]
            q3 = c3 * s[L.PHASOR + 3 * L.LEGS + x] - s3 * s[L.PHASOR + 2 * L.LEGS + x]
            slope += d3 * turn_d3 + q3 * turn_q3
            on_d += l_13 * d3
            on_q += l_13 * q3
            on_d3 = l_13 * d + l_d3 * d3
            on_q3 = l_13 * q + l_q3 * q3
        s[L.FLUX_SLOPE + x] = slope
        for y in range(x, PHASES):
            a1 = s[L.PHASOR + y]
            b1 = s[L.PHASOR + L.LEGS + y]
            entry = s[L.WINDING + x] * s[L.WINDING + y] * l_zero
            entry += (c1 * on_d - s1 * on_q) * a1 + (s1 * on_d + c1 * on_q) * b1
            if PHASES == 5:
                a3 = s[L.PHASOR + 2 * L.LEGS + y]
                b3 = s[L.PHASOR + 3 * L.LEGS + y]
                entry += (c3 * on_d3 - s3 * on_q3) * a3 + (s3 * on_d3 + c3 * on_q3) * b3
            s[L.LM + PHASES * x + y] = entry
            s[L.LM + PHASES * y + x] = entry


def product(s: Vector, a: int, b: int, first: int, n: int) -> float:
    """Power n of a product of the series at a and b, without the powers of a below `first`."""
    total = 0.0
    for m in range(first, n + 1):
        total += s[a + m] * s[b + n - m]
    return total


def work(s: Vector, current: int, b: int, n: int) -> float:
    """Power n of the integral over the current's series of the series at b."""
    total = 0.0
    for m in range(1, n + 1):
        total += m * s[current + m] * s[b + n - m]
    return total / n


def cross_power(s: Vector, n: int) -> None:
    """Set power n of SERIES_CROSS from the powers of SERIES_Y."""
    c = L.CROSS + 5 * int(s[L.PIECE])
    y = L.SERIES_Y + n
    y2 = s[y + L.NK]
    y3 = s[y + 2 * L.NK]
    s[L.SERIES_CROSS + n] = s[c + 2] * s[y] + s[c + 3] * y2 + s[c + 4] * y3
    f = s[c + 1] * s[y] + s[c + 2] / 2.0 * y2 + s[c + 3] / 3.0 * y3 + s[c + 4] / 4.0 * s[y + 3 * L.NK]
    s[L.SERIES_CROSS + L.NK + n] = f


def begin_saturation(s: Vector) -> None:
    """Power 0 of the series of `saturation`."""
    c = L.CROSS + 5 * int(s[L.PIECE])
    v = math.tanh(s[L.ROTOR_I] / s[L.SAT_I])
    y = s[L.ROTOR_I + 1] - s[L.CROSS_EDGE + int(s[L.PIECE])]
    s[L.SERIES_TANH] = v
    s[L.SERIES_TANH2] = v * v
    s[L.SERIES_LOGCOSH] = log_cosh(s[L.ROTOR_I] / s[L.SAT_I])
    s[L.SERIES_Y] = y
    s[L.SERIES_Y + L.NK] = y * y
    s[L.SERIES_Y + 2 * L.NK] = y * y * y
    s[L.SERIES_Y + 3 * L.NK] = y * y * y * y
    cross_power(s, 0)
    s[L.SERIES_CROSS] = s[L.SERIES_CROSS] + s[c + 1]
    s[L.SERIES_CROSS + L.NK] = s[L.SERIES_CROSS + L.NK] + s[c]


def saturation(s: Vector, n: int) -> None:
    """Add to power n >= 1 of SERIES_FLUX what saturation adds, with power n of SERIES_ROTOR as it stands."""
    d = L.SERIES_ROTOR
    v = L.SERIES_TANH
    square = L.SERIES_TANH2
    scale = 1.0 / s[L.SAT_I]
    i_d = s[d + n]
    s[v + n] = scale * (i_d - work(s, d, square, n))
    s[square + n] = product(s, v, v, 0, n)
    s[L.SERIES_LOGCOSH + n] = scale * work(s, d, v, n)
    y = L.SERIES_Y
    s[y + n] = s[d + L.NK + n]
    s[y + L.NK + n] = product(s, y, y, 0, n)
    s[y + 2 * L.NK + n] = product(s, y, y + L.NK, 0, n)
    s[y + 3 * L.NK + n] = product(s, y + L.NK, y + L.NK, 0, n)
    cross_power(s, n)
    f = L.SERIES_CROSS + L.NK
    bend = s[L.SAT_A] * s[L.SERIES_LOGCOSH + n] + s[L.SAT_B] * (scale * i_d - s[v + n])
    s[L.SERIES_FLUX + n] += s[f + n] - product(s, square, f, 0, n) - s[L.L_AXES] * s[L.SAT_I] * bend
    s[L.SERIES_FLUX + L.NK + n] += s[L.SAT_I] * product(s, v, L.SERIES_CROSS, 0, n)


def saturation_grows(s: Vector, n: int, d: float, q: float) -> None:
    """Follow an addition of d and q to power n of i_d and i_q in the series of `saturation`."""
    v0 = s[L.SERIES_TANH]
    c = L.CROSS + 5 * int(s[L.PIECE])
    y = L.SERIES_Y
    y0 = s[y]
    dv = (1.0 - v0 * v0) * d / s[L.SAT_I]
    s[L.SERIES_TANH + n] += dv
    s[L.SERIES_TANH2 + n] += 2.0 * v0 * dv
    s[L.SERIES_LOGCOSH + n] += v0 * d / s[L.SAT_I]
    s[y + n] += q
    s[y + L.NK + n] += 2.0 * y0 * q
    s[y + 2 * L.NK + n] += 3.0 * y0 * y0 * q
    s[y + 3 * L.NK + n] += 4.0 * y0 * y0 * y0 * q
    s[L.SERIES_CROSS + n] += (s[c + 2] + y0 * (2.0 * s[c + 3] + 3.0 * y0 * s[c + 4])) * q
    s[L.SERIES_CROSS + L.NK + n] += s[L.SERIES_CROSS] * q


def begin_flux_series(s: Vector) -> None:
    """Power 0 of the series in rotor axes."""
    for axis in range(PHASES - 1):
        s[L.SERIES_ROTOR + axis * L.NK] = s[L.ROTOR_I + axis]
        s[L.SERIES_FLUX + axis * L.NK] = s[L.FLUX + axis]
    if s[L.SATURATED] != 0.0:
        begin_saturation(s)


def rest_of_flux(s: Vector, n: int, wh: float) -> None:
    """Set ROTATION: power n of the phases' flux linkages without what power n of the phase currents adds.

    Power n of SERIES_TURN is set; those of SERIES_ROTOR and SERIES_FLUX lack the same part.
    """
    for plane in range(PHASES // 2):
        h = 1.0 + 2.0 * plane
        turn = L.SERIES_TURN + 2 * plane * L.NK
        c = turn
        sn = turn + L.NK
        s[c + n] = -h * wh / n * s[sn + n - 1]
        s[sn + n] = h * wh / n * s[c + n - 1]
        a = L.SERIES_STATOR + 2 * plane * L.NK
        b = a + L.NK
        d = L.SERIES_ROTOR + 2 * plane * L.NK
        s[a + n] = 0.0
        s[b + n] = 0.0
        s[d + n] = product(s, c, a, 1, n) + product(s, sn, b, 1, n)
        s[d + L.NK + n] = product(s, c, b, 1, n) - product(s, sn, a, 1, n)
    d = L.SERIES_ROTOR + n
    q = d + L.NK
    fd = L.SERIES_FLUX + n
    fq = fd + L.NK
    s[fd] = s[L.L_AXES] * s[d]
    s[fq] = s[L.L_AXES + 1] * s[q]
    if PHASES == 5:
        l_13 = s[L.L_AXES + 4]
        s[fd] += l_13 * s[d + 2 * L.NK]
        s[fq] += l_13 * s[q + 2 * L.NK]
        s[fd + 2 * L.NK] = s[L.L_AXES + 2] * s[d + 2 * L.NK] + l_13 * s[d]
        s[fq + 2 * L.NK] = s[L.L_AXES + 3] * s[q + 2 * L.NK] + l_13 * s[q]
    if s[L.SATURATED] != 0.0:
        saturation(s, n)
    for x in range(PHASES):
        s[L.ROTATION + x] = 0.0
    for plane in range(PHASES // 2):
        c = L.SERIES_TURN + 2 * plane * L.NK
        sn = c + L.NK
        fd = L.SERIES_FLUX + 2 * plane * L.NK
        fq = fd + L.NK
        alpha = product(s, c, fd, 0, n) - product(s, sn, fq, 0, n)
        beta = product(s, sn, fd, 0, n) + product(s, c, fq, 0, n)
        for x in range(PHASES):
            turned = s[L.PHASOR + 2 * plane * L.LEGS + x] * alpha + s[L.PHASOR + (2 * plane + 1) * L.LEGS + x] * beta
            s[L.ROTATION + x] += turned


def add_current(s: Vector, n: int) -> None:
    """Complete power n of the series in stator and rotor axes with that of SERIES_I."""
    share = 2.0 / PHASES
    for plane in range(PHASES // 2):
        alpha = 0.0
        beta = 0.0
        for x in range(PHASES):
            i = s[L.SERIES_I + x * L.NK + n]
            alpha += s[L.PHASOR + 2 * plane * L.LEGS + x] * i
            beta += s[L.PHASOR + (2 * plane + 1) * L.LEGS + x] * i
        alpha = share * alpha
        beta = share * beta
        at = 2 * plane * L.NK
        s[L.SERIES_STATOR + at + n] = alpha
        s[L.SERIES_STATOR + at + L.NK + n] = beta
        cs = s[L.SERIES_TURN + at]
        sn = s[L.SERIES_TURN + at + L.NK]
        d = cs * alpha + sn * beta
        q = cs * beta - sn * alpha
        s[L.SERIES_ROTOR + at + n] += d
        s[L.SERIES_ROTOR + at + L.NK + n] += q
        if plane == 0:
            s[L.SERIES_FLUX + n] += s[L.L_NOW] * d + s[L.L_NOW + 1] * q
            s[L.SERIES_FLUX + L.NK + n] += s[L.L_NOW + 1] * d + s[L.L_NOW + 2] * q
            if s[L.SATURATED] != 0.0:
                saturation_grows(s, n, d, q)
            if PHASES == 5:
                s[L.SERIES_FLUX + 2 * L.NK + n] += s[L.L_AXES + 4] * d
                s[L.SERIES_FLUX + 3 * L.NK + n] += s[L.L_AXES + 4] * q
        else:
            s[L.SERIES_FLUX + n] += s[L.L_AXES + 4] * d
            s[L.SERIES_FLUX + L.NK + n] += s[L.L_AXES + 4] * q
            s[L.SERIES_FLUX + 2 * L.NK + n] += s[L.L_AXES + 2] * d
            s[L.SERIES_FLUX + 3 * L.NK + n] += s[L.L_AXES + 3] * q


def build_flux_series(s: Vector, h: float) -> int:
    """Fill SERIES_I, _V, _E, _D, _ROTOR, _FLUX for a step h (s) from now; return their order, 0 if h is too long."""
    if h < 1e-16:
        h = 1e-16  # an empty step: only the values at its begin are used, but voltages are differences over it
    conducting = s[L.CONDUCTING]
    reference = int(s[L.REFERENCE])
    clamp = int(s[L.STAR_CLAMP])
    c_inv = s[L.LINK_C_INV]
    supply = s[L.VALUE + L.SUPPLY]
    source_g = s[L.SUPPLY_G] * s[L.SOURCE_ON]
    leak_g = source_g + s[L.CHOPPER_G] * s[L.CHOPPER_ON]
    wh = s[L.OMEGA] * h
    begin_flux_series(s)
    d = s[L.VDC]
    size = 0.0
    for x in range(PHASES):
        s[L.SERIES_I + x * L.NK] = s[L.I + x]
        size += abs(s[L.I + x])
    constant = 1.0
    scale_d = (abs(d) + 1.0) * L.CONVERGED
    scale_i = 0.0
    converged = False
    k = 0
    while k <= L.ORDER:
        idc = 0.0
        for x in range(PHASES):
            idc += s[L.RAIL + x] * s[L.SERIES_I + x * L.NK + k]
        if c_inv == 0.0:
            d = constant * supply - s[L.SUPPLY_R] * idc
        s[L.SERIES_D + k] = d
        rest_of_flux(s, k + 1, wh)
        rate = (k + 1) / h
        e_size = 0.0
        for x in range(PHASES):
            e = rate * s[L.ROTATION + x]
            s[L.SERIES_E + x * L.NK + k] = e
            e_size += abs(e)
            i = s[L.SERIES_I + x * L.NK + k]
            v = s[L.RAIL + x] * d + constant * s[L.V_LEG + x] - s[L.R_LEG + x] * i
            s[L.SERIES_V + x * L.NK + k] = v
            s[L.U + x] = v - s[L.R + x] * i - e
        i_size = 0.0
        for x in range(PHASES):
            slope = 0.0
            if conducting > 1:
                for y in range(PHASES):
                    slope += s[L.G_FULL + PHASES * x + y] * s[L.U + y]
            s[L.ROTATION + x] = slope
            i_size += abs(slope / rate)
            s[L.SERIES_I + x * L.NK + k + 1] = slope / rate
        add_current(s, k + 1)
        if conducting < PHASES:
            star = 0.0
            if reference >= 0:
                star = s[L.U + reference]
                if conducting > 1:
                    for y in range(PHASES):
                        star -= s[L.LM + PHASES * reference + y] * s[L.ROTATION + y]
            elif clamp >= 0:
                star = -constant * s[L.DIODE_V] - s[L.SERIES_E + clamp * L.NK + k]
            else:
                for x in range(PHASES):
                    star -= s[L.SERIES_E + x * L.NK + k] / PHASES
            for x in range(PHASES):
                if s[L.MODE + x] == L.OPEN:
                    v = star + s[L.SERIES_E + x * L.NK + k]
                    for y in range(PHASES):
                        v += s[L.LM + PHASES * x + y] * s[L.ROTATION + y]
                    s[L.SERIES_V + x * L.NK + k] = v
        if converged:
            return k
        if c_inv != 0.0:
            d = (constant * supply * source_g - leak_g * d - idc) * c_inv / rate
        if k == 0:
            scale_i = (size + i_size + L.LEAST_A) * L.CONVERGED
        constant = 0.0
        k += 1
        # The term after a negligible one is kept as well: every other term of a series may be zero.
        converged = k >= 2 and i_size <= scale_i and (c_inv == 0.0 or abs(d) <= scale_d) and e_size <= scale_d
    return 0
