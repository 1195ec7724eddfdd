# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What turns with the rotor: EMF, corners, inductance of a salient machine, torque. Kernel code: see `build.py`.

Phase x: e_x = -psi_x * omega * g(theta - 120 deg * x), theta = d axis against phase A. g = sin, or a
trapezoid of height 1 with the sine's sign and zero crossings, so the flat top of the phase EMF is psi *
omega. A salient machine has

    L_xy = n_x n_y ((L_d + L_q) / 2 [x = y] + (L_d - L_q) / 3 cos(2 theta - 120 deg (x + y)))

(n: share of the turns that act), which for currents of zero sum is L_d on the d and L_q on the q axis: the mean and one
wave of twice the angle. Torque T = sum(e_x i_x) / omega_mechanical + (p / 2) i' (dL/dtheta) i.
"""

from __future__ import annotations

import math

from . import layout as L
from .flux import flux_now
from .vector import Vector

FIELD = False
TWO_PI = 2.0 * math.pi
HALF_SQRT3 = math.sqrt(3.0) / 2.0
THIRD_TURN = TWO_PI / 3.0
NUDGE = 1e-9  # rad: on a corner the piece ahead of the rotor counts


def wrapped(angle: float) -> float:
    """Angle in 0 .. 2 pi."""
    return angle - TWO_PI * math.floor(angle / TWO_PI)


def piece_of(s: Vector, phase: int) -> int:
    """Piece 0 .. 4 of the trapezoid ahead of the rotor: rising, top, falling, bottom, rising."""
    nudge = -NUDGE if s[L.OMEGA] < 0.0 else NUDGE
    angle = wrapped(s[L.THETA] - THIRD_TURN * phase + nudge)
    ramp = s[L.RAMP]
    if angle < ramp:
        return 0
    if angle < math.pi - ramp:
        return 1
    if angle <= math.pi + ramp:
        return 2
    if angle < TWO_PI - ramp:
        return 3
    return 4


def piece_angle(s: Vector, phase: int, piece: int) -> float:
    """Phase angle, counted so that it lies in or within rounding of the piece."""
    angle = wrapped(s[L.THETA] - THIRD_TURN * phase)
    if piece == 0 and angle > math.pi:
        return angle - TWO_PI
    if piece == 4 and angle < math.pi:
        return angle + TWO_PI
    return angle


def shape_now(s: Vector) -> None:
    """Set SHAPE, SLOPE and TORQUE for the present angle and currents."""
    if FIELD:
        flux_now(s)
        return
    if s[L.TRAPEZOID] == 0.0:
        sn = math.sin(s[L.THETA])
        cs = math.cos(s[L.THETA])
        s[L.SHAPE] = sn
        s[L.SHAPE + 1] = -0.5 * sn - HALF_SQRT3 * cs
        s[L.SHAPE + 2] = -0.5 * sn + HALF_SQRT3 * cs
        s[L.SLOPE] = cs
        s[L.SLOPE + 1] = -0.5 * cs + HALF_SQRT3 * sn
        s[L.SLOPE + 2] = -0.5 * cs - HALF_SQRT3 * sn
    else:
        ramp = s[L.RAMP]
        for x in range(3):
            piece = piece_of(s, x)
            angle = piece_angle(s, x, piece)
            if piece == 0:
                s[L.SHAPE + x] = angle / ramp
                s[L.SLOPE + x] = 1.0 / ramp
            elif piece == 1:
                s[L.SHAPE + x] = 1.0
                s[L.SLOPE + x] = 0.0
            elif piece == 2:
                s[L.SHAPE + x] = (math.pi - angle) / ramp
                s[L.SLOPE + x] = -1.0 / ramp
            elif piece == 3:
                s[L.SHAPE + x] = -1.0
                s[L.SLOPE + x] = 0.0
            else:
                s[L.SHAPE + x] = (angle - TWO_PI) / ramp
                s[L.SLOPE + x] = 1.0 / ramp
    if s[L.SALIENT] != 0.0:
        inductance_now(s)
    torque_now(s)


def inductance_now(s: Vector) -> None:
    """Set LM, L_WAVE and L_SLOPE of a salient machine for the present angle; G is stale then."""
    cs = math.cos(2.0 * s[L.THETA])
    sn = math.sin(2.0 * s[L.THETA])
    for x in range(3):
        for y in range(x, 3):
            swing = s[L.L_SWING] * s[L.WINDING + x] * s[L.WINDING + y]
            lag = (x + y) % 3
            wave = swing * cs
            slope = -2.0 * swing * sn
            if lag == 1:
                wave = swing * (-0.5 * cs + HALF_SQRT3 * sn)
                slope = 2.0 * swing * (0.5 * sn + HALF_SQRT3 * cs)
            elif lag == 2:
                wave = swing * (-0.5 * cs - HALF_SQRT3 * sn)
                slope = 2.0 * swing * (0.5 * sn - HALF_SQRT3 * cs)
            mean = s[L.L_MEAN] * s[L.WINDING + x] * s[L.WINDING + x] if x == y else 0.0
            s[L.LM + 3 * x + y] = mean + wave
            s[L.LM + 3 * y + x] = mean + wave
            s[L.L_WAVE + 3 * x + y] = wave
            s[L.L_WAVE + 3 * y + x] = wave
            s[L.L_SLOPE + 3 * x + y] = slope
            s[L.L_SLOPE + 3 * y + x] = slope
    s[L.G_MASK] = -1.0


def row_times(s: Vector, row: int, a: float, b: float, c: float) -> float:
    """Row of a 3 x 3 matrix that begins at index `row`, times a vector."""
    return s[row] * a + s[row + 1] * b + s[row + 2] * c


def quadratic(s: Vector, matrix: int, a: float, b: float, c: float) -> float:
    """Quadratic form of the 3 x 3 matrix at index `matrix`."""
    return (
        a * row_times(s, matrix, a, b, c)
        + b * row_times(s, matrix + 3, a, b, c)
        + c * row_times(s, matrix + 6, a, b, c)
    )


def torque_now(s: Vector) -> None:
    """Set TORQUE (N*m) from SHAPE, L_SLOPE and the currents."""
    if FIELD:
        flux_now(s)
        return
    s[L.TORQUE] = -s[L.POLE_PAIRS] * (
        s[L.PSI] * s[L.SHAPE] * s[L.I]
        + s[L.PSI + 1] * s[L.SHAPE + 1] * s[L.I + 1]
        + s[L.PSI + 2] * s[L.SHAPE + 2] * s[L.I + 2]
    )
    if s[L.SALIENT] != 0.0:
        force = quadratic(s, L.L_SLOPE, s[L.I], s[L.I + 1], s[L.I + 2])
        s[L.TORQUE] = s[L.TORQUE] + 0.5 * s[L.POLE_PAIRS] * force


def corner_limit(s: Vector, h: float) -> float:
    """The step h, shortened to end at the next corner of a trapezoid."""
    omega = s[L.OMEGA]
    if s[L.TRAPEZOID] == 0.0 or omega == 0.0:
        return h
    ramp = s[L.RAMP]
    for x in range(3):
        piece = piece_of(s, x)
        angle = piece_angle(s, x, piece)
        if omega > 0.0:
            end = ramp
            if piece == 1:
                end = math.pi - ramp
            elif piece == 2:
                end = math.pi + ramp
            elif piece == 3:
                end = TWO_PI - ramp
            elif piece == 4:
                end = TWO_PI + ramp
            room = (end - angle) / omega
        else:
            end = -ramp
            if piece == 1:
                end = ramp
            elif piece == 2:
                end = math.pi - ramp
            elif piece == 3:
                end = math.pi + ramp
            elif piece == 4:
                end = TWO_PI - ramp
            room = (end - angle) / omega
        if room < h:
            h = room
    return h


def turn(s: Vector, angle: float) -> None:
    """Advance the rotor by an electrical angle, keeping THETA in 0 .. 2 pi and counting TURNS."""
    theta = s[L.THETA] + angle
    if theta >= TWO_PI or theta < 0.0:
        whole = math.floor(theta / TWO_PI)
        theta = theta - TWO_PI * whole
        s[L.TURNS] = s[L.TURNS] + whole
    s[L.THETA] = theta


def theta_unwrapped(s: Vector) -> float:
    """Electrical angle since the start of the first turn."""
    return s[L.TURNS] * TWO_PI + s[L.THETA]
