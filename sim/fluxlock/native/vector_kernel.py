# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip's vector path and its machine, from current sample to current sample, compiled.

Hardware: angle accumulator, shadowed settings, snapshots and control tick as the registers describe them. The
regulator is the firmware's `complex_regulator.c`, which the RTL equals bit for bit. The kernel calls it by its address,
and the control tick too. Machine: without ripple of the carrier. It is exact between two samples if phases and axes
are equal and the EMF is a sine, else integrated by Runge and Kutta's rule; mechanics by Euler's.

What is unequal between the phases acts on the conjugate: with n_k the axis of phase k, sum_k x_k n_k (n_k . i) * 2/3 =
mean(x) i + y conj(i), y = sum_k x_k n_k^2 / 3, and likewise for saliency with the rotor's axis.

`s` is the state, `m` the machine and what surrounds it, `r` the register file, `x` the places of registers in it. All
in SI units; `omega` is electrical, `i` the current in the rotor's frame, d + jq.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core import types
from numba.core.typing.templates import Signature
from numpy.typing import NDArray

from fluxlock.clock import CLOCK_HZ
from fluxlock.firmware.binding import types as c_types
from fluxlock.headers import CData
from fluxlock.plant.emf import THIRD_TURN

Registers = NDArray[np.uint32]
Array = Any  # of one record, or of rows, whose fields mypy does not know
Whole = Any  # int, or a number of a register

Q17, Q32, Q36 = 2**17, 2**32, 2**36
PENDING = 2
STEPS = 2  # of Runge and Kutta's rule, a voltage
AXIS_B, AXIS_C = cmath.exp(1j * THIRD_TURN), cmath.exp(-1j * THIRD_TURN)
SEEN_CYCLES = 20 + 3  # filter and synchronisers of the encoder's inputs
LOG_TRIP, LOG_UPDATE, LOG_ANGLE = 4, 5, 8  # fluxlock.results.rundata.LogKind

STATE = np.dtype(
    [
        ("theta", "f8"),
        ("omega", "f8"),
        ("i", "c16"),
        ("u_before", "c16"),  # stationary
        ("kept", "c16"),  # voltage of the compares in use, stationary
        ("torque_nm", "f8"),
        ("error_deg", "f8"),  # of the frame at the last sample
        ("vdc", "f8"),
        ("idc", "f8"),
        ("nco_q36", "i8"),
        ("omega_q36", "i8"),
        ("enable", "i8"),
        ("regulate", "i8"),
        ("preset_re", "i8"),
        ("preset_im", "i8"),
        ("reference_re", "i8"),
        ("reference_im", "i8"),
        ("forward_re", "i8"),
        ("forward_im", "i8"),
        ("limit", "i8"),
        ("lead", "i8"),
        ("scale", "f8"),
        ("samples", "i8"),
        ("steps", "i8"),
        ("sum_re", "i8"),
        ("sum_im", "i8"),
        ("since_timer", "i8"),  # clocks
        ("trips", "i8"),
        ("missed", "i8"),  # updates without new compares
        ("encoder", "i8"),
        ("place", "i8"),
        ("indexed", "i8"),
        ("position_shift", "i8"),  # from what the tracks have counted to the position
        ("direct_steps", "i8"),
        ("direct_limited", "i8"),
        ("direct_differences", "i8"),
        ("late_answers", "i8"),  # direct steps whose answer is to come after their update
        ("masked_steps", "i8"),  # direct steps whose update is to pass before the core has looked at them
        ("late_commits", "i8"),  # ticks that the next set is to miss
        ("silent", "i8"),  # the converter gives no samples
        ("records", "i8"),  # of a capture under way
        ("captures", "?"),
        ("rows", "i8"),
        ("logged", "i8"),
    ],
    align=True,
)

MACHINE = np.dtype(
    [
        ("period_s", "f8"),
        ("period_cycles", "i8"),
        ("tick_samples", "i8"),
        ("delay", "f8"),
        ("resistance_ohm", "f8"),
        ("l_d_h", "f8"),
        ("l_q_h", "f8"),
        ("psi_vs", "f8"),
        ("unequal_ohm", "c16"),  # what acts on the conjugate of the current
        ("unequal_h", "c16"),
        ("flux_share", "f8", (3,)),  # flux of a phase over psi_vs, which is their mean
        ("ramp_rad", "f8"),  # of a trapezoidal EMF, from a crossing to the flat top; 0: a sine
        ("pole_pairs", "i8"),
        ("inertia_kgm2", "f8"),
        ("fan_nm_s2_per_rad2", "f8"),
        ("viscous_nm_s_per_rad", "f8"),
        ("constant_nm", "f8"),
        ("coulomb_nm", "f8"),
        ("stiction_ratio", "f8"),
        ("guided", "i8"),  # the speed is imposed, and grows by:
        ("guided_rad_s2", "f8"),
        ("supply_v", "f8"),
        ("supply_ohm", "f8"),
        ("diode_v", "f8"),
        ("trip_a", "f8"),
        ("noise_a", "f8"),  # rms, an axis
        ("unit_a", "f8"),  # codes an ampere
        ("unit_v", "f8"),
        ("dead_time", "i8"),  # the legs lose what the modulator would add for the current at the time of action
        ("left_v", "f8"),  # what a leg loses beyond its compensation, with the sign of its current
        ("quarters", "i8"),  # of the encoder's lines, 0: there is none
        ("index", "i8"),
        ("offset_turn", "f8"),  # electrical, of the index
        ("inverted", "?"),  # the position counts backward
        ("missing_lines", "i8"),  # that show no edge, before the index
        ("power_up_quarter", "i8"),
        ("open_phase", "i8"),  # 0: none; 1, 2, 3: the leg of A, B, C has lost the machine
        ("wired", "?"),  # the inputs of the converter are not those of the phases:
        ("current_gain", "f8", (3, 3)),  # of input and phase
        ("voltage_gain", "f8", (3, 3)),
    ],
    align=True,
)

# A row a sample.
ROW = np.dtype(
    [
        ("t_cycle", "i8"),
        ("theta", "f8"),
        ("omega", "f8"),
        ("i", "c16"),  # stationary
        ("v", "c16"),
        ("vdc", "f8"),
        ("idc", "f8"),
        ("torque_nm", "f8"),
        ("error_deg", "f8"),  # of the frame
        ("state", "i8"),  # drive_state_t
    ],
    align=True,
)

REGISTERS = (
    *("foc.control", "foc.lead", "foc.omega", "foc.correct", "foc.scale", "foc.slope", "foc.dead_time", "foc.band"),
    *("foc.reference", "foc.gain", "foc.hold", "foc.preset", "foc.forward", "foc.shift", "foc.limit", "foc.ratio"),
    *("foc.direct_v", "foc.direct_go", "foc.direct_i", "foc.direct_run"),
    *("foc.snap_i", "foc.snap_u", "foc.snap_v", "foc.snap_v_sum", "foc.snap_count", "foc.snap_theta_sample"),
    *("encoder.turn", "encoder.counters", "foc.snap_encoder", "foc.snap_omega", "safety.trip", "safety.guard"),
    *("sense.snap_number", "sense.snap_vdc_sum", "sense.snap_idc_sum", "sense.snap_count", "sense.snap_channel"),
    *("timer.machine_period", "timer.update", "sense.period", "sense.scheduler", "capture.control", "capture.status"),
)
# Of the telemetry.
WORDS = ("published_q32", "state", "limit", "lost_locks", "speed_rpm_q8", "target_rpm", "reference_rpm_q8")
PLACES = np.dtype([(name.replace(".", "_"), "i8") for name in (*REGISTERS, *WORDS, "machine_timer", "phase_trip")])


class _Foreign(types.WrapperAddressProtocol):
    """A C function for the kernel."""

    def __init__(self, function: CData, result: Callable[..., Signature], *arguments: object) -> None:
        self._address, self._signature = int(c_types().cast("uintptr_t", function)), result(*arguments)

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Signature:
        """As numba has it."""
        return self._signature


class Calls(NamedTuple):
    """Functions of a library of the firmware, `_Foreign`. A complex_t by value is the 64-bit integer of `pair`."""

    tick: Any
    poll: Any
    cause: Any
    current: Any
    step: Any
    preset: Any
    bound: Any


def calls(lib: CData) -> Calls:
    """Of an open library."""
    address, vector, word = types.uint64, types.int64, types.int32
    return Calls(
        _Foreign(lib.fl_host_tick, types.void),
        _Foreign(lib.fl_host_poll, types.void),
        _Foreign(lib.fl_host_raise, types.void, word),
        _Foreign(lib.fl_host_current, types.void),
        _Foreign(lib.complex_regulator_step, types.uint8, address, address, vector, vector, word),
        _Foreign(lib.complex_regulator_preset, types.void, address, vector, vector),
        _Foreign(lib.circle_limit_v_q25, vector, vector, word, address),
    )


@numba.njit(cache=True)
def pair(re: Whole, im: Whole) -> Whole:
    """A complex_t as C passes it: its two halves in one register."""
    return (np.int64(re) & 0xFFFFFFFF) | np.int64(im) << 32


@numba.njit(cache=True)
def signed(r: Registers, at: Whole, bits: Whole) -> Whole:
    """Signed value of a register."""
    low = np.int64(r[at]) & ((1 << bits) - 1)
    return low - (1 << bits) if low >> (bits - 1) else low


@numba.njit(cache=True)
def put(r: Registers, at: Whole, value: Whole) -> None:
    """Set a register, signed values in two's complement."""
    r[at] = np.uint32(np.int64(value) & 0xFFFFFFFF)


@numba.njit(cache=True)
def mantissa(word: Whole, shift_at: Whole) -> float:
    """A mantissa of 17 bits times 2^-shift."""
    return float((word & (Q17 - 1)) * 2.0 ** -(word >> shift_at & 31))


@numba.njit(cache=True)
def turned(angle_q32: Whole) -> complex:
    """Unit vector at an angle."""
    return cmath.exp(2j * math.pi * angle_q32 / Q32)


@numba.njit(cache=True)
def take(r: Registers, x: Array, s: Array, gains: NDArray[np.int32]) -> None:
    """The update event: the settings written become those in use."""
    s, x = s[0], x[0]
    control = np.int64(r[x.foc_control])
    s.enable, s.regulate = control >> 1 & 1, control >> 4 & 1
    for k in range(2):
        gains[k] = signed(r, x.foc_gain + k, 18)
        gains[2 + k] = signed(r, x.foc_hold + k, 18)
        gains[4 + k] = signed(r, x.foc_ratio + k, 18)
    gains[6] = np.int64(r[x.foc_shift])
    s.reference_re, s.reference_im = signed(r, x.foc_reference, 18), signed(r, x.foc_reference + 1, 18)
    s.preset_re, s.preset_im = signed(r, x.foc_preset, 18), signed(r, x.foc_preset + 1, 18)
    s.forward_re, s.forward_im = signed(r, x.foc_forward, 18), signed(r, x.foc_forward + 1, 18)
    s.limit = np.int64(r[x.foc_limit]) & (Q17 - 1)
    s.lead = np.int64(r[x.foc_lead])
    s.scale = mantissa(np.int64(r[x.foc_scale]), 24)
    s.omega_q36 = signed(r, x.foc_omega, 32)
    # A correction counts once; the firmware writes it before the commit that it belongs to.
    s.nco_q36 = (s.nco_q36 + (np.int64(r[x.foc_correct]) << 4)) % Q36
    put(r, x.foc_correct, 0)


@numba.njit(cache=True)
def log(s: Array, rows: NDArray[np.int64], kind: Whole, a: Whole, b: Whole, cycle: Whole) -> None:
    """A row of the log, if one is kept."""
    if s[0].logged < len(rows):
        row = rows[s[0].logged]
        row[0], row[1], row[2], row[3] = cycle, kind, a, b
        s[0].logged += 1


@numba.njit(cache=True)
def trip(r: Registers, x: Array, s: Array, causes: Whole) -> None:
    """Latch trip causes and open the gates."""
    old = np.int64(r[x[0].safety_trip])
    first = old >> 16 & 0xFF
    put(r, x[0].safety_trip, old & 0xFF | causes | (first if first else causes) << 16)
    put(r, x[0].safety_guard, np.int64(r[x[0].safety_guard]) & ~1)
    s[0].trips += 1


@numba.njit(cache=True)
def counted(place: Whole, m: Array) -> Whole:
    """Edges that the tracks show up to a place."""
    m = m[0]
    whole = m.quarters - 4 * m.missing_lines
    return place // m.quarters * whole + min(place % m.quarters, whole - 1)


@numba.njit(cache=True)
def encode(r: Registers, x: Array, s: Array, machine: Array) -> None:
    """Position of the encoder now, as filter and synchronisers show it."""
    s, x, m = s[0], x[0], machine[0]
    if m.quarters == 0:
        return
    told = (np.int64(r[x.encoder_turn]) & 0x3FFFF) + 1
    seen = s.theta - s.omega * SEEN_CYCLES / CLOCK_HZ
    quarters = (seen / (2 * math.pi) - m.offset_turn) / m.pole_pairs * m.quarters
    place = np.int64(math.floor(-quarters if m.inverted else quarters))
    turn, before = place // m.quarters, s.place // m.quarters
    if m.index and (turn != before or place % m.quarters == 0):
        passed = counted(max(turn, before) * m.quarters, machine)
        if s.indexed and (passed + s.position_shift) % told != 0:
            counters = np.int64(r[x.encoder_counters])
            put(r, x.encoder_counters, (counters + (1 << 16)) & 0xFFFF0000 | counters & 0xFFFF)
        s.position_shift, s.indexed = -passed, 1
    s.place = place
    position = (counted(place, machine) + (0 if s.indexed else m.power_up_quarter) + s.position_shift) % told
    s.encoder = position | s.indexed << 31


@numba.njit(cache=True)
def direct(
    r: Registers,
    x: Array,
    s: Array,
    regulator: NDArray[np.int32],
    i_re: Whole,
    i_im: Whole,
    masked: bool,
    late: bool,
    c: Calls,
) -> Whole:
    """The firmware's regulator; counts where the state is not the one that the hardware's would have.

    An answer that comes late is ignored: the step is abandoned, as one is that the core was not let look at. The
    hardware's regulator keeps the state of a step whose compares miss their update, and makes none for a current
    that it has to ignore.
    """
    s, x = s[0], x[0]
    number = s.samples & 0xFFFF
    put(r, x.foc_direct_run, number | (0 if masked else 1 << 31))
    put(r, x.foc_direct_i, i_re)
    put(r, x.foc_direct_i + 1, i_im)
    put(r, x.foc_direct_go, ~number & 0xFFFF)
    c.current()
    if masked:
        assert np.int64(r[x.foc_direct_go]) == ~number & 0xFFFF, "an answer to no step"
        return 0
    assert np.int64(r[x.foc_direct_go]) == number, "no answer"
    if late:
        return 0
    limited = np.zeros(1, np.uint8)
    wanted = pair(signed(r, x.foc_direct_v, 28), signed(r, x.foc_direct_v + 1, 28))
    voltage = c.bound(wanted, np.int32(s.limit), limited.ctypes.data)
    s.direct_steps += 1
    s.direct_limited += limited[0]
    s.direct_differences += voltage != pair(regulator[0], regulator[1])
    regulator[0], regulator[1] = np.int32(voltage & 0xFFFFFFFF), np.int32(voltage >> 32)
    return int(limited[0])


@numba.njit(cache=True)
def dead_time_v(r: Registers, x: Array, m: Array, vdc: float, current_a: complex) -> complex:
    """Vector of the modulator's compensation for a stationary current."""
    m, x = m[0], x[0]
    most = np.int64(r[x.foc_dead_time])
    per_ampere = mantissa(np.int64(r[x.foc_slope]), 24) * m.unit_a
    band = np.int64(r[x.foc_band]) / m.unit_a
    v = 0j
    for k in range(3):
        turn = cmath.exp(2j * math.pi * k / 3)
        current = (current_a * turn.conjugate()).real
        beyond = math.copysign(max(abs(current) - band, 0.0), current)
        v += 2 / 3 * min(max(beyond * per_ampere, -most), most) * turn
    double = np.int64(r[x.foc_control]) >> 2 & 1
    return complex(v * vdc / (m.period_cycles * (1 + double)))


@numba.njit(cache=True)
def left_v(v: float, current_a: complex) -> complex:
    """Vector of a voltage that each leg loses with the sign of its current (stationary)."""
    lost = 0j
    for k in range(3):
        turn = cmath.exp(2j * math.pi * k / 3)
        lost += 2 / 3 * math.copysign(v, (current_a * turn.conjugate()).real) * turn
    return lost


@numba.njit(cache=True)
def plain(m: Array) -> Whole:
    """Whether axes and phases are equal and the EMF is a sine."""
    k = m[0]
    share = k.flux_share
    equal = k.unequal_ohm == 0j and k.unequal_h == 0j and share[0] == share[1] and share[1] == share[2]
    return equal and k.l_d_h == k.l_q_h and k.ramp_rad == 0.0


@numba.njit(cache=True)
def magnet_shape(angle: float, ramp: float) -> tuple[float, float]:
    """Flux of a phase with a trapezoidal EMF over its peak EMF per speed, and its slope over the angle."""
    turned = (angle + math.pi) % (2 * math.pi) - math.pi
    x, sign = abs(turned), math.copysign(1.0, turned)
    # The flux is even; it falls by the trapezoid's area from its peak at 0, where half a turn is worth pi - ramp.
    half = (math.pi - ramp) / 2
    if x < ramp:
        return half - x * x / (2 * ramp), -sign * x / ramp
    if x <= math.pi - ramp:
        return half - ramp / 2 - (x - ramp), -sign
    rest = math.pi - x
    return rest * rest / (2 * ramp) - half, -sign * rest / ramp


@numba.njit(cache=True)
def magnets(theta: float, m: Array) -> tuple[complex, complex]:
    """Stationary vector of the magnets' flux, and its slope over the angle."""
    k = m[0]
    share = k.flux_share
    if k.ramp_rad == 0.0:
        turn = cmath.exp(1j * theta)
        # The mean share is 1; what is unequal turns backwards.
        other = (share[0] + share[1] * AXIS_B * AXIS_B + share[2] * AXIS_C * AXIS_C) / 3 * turn.conjugate()
        return k.psi_vs * (turn + other), 1j * k.psi_vs * (turn - other)
    a, b, c = (
        magnet_shape(theta, k.ramp_rad),
        magnet_shape(theta - THIRD_TURN, k.ramp_rad),
        magnet_shape(theta + THIRD_TURN, k.ramp_rad),
    )
    flux = share[0] * a[0] + share[1] * b[0] * AXIS_B + share[2] * c[0] * AXIS_C
    slope = share[0] * a[1] + share[1] * b[1] * AXIS_B + share[2] * c[1] * AXIS_C
    return 2 / 3 * k.psi_vs * flux, 2 / 3 * k.psi_vs * slope


@numba.njit(cache=True)
def emf(s: Array, m: Array) -> complex:
    """Stationary EMF."""
    if plain(m):
        return complex(1j * m[0].psi_vs * s[0].omega * cmath.exp(1j * s[0].theta))
    return complex(s[0].omega * magnets(s[0].theta, m)[1])


@numba.njit(cache=True)
def inductances(theta: float, m: Array) -> tuple[float, complex]:
    """What acts on the current and what on its conjugate."""
    k = m[0]
    if k.l_d_h == k.l_q_h:
        return k.l_d_h, k.unequal_h
    return (k.l_d_h + k.l_q_h) / 2, k.unequal_h + (k.l_d_h - k.l_q_h) / 2 * cmath.exp(2j * theta)


@numba.njit(cache=True)
def current_of(flux: complex, theta: float, m: Array) -> complex:
    """Current for a flux, both stationary."""
    own = flux - magnets(theta, m)[0]
    mean, other = inductances(theta, m)
    return complex((mean * own - other * own.conjugate()) / (mean * mean - abs(other) ** 2))


@numba.njit(cache=True)
def torque_of(s: Array, m: Array) -> float:
    """Of the currents as they are: p times the slope of the co-energy over the angle."""
    z, k = s[0], m[0]
    if plain(m):
        return float(1.5 * k.pole_pairs * k.psi_vs * z.i.imag)
    i = z.i * cmath.exp(1j * z.theta)
    slope = magnets(z.theta, m)[1]
    reluctance = (k.l_d_h - k.l_q_h) * z.i.real * z.i.imag
    return float(1.5 * k.pole_pairs * ((i.conjugate() * slope).real + reluctance))


@numba.njit(cache=True)
def voltage_left(u: complex, flux: complex, theta: float, m: Array) -> complex:
    """Slope of the flux: voltage less the drop of the resistances."""
    i = current_of(flux, theta, m)
    return complex(u - m[0].resistance_ohm * i - m[0].unequal_ohm * i.conjugate())


@numba.njit(cache=True)
def electric(s: Array, m: Array, u: complex, theta: float, time_s: float) -> None:
    """A time with a stationary voltage, from a rotor angle on; the state's current is in that rotor's frame."""
    z, k = s[0], m[0]
    if time_s <= 0.0:
        return
    turn, ahead = cmath.exp(1j * theta), cmath.exp(1j * z.omega * time_s)
    if plain(m):
        decay = math.exp(-k.resistance_ohm / k.l_d_h * time_s)
        back = 1j * z.omega * k.psi_vs / (k.resistance_ohm + 1j * z.omega * k.l_d_h)
        i = z.i * decay + u * turn.conjugate() * (1.0 - decay) / k.resistance_ohm - back * (ahead - decay)
        z.i = i * ahead.conjugate()
        return
    i = z.i * turn
    mean, other = inductances(theta, m)
    flux = mean * i + other * i.conjugate() + magnets(theta, m)[0]
    h = time_s / STEPS
    for _ in range(STEPS):
        middle, end = theta + z.omega * h / 2, theta + z.omega * h
        k1 = voltage_left(u, flux, theta, m)
        k2 = voltage_left(u, flux + h / 2 * k1, middle, m)
        k3 = voltage_left(u, flux + h / 2 * k2, middle, m)
        k4 = voltage_left(u, flux + h * k3, end, m)
        flux += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        theta = end
    z.i = current_of(flux, theta, m) * cmath.exp(-1j * theta)


@numba.njit(cache=True)
def mechanic(s: Array, m: Array) -> None:
    """Angle and speed a sample later; a rotor that stands is held by friction."""
    s, m = s[0], m[0]
    s.theta += s.omega * m.period_s
    if m.guided:
        s.omega += m.guided_rad_s2 * m.period_s
        return
    speed = s.omega / m.pole_pairs
    torque = s.torque_nm - m.fan_nm_s2_per_rad2 * speed * abs(speed) - m.viscous_nm_s_per_rad * speed - m.constant_nm
    if s.omega == 0.0 and abs(torque) <= m.coulomb_nm * m.stiction_ratio:
        return
    torque -= math.copysign(m.coulomb_nm, s.omega if s.omega != 0.0 else torque)
    later = s.omega + m.pole_pairs * torque / m.inertia_kgm2 * m.period_s
    s.omega = 0.0 if m.coulomb_nm > 0.0 and later * s.omega < 0.0 else later


@numba.njit(cache=True)
def machine(r: Registers, x: Array, s: Array, m: Array, u: complex, gates: bool) -> None:
    """One sample period of the machine with a stationary voltage from the delay on."""
    k = m[0]
    if gates:
        s[0].torque_nm = torque_of(s, m)
        early = k.delay * k.period_s
        electric(s, m, s[0].u_before, s[0].theta, early)
        electric(s, m, u, s[0].theta + s[0].omega * early, k.period_s - early)
        if k.open_phase:
            # No current along the axis of a phase that is not connected; the other axis does not know of it.
            axis = cmath.exp(1j * (THIRD_TURN * (k.open_phase - 1) - s[0].theta - s[0].omega * k.period_s))
            s[0].i -= axis * (s[0].i * axis.conjugate()).real
        s[0].u_before = u
        s[0].idc = (
            1.5 * (u * cmath.exp(-1j * (s[0].theta + s[0].omega * k.period_s)) * s[0].i.conjugate()).real / s[0].vdc
        )
        if abs(s[0].i) > k.trip_a:
            trip(r, x, s, x[0].phase_trip)
    else:
        s[0].i, s[0].torque_nm, s[0].idc = 0j, 0.0, 0.0
        s[0].u_before = emf(s, m)
    s[0].vdc = k.supply_v - k.supply_ohm * s[0].idc
    mechanic(s, m)


@numba.njit(cache=True)
def show(
    r: Registers,
    x: Array,
    s: Array,
    m: Array,
    regulator: NDArray[np.int32],
    i: tuple[Whole, Whole],
    v: tuple[Whole, Whole],
    angle: Whole,
    limited: Whole,
) -> None:
    """Snapshots of the tick."""
    open_v = emf(s, m)
    s, x, m = s[0], x[0], m[0]
    if not s.silent:
        put(r, x.sense_snap_number, s.samples)
    put(r, x.sense_snap_vdc_sum, round(s.vdc * m.unit_v) * s.steps)
    put(r, x.sense_snap_idc_sum, round(s.idc * m.unit_a) * s.steps)
    put(r, x.sense_snap_count, s.steps)
    # Terminals with open gates: they sum to zero until a diode holds the lowest one; nothing negative is seen.
    phases = np.array([(open_v * cmath.exp(-2j * math.pi * k / 3)).real for k in range(3)])
    lift = max(-phases.min() - m.diode_v, 0.0)
    terminals = m.voltage_gain @ (phases + lift) if m.wired else phases + lift
    for k in range(3):
        put(r, x.sense_snap_channel + k, max(0, round(terminals[k] * m.unit_v)))
    put(r, x.foc_snap_i, i[0])
    put(r, x.foc_snap_i + 1, i[1])
    for axis in range(2):
        put(r, x.foc_snap_u + axis, regulator[axis])
        put(r, x.foc_snap_v + axis, v[axis])
    put(r, x.foc_snap_v_sum, s.sum_re)
    put(r, x.foc_snap_v_sum + 1, s.sum_im)
    put(r, x.foc_snap_count, s.steps | 1 << 16 | limited << 24)
    put(r, x.foc_snap_theta_sample, angle)
    put(r, x.foc_snap_encoder, s.encoder)
    put(r, x.foc_snap_omega, s.omega_q36)


@numba.njit(cache=True)
def phases_of(vector: complex) -> NDArray[np.float64]:
    """Values of the phases whose vector this is; they sum to zero."""
    return np.array([vector.real, (vector * AXIS_C).real, (vector * AXIS_B).real])


@numba.njit(cache=True)
def sensed(m: Array, current_a: complex, rng: np.random.Generator) -> NDArray[np.float64]:
    """What the inputs of the converter see of a stationary current, A."""
    k = m[0]
    if not k.wired:
        if k.noise_a > 0.0:
            current_a += complex(rng.standard_normal(), rng.standard_normal()) * k.noise_a
        return phases_of(current_a)
    seen: NDArray[np.float64] = k.current_gain @ phases_of(current_a)
    for x in range(3):
        seen[x] += rng.standard_normal() * k.noise_a * math.sqrt(1.5)
    return seen


@numba.njit(cache=True)
def capture(r: Registers, x: Array, s: Array, m: Array, records: NDArray[np.int32], gates: bool) -> None:
    """Terminal voltages of a sample period into the capture buffer, if it is armed; its lanes are those voltages.

    Pulses lie around the middle of the carrier, with an update in between each half follows from its own voltage.
    """
    z, k, at = s[0], m[0], x[0]
    if np.int64(r[at.capture_control]) & 1:
        put(r, at.capture_control, 0)
        put(r, at.capture_status, len(records) << 16 | 1)
        z.records, z.captures = 0, True
    if not z.captures:
        return
    period = max(int(r[at.sense_period]), 16)
    first = (int(r[at.sense_scheduler]) >> 16) % period
    count = (int(k.period_cycles) - first + period - 1) // period
    double = np.int64(r[at.foc_control]) >> 2 & 1
    duty = phases_of(z.kept) / z.vdc + 0.5
    for j in range(min(count, len(records) - z.records)):
        place = (first + j * period) / k.period_cycles
        ramp = 1.0 - place if double else 2.0 * abs(place - 0.5)
        legs = np.zeros(3)
        for leg in range(3):
            legs[leg] = z.vdc if gates and ramp < duty[leg] else 0.0
        seen = k.voltage_gain @ legs if k.wired else legs
        for lane in range(3):
            records[z.records, lane] = round(seen[lane] * k.unit_v)
        records[z.records, 3] = round(z.vdc * k.unit_v)
        z.records += 1
    if z.records == len(records):
        put(r, at.capture_status, len(records) << 16 | 2)
        z.captures = False


@numba.njit(cache=True)
def sample(
    r: Registers,
    x: Array,
    t: NDArray[np.uint32],
    s: Array,
    m: Array,
    regulator: NDArray[np.int32],
    gains: NDArray[np.int32],
    c: Calls,
    rng: np.random.Generator,
    rows: Array,
    logs: NDArray[np.int64],
    records: NDArray[np.int32],
) -> None:
    """One sample period: currents, regulator, voltage, and the tick if it is due."""
    z, k, at = s[0], m[0], x[0]
    cycle = z.samples * k.period_cycles
    angle = z.nco_q36 >> 4
    frame, rotor = turned(angle), cmath.exp(1j * z.theta)
    inputs = sensed(m, z.i * rotor, rng)
    stationary = 2 / 3 * (inputs[0] + inputs[1] * AXIS_B + inputs[2] * AXIS_C)
    for leg in range(3):
        put(r, at.sense_snap_channel + 3 + leg, round(inputs[leg] * k.unit_a))
    measured = stationary * frame.conjugate()
    z.error_deg = math.degrees(cmath.phase(frame * rotor.conjugate()))
    encode(r, x, s, m)
    i_re, i_im = round(measured.real * k.unit_a), round(measured.imag * k.unit_a)
    log(s, logs, LOG_ANGLE, angle, np.int64(t[at.published_q32]), cycle)
    by_core = np.int64(r[at.foc_control]) & 64 != 0
    masked = by_core and z.masked_steps > 0
    late = by_core and not masked and z.late_answers > 0
    limited = 0
    if not masked:
        if z.regulate:
            reference = pair(z.reference_re, z.reference_im)
            found = c.step(regulator.ctypes.data, gains.ctypes.data, reference, pair(i_re, i_im), np.int32(z.limit))
            limited = int(found)
        else:
            error = pair(z.reference_re - i_re, z.reference_im - i_im)
            c.preset(regulator.ctypes.data, pair(z.preset_re * 256, z.preset_im * 256), error)
    if by_core:
        limited = direct(r, x, s, regulator, i_re, i_im, masked, late, c)
    v_re, v_im = (np.int64(regulator[0]) + 128 >> 8) + z.forward_re, (np.int64(regulator[1]) + 128 >> 8) + z.forward_im
    if masked or late:
        z.masked_steps -= 1 if masked else 0
        z.late_answers -= 1 if late else 0
        z.missed += 1
    else:
        z.steps += 1
        z.sum_re += v_re
        z.sum_im += v_im
        # Clocks of the modulator over its period.
        double = np.int64(r[at.foc_control]) >> 2 & 1
        duty = complex(v_re, v_im) * z.scale / (k.period_cycles * (1 + double))
        z.kept = duty * z.vdc * frame * turned(z.lead)
    gates = np.int64(r[at.safety_guard]) & 1 != 0 and np.int64(r[at.safety_trip]) & 0xFF == 0 and z.enable != 0
    capture(r, x, s, m, records, gates)
    applied = z.kept
    later = cmath.exp(1j * z.omega * (k.delay + 0.5) * k.period_s)
    if k.left_v > 0.0:
        applied -= left_v(k.left_v, z.i * rotor * later)
    if k.dead_time:
        applied += dead_time_v(r, x, m, z.vdc, stationary) - dead_time_v(r, x, m, z.vdc, stationary * later)
    if z.rows < len(rows):
        row = rows[z.rows]
        row.t_cycle, row.theta, row.omega = cycle, z.theta, z.omega
        row.i, row.v = z.i * rotor, z.u_before
        row.vdc, row.idc, row.torque_nm = z.vdc, z.idc, z.torque_nm
        row.error_deg, row.state = z.error_deg, np.int64(t[at.state])
        z.rows += 1
    trips = z.trips
    machine(r, x, s, m, applied, gates)
    z.nco_q36 = (z.nco_q36 + z.omega_q36 * k.period_cycles) % Q36
    z.samples += 1
    if z.trips != trips:
        log(s, logs, LOG_TRIP, at.phase_trip, 0, z.samples * k.period_cycles)
    if z.steps >= k.tick_samples and not (masked or late):
        show(r, x, s, m, regulator, (i_re, i_im), (v_re, v_im), angle, limited)
        z.steps = z.sum_re = z.sum_im = 0
        if z.late_commits > 0:
            z.late_commits -= 1
        elif np.int64(r[at.timer_update]) & PENDING:
            put(r, at.timer_update, 0)
            take(r, x, s, gains)
            told = np.int64(t[at.state]) & 0xFF | (np.int64(t[at.limit]) & 0xF) << 16
            told |= (np.int64(t[at.lost_locks]) & 0xFFF) << 20 | signed(t, at.speed_rpm_q8, 32) << 32
            target = signed(t, at.target_rpm, 32) << 32 | np.int64(t[at.reference_rpm_q8])
            log(s, logs, LOG_UPDATE, told, target, z.samples * k.period_cycles)
        c.tick()
    z.since_timer += k.period_cycles
    if z.since_timer >= np.int64(r[at.timer_machine_period]):
        z.since_timer -= np.int64(r[at.timer_machine_period])
        c.cause(np.int32(at.machine_timer))
        c.poll()


@numba.njit(cache=True)
def advance(
    count: Whole,
    r: Registers,
    x: Array,
    t: NDArray[np.uint32],
    s: Array,
    m: Array,
    regulator: NDArray[np.int32],
    gains: NDArray[np.int32],
    c: Calls,
    rng: np.random.Generator,
    rows: Array,
    logs: NDArray[np.int64],
    records: NDArray[np.int32],
) -> None:
    """So many sample periods."""
    for _ in range(count):
        sample(r, x, t, s, m, regulator, gains, c, rng, rows, logs, records)
