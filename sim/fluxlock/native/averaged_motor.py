# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Small averaged model of chip, inverter and six-step machine, in floating point.

Independent of the firmware's arithmetic: SI units; the conducting pair's current follows pulse, dead time and gap of
each carrier exactly, diodes end it at zero; an outgoing phase's current drops at once (its volt-seconds act as
3/pi*omega_e*L), crossings and forced commutations at exact times. Sector k drives a field at 330 + 60 k degrees; a
floating phase's crossing is the sign change of its EMF. Hall sensor A shows e_A > e_B and so on, each turned by its
offset; its edges commutate at offset and advance after them, as long as intervals are known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from fluxlock.config import Inverter, Load, Motor
from fluxlock.config.machine import Machine
from fluxlock.plant.emf import THIRD_TURN

STEP_S = 5e-6

# State vector.
(T, THETA, OMEGA, I_ALPHA, I_BETA, I_LINE, SECTOR, T_COMM, T_SCHED, T_ZC, INTERVAL, RING, RING_AT) = range(13)
RING_FIRST = 13  # six intervals
(CROSSINGS, LATE, COMMUTATIONS, MISSES, TIMEOUTS, FOUND, TRIPS, IDC_SUM, SUM_TIME, SEED) = range(19, 29)
(ARMED, I_PEAK, IDC_MEAN, ZC_SECTOR) = range(29, 33)
(H_CODE, H_POSITION, H_TIME, H_EDGES, H_INVALID, H_SKIPPED, H_BACKWARD, H_KNOWN, H_LOAD) = range(33, 42)
H_PHASE = 42  # six: from the last crossing to the edge into a sector
(T_FOUND, H_FOLLOWS) = 48, 49  # last crossing, whoever commutates; an interval after a commutation follows the next
# Current of this instant (I_LINE: mean of the last call), time since the carrier began, charge through the pair, mean
# torque of the last call.
(I_NOW, CARRIER_AT, CHARGE, TORQUE) = range(50, 54)
PATIENCE = 54  # with a crossing after T_COMM, s: settings that come later act from the next commutation on
STATES = 55

# What happened since the reader last emptied it: a count, then time, kind, sector of each event.
NOTES, NOTE_ROWS, NOTE_FIELDS = 64, 64, 3
NOTE_COMMUTATION, NOTE_CROSSING, NOTE_LATE = 0.0, 1.0, 2.0
STATE_FLOATS = NOTES + 1 + NOTE_ROWS * NOTE_FIELDS

# Settings.
(C_SEQ, C_REVERSE, C_DUTY, C_SYNC, C_TIMER, C_FORCED, C_DELAY, C_TIMEOUT, C_MISS_LIMIT, C_ZCD, C_GATES) = range(11)
C_FORCE = 14
C_LEG = 11
C_THRESHOLD = 15  # six, fractions of vdc
C_HALL_OFFSET = 21  # six, fractions of an interval
(C_PULSE, C_PERIOD, C_DEAD, C_RESTART) = range(27, 31)  # s, s, s; CSC: a commutation restarts the carrier
SETTINGS = 31

# Machine and surroundings.
(M_R, M_L, M_PSI, M_TRAPEZOID, M_P, M_J, M_FAN, M_COULOMB, M_VDC, M_DIODE, M_TRIP, M_NOISE, M_LOCKED) = range(13)
(M_BLIND, M_DC_TRIP) = 13, 14
M_DIVIDER = 15  # three gains of the voltage dividers
M_UNEQUAL = 18  # three phase inductances over their mean
M_HALL = 21  # 1: there are Hall sensors; angles at which the inputs rise, rad; three stuck outputs, -1: free
M_ONE_BLIND = 28  # phase whose crossings are not seen, -1: none
M_GHOST = 29  # a crossing that is none comes so long after each commutation, 0: never
(M_VISCOUS, M_CONSTANT) = 30, 31
M_FLUX = 32  # three phases' fluxes over their mean
M_OPEN = 35  # phase whose leg has lost the machine, -1: none
MACHINE = 36

SEQ_OFF, SEQ_MANUAL, SEQ_SIX = 0, 1, 2
TIMER_OFF, TIMER_FORCED, TIMER_ZCD, TIMER_HALL = 0, 1, 2, 3
LEG_PWM_HIGH = 3
TRIP_PHASE, TRIP_DC, TRIP_LOST = 1, 2, 8

HIGH = np.array([0, 0, 1, 1, 2, 2])
LOW = np.array([1, 2, 2, 0, 0, 1])
OPEN = np.array([2, 1, 0, 2, 1, 0])

# Sector of each Hall code (C, B, A), 7: invalid.
HALL_MAP = np.array([7, 0, 2, 1, 4, 5, 3, 7])


@numba.njit(cache=True)
def emf_shape(theta: float, phase: int, trapezoid: float) -> float:
    """EMF of a phase over psi*omega_e: -sin, or a trapezoid with a flat top of 120 degrees."""
    angle = (theta - phase * THIRD_TURN) % 6.283185307179586
    if trapezoid == 0.0:
        return -math.sin(angle)
    sixths = angle / 1.0471975511965976
    if sixths < 0.5:
        return -2.0 * sixths
    if sixths < 2.5:
        return -1.0
    if sixths < 3.5:
        return 2.0 * (sixths - 3.0)
    if sixths < 5.5:
        return 1.0
    return -2.0 * (sixths - 6.0)


@numba.njit(cache=True)
def phase_shape(theta: float, phase: int, m: NDArray[np.float64]) -> float:
    """EMF of a phase over the mean psi times omega_e."""
    return float(m[M_FLUX + phase] * emf_shape(theta, phase, m[M_TRAPEZOID]))


@numba.njit(cache=True)
def noise(s: NDArray[np.float64]) -> float:
    """Roughly Gaussian number of unit variance from a linear congruential generator."""
    total = 0.0
    for _ in range(4):
        s[SEED] = (s[SEED] * 16807.0) % 2147483647.0
        total += s[SEED] / 2147483647.0 - 0.5
    return total * 1.7320508075688772


@numba.njit(cache=True)
def note(s: NDArray[np.float64], time: float, kind: float) -> None:
    """Keep an event of the present sector; those that find no room are lost."""
    count = int(s[NOTES])
    if count < NOTE_ROWS:
        at = NOTES + 1 + count * NOTE_FIELDS
        s[at], s[at + 1], s[at + 2] = time, kind, s[SECTOR]
        s[NOTES] += 1.0


@numba.njit(cache=True)
def measure(s: NDArray[np.float64], t: float) -> None:
    """Interval that ends at time t: of crossings, or of Hall edges where they commutate."""
    s[INTERVAL] = t - s[T_ZC]
    s[RING_FIRST + int(s[RING_AT])] = s[INTERVAL]
    s[RING_AT] = (s[RING_AT] + 1.0) % 6.0


@numba.njit(cache=True)
def hall_code(theta: float, m: NDArray[np.float64]) -> int:
    """Outputs of the sensors C, B, A."""
    code = 0
    for x in range(3):
        high = math.sin(theta - m[M_HALL + 1 + x]) > 0.0
        stuck = m[M_HALL + 4 + x]
        code |= (1 if (high if stuck < 0.0 else stuck > 0.5) else 0) << x
    return code


@numba.njit(cache=True)
def look_at_hall(s: NDArray[np.float64], c: NDArray[np.float64], m: NDArray[np.float64], h: float) -> None:
    """Edges of the step that ended at s[T], halved down to 10 ns, and the schedule that follows from them."""
    code = hall_code(s[THETA], m)
    if code == s[H_CODE]:
        return
    speed = s[OMEGA] * m[M_P]
    low, high = 0.0, h
    while high - low > 1e-8:
        middle = 0.5 * (low + high)
        if hall_code(s[THETA] - (h - middle) * speed, m) == s[H_CODE]:
            low = middle
        else:
            high = middle
    first = s[H_CODE] < 0.0
    s[H_CODE] = code
    position = HALL_MAP[code]
    if position > 5:
        s[H_INVALID] += 1.0
        return
    if position == s[H_POSITION]:
        return
    time = s[T] - h + high
    step = (position - int(s[H_POSITION])) % 6
    s[H_POSITION] = position
    s[H_EDGES] += 1.0
    if first:
        return
    single = step == 1 or step == 5
    s[H_BACKWARD] = 1.0 if step == 5 else 0.0
    reverse = c[C_REVERSE] > 0.0
    sector = (position + 3) % 6 if reverse else position
    s[H_PHASE + sector] = time - s[T_FOUND] if single else 1.0
    if not single:
        s[H_SKIPPED] += 1.0
        s[H_KNOWN] = 0.0
    if c[C_TIMER] != TIMER_HALL:
        return
    if single and s[H_TIME] > 0.0 and s[H_KNOWN] >= 0.0:
        measure_from = s[T_ZC]
        s[T_ZC] = s[H_TIME]
        measure(s, time)
        s[T_ZC] = measure_from
        s[H_KNOWN] += 1.0
    s[ZC_SECTOR] = sector
    s[H_TIME] = time
    s[CROSSINGS] += 1.0
    mean = s[RING_FIRST : RING_FIRST + 6].mean()
    good = single and (s[H_BACKWARD] > 0.0) == reverse and s[H_KNOWN] > 7.0
    due = time + mean * (c[C_HALL_OFFSET + sector] - 0.5 + c[C_DELAY]) if good else s[T]
    if int(s[SECTOR]) == sector:
        # It has been driven already: the next one follows an interval later, unless an edge comes first.
        step = 5 if reverse else 1
        s[H_LOAD] = (sector + step) % 6
        s[T_SCHED] = due + mean if good else 1e30
    else:
        s[H_LOAD] = sector
        s[T_SCHED] = max(due, s[T])
        s[H_FOLLOWS] = 1.0 if good else 0.0


@numba.njit(cache=True)
def crossing(s: NDArray[np.float64], t: float, late: bool, hall: bool) -> None:
    """A crossing at time t: intervals, counters; where Hall edges commutate, only its time."""
    s[T_FOUND] = t
    s[FOUND] = 1.0
    note(s, t, NOTE_LATE if late else NOTE_CROSSING)
    if hall:
        return
    if s[T_ZC] > 0.0:
        measure(s, t)
    s[T_ZC] = t
    s[ZC_SECTOR] = s[SECTOR]
    s[CROSSINGS] += 1.0
    s[MISSES] = 0.0
    if late:
        s[LATE] += 1.0


@numba.njit(cache=True)
def commutate(s: NDArray[np.float64], c: NDArray[np.float64], t: float) -> None:
    """Step the sector; a new schedule in forced mode."""
    step = 5.0 if c[C_REVERSE] > 0.0 else 1.0
    s[SECTOR] = s[H_LOAD] if c[C_TIMER] == TIMER_HALL else (s[SECTOR] + step) % 6.0
    s[COMMUTATIONS] += 1.0
    note(s, t, NOTE_COMMUTATION)
    s[T_COMM] = t
    s[FOUND] = 0.0
    s[ARMED] = 0.0
    if c[C_RESTART] > 0.0:
        s[CARRIER_AT] = 0.0
    s[T_SCHED] = t + c[C_FORCED] if c[C_TIMER] == TIMER_FORCED else 1e30
    s[PATIENCE] = c[C_TIMEOUT] * s[INTERVAL] if c[C_TIMER] == TIMER_ZCD else 1e30
    if c[C_TIMER] == TIMER_HALL and s[H_FOLLOWS] > 0.0:
        s[H_FOLLOWS] = 0.0
        s[T_SCHED] = t + s[RING_FIRST : RING_FIRST + 6].mean()
        s[H_LOAD] = (s[SECTOR] + step) % 6.0


@numba.njit(cache=True)
def crossing_level(s: NDArray[np.float64], c: NDArray[np.float64], m: NDArray[np.float64]) -> float:
    """EMF of the floating phase at which its measured voltage meets the sector's threshold."""
    sector = int(s[SECTOR])
    high, low = m[M_UNEQUAL + HIGH[sector]], m[M_UNEQUAL + LOW[sector]]
    to_emf = m[M_PSI] * s[OMEGA] * m[M_P]
    upper, lower = phase_shape(s[THETA], HIGH[sector], m), phase_shape(s[THETA], LOW[sector], m)
    drive = m[M_VDC] - (upper - lower) * to_emf
    shift = -0.5 * drive * (high - low) / (high + low)
    slope = 1.0 if m[M_TRAPEZOID] > 0.0 else 1.5
    wanted = c[C_THRESHOLD + sector] * m[M_VDC] / m[M_DIVIDER + OPEN[sector]]
    # What the pair's EMFs do not have in common with minus the floating one: 0 between phases of equal flux.
    rest = -0.5 * (upper + lower) - (slope - 1.0) * phase_shape(s[THETA], OPEN[sector], m)
    return float((wanted - 0.5 * m[M_VDC] - shift - rest * to_emf) / slope)


@numba.njit(cache=True)
def look(s: NDArray[np.float64], c: NDArray[np.float64], m: NDArray[np.float64], before: float, h: float) -> None:
    """Crossing detection and commutation timer over the step that ended at s[T]."""
    sector = int(s[SECTOR])
    rising = (sector % 2 == 1) != (c[C_REVERSE] > 0.0)
    sign = 1.0 if rising else -1.0
    omega_e = s[OMEGA] * m[M_P]
    emf = phase_shape(s[THETA], OPEN[sector], m) * m[M_PSI] * omega_e
    now = sign * (emf - crossing_level(s, c, m))
    freewheel = 3e-6 + m[M_L] * abs(s[I_LINE]) / (0.5 * m[M_VDC])
    visible = abs(omega_e) * m[M_PSI] > 5.0 * m[M_NOISE] and c[C_ZCD] > 0.0 and m[M_BLIND] == 0.0
    # Without its pair's current the star point is nowhere near half of the link.
    visible = visible and m[M_ONE_BLIND] != OPEN[sector] and closed(sector, m)
    hall = c[C_TIMER] == TIMER_HALL
    before_found = s[FOUND]
    if s[FOUND] == 0.0 and visible and s[T] - s[T_COMM] > freewheel and c[C_DUTY] > 0.01:
        jitter = noise(s) * m[M_NOISE] / (1.5 * m[M_PSI] * omega_e * omega_e + 1e-9)
        if s[ARMED] == 0.0 and now >= 0.0:
            crossing(s, s[T], True, hall)
        elif now >= 0.0:
            crossing(s, s[T] - h * now / max(now - before, 1e-12) + jitter, False, hall)
        s[ARMED] = 1.0
    if s[FOUND] == 0.0 and m[M_GHOST] > 0.0 and s[T] - s[T_COMM] > m[M_GHOST] and c[C_ZCD] > 0.0:
        crossing(s, s[T], False, hall)
    if before_found == 0.0 and s[FOUND] > 0.0 and c[C_TIMER] == TIMER_ZCD:
        s[T_SCHED] = s[T_ZC] + s[INTERVAL] * c[C_DELAY]
    if c[C_TIMER] == TIMER_ZCD and s[FOUND] == 0.0 and s[T] - s[T_COMM] > s[PATIENCE]:
        s[MISSES] += 1.0
        s[TIMEOUTS] += 1.0
        if c[C_MISS_LIMIT] > 0.0 and s[MISSES] >= c[C_MISS_LIMIT]:
            s[TRIPS] = TRIP_LOST
            c[C_GATES] = 0.0
        if c[C_FORCE] > 0.0:
            s[T_ZC] += s[INTERVAL]
            commutate(s, c, s[T])
        else:
            s[T_COMM] = s[T]
            s[PATIENCE] = c[C_TIMEOUT] * s[INTERVAL]


@numba.njit(cache=True)
def torque_of(s: NDArray[np.float64], c: NDArray[np.float64], m: NDArray[np.float64]) -> float:
    """Machine torque of the currents as they are."""
    k = m[M_PSI] * m[M_P]
    if c[C_SEQ] == SEQ_SIX:
        sector = int(s[SECTOR])
        pair = phase_shape(s[THETA], HIGH[sector], m) - phase_shape(s[THETA], LOW[sector], m)
        return float(k * pair * s[I_NOW])
    total = 0.0
    for x in range(3):
        a = THIRD_TURN * x
        current = s[I_ALPHA] * math.cos(a) + s[I_BETA] * math.sin(a)
        total += current * phase_shape(s[THETA], x, m)
    return float(k * total)


@numba.njit(cache=True)
def conduct(s: NDArray[np.float64], volts: float, ohms: float, henries: float, h: float, diodes: bool) -> float:
    """Advance the pair's current by h under a voltage; diodes end it at zero. Returns the charge."""
    before, final, tau = s[I_NOW], volts / ohms, henries / ohms
    after = final + (before - final) * math.exp(-h / tau)
    if diodes and before * after <= 0.0:
        # None flows from the beginning, or it ends within the time.
        flows_s = tau * math.log((before - final) / -final) if before != 0.0 else 0.0
        s[I_NOW] = 0.0
        return float(final * flows_s + before * tau)
    s[I_NOW] = after
    return float(final * h + (before - after) * tau)


@numba.njit(cache=True)
def closed(sector: int, m: NDArray[np.float64]) -> bool:
    """Whether both phases of a sector's pair are connected to their legs."""
    return bool(m[M_OPEN] != HIGH[sector] and m[M_OPEN] != LOW[sector])


@numba.njit(cache=True)
def chop(s: NDArray[np.float64], c: NDArray[np.float64], m: NDArray[np.float64], h: float) -> None:
    """Advance the pair's current by h through pulses, dead times and gaps; the link's current with it."""
    if h <= 0.0:
        return
    sector, omega_e = int(s[SECTOR]), s[OMEGA] * m[M_P]
    if not closed(sector, m):
        s[I_NOW] = s[IDC_MEAN] = 0.0
        s[CARRIER_AT] = (s[CARRIER_AT] + h) % c[C_PERIOD]
        return
    pair = phase_shape(s[THETA], HIGH[sector], m) - phase_shape(s[THETA], LOW[sector], m)
    emf = pair * m[M_PSI] * omega_e
    commutation_ohm = 3.0 / math.pi * abs(omega_e) * m[M_L]
    ohms, henries = 2.0 * m[M_R] + commutation_ohm, 2.0 * m[M_L]
    sync, pulse, dead = c[C_SYNC] > 0.0, c[C_PULSE], c[C_DEAD]
    left, charge, linked = h, 0.0, 0.0
    while left > 1e-12:
        if s[CARRIER_AT] >= c[C_PERIOD] - 1e-12:
            s[CARRIER_AT] = 0.0
        at = s[CARRIER_AT]
        # Neither switch is on in a dead time, nor in a gap without synchronous rectification.
        on, off = at < pulse, at >= pulse
        until = pulse if on else c[C_PERIOD]
        if sync and pulse > 0.0 and at < dead:
            on, until = False, min(dead, pulse)
        elif sync and pulse > 0.0 and off and at < pulse + dead:
            off, until = False, pulse + dead
        part = max(min(until - at, left), 1e-12)
        switched = (on and at < pulse) or (off and sync)
        high = on if switched else s[I_NOW] < 0.0
        drop = 0.0 if switched else math.copysign(m[M_DIODE], s[I_NOW])
        through = conduct(s, (m[M_VDC] if high else 0.0) - drop - emf, ohms, henries, part, not switched)
        charge += through
        linked += through if high else 0.0
        s[I_PEAK] = max(s[I_PEAK], s[I_NOW])
        if abs(s[I_NOW]) > m[M_TRIP]:
            s[TRIPS] = TRIP_PHASE
            c[C_GATES] = 0.0
        s[CARRIER_AT] += part
        left -= part
    s[CHARGE] += charge
    # The volt-seconds of a commutation are no loss: the outgoing phase's energy returns to the link.
    mean = charge / h
    s[IDC_MEAN] = linked / h - commutation_ohm * mean * mean / m[M_VDC]
    s[IDC_SUM] += s[IDC_MEAN] * h


@numba.njit(cache=True)
def currents(s: NDArray[np.float64], c: NDArray[np.float64], m: NDArray[np.float64], h: float) -> None:
    """Advance the currents by h with the EMF held, exactly for the first-order circuits."""
    omega_e = s[OMEGA] * m[M_P]
    if c[C_GATES] == 0.0 or c[C_SEQ] == SEQ_OFF:
        s[I_NOW] = 0.0
        s[I_ALPHA] = 0.0
        s[I_BETA] = 0.0
        return
    if c[C_SEQ] == SEQ_MANUAL:
        v_alpha, v_beta = 0.0, 0.0
        for x in range(3):
            if c[C_LEG + x] == LEG_PWM_HIGH:
                a = THIRD_TURN * x
                v_alpha += 2.0 / 3.0 * c[C_DUTY] * m[M_VDC] * math.cos(a)
                v_beta += 2.0 / 3.0 * c[C_DUTY] * m[M_VDC] * math.sin(a)
        for x in range(3):
            a = THIRD_TURN * x
            e = phase_shape(s[THETA], x, m) * m[M_PSI] * omega_e
            v_alpha -= 2.0 / 3.0 * e * math.cos(a)
            v_beta -= 2.0 / 3.0 * e * math.sin(a)
        keep = math.exp(-m[M_R] * h / m[M_L])
        s[I_ALPHA] = v_alpha / m[M_R] + (s[I_ALPHA] - v_alpha / m[M_R]) * keep
        s[I_BETA] = v_beta / m[M_R] + (s[I_BETA] - v_beta / m[M_R]) * keep
        if m[M_OPEN] >= 0.0:  # no current along the axis of a phase that is not connected
            cosine, sine = math.cos(THIRD_TURN * m[M_OPEN]), math.sin(THIRD_TURN * m[M_OPEN])
            along = s[I_ALPHA] * cosine + s[I_BETA] * sine
            s[I_ALPHA] -= along * cosine
            s[I_BETA] -= along * sine
        s[I_NOW] = 0.0
        return
    chop(s, c, m, h)


@numba.njit(cache=True)
def advance(s: NDArray[np.float64], c: NDArray[np.float64], m: NDArray[np.float64], t_end: float) -> None:
    """Advance chip and machine to t_end."""
    begin, linked, s[CHARGE], impulse = s[T], s[IDC_SUM], 0.0, 0.0
    while s[T] < t_end - 1e-12:
        h = min(STEP_S, t_end - s[T])
        due = c[C_TIMER] != TIMER_OFF and c[C_GATES] > 0.0 and c[C_SEQ] == SEQ_SIX and s[T_SCHED] < s[T] + h
        if due:
            h = max(s[T_SCHED] - s[T], 0.0)
        sector = int(s[SECTOR])
        rising = (sector % 2 == 1) != (c[C_REVERSE] > 0.0)
        before = phase_shape(s[THETA], OPEN[sector], m) * m[M_PSI] * s[OMEGA] * m[M_P]
        before -= crossing_level(s, c, m)
        before = before if rising else -before
        currents(s, c, m, h)
        load = m[M_FAN] * s[OMEGA] * abs(s[OMEGA]) + m[M_COULOMB] * math.tanh(s[OMEGA] / 2.0)
        load += m[M_VISCOUS] * s[OMEGA] + m[M_CONSTANT]
        torque = torque_of(s, c, m)
        impulse += torque * h
        if m[M_LOCKED] == 0.0:
            s[OMEGA] += h * (torque - load) / m[M_J]
        else:
            s[OMEGA] = 0.0
        s[THETA] += h * s[OMEGA] * m[M_P]
        s[T] += h
        if m[M_HALL] > 0.0:
            look_at_hall(s, c, m, h)
        s[SUM_TIME] += h
        if c[C_TIMER] != TIMER_OFF and c[C_GATES] > 0.0 and c[C_SEQ] == SEQ_SIX:
            look(s, c, m, before, h)
            if due:
                commutate(s, c, s[T])
    if s[T] > begin:
        s[I_LINE] = s[CHARGE] / (s[T] - begin)
        s[TORQUE] = impulse / (s[T] - begin)
        s[IDC_MEAN] = (s[IDC_SUM] - linked) / (s[T] - begin)
        if s[IDC_MEAN] > m[M_DC_TRIP]:
            s[TRIPS] = TRIP_DC
            c[C_GATES] = 0.0


@dataclass
class AveragedMotor:
    """State and parameters of the model, with the quantities to look at."""

    motor: Motor
    inverter: Inverter
    load: Load
    theta_rad: float = 0.0
    speed_rpm: float = 0.0

    def __post_init__(self) -> None:
        self.s = np.zeros(STATE_FLOATS)
        self.c = np.zeros(SETTINGS)
        self.m = np.zeros(MACHINE)
        self.s[THETA] = self.theta_rad
        self.s[OMEGA] = self.speed_rpm * math.pi / 30.0
        self.s[T_SCHED] = 1e30
        self.s[SEED] = 12345.0
        motor, inverter, machine = self.motor, self.inverter, Machine.of(self.motor, self.inverter)
        self.m[:M_BLIND] = (
            machine.resistance_ohm,
            machine.inductance_h,
            machine.psi_vs,
            float(motor.emf == "trapezoidal"),
            motor.pole_pairs,
            motor.inertia_kgm2,
            0.0,
            0.0,
            inverter.supply_v,
            inverter.diode_drop_v,
            inverter.protection.phase_current_a,
            inverter.sensing.step_v,
            0.0,
        )
        self.c[C_THRESHOLD : C_THRESHOLD + 6] = 0.5
        self.m[M_DIVIDER : M_DIVIDER + 3] = 1.0
        self.m[M_UNEQUAL : M_UNEQUAL + 3] = np.array(motor.inductance_h) / np.mean(motor.inductance_h)
        self.m[M_FLUX : M_FLUX + 3] = np.array(motor.psi_vs) / np.mean(motor.psi_vs)
        self.m[M_HALL + 4 : M_HALL + 7] = -1.0
        self.m[[M_ONE_BLIND, M_OPEN]] = -1.0
        self.s[[H_CODE, H_POSITION]] = -1.0
        self.s[H_PHASE : H_PHASE + 6] = 1.0
        if motor.hall is not None:
            self.m[M_HALL] = 1.0
            self.m[M_HALL + 1 : M_HALL + 4] = motor.hall.params.rise_rad
        self.m[M_DC_TRIP] = inverter.protection.dc_current_a
        self.set_load(self.load)

    def set_load(self, load: Load) -> None:
        """Change the load."""
        self.m[M_FAN] = load.fan_nm_s2_per_rad2
        self.m[[M_COULOMB, M_VISCOUS, M_CONSTANT]] = load.coulomb_nm, load.viscous_nm_s_per_rad, load.constant_nm

    def notes(self) -> NDArray[np.float64]:
        """Events since the last call: time, kind, sector."""
        count = int(self.s[NOTES])
        self.s[NOTES] = 0.0
        return self.s[NOTES + 1 : NOTES + 1 + count * NOTE_FIELDS].reshape(count, NOTE_FIELDS).copy()

    @property
    def rpm(self) -> float:
        """True mechanical speed."""
        return float(self.s[OMEGA]) * 30.0 / math.pi

    def advance(self, t_end: float) -> None:
        """Advance to a time in seconds."""
        advance(self.s, self.c, self.m, t_end)
