# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The plant's kernel: one call an event. Kernel code: see `build.py` for its rules."""

from __future__ import annotations

import math

from . import layout as L
from .circuit import couple, link_now
from .edge import reconnect
from .emf import corner_limit, shape_now, turn
from .encoder import encode
from .events import balance, end_current, next_event, switch_link
from .flux import build_flux_series
from .mechanics import kick, profile_speed, ramps, step_limit
from .record import add_energies, in_zoom, record_wave, record_zoom
from .sensing import convert, filter_step
from .series import build_series, build_turning_series, series_end, stretch
from .vector import IntVector, Vector

PHASES = 3
FIELD = False
EVENTS_MAX = 100_000  # diode, supply and chopper events in one electrical step


def finite(x: float) -> bool:
    """False for infinities and nan."""
    return x - x == 0.0


def series(s: Vector, h: float) -> int:
    """Fill the series for a step of h seconds; return their order, 0 if h is too long."""
    if FIELD:
        return build_flux_series(s, h)
    if s[L.SALIENT] != 0.0:
        return build_turning_series(s, h)
    return build_series(s, h)


def electrical(s: Vector, gates: int, total: float) -> int:
    """Advance circuit and angle by `total` seconds at constant speed, from event to event."""
    done = 0.0
    clock = s[L.CLOCK_S]
    begin = s[L.T_BASE]
    events = 0
    while events < EVENTS_MAX:
        left = total - done
        h = corner_limit(s, left)
        if h > s[L.H_LIMIT]:
            h = s[L.H_LIMIT]
        switch_link(s)
        code = reconnect(s, gates)
        if code != L.OK:
            return code
        order = series(s, h)
        while order == 0:
            h = 0.5 * h
            s[L.H_LIMIT] = h
            if not h > 1e-15:
                return L.FAULT_NOT_FINITE
            order = series(s, h)
        if order < L.ORDER // 2 and h == s[L.H_LIMIT]:
            s[L.H_LIMIT] = 2.0 * h
        last = h >= left
        x = next_event(s, order)
        event = x <= 1.0
        if event:
            events += 1
        if event and x < 1.0:
            stretch(s, order, x)
            h = x * h
            last = False
        if h > 0.0:
            if s[L.ENERGY_ON] != 0.0:
                add_energies(s, order, h)
            filter_step(s, order, h)
            for p in range(PHASES):
                s[L.I + p] = series_end(s, L.SERIES_I + p * L.NK, order)
            s[L.VDC] = series_end(s, L.SERIES_D, order)
            turn(s, s[L.OMEGA] * h)
        done = total if last else done + h
        s[L.T_BASE] = begin + done / clock
        if event and s[L.EVENT_LEG] >= 0.0:
            code = end_current(s, int(s[L.EVENT_LEG]))
            if code != L.OK:
                return code
        balance(s)
        link_now(s)
        shape_now(s)
        if FIELD or s[L.SALIENT] != 0.0:
            couple(s)
        if last:
            return L.OK
    return L.FAULT_EVENTS


def advance(s: Vector, gates: int, duration: float) -> int:
    """Advance everything by `duration` seconds: second-order splitting of rotor and circuit."""
    done = 0.0
    begin = s[L.T_BASE]
    start_s = s[L.T_CYCLE] * s[L.CLOCK_S]
    while done < duration:
        now_s = start_s + done
        left = duration - done
        h = step_limit(s, now_s, left)
        last = h >= left
        if last:
            h = left
        ramps(s, now_s + 0.5 * h)
        if s[L.MECHANICS] == L.FREE:
            kick(s, 0.5 * h)
        elif s[L.MECHANICS] == L.LOCKED:
            s[L.OMEGA] = 0.0
        else:
            s[L.OMEGA] = profile_speed(s, now_s + 0.5 * h)
        code = electrical(s, gates, h)
        if code != L.OK:
            return code
        if s[L.MECHANICS] == L.FREE:
            kick(s, 0.5 * h)
        elif s[L.MECHANICS] == L.IMPOSED:
            s[L.OMEGA] = profile_speed(s, now_s + h)
        done = duration if last else done + h
        s[L.T_BASE] = begin + done / s[L.CLOCK_S]
    return L.OK


def hall_pins(s: Vector) -> int:
    """Outputs of the Hall sensors at the inputs A, B, C in bits 1, 2, 3: high for the half turn after its rise."""
    pins = 0
    if s[L.HALL] > 0.0:
        for x in range(PHASES):
            if math.sin(s[L.THETA] - s[L.HALL_RISE + x]) > 0.0:
                pins += 2 << x
    return pins


def take_event(t_cycle: int, gates: int, flags: int, s: Vector, io: IntVector) -> int:
    """Advance to t_cycle, sample and record as flagged, then take gates and brake. Returns a fault code."""
    old = int(s[L.GATES])
    cycles = t_cycle - s[L.T_CYCLE]
    if cycles < 0.0:
        return L.FAULT_TIME
    if cycles > 0.0:
        s[L.T_BASE] = s[L.T_CYCLE]
        code = advance(s, old, cycles * s[L.CLOCK_S])
        if code != L.OK:
            return code
        s[L.T_CYCLE] = t_cycle
        s[L.T_BASE] = t_cycle
    currents = s[L.I]
    for x in range(1, PHASES - 1):
        currents += s[L.I + x]
    if not (finite(currents) and finite(s[L.VDC]) and finite(s[L.OMEGA])):
        return L.FAULT_NOT_FINITE
    zoom = s[L.ZOOM_N] > 0.0 and in_zoom(s)
    if flags & L.STROBE:
        convert(s, io)
        code = record_wave(s, old)
        if code != L.OK:
            return code
    if zoom:
        code = record_zoom(s, old)
        if code != L.OK:
            return code
    if s[L.CHOPPER_DRIVEN] != 0.0:
        s[L.CHOPPER_ON] = 1.0 if flags & L.BRAKE else 0.0
    if gates != old:
        s[L.GATES] = gates
        # Diodes that the new gates turn on are logged here, at the edge, and idc and vdc follow at once.
        code = reconnect(s, gates)
        if code != L.OK:
            return code
        if zoom:
            code = record_zoom(s, gates)
            if code != L.OK:
                return code
    io[L.IO_PINS] = int(s[L.FAULT_PIN]) + hall_pins(s)
    if s[L.ENCODER_LINES] > 0.0:
        encode(s, io)
    io[L.IO_HEARTBEAT] += 1
    return L.OK
