# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Layout of the plant's state vector `s[]` (float64) and of `io[]` (int32): the one place that numbers them.

Everything the kernel knows is in `s`: parameters, physical state, scratch of the current sub-interval, and
the record buffers at its end. Writing an entry between two kernel calls is how a parameter or a fault changes
at run time. SI units; angles in electrical rad; time in clock cycles where the name says so.
"""

from __future__ import annotations

LEGS = 5  # room for the phases of a machine
CHANNELS = 2 * LEGS + 3  # room for va.. ia.. vdc idc vsm
ORDER = 16  # highest power of a Taylor series
CONVERGED = 1e-17  # share of a series below which its terms count no more
LEAST_A = 1e-9  # currents below it are none: at rest rounding of two equal voltages is all that drives one
NK = ORDER + 2  # room of one series

_size = 0


def _take(count: int = 1) -> int:
    """Reserve `count` entries and return the index of the first."""
    global _size
    first = _size
    _size += count
    return first


# --- time and gates
CLOCK_S = _take()  # clock period
T_CYCLE = _take()  # time of the last event
T_BASE = _take()  # cycle at which the running sub-interval began (fractional)
GATES = _take()

# --- machine
POLE_PAIRS = _take()
R = _take(LEGS)
LM = _take(LEGS * LEGS)  # inductance matrix, rows of `phases`; if it varies, the incremental one at THETA and I
SALIENT = _take()  # 1: LM turns with the rotor; the entries below up to L_SLOPE serve such machines only
L_MEAN = _take()  # (L_d + L_q) / 2
L_SWING = _take()  # (L_d - L_q) / 3
WINDING = _take(LEGS)  # share of each winding's turns that still act
L_WAVE = _take(9)  # LM without its mean: second harmonic of THETA
L_SLOPE = _take(9)  # d LM / d THETA
PSI = _take(LEGS)  # amplitude of the phase EMF / electrical speed
TRAPEZOID = _take()  # 1: trapezoidal EMF
RAMP = _take()  # half width of the trapezoid's slope, rad

# --- machine by its flux linkages (`flux.py`)
PHASOR = _take(4 * LEGS)  # cos, sin of the winding axes in plane 1, then in plane 3, times WINDING
L_AXES = _take(5)  # L_d, L_q, then of plane 3 L_d3, L_q3 and between the planes L_13
L_ZERO = _take()  # of the zero sequence, which only a machine with shorted turns shows
PSI_1 = _take()  # magnet flux in plane 1
PSI_3 = _take()
SATURATED = _take()  # 1: the entries below up to CROSS hold
SAT_A = _take()  # L_d falls by L_d (SAT_A v + SAT_B v^2), v = tanh(i_d / SAT_I)
SAT_B = _take()
SAT_I = _take()  # A
CROSS_WIDTH = _take()  # A, of a piece of the curve L_dq(i_q)
CROSS_PIECES = 66  # the first and the last reach to infinity
CROSS_EDGE = _take(CROSS_PIECES)  # where a piece begins, A; of the first: where it ends
CROSS = _take(5 * CROSS_PIECES)  # integral of L_dq from 0 to the edge, then L_dq in powers 0 .. 3 of i_q less the edge

# --- inverter and link
R_ON = _take()
DIODE_V = _take()
DIODE_R = _take()
SUPPLY_R = _take()
SUPPLY_G = _take()  # 1 / SUPPLY_R, 0 without capacitor
LINK_C_INV = _take()  # 1 / C, 0 = no capacitor: vdc = supply - SUPPLY_R * idc
SUPPLY_DIODE = _take()
CHOPPER_ON_V = _take()
CHOPPER_OFF_V = _take()
CHOPPER_G = _take()  # 1 / resistance, 0 = none
CHOPPER_DRIVEN = _take()  # 1: by the flag BRAKE of the calls, not by its thresholds

LEG_FAULT = _take(LEGS)  # WHOLE .. STUCK_LOW

# --- mechanics
MECHANICS = _take()  # FREE, IMPOSED, LOCKED
INERTIA = _take()
STICTION_RATIO = _take()  # breakaway / sliding friction
OUTER_NM = _take()  # load torque that whoever leads the run sets
STEP_MAX_S = _take()  # longest step of the electro-mechanical splitting
PROFILE_N = _take()
PROFILE_AT = _take()  # index of the segment in force
PROFILE_T = _take(64)  # s
PROFILE_W = _take(64)  # electrical rad/s
PROFILE_MAX = 64

# --- quantities that ramp: value and ramp (V0 at T0 to V1 at T1, seconds) of each
RAMPS = 5
FAN, CONSTANT, VISCOUS, COULOMB, SUPPLY = range(RAMPS)
VALUE = _take(RAMPS)
RAMP_V0 = _take(RAMPS)
RAMP_V1 = _take(RAMPS)
RAMP_T0 = _take(RAMPS)
RAMP_T1 = _take(RAMPS)
RAMP_BUSY = _take(RAMPS)  # 1 while the ramp is not over

# --- sensing
POLE_S = _take()
ADC_MAX = _take()  # highest code
SOURCE = _take(CHANNELS)  # channel whose signal is at a channel's input
CODES_PER_UNIT = _take(CHANNELS)  # codes per V or A, divider gain and sign included
CODE_ZERO = _take(CHANNELS)  # code of 0, offset included
NOISE_LSB = _take()
NOISE_KEY = _take(1 + CHANNELS)  # 32-bit keys from the seed: one for the sample number, one a channel
STUCK = _take(CHANNELS)  # code of a stuck channel, -1 = works
FAULT_PIN = _take()

# --- edge terms (`edge.py`): amplitudes at a jump of 1 V
EDGE = _take()  # 1: there are any; the entries below up to EDGE_DC serve only then
EDGE_OWN = _take()
EDGE_COUPLING = _take()
EDGE_STEP = _take()
EDGE_STEP_S = _take()
EDGE_RING = _take()
EDGE_RING_W = _take()  # rad/s
EDGE_RING_S = _take()
EDGE_LOBE = _take()
EDGE_LOBE_S = _take()
EDGE_SLEW_S = _take()
EDGE_AMPERE = _take()
EDGE_AMPERE_S = _take()
EDGE_AT = _take()  # cycle for which the entries below hold
EDGE_STEPS = _take(LEGS)  # V, decaying steps of the channels
EDGE_COS = _take(LEGS)  # V, rings: real and imaginary part of the phasor
EDGE_SIN = _take(LEGS)
EDGE_FEED = _take(LEGS)  # V, lobes: what still flows in, and the lobe
EDGE_LOBES = _take(LEGS)
EDGE_RAMP = _take(LEGS)  # V, slewing terminal less its new voltage
EDGE_LEFT = _take(LEGS)  # s until it is there
EDGE_OUT = _take(LEGS)  # V, all of them behind the pole
EDGE_CURRENT = _take(LEGS)  # A, errors of the current channels
EDGE_DC = _take()  # A, error of idc
EDGE_VT = _take(LEGS)  # scratch: terminals before an edge
EDGE_MODE = _take(LEGS)  # scratch: MODE before an edge

HALL = _take()  # 1: there are Hall sensors
HALL_RISE = _take(3)  # electrical angle at which each input rises, rad
ENCODER_LINES = _take()  # a mechanical turn; 0 = none
ENCODER_INDEX = _take()  # 1: there is an index
ENCODER_INVERTED = _take()  # 1: B leads A at positive speed
ENCODER_OFFSET = _take()  # mounting angle, mechanical turns
ENCODER_MISSING = _take()  # lines before the index at which no track changes

# --- recording
WAVE_EVERY = _take()  # record each n-th strobe; 0 = none
WAVE_PHASE = _take()
ZOOM_N = _take()
ZOOM_T0 = _take(16)  # cycles
ZOOM_T1 = _take(16)
ZOOM_MAX = 16
ENERGY_ON = _take()

# --- physical state
I = _take(LEGS)  # noqa: E741
VDC = _take()
OMEGA = _take()  # electrical
THETA = _take()  # 0 .. 2 pi
TURNS = _take()  # whole electrical turns
TORQUE = _take()
SOURCE_ON = _take()  # supply conducts
CHOPPER_ON = _take()
FILTERED = _take(LEGS + 1)  # divider outputs: phases, vdc
SAMPLE = _take()  # number of the next sample

# --- derived, valid at T_CYCLE
VT = _take(LEGS)  # terminal voltages against the negative rail; set by `terminals_now` only
IDC = _take()
SHAPE = _take(3)  # EMF of phase x = -PSI * omega * SHAPE
SLOPE = _take(3)  # d SHAPE / d theta
ROTOR_I = _take(4)  # id iq id3 iq3
FLUX = _take(4)  # their flux linkages
L_NOW = _take(3)  # incremental L_d, L_dq, L_q
FLUX_SLOPE = _take(LEGS)  # d (flux linkage of a phase) / d theta at constant currents
PIECE = _take()  # of CROSS, in force

# --- scratch of a sub-interval
MODE = _take(LEGS)  # OPEN .. DIODE_HIGH
RAIL = _take(LEGS)  # 1: leg tied to the positive rail
V_LEG = _take(LEGS)  # constant part of the leg voltage
R_LEG = _take(LEGS)
CONDUCTING = _take()  # number of conducting legs
FLOATING = _take()  # index of an open leg to check, -1 = none
REFERENCE = _take()  # a conducting leg, -1 = none
STAR_CLAMP = _take()  # phase whose diode clamps the star point when no leg conducts, -1 = none
G_MASK = _take()  # conducting legs for which G holds; -1 = stale
G = _take(6)  # d i / d t = G (v - R i - e), order aa ab ac bb bc cc
G_FULL = _take(LEGS * LEGS)  # the same of a machine by its flux linkages, rows of `phases`
U = _take(LEGS)  # v - R i - e of the conducting legs
LIST = _take(LEGS)  # numbers of the conducting legs
PIVOT = _take(LEGS * LEGS)  # work space of the elimination
H_LIMIT = _take()  # adapts: longest series step that converges
SERIES_I = _take(LEGS * NK)
SERIES_V = _take(LEGS * NK)
SERIES_E = _take(LEGS * NK)
SERIES_D = _take(NK)
SERIES_L = _take(NK)  # factor of the power of the turning inductance, over the step
ROTATION = _take(LEGS)  # term of the voltage that the turning machine induces
SERIES_TURN = _take(4 * NK)  # cos, sin of the angle, then of three times the angle
SERIES_STATOR = _take(4 * NK)  # currents in the axes of the stator, planes 1 and 3
SERIES_ROTOR = _take(4 * NK)  # ROTOR_I
SERIES_FLUX = _take(4 * NK)  # FLUX
SERIES_TANH = _take(NK)  # v = tanh(i_d / SAT_I)
SERIES_TANH2 = _take(NK)  # its square
SERIES_LOGCOSH = _take(NK)  # ln cosh(i_d / SAT_I)
SERIES_Y = _take(4 * NK)  # powers 1 .. 4 of i_q less the edge of the piece
SERIES_CROSS = _take(2 * NK)  # L_dq and its integral over i_q
ROOT = _take(NK)
EVENT_LEG = _take()
DECAY_H = _take()  # step for which DECAY holds
DECAY = _take()

# --- energies since the start, J (only while ENERGY_ON)
ENERGIES = 8
E_SUPPLY, E_SOURCE_R, E_COPPER, E_SWITCH, E_DIODE, E_CHOPPER, E_SHAFT, E_LOAD = range(ENERGIES)
ENERGY = _take(ENERGIES)

# --- record buffers: position, count and capacity of each
WAVE_AT, WAVE_COUNT, WAVE_ROWS = _take(), _take(), _take()
ZOOM_AT, ZOOM_COUNT, ZOOM_ROWS = _take(), _take(), _take()
EVENT_AT, EVENT_COUNT, EVENT_ROWS = _take(), _take(), _take()
BUFFERS = _size  # the buffers begin here

# --- columns of a waveform row and of an event row
WAVE_COLUMNS = 7  # t_cycle theta_e omega_e, then i and v of the phases, vdc idc torque_nm gates
EVENT_COLUMNS = 4  # t_cycle kind phase theta_e

# --- constants
OPEN, HIGH, LOW, DIODE_LOW, DIODE_HIGH = range(5)
FREE, IMPOSED, LOCKED = range(3)
EXTINCTION, DIODE_ON = 1, 2
WHOLE, BROKEN, STUCK_HIGH, STUCK_LOW = range(4)
STROBE = 1  # flag bit
BRAKE = 4  # flag bit: switch of a driven chopper
TOLERANCE_V = 1e-9  # a diode turns on this far beyond its threshold

# --- io
IO_SIZE = 32
IO_HEARTBEAT = 16
IO_PINS = 17
IO_ENCODER = 18  # A, B, Z in bits 0, 1, 2
IO_ENCODER_WAIT = 19  # clocks within which the next call must come, so that no edge is late; 0 = no encoder

# --- fault codes
OK = 0
FAULT_SHOOT_THROUGH = 1
FAULT_NOT_FINITE = 2
FAULT_TIME = 3
FAULT_RECORDS_FULL = 4
FAULT_TOPOLOGY = 5
FAULT_EVENTS = 6
FAULT_EXCEPTION = 7
FAULT_TEXT = {
    OK: "no fault",
    FAULT_SHOOT_THROUGH: "both switches of a leg are on (shoot-through)",
    FAULT_NOT_FINITE: "a current, the link voltage or the speed is not finite",
    FAULT_TIME: "time ran backwards",
    FAULT_RECORDS_FULL: "a record buffer is full: drain it more often or enlarge it",
    FAULT_TOPOLOGY: "no consistent state of the diodes found",
    FAULT_EVENTS: "too many diode or chopper events in one step",
    FAULT_EXCEPTION: "exception in the kernel",
}
