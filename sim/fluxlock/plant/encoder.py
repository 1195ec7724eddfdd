# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Incremental encoder: levels A, B, Z and when they change next. Kernel code: see `build.py` for its rules.

A mechanical turn has 4 * lines quarters, counted from the mounting angle. Through quarters 0, 1, 2, 3 of a line A is
1 1 0 0 and B is 0 1 1 0: A leads B at positive speed. Z is 1 in quarter 0 of the turn. An inverted one has A and B
exchanged. On the last lines of the turn that are missing, as on a dirty disc, the tracks keep their levels.

Nothing but a kernel call moves the levels, so the caller is told when it must call at the latest: at the clock before
the next edge or, as nobody else may call before the rotor's acceleration has changed, HORIZON_S later. The calls close
in on an edge and one falls on the first clock at which the angle has passed it.
"""

from __future__ import annotations

import math

from . import layout as L
from .emf import TWO_PI
from .mechanics import acceleration, profile_speed, step_limit
from .vector import IntVector, Vector

HORIZON_S = 1e-6


def edge_time(speed: float, change: float, room: float) -> float:
    """Seconds until an angle `room` >= 0 is covered at a speed that changes by `change` a second; -1 = never."""
    if room == 0.0:
        return 0.0 if speed > 0.0 or (speed == 0.0 and change > 0.0) else -1.0
    square = speed * speed + 2.0 * change * room
    if square < 0.0:
        return -1.0
    final = speed + math.sqrt(square)
    return 2.0 * room / final if final > 0.0 else -1.0


def encode(s: Vector, io: IntVector) -> None:
    """Put the levels (A, B, Z in bits 0, 1, 2) and the clocks until the next call into io."""
    quarters = 4.0 * s[L.ENCODER_LINES]
    poles = s[L.POLE_PAIRS]
    turn = (s[L.TURNS] - poles * math.floor(s[L.TURNS] / poles) + s[L.THETA] / TWO_PI) / poles - s[L.ENCODER_OFFSET]
    place = (turn - math.floor(turn)) * quarters
    quarter = math.floor(place)
    phase = 3 if quarter >= quarters - 4.0 * s[L.ENCODER_MISSING] else quarter % 4
    levels = 0
    first, second = (2, 1) if s[L.ENCODER_INVERTED] != 0.0 else (1, 2)
    if phase < 2:
        levels += first
    if phase == 1 or phase == 2:
        levels += second
    if s[L.ENCODER_INDEX] != 0.0 and (quarter == 0 or quarter >= quarters):
        levels += 4
    io[L.IO_ENCODER] = levels

    now_s = s[L.T_CYCLE] * s[L.CLOCK_S]
    wait_s = step_limit(s, now_s, HORIZON_S)  # ends at a corner of an imposed speed
    speed = s[L.OMEGA]
    if s[L.MECHANICS] == L.IMPOSED:
        speed = profile_speed(s, now_s)
    elif s[L.MECHANICS] == L.LOCKED:
        speed = 0.0
    change = acceleration(s)
    radians = TWO_PI * poles / quarters
    forward = edge_time(speed, change, (quarter + 1.0 - place) * radians)
    back = edge_time(-speed, -change, (place - quarter) * radians)
    if 0.0 <= forward < wait_s:
        wait_s = forward
    if 0.0 <= back < wait_s:
        wait_s = back
    clocks = int(wait_s / s[L.CLOCK_S])
    io[L.IO_ENCODER_WAIT] = clocks if clocks > 1 else 1
