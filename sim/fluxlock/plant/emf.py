"""Back EMF: shape, slope, Taylor series, corners, torque. Kernel code: see `build.py` for its rules.

Phase x: e_x = -psi_x * omega * g(theta - 120 deg * x), theta = d axis against phase A. g = sin, or a
trapezoid of height 1 with the sine's sign and zero crossings, so the flat top of the phase EMF is psi *
omega. Torque T = sum(e_x i_x) / omega_mechanical.
"""

from __future__ import annotations

import math

from . import layout as L
from .vector import Vector

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
    torque_now(s)


def torque_now(s: Vector) -> None:
    """Set TORQUE (N*m) from SHAPE and the currents."""
    s[L.TORQUE] = -s[L.POLE_PAIRS] * (
        s[L.PSI] * s[L.SHAPE] * s[L.I]
        + s[L.PSI + 1] * s[L.SHAPE + 1] * s[L.I + 1]
        + s[L.PSI + 2] * s[L.SHAPE + 2] * s[L.I + 2]
    )


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
