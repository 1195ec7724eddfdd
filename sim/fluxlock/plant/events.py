# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Instants inside a sub-interval at which the circuit changes. Kernel code: see `build.py` for its rules.

Each is the first zero of a polynomial that is positive before: a diode current, the room of an open terminal
to a rail, the room of the link voltage to the supply or to the chopper's thresholds. The step is so short
that a polynomial bends at most once.
"""

from __future__ import annotations

from . import layout as L
from .circuit import log_event
from .series import series_at
from .vector import Vector

PHASES = 3
FIELD = False
NONE = 2.0  # "no zero in 0 .. 1"
RESOLUTION = 2e-16  # of x
MARGIN_A = 1e-9  # beyond the edge of a piece, so that the next one is in force there
MARGIN_V = 2.0 * L.TOLERANCE_V  # beyond the threshold of `connect`, which then finds the diode conducting


def root_slope(s: Vector, order: int, x: float) -> float:
    """Derivative of the polynomial ROOT."""
    total = 0.0
    for k in range(order, 0, -1):
        total = total * x + k * s[L.ROOT + k]
    return total


def root_bend(s: Vector, order: int, x: float) -> float:
    """Second derivative of the polynomial ROOT."""
    total = 0.0
    for k in range(order, 1, -1):
        total = total * x + k * (k - 1) * s[L.ROOT + k]
    return total


def first_zero(s: Vector, order: int) -> float:
    """First x in 0 .. 1 at which ROOT is no longer positive, else NONE. ROOT(0) <= 0 gives 0."""
    if s[L.ROOT] <= 0.0:
        return 0.0
    reach = 0.0
    for k in range(1, order + 1):
        reach += abs(s[L.ROOT + k])
    if reach < s[L.ROOT]:
        return NONE
    left = 0.0
    right = 1.0
    if series_at(s, L.ROOT, order, 1.0) > 0.0:
        # Positive at both ends: look at the minimum between them.
        if root_slope(s, order, 0.0) >= 0.0 or root_slope(s, order, 1.0) <= 0.0:
            return NONE
        low = 0.0
        high = 1.0
        x = 0.5
        for _ in range(60):
            g = root_slope(s, order, x)
            if g < 0.0:
                low = x
            else:
                high = x
            b = root_bend(s, order, x)
            x = 0.5 * (low + high)
            if b > 0.0:
                newton = (low if g < 0.0 else high) - g / b
                if low < newton < high:
                    x = newton
            if high - low < 1e-9:
                break
        if series_at(s, L.ROOT, order, x) > 0.0:
            return NONE
        right = x
    # Newton's method held in the bracket (left, right]: positive on the left, not on the right.
    x = 0.5 * (left + right)
    for n in range(100):
        f = series_at(s, L.ROOT, order, x)
        if f > 0.0:
            left = x
        else:
            right = x
        if f == 0.0 or right - left <= RESOLUTION:
            break
        g = root_slope(s, order, x)
        following = 0.5 * (left + right)
        if g < 0.0 and n < 60:
            step = -f / g
            if abs(step) <= RESOLUTION:
                return x + RESOLUTION
            if left < x + step < right:
                following = x + step
        x = following
    return right


def current_zero(s: Vector, order: int, x: int, sign: float) -> float:
    """Where the current of leg x, of the given sign, ends."""
    base = L.SERIES_I + L.NK * x
    reach = 0.0
    for k in range(1, order + 1):
        reach += abs(s[base + k])
    if reach < sign * s[base]:
        return NONE
    if s[base] == 0.0:
        # Just turned on: divide by x, which removes the zero at the start.
        for k in range(order):
            s[L.ROOT + k] = sign * s[base + k + 1]
        return first_zero(s, order - 1)
    for k in range(order + 1):
        s[L.ROOT + k] = sign * s[base + k]
    return first_zero(s, order)


def terminal_zero(s: Vector, order: int, x: int) -> float:
    """Where the terminal of open leg x passes a rail by the diode drop."""
    base = L.SERIES_V + L.NK * x
    reach = 0.0
    for k in range(1, order + 1):
        reach += abs(s[base + k]) + abs(s[L.SERIES_D + k])
    room = s[L.DIODE_V] + MARGIN_V
    best = NONE
    if s[base] + room <= reach:
        for k in range(order + 1):
            s[L.ROOT + k] = s[base + k]
        s[L.ROOT] = s[L.ROOT] + room
        best = first_zero(s, order)
    if s[L.SERIES_D] + room - s[base] <= reach:
        for k in range(order + 1):
            s[L.ROOT + k] = s[L.SERIES_D + k] - s[base + k]
        s[L.ROOT] = s[L.ROOT] + room
        at = first_zero(s, order)
        if at < best:
            best = at
    return best


def pair_zero(s: Vector, order: int, x: int, y: int) -> float:
    """No leg conducts: where the EMF from y to x exceeds the link voltage and two diodes."""
    a = L.SERIES_E + L.NK * x
    b = L.SERIES_E + L.NK * y
    for k in range(order + 1):
        s[L.ROOT + k] = s[L.SERIES_D + k] - s[a + k] + s[b + k]
    s[L.ROOT] = s[L.ROOT] + 2.0 * s[L.DIODE_V] + MARGIN_V
    return first_zero(s, order)


def link_zero(s: Vector, order: int, level: float, rising: bool) -> float:
    """Where the link voltage passes a level."""
    sign = -1.0 if rising else 1.0
    for k in range(order + 1):
        s[L.ROOT + k] = sign * s[L.SERIES_D + k]
    s[L.ROOT] = s[L.ROOT] - sign * level
    return first_zero(s, order)


def piece_zero(s: Vector, order: int) -> float:
    """Where i_q leaves the piece of the cross-saturation curve in force."""
    best = NONE
    base = L.SERIES_ROTOR + L.NK
    piece = int(s[L.PIECE])
    reach = 0.0
    for k in range(1, order + 1):
        reach += abs(s[base + k])
    for side in range(2):
        end = piece + side
        sign = 1.0 - 2.0 * side
        if end < 1 or end >= L.CROSS_PIECES:
            continue
        room = sign * (s[base] - s[L.CROSS_EDGE + end]) + MARGIN_A
        if room <= reach:
            for k in range(1, order + 1):
                s[L.ROOT + k] = sign * s[base + k]
            s[L.ROOT] = room
            at = first_zero(s, order)
            if at < best:
                best = at
    return best


def next_event(s: Vector, order: int) -> float:
    """Return x of the first event (else NONE) and set EVENT_LEG to the leg whose current ends (else -1)."""
    best = NONE
    s[L.EVENT_LEG] = -1.0
    for x in range(PHASES):
        mode = s[L.MODE + x]
        if mode >= L.DIODE_LOW:
            at = current_zero(s, order, x, 1.0 if mode == L.DIODE_LOW else -1.0)
            if at < best:
                best = at
                s[L.EVENT_LEG] = x
        elif mode == L.OPEN and s[L.CONDUCTING] > 0 and s[L.LEG_FAULT + x] != L.BROKEN:
            at = terminal_zero(s, order, x)
            if at < best:
                best = at
                s[L.EVENT_LEG] = -1.0
    if s[L.CONDUCTING] == 0:
        for x in range(PHASES):
            for y in range(PHASES):
                if x != y and s[L.LEG_FAULT + x] != L.BROKEN and s[L.LEG_FAULT + y] != L.BROKEN:
                    at = pair_zero(s, order, x, y)
                    if at < best:
                        best = at
    if s[L.LINK_C_INV] != 0.0:
        if s[L.SUPPLY_DIODE] != 0.0:
            rising = s[L.SOURCE_ON] != 0.0
            margin = MARGIN_V if rising else -MARGIN_V
            at = link_zero(s, order, s[L.VALUE + L.SUPPLY] + margin, rising)
            if at < best:
                best = at
                s[L.EVENT_LEG] = -1.0
        if s[L.CHOPPER_G] != 0.0 and s[L.CHOPPER_DRIVEN] == 0.0:
            rising = s[L.CHOPPER_ON] == 0.0
            at = link_zero(s, order, s[L.CHOPPER_ON_V] if rising else s[L.CHOPPER_OFF_V], rising)
            if at < best:
                best = at
                s[L.EVENT_LEG] = -1.0
    if FIELD and s[L.SATURATED] != 0.0:
        at = piece_zero(s, order)
        if at < best:
            best = at
            s[L.EVENT_LEG] = -1.0
    return best


def switch_link(s: Vector) -> None:
    """Set the supply diode and the chopper from the link voltage, with hysteresis."""
    if s[L.LINK_C_INV] == 0.0:
        return
    if s[L.SUPPLY_DIODE] != 0.0:
        excess = s[L.VDC] - s[L.VALUE + L.SUPPLY]
        if excess > L.TOLERANCE_V:
            s[L.SOURCE_ON] = 0.0
        elif excess < -L.TOLERANCE_V:
            s[L.SOURCE_ON] = 1.0
    if s[L.CHOPPER_G] != 0.0 and s[L.CHOPPER_DRIVEN] == 0.0:
        # An event ends within rounding of its threshold.
        if s[L.VDC] >= s[L.CHOPPER_ON_V] - MARGIN_V:
            s[L.CHOPPER_ON] = 1.0
        elif s[L.VDC] <= s[L.CHOPPER_OFF_V] + MARGIN_V:
            s[L.CHOPPER_ON] = 0.0


def end_current(s: Vector, x: int) -> int:
    """The current of leg x has ended: make it exactly zero, and log it and a partner that ends with it."""
    s[L.I + x] = 0.0
    code = log_event(s, s[L.T_BASE], L.EXTINCTION, x)
    if s[L.CONDUCTING] == 2:
        for y in range(PHASES):
            s[L.I + y] = 0.0
            if code == L.OK and y != x and s[L.MODE + y] >= L.DIODE_LOW:
                code = log_event(s, s[L.T_BASE], L.EXTINCTION, y)
    return code


def balance(s: Vector) -> None:
    """Remove rounding: currents sum to zero, an open leg carries none, a diode never a reverse current."""
    for x in range(PHASES):
        mode = s[L.MODE + x]
        current = s[L.I + x]
        if mode == L.OPEN or (mode == L.DIODE_LOW and current < 0.0) or (mode == L.DIODE_HIGH and current > 0.0):
            s[L.I + x] = 0.0
    # The leg that takes up the rest must be able to: a switch if there is one, else the largest current.
    rest = 0
    for x in range(1, PHASES):
        switch_x = s[L.MODE + x] == L.HIGH or s[L.MODE + x] == L.LOW
        switch_r = s[L.MODE + rest] == L.HIGH or s[L.MODE + rest] == L.LOW
        if (switch_x and not switch_r) or (switch_x == switch_r and abs(s[L.I + x]) > abs(s[L.I + rest])):
            rest = x
    y = 1 if rest == 0 else 0
    total = s[L.I + y]
    for x in range(y + 1, PHASES):
        if x != rest:
            total += s[L.I + x]
    s[L.I + rest] = -total
