# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the averaged chip does with the firmware's registers: settings taken over at the update, snapshots at the tick.

Compiled, because it runs ten thousand times a simulated second. `r` is the register file, `x` the places of the
registers in it; `s`, `c`, `m` are the arrays of the averaged motor. Formats are those of the registers.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from fluxlock.native import averaged_motor as am

Floats = NDArray[np.float64]
Registers = NDArray[np.uint32]
Places = NDArray[np.int64]
SAMPLING_ONCE = 3
CSC = 2
# Values of `stuck` for a channel that is free.
FREE = -(1 << 31)

# Registers, of arrays the first one, and the places of their indices in `x`.
NAMES = (
    "pwm.control",
    "pwm.period",
    "pwm.duty",
    "pwm.manual",
    "safety.dead_time",
    "comm.control",
    "comm.forced_interval",
    "comm.delay",
    "comm.timeout",
    "comm.hall_offset",
    "comm.snap_interval",
    "comm.snap_period",
    "comm.snap_sector_interval",
    "comm.snap_counters",
    "comm.snap_events",
    "zcd.control",
    "zcd.threshold",
    "sense.scheduler",
    "sense.snap_vdc_sum",
    "sense.snap_idc_sum",
    "sense.snap_channel",
    "hall.state",
    "hall.counters",
    "hall.phase",
    "pwm.state",
)
(
    PWM_CONTROL,
    PWM_PERIOD,
    PWM_DUTY,
    PWM_MANUAL,
    SAFETY_DEAD_TIME,
    COMM_CONTROL,
    COMM_FORCED_INTERVAL,
    COMM_DELAY,
    COMM_TIMEOUT,
    COMM_HALL_OFFSET,
    COMM_SNAP_INTERVAL,
    COMM_SNAP_PERIOD,
    COMM_SNAP_SECTOR_INTERVAL,
    COMM_SNAP_COUNTERS,
    COMM_SNAP_EVENTS,
    ZCD_CONTROL,
    ZCD_THRESHOLD,
    SENSE_SCHEDULER,
    SENSE_SNAP_VDC_SUM,
    SENSE_SNAP_IDC_SUM,
    SENSE_SNAP_CHANNEL,
    HALL_STATE,
    HALL_COUNTERS,
    HALL_PHASE,
    PWM_STATE,
) = range(25)

# Constants of a chip in `k`: clocks a second, codes (2^17 a full scale) a volt and an ampere, samples a tick, whether
# with CSC the mean of a sector is that of its cut pulse train, whether there are Hall sensors.
K_NUMBERS = 6
(K_CLOCK_HZ, K_V_UNIT, K_I_UNIT, K_SAMPLES, K_CUT_PULSES, K_HALL) = range(K_NUMBERS)


def places(offsets: dict[str, int]) -> Places:
    """From byte offsets by `block.register`."""
    return np.array([offsets[name] // 4 for name in NAMES])


@numba.njit(cache=True)
def signed16(value: int) -> int:
    """The lower half of a register as a number with a sign."""
    return ((value & 0xFFFF) ^ 0x8000) - 0x8000


@numba.njit(cache=True)
def mean_duty(duty: float, carriers: float, cut_pulses: float) -> float:
    """Mean over a sector of so many carriers: whole ones and a cut one, if looked at so closely."""
    if cut_pulses == 0.0 or carriers <= 0.0:
        return duty
    whole = math.floor(carriers)
    return float((whole * duty + min(duty, carriers - whole)) / carriers)


@numba.njit(cache=True)
def take_settings(r: Registers, x: Places, k: Floats, s: Floats, c: Floats) -> None:
    """The update event: what has been committed becomes active."""
    was_seq, was_timer = int(c[am.C_SEQ]), int(c[am.C_TIMER])
    control = int(r[x[PWM_CONTROL]])
    comm = int(r[x[COMM_CONTROL]])
    seq, timer = control & 3, comm & 3
    sync = control & 0x1000 != 0
    period = int(r[x[PWM_PERIOD]])
    dead = int(r[x[SAFETY_DEAD_TIME]]) if sync and seq != am.SEQ_OFF else 0
    pulse = min(int(r[x[PWM_DUTY]]) / 256.0, period)
    duty = max(0.0, pulse - dead) / period
    c[am.C_PULSE], c[am.C_PERIOD], c[am.C_DEAD] = pulse / k[K_CLOCK_HZ], period / k[K_CLOCK_HZ], dead / k[K_CLOCK_HZ]
    c[am.C_RESTART] = k[K_CUT_PULSES] if control >> 4 & 3 == CSC else 0.0
    c[am.C_DUTY] = mean_duty(duty, s[am.INTERVAL] * k[K_CLOCK_HZ] / period, c[am.C_RESTART])
    c[am.C_SYNC] = 1.0 if sync else 0.0
    c[am.C_REVERSE] = 1.0 if control & 0x2000 else 0.0
    c[am.C_FORCED] = int(r[x[COMM_FORCED_INTERVAL]]) / k[K_CLOCK_HZ]
    delay = int(r[x[COMM_DELAY]])
    c[am.C_DELAY] = ((delay & 0xFFFF) - signed16(delay >> 16)) / 65536.0
    c[am.C_TIMEOUT] = int(r[x[COMM_TIMEOUT]]) / 4096.0
    c[am.C_FORCE] = 1.0 if comm & 16 else 0.0
    c[am.C_MISS_LIMIT] = comm >> 8 & 0xFF
    c[am.C_ZCD] = int(r[x[ZCD_CONTROL]]) & 1
    for i in range(6):
        c[am.C_THRESHOLD + i] = int(r[x[ZCD_THRESHOLD] + i]) / 131072.0
        c[am.C_HALL_OFFSET + i] = signed16(int(r[x[COMM_HALL_OFFSET] + i])) / 65536.0
    for i in range(3):
        c[am.C_LEG + i] = int(r[x[PWM_MANUAL]]) >> (4 * i) & 7
    if seq == am.SEQ_SIX and was_seq != am.SEQ_SIX:
        s[am.SECTOR] = control >> 16 & 7
        if control & 1 << 19 and s[am.H_POSITION] >= 0.0:
            s[am.SECTOR] = (s[am.H_POSITION] + 3 * c[am.C_REVERSE]) % 6
        s[am.T_COMM] = s[am.T]
        s[am.I_NOW] = math.hypot(s[am.I_ALPHA], s[am.I_BETA]) * 0.75
    if timer != am.TIMER_OFF and was_timer == am.TIMER_OFF:
        for i in (am.CROSSINGS, am.LATE, am.COMMUTATIONS, am.MISSES, am.TIMEOUTS, am.FOUND, am.ARMED):
            s[i] = 0.0
        s[am.T_ZC] = s[am.H_TIME] = s[am.H_KNOWN] = 0.0
        s[am.INTERVAL] = c[am.C_FORCED]
        s[am.T_SCHED] = s[am.T] + c[am.C_FORCED] if timer == am.TIMER_FORCED else 1e30
    elif timer == am.TIMER_HALL and was_timer == am.TIMER_ZCD:
        # The intervals go on, the sensors' sector is driven.
        s[am.H_TIME], s[am.H_KNOWN] = 0.0, 6.0
        s[am.H_LOAD] = (s[am.H_POSITION] + 3 * c[am.C_REVERSE]) % 6
        s[am.T_SCHED] = s[am.T]
    elif timer == am.TIMER_ZCD and was_timer == am.TIMER_HALL:
        s[am.T_ZC] = s[am.T_FOUND]
    if timer == am.TIMER_ZCD and was_timer in (am.TIMER_OFF, am.TIMER_HALL):
        s[am.PATIENCE] = c[am.C_TIMEOUT] * s[am.INTERVAL]
    c[am.C_SEQ], c[am.C_TIMER] = seq, timer


@numba.njit(cache=True)
def put(r: Registers, at: int, value: int) -> None:
    """Set a register, signed values in two's complement."""
    r[at] = value & 0xFFFFFFFF


@numba.njit(cache=True)
def show_samples(
    r: Registers,
    x: Places,
    k: Floats,
    s: Floats,
    c: Floats,
    m: Floats,
    stuck: NDArray[np.int64],
    idc_offset_a: float,
) -> None:
    """Sums and samples of the converter; stuck: codes of voltage channels that keep one, else FREE."""
    idc = s[am.IDC_SUM] / max(s[am.SUM_TIME], 1e-12) + idc_offset_a
    if int(r[x[SENSE_SCHEDULER]]) & 3 == SAMPLING_ONCE:
        idc = s[am.I_LINE] + idc_offset_a  # a sample in the pulse
    s[am.IDC_SUM] = s[am.SUM_TIME] = 0.0
    put(r, x[SENSE_SNAP_VDC_SUM], round(m[am.M_VDC] * k[K_V_UNIT]) * int(k[K_SAMPLES]))
    put(r, x[SENSE_SNAP_IDC_SUM], round(idc * k[K_I_UNIT]) * int(k[K_SAMPLES]))
    emf, current = np.zeros(3), np.zeros(3)
    for i in range(3):
        emf[i] = am.phase_shape(s[am.THETA], i, m) * m[am.M_PSI] * (s[am.OMEGA] * m[am.M_P])
    lowest, mean = emf.min(), emf.sum() / 3
    if c[am.C_SEQ] == am.SEQ_SIX:
        sector = int(s[am.SECTOR])
        current[am.HIGH[sector]] = s[am.I_LINE]
        current[am.LOW[sector]] = -s[am.I_LINE]
    else:
        for i in range(3):
            angle = 2.0 * math.pi / 3.0 * i
            current[i] = s[am.I_ALPHA] * math.cos(angle) + s[am.I_BETA] * math.sin(angle)
    for i in range(3):
        terminal = emf[i] - lowest
        if c[am.C_SEQ] == am.SEQ_OFF or c[am.C_GATES] == 0.0:
            # Gates off: the terminals sum to zero, a diode holds the lowest one; the converter shows nothing negative.
            terminal = max(emf[i] - mean + max(0.0, mean - lowest - m[am.M_DIODE]), 0.0)
        put(r, x[SENSE_SNAP_CHANNEL] + i, round(terminal * k[K_V_UNIT]) if stuck[i] == FREE else stuck[i])
        put(r, x[SENSE_SNAP_CHANNEL] + 3 + i, round(current[i] * k[K_I_UNIT]))


@numba.njit(cache=True)
def show_crossings(r: Registers, x: Places, k: Floats, s: Floats, c: Floats) -> None:
    """Intervals and counters of the commutation timer, and of the Hall sensors where there are any."""
    put(r, x[COMM_SNAP_INTERVAL], min(0xFFFFFF, round(s[am.INTERVAL] * k[K_CLOCK_HZ])))
    period_s = s[am.RING_FIRST : am.RING_FIRST + 6].sum()
    put(r, x[COMM_SNAP_PERIOD], min(0x7FFFFFF, round(period_s * k[K_CLOCK_HZ])))
    step = -1 if c[am.C_REVERSE] > 0.0 else 1
    for back in range(6):
        # Ring entry n is the interval that ended n crossings after the ring began; its next entry is the oldest.
        sector = int(s[am.ZC_SECTOR] - back * step) % 6
        interval_s = s[am.RING_FIRST + int(s[am.RING_AT] - 1 - back) % 6]
        put(r, x[COMM_SNAP_SECTOR_INTERVAL] + sector, min(0xFFFFFF, round(interval_s * k[K_CLOCK_HZ])))
    misses, late = min(255, int(s[am.MISSES])), int(s[am.LATE]) & 0xFF
    put(r, x[COMM_SNAP_COUNTERS], (int(s[am.CROSSINGS]) & 0xFFFF) | misses << 16 | late << 24)
    put(r, x[COMM_SNAP_EVENTS], (int(s[am.COMMUTATIONS]) & 0xFFFF) | (int(s[am.TIMEOUTS]) & 0xFF) << 24)
    put(r, x[PWM_STATE], int(s[am.SECTOR]))
    if k[K_HALL] == 0.0:
        return
    valid = 1 if am.HALL_MAP[int(s[am.H_CODE])] < 6 else 0
    sector = int(s[am.H_POSITION] + (3 if c[am.C_REVERSE] > 0.0 else 0)) % 6
    put(r, x[HALL_STATE], sector << 8 | valid << 12 | int(s[am.H_BACKWARD]) << 13)
    edges, invalid = int(s[am.H_EDGES]) & 0xFFFF, int(s[am.H_INVALID]) & 0xFF
    put(r, x[HALL_COUNTERS], edges | invalid << 16 | (int(s[am.H_SKIPPED]) & 0xFF) << 24)
    for i in range(6):
        put(r, x[HALL_PHASE] + i, min(0xFFFFFF, round(s[am.H_PHASE + i] * k[K_CLOCK_HZ])))
