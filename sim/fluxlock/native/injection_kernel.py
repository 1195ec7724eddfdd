# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip's vector path with injection and its machine, from current sample to current sample, compiled.

The machine is that of the injection's float model: two planes with saturation, mean voltages of a sample period, dead
time lost at the edges. The hardware is what the registers describe: angle accumulator, shadowed settings, square wave,
band-pass, demodulators. The current regulators are the firmware's `complex_regulator.c`, which the RTL equals bit for
bit. Demodulators and transforms are in floating point; what the firmware reads has the register's format.

`z` is the hardware's state, `m` the machine's parameters, `state` its currents, angle and speed, `r` the register file,
`x` the places of registers in it. SI units; angles of the machine electrical, rad.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fluxlock.native.vector_kernel import (
    LOG_ANGLE,
    LOG_TRIP,
    LOG_UPDATE,
    PENDING,
    Q17,
    Q32,
    Q36,
    Array,
    Calls,
    Registers,
    Whole,
    mantissa,
    pair,
    put,
    signed,
    turned,
)
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.kernel import biquad
from fluxlock.theory.injection.machine import (
    OMEGA_AT,
    THETA_AT,
    TORQUE_AT,
    InverterSet,
    MachineSet,
    advance,
    compiled,
    converted,
    leg_voltages,
    phase_current,
    triangle,
)

SUBSTEPS = 8  # Runge-Kutta steps a sample period
LOCK_IN, CONVENTIONAL, IQ, SEPARATOR = range(4)
SUMS_UNIT, SEPARATOR_UNIT, LOCK_IN_UNIT = 4.0, 2.0, 16.0  # of the results over 2^17 of full scale
DELAY = 2  # updates from a sample's phase to that of the voltage computed from it

STATE = np.dtype(
    [
        ("nco_q36", "i8"),
        ("omega_q36", "i8"),
        ("lead", "i8"),
        ("enable", "i8"),
        ("regulate", "i8"),
        ("preset", "i8", (4,)),
        ("reference", "i8", (4,)),
        ("forward", "i8", (4,)),
        ("limit", "i8", (2,)),
        ("scale", "f8"),
        ("samples", "i8"),
        ("steps", "i8"),
        ("sums", "i8", (4,)),
        ("since_timer", "i8"),  # clocks
        ("trips", "i8"),
        ("active", "i8"),  # the wave runs
        ("waved", "i8"),  # updates since it began, saturates
        ("phase", "i8"),  # of the voltage that the next step computes
        ("amplitude", "i8"),
        ("last_phase", "i8"),
        ("known", "i8"),  # samples that follow each other, separator; whole periods, sums
        ("results", "i8"),
        ("count", "i8"),
        ("sum", "c16", (2,)),
        ("held_i", "c16"),  # at the latest zero crossing
        ("peak_i", "c16"),
        ("error_deg", "f8"),  # of the published angle at the latest sample
        ("rows", "i8"),
        ("logged", "i8"),
        ("late_every", "i8"),  # every how many ticks a set misses its update, 0: none
    ],
    align=True,
)

# A row a sample; the currents in the rotor's frame. v: mean voltages of the legs against the negative rail.
ROW = np.dtype(
    [
        ("t_cycle", "i8"),
        ("theta", "f8"),
        ("omega", "f8"),
        ("i_d", "f8"),
        ("i_q", "f8"),
        ("i_d3", "f8"),
        ("i_q3", "f8"),
        ("v", "f8", (5,)),
        ("vdc", "f8"),
        ("idc", "f8"),
        ("torque_nm", "f8"),
        ("error_deg", "f8"),  # of the published angle
        ("rpm", "f8"),  # as the drive reports it
        ("state", "i8"),  # drive_state_t
    ],
    align=True,
)

REGISTERS = (
    *("foc.control", "foc.lead", "foc.omega", "foc.correct", "foc.scale"),
    *("foc.reference", "foc.gain", "foc.hold", "foc.preset", "foc.forward", "foc.shift", "foc.limit", "foc.ratio"),
    *("foc.snap_i", "foc.snap_u", "foc.snap_v", "foc.snap_v_sum", "foc.snap_count", "foc.snap_theta_sample"),
    *("foc.snap_omega", "safety.trip", "safety.guard"),
    *("sense.snap_number", "sense.snap_vdc_sum", "sense.snap_idc_sum", "sense.snap_count", "sense.snap_channel"),
    *("timer.machine_period", "timer.update"),
    *("injection.control", "injection.wave", "injection.amplitude", "injection.filter", "injection.band_g"),
    *("injection.band_k", "injection.low_g", "injection.snap_re", "injection.snap_im", "injection.snap_result"),
    "injection.snap_state",
)


class Setup(NamedTuple):
    """Sampling and formats. delay: from a sample to the update of its voltage over the period; trip_a: of a phase."""

    period_s: float
    period_cycles: int
    tick_samples: int
    delay: float
    unit_a: float  # codes an ampere
    unit_v: float
    trip_a: float
    low_k: float
    diode_v: float


class Shaft(NamedTuple):
    """Load of the rotor: constant and Coulomb torque (N m), imposed mechanical speed (rad/s) or NaN."""

    load_nm: float
    coulomb_nm: float
    imposed_rad_s: float


class Room(NamedTuple):
    """Working memory: legs that act, currents seen, voltage vector, filters, regulators, tables of the phases."""

    legs: FloatArray
    later: FloatArray
    seen: FloatArray
    last: FloatArray
    vector: FloatArray
    filters: FloatArray
    scratch: FloatArray
    edges: FloatArray
    cosine: FloatArray
    sine: FloatArray
    regulator: NDArray[np.int32]
    gains: NDArray[np.int32]


@compiled
def take(r: Registers, x: Array, s: Array, w: Room) -> None:
    """The update event: the settings written become those in use."""
    z, at = s[0], x[0]
    control = np.int64(r[at.foc_control])
    z.enable, z.regulate = control >> 1 & 1, control >> 4 & 3
    for k in range(4):
        z.reference[k] = signed(r, at.foc_reference + k, 18)
        z.preset[k] = signed(r, at.foc_preset + k, 18)
        z.forward[k] = signed(r, at.foc_forward + k, 18)
        w.gains[k // 2, k % 2] = signed(r, at.foc_gain + k, 18)
        w.gains[k // 2, 2 + k % 2] = signed(r, at.foc_hold + k, 18)
        w.gains[k // 2, 4 + k % 2] = signed(r, at.foc_ratio + k, 18)
    for plane in range(2):
        w.gains[plane, 6] = np.int64(r[at.foc_shift + plane])
        z.limit[plane] = np.int64(r[at.foc_limit + plane]) & (Q17 - 1)
    z.lead = np.int64(r[at.foc_lead])
    z.scale = mantissa(np.int64(r[at.foc_scale]), 24)
    z.omega_q36 = signed(r, at.foc_omega, 32)
    # A correction counts once; the firmware writes it before the commit that it belongs to.
    z.nco_q36 = (z.nco_q36 + (np.int64(r[at.foc_correct]) << 4)) % Q36
    put(r, at.foc_correct, 0)


@compiled
def log(z: Array, rows: NDArray[np.int64], kind: Whole, a: Whole, b: Whole, cycle: Whole) -> None:
    """A row of the log, if one is kept."""
    if z.logged < len(rows):
        row = rows[z.logged]
        row[0], row[1], row[2], row[3] = cycle, kind, a, b
        z.logged += 1


@compiled
def trip(r: Registers, x: Array, s: Array, causes: Whole) -> None:
    """Latch trip causes and open the gates."""
    old = np.int64(r[x[0].safety_trip])
    first = old >> 16 & 0xFF
    put(r, x[0].safety_trip, old & 0xFF | causes | (first if first else causes) << 16)
    put(r, x[0].safety_guard, np.int64(r[x[0].safety_guard]) & ~1)
    s[0].trips += 1


@compiled
def step_wave(r: Registers, x: Array, z: Array) -> float:
    """Voltage code of the wave in the step that runs now; the wave starts and ends at its first phase."""
    at = x[0]
    wave = np.int64(r[at.injection_wave])
    period, first = wave & 0xFFF, wave >> 16 & 0xFFF
    wanted = np.int64(r[at.injection_control]) & 1
    if not z.active and wanted:
        z.active, z.phase, z.waved = 1, first, 0
        z.amplitude = signed(r, at.injection_amplitude, 18)
    elif z.active:
        z.phase = (z.phase + 1) % period
        z.waved = min(z.waved + 1, 8 * period)
        if z.phase == first:
            z.active = wanted
            z.amplitude = signed(r, at.injection_amplitude, 18)
    if not z.active:
        return 0.0
    return float(z.amplitude if z.phase < period // 2 else -z.amplitude)


@compiled
def result(z: Array, r: Registers, x: Array, re: FloatArray, im: FloatArray, count: Whole) -> None:
    """A result for the firmware."""
    at = x[0]
    for axis in range(2):
        put(r, at.injection_snap_re + axis, round(re[axis]))
        put(r, at.injection_snap_im + axis, round(im[axis]))
    z.results = (z.results + 1) & 0xFFFF
    put(r, at.injection_snap_result, z.results | count << 16)


@compiled
def demodulate(r: Registers, x: Array, z: Array, setup: Setup, w: Room, i: complex) -> complex:
    """A sample in codes to its result; the current for the regulators of subspace 1."""
    at = x[0]
    control, form = np.int64(r[at.injection_control]), np.int64(r[at.injection_filter])
    method, remove = control >> 1 & 3, control >> 3 & 1
    period = np.int64(r[at.injection_wave]) & 0xFFF
    phase = (z.phase - DELAY) % period
    put(r, at.injection_snap_state, phase | z.active << 31)
    turns = (z.phase - setup.delay) / period  # of the wave that acts, at the sample
    g = signed(r, at.injection_band_g, 18) / (2.0**22 if form >> 8 & 1 else 2.0**17)
    k = signed(r, at.injection_band_k, 18) / 2.0**16
    h = k * complex(biquad(g, k, w.filters, 0, i.real), biquad(g, k, w.filters, 3, i.imag))
    re, im = np.zeros(2), np.zeros(2)
    if method <= CONVENTIONAL:
        reference = math.sin(2 * math.pi * (turns - 0.25))
        if method == LOCK_IN:
            reference = math.copysign(1.0, h.real) if h.real != 0.0 else 0.0
        g = signed(r, at.injection_low_g, 18) / (2.0**22 if form >> 9 & 1 else 2.0**17)
        biquad(g, setup.low_k, w.filters, 6, h.real * reference)
        biquad(g, setup.low_k, w.filters, 9, h.imag * reference)
        re[0], re[1] = w.filters[8] * LOCK_IN_UNIT, w.filters[11] * LOCK_IN_UNIT * 2.0 ** (form & 7)
        result(z, r, x, re, im, 0)
    elif not z.active:
        z.known = 0
    elif method == IQ:
        if phase < z.last_phase or z.known == 0:
            if z.known == 2:
                for axis in range(2):
                    re[axis], im[axis] = z.sum[axis].real, z.sum[axis].imag
                result(z, r, x, re, im, z.count)
            z.known = 2 if z.known == 1 and phase < z.last_phase else max(z.known, 1)
            z.count = 0
            z.sum[0], z.sum[1] = 0j, 0j
        z.last_phase = phase
        kernel = SUMS_UNIT * cmath.exp(-2j * math.pi * (turns - 0.25))
        z.sum[0] += i.real * kernel
        z.sum[1] += i.imag * kernel
        z.count += 1
    else:
        z.known = min(z.known + 1, 3)
        if phase % 2:
            z.peak_i = i
        else:
            if z.known == 3:
                hf = (z.peak_i - (z.held_i + i) / 2) * SEPARATOR_UNIT
                hf = hf if phase == 2 else -hf
                re[0], re[1] = hf.real, hf.imag
                result(z, r, x, re, im, 0)
            z.held_i = i
        if remove and z.known > 0:
            return complex(z.held_i)
    return i - h if remove and z.active else i


@compiled
def regulate(z: Array, w: Room, c: Calls, plane: Whole, i: complex, setup: Setup) -> Whole:
    """A step of a subspace's regulator; whether the voltage limit acted."""
    i_re, i_im = round(i.real), round(i.imag)
    wanted = pair(z.reference[2 * plane], z.reference[2 * plane + 1])
    regulator, gains = w.regulator[plane], w.gains[plane]
    if z.regulate >> plane & 1:
        return int(c.step(regulator.ctypes.data, gains.ctypes.data, wanted, pair(i_re, i_im), np.int32(z.limit[plane])))
    error = pair(z.reference[2 * plane] - i_re, z.reference[2 * plane + 1] - i_im)
    preset = pair(z.preset[2 * plane] * 256, z.preset[2 * plane + 1] * 256)
    c.preset(regulator.ctypes.data, preset, error)
    return 0


@compiled
def coast(m: MachineSet, state: FloatArray, shaft: Shaft, time_s: float) -> None:
    """Open gates: no current, the load alone."""
    state[:4] = 0.0
    state[TORQUE_AT] = 0.0
    speed = state[OMEGA_AT] / m.pole_pairs
    state[THETA_AT] += state[OMEGA_AT] * time_s
    if not math.isnan(shaft.imposed_rad_s):
        state[OMEGA_AT] = shaft.imposed_rad_s * m.pole_pairs
        return
    torque = -shaft.load_nm - m.viscous * speed - m.fan * speed * abs(speed)
    free, most = speed + time_s * torque / m.inertia, time_s * shaft.coulomb_nm / m.inertia
    state[OMEGA_AT] = m.pole_pairs * (math.copysign(max(abs(free) - most, 0.0), free))


@compiled
def machine(
    m: MachineSet, inv: InverterSet, state: FloatArray, setup: Setup, shaft: Shaft, w: Room, rising: bool
) -> None:
    """One sample period: the voltage in use to the update, then the later one."""
    shared = (shaft.load_nm, shaft.coulomb_nm, shaft.imposed_rad_s, w.cosine, w.sine, w.scratch, w.edges)
    update = min(max(round((1.0 - setup.delay) * SUBSTEPS), 0), SUBSTEPS)
    advance(m, inv, state, w.legs, setup.period_s, SUBSTEPS, update, SUBSTEPS, not rising, *shared)
    w.legs[:] = w.later
    advance(m, inv, state, w.legs, setup.period_s, SUBSTEPS, 0, update, rising, *shared)


@compiled
def open_terminals(m: MachineSet, state: FloatArray, setup: Setup) -> FloatArray:
    """Voltages with open gates: they sum to zero until a diode holds the lowest one."""
    terminals = np.zeros(m.phases)
    for k in range(m.phases):
        place = state[THETA_AT] - 2 * math.pi * k / m.phases
        terminals[k] = -state[OMEGA_AT] * (m.psi * math.sin(place) + 3 * m.psi_3 * math.sin(3 * place))
    terminals += max(-terminals.min() - setup.diode_v, 0.0)
    return terminals


@compiled
def link_current(inv: InverterSet, w: Room, phases: Whole) -> float:
    """Current from the DC link, of the legs' mean voltages and the currents seen."""
    power = 0.0
    for k in range(phases):
        power += w.legs[k] * w.seen[k]
    return power / inv.vdc


@compiled
def note(row: Array, m: MachineSet, inv: InverterSet, state: FloatArray, setup: Setup, w: Room, gates: bool) -> None:
    """What a row has of machine and inverter."""
    row.theta, row.omega, row.torque_nm = state[THETA_AT], state[OMEGA_AT], state[TORQUE_AT]
    row.i_d, row.i_q, row.i_d3, row.i_q3 = state[0], state[1], state[2], state[3]
    row.vdc, row.idc = inv.vdc, link_current(inv, w, m.phases)
    terminals = w.legs + inv.vdc / 2 if gates else open_terminals(m, state, setup)
    for k in range(m.phases):
        row.v[k] = terminals[k]


@compiled
def show(
    r: Registers,
    x: Array,
    z: Array,
    m: MachineSet,
    inv: InverterSet,
    state: FloatArray,
    setup: Setup,
    w: Room,
    currents: FloatArray,
    angle: Whole,
    limited: Whole,
) -> None:
    """Snapshots of the tick."""
    at, n = x[0], m.phases
    put(r, at.sense_snap_number, z.samples)
    put(r, at.sense_snap_vdc_sum, round(inv.vdc * setup.unit_v) * z.steps)
    put(r, at.sense_snap_idc_sum, round(link_current(inv, w, n) * setup.unit_a) * z.steps)
    put(r, at.sense_snap_count, z.steps)
    terminals = open_terminals(m, state, setup)
    for k in range(n):
        put(r, at.sense_snap_channel + k, max(0, round(terminals[k] * setup.unit_v)))
        put(r, at.sense_snap_channel + n + k, round(w.seen[k] * setup.unit_a))
    for k in range(4):
        put(r, at.foc_snap_i + k, round(currents[k]))
        put(r, at.foc_snap_u + k, w.regulator[k // 2, k % 2])
        put(r, at.foc_snap_v + k, ((np.int64(w.regulator[k // 2, k % 2]) + 128) >> 8) + z.forward[k])
        put(r, at.foc_snap_v_sum + k, z.sums[k])
    put(r, at.foc_snap_count, z.steps | 1 << 16 | limited << 24)
    put(r, at.foc_snap_theta_sample, angle)
    put(r, at.foc_snap_omega, z.omega_q36)


@compiled
def sample(
    r: Registers,
    x: Array,
    t: NDArray[np.uint32],
    s: Array,
    m: MachineSet,
    inv: InverterSet,
    state: FloatArray,
    setup: Setup,
    shaft: Shaft,
    w: Room,
    c: Calls,
    rows: Array,
    logs: NDArray[np.int64],
) -> None:
    """One sample period: currents, demodulation, regulators, voltage, and the tick if it is due."""
    z, at, n = s[0], x[0], m.phases
    planes = 2 if n == 5 else 1
    cycle = z.samples * setup.period_cycles
    angle = z.nco_q36 >> 4
    frame = 2 * math.pi * angle / Q32
    vectors = np.zeros(2, np.complex128)
    for k in range(n):
        w.seen[k] = converted(inv, phase_current(state[:4], state[THETA_AT], planes, w.cosine, w.sine, k))
        for plane in range(planes):
            vectors[plane] += 2.0 / n * w.seen[k] * complex(w.cosine[plane, k], w.sine[plane, k])
    first = vectors[0] * cmath.exp(-1j * frame) * setup.unit_a
    third = vectors[1] * cmath.exp(-3j * frame) * setup.unit_a
    published = np.int64(t[at.published_q32])
    error = frame + 2 * math.pi * published / Q32 - state[THETA_AT]
    z.error_deg = math.degrees(cmath.phase(cmath.exp(1j * error)))
    log(z, logs, LOG_ANGLE, angle, published, cycle)
    wave = step_wave(r, x, z)
    clean = demodulate(r, x, z, setup, w, first)
    control, limited = np.int64(r[at.injection_control]), 0
    separate = control >> 1 & 3 == SEPARATOR and control >> 3 & 1 and z.active
    # With the separator subspace 1 runs in the steps whose voltage begins at a zero crossing of the HF current.
    if not separate or z.phase % 2 == 1:
        limited = regulate(z, w, c, 0, clean, setup)
    if planes == 2:
        limited |= regulate(z, w, c, 1, third, setup) << 1
    codes = np.zeros(4)
    for k in range(2 * planes):
        code = ((np.int64(w.regulator[k // 2, k % 2]) + 128) >> 8) + z.forward[k]
        z.sums[k] += code
        codes[k] = code
    z.steps += 1
    updates = 1 + inv.double
    volt = z.scale / (setup.period_cycles * updates) * inv.vdc
    act = turned(z.lead) * cmath.exp(1j * frame)
    one = complex(codes[0] + wave, codes[1]) * act * volt
    three = complex(codes[2], codes[3]) * act * act * act * volt
    w.vector[0], w.vector[1], w.vector[2], w.vector[3] = one.real, one.imag, three.real, three.imag
    move = 0.0
    if inv.model and z.active:
        period = np.int64(r[at.injection_wave]) & 0xFFF
        turns = (z.phase - setup.delay) / period
        peak = z.amplitude / setup.unit_v * setup.period_s * period / (4 * m.l_d)
        move = peak * (triangle(turns + (setup.delay + 0.5) / period) - triangle(turns))
    # With double update the carrier's halves take turns.
    rising = z.samples % 2 == 0
    leg_voltages(inv, w.vector, w.seen, w.last, move, frame, rising, w.edges, setup.period_s, w.cosine, w.sine, w.later)
    gates = np.int64(r[at.safety_guard]) & 1 != 0 and np.int64(r[at.safety_trip]) & 0xFF == 0 and z.enable != 0
    if z.rows < len(rows):
        row = rows[z.rows]
        note(row, m, inv, state, setup, w, gates)
        row.t_cycle, row.error_deg, row.state = cycle, z.error_deg, np.int64(t[at.state])
        row.rpm = signed(t, at.speed_rpm_q8, 32) / 256
        z.rows += 1
    if gates:
        machine(m, inv, state, setup, shaft, w, rising)
        for k in range(n):
            if abs(phase_current(state[:4], state[THETA_AT], planes, w.cosine, w.sine, k)) > setup.trip_a:
                trip(r, x, s, at.phase_trip)
                log(z, logs, LOG_TRIP, at.phase_trip, 0, cycle)
                break
    else:
        coast(m, state, shaft, setup.period_s)
        w.legs[:] = 0.0
    z.nco_q36 = (z.nco_q36 + z.omega_q36 * setup.period_cycles) % Q36
    z.samples += 1
    if z.steps >= setup.tick_samples:
        currents = np.array([clean.real, clean.imag, third.real, third.imag])
        show(r, x, z, m, inv, state, setup, w, currents, angle, limited)
        z.steps = 0
        z.sums[:] = 0
        late = z.late_every > 0 and z.samples // setup.tick_samples % z.late_every == 0
        if np.int64(r[at.timer_update]) & PENDING and not late:
            put(r, at.timer_update, 0)
            take(r, x, s, w)
            told = np.int64(t[at.state]) & 0xFF | (np.int64(t[at.limit]) & 0xF) << 16
            told |= (np.int64(t[at.lost_locks]) & 0xFFF) << 20 | signed(t, at.speed_rpm_q8, 32) << 32
            target = signed(t, at.target_rpm, 32) << 32 | np.int64(t[at.reference_rpm_q8])
            log(z, logs, LOG_UPDATE, told, target, z.samples * setup.period_cycles)
        c.tick()
    z.since_timer += setup.period_cycles
    if z.since_timer >= np.int64(r[at.timer_machine_period]):
        z.since_timer -= np.int64(r[at.timer_machine_period])
        c.cause(np.int32(at.machine_timer))
        c.poll()


@compiled
def run(
    count: Whole,
    r: Registers,
    x: Array,
    t: NDArray[np.uint32],
    s: Array,
    m: MachineSet,
    inv: InverterSet,
    state: FloatArray,
    setup: Setup,
    shaft: Shaft,
    w: Room,
    c: Calls,
    rows: Array,
    logs: NDArray[np.int64],
) -> None:
    """So many sample periods."""
    for _ in range(count):
        sample(r, x, t, s, m, inv, state, setup, shaft, w, c, rows, logs)


@compiled
def seed_noise(seed: int) -> None:
    """Noise of the converters."""
    np.random.seed(seed)
