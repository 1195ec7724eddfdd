# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Makes the initial state vector from parameters."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import numpy.typing as npt

from . import layout as L
from .build import Variant, interpreted
from .circuit import connect, terminals_now
from .edge_params import EdgeParams
from .emf import TWO_PI, inductance_now, shape_now
from .magnetics import FluxMap
from .params import MECHANICS_MODES, MachineParams, Phases, PlantParams, SensingParams, channel_names
from .vector import view_of

FloatArray = npt.NDArray[np.float64]


def variant_of(machine: MachineParams) -> Variant:
    """Kernel that a machine needs."""
    return Variant(machine.phases, machine.by_flux)


def write_flux_map(s: FloatArray, machine: MachineParams, turns: Phases) -> None:
    """Write the parameters of a machine that is taken by its flux linkages."""
    m, flux = machine, FluxMap(machine)
    for x in range(m.phases):
        s[L.R + x] = m.r_ohm[x] * turns[x]
        s[L.WINDING + x] = turns[x]
        for plane in range(m.phases // 2):
            angle = (1 + 2 * plane) * TWO_PI * x / m.phases
            s[L.PHASOR + 2 * plane * L.LEGS + x] = turns[x] * math.cos(angle)
            s[L.PHASOR + (2 * plane + 1) * L.LEGS + x] = turns[x] * math.sin(angle)
    s[L.L_AXES : L.L_AXES + 5] = (flux.l_d, flux.l_q, flux.l_d3, flux.l_q3, flux.l_13)
    s[L.L_ZERO] = flux.l_zero
    s[L.PSI_1] = flux.psi_1
    s[L.PSI_3] = flux.psi_3
    s[L.SATURATED] = m.saturation is not None
    if m.saturation:
        s[L.SAT_A], s[L.SAT_B], s[L.SAT_I] = flux.sat_a, flux.sat_b, flux.sat_i
        s[L.CROSS_WIDTH] = flux.edges[2] - flux.edges[1]
        s[L.CROSS_EDGE : L.CROSS_EDGE + L.CROSS_PIECES] = flux.edges
        s[L.CROSS : L.CROSS + 5 * L.CROSS_PIECES] = flux.cross.ravel()
    interpreted(variant_of(m))[shape_now](view_of(s))


def write_machine(s: FloatArray, machine: MachineParams, turns: Phases = ()) -> None:
    """Write machine parameters; `turns` are the fractions of each winding's turns that still act, empty: all."""
    turns = turns or (1.0,) * machine.phases
    s[L.POLE_PAIRS] = machine.pole_pairs
    s[L.TRAPEZOID] = machine.emf == "trapezoidal"
    s[L.HALL] = machine.hall is not None
    if machine.hall is not None:
        s[L.HALL_RISE : L.HALL_RISE + 3] = machine.hall.rise_rad
    if machine.encoder is not None:
        s[L.ENCODER_LINES] = machine.encoder.lines
        s[L.ENCODER_INDEX] = machine.encoder.index
        s[L.ENCODER_INVERTED] = machine.encoder.inverted
        s[L.ENCODER_OFFSET] = machine.encoder.offset_deg / 360.0
        s[L.ENCODER_MISSING] = machine.encoder.missing_lines
    if machine.by_flux:
        write_flux_map(s, machine, turns)
        return
    s[L.RAMP] = math.radians((180.0 - machine.flat_top_deg) / 2.0)
    mutual = {(0, 1): machine.m_h[0], (1, 2): machine.m_h[1], (0, 2): machine.m_h[2]}
    for x in range(3):
        s[L.R + x] = machine.r_ohm[x] * turns[x]
        s[L.PSI + x] = machine.psi_vs[x] * turns[x]
        for y in range(3):
            henry = machine.l_h[x] if x == y else mutual[min(x, y), max(x, y)]
            s[L.LM + 3 * x + y] = henry * turns[x] * turns[y]
    s[L.SALIENT] = machine.l_q_h is not None
    if machine.l_q_h is not None:
        l_d, l_q = machine.l_h[0], machine.l_q_h
        s[L.L_MEAN] = 0.5 * (l_d + l_q)
        s[L.L_SWING] = (l_d - l_q) / 3.0
        s[L.WINDING : L.WINDING + 3] = turns
        inductance_now(view_of(s))
    s[L.G_MASK] = -1


def write_edges(s: FloatArray, edge: EdgeParams) -> None:
    """Write the edge terms."""
    s[L.EDGE] = 1.0
    s[L.EDGE_OWN], s[L.EDGE_COUPLING] = edge.own, edge.coupling
    s[L.EDGE_STEP], s[L.EDGE_STEP_S] = edge.step_v / edge.reference_v, edge.step_tau_s
    s[L.EDGE_RING], s[L.EDGE_RING_S] = edge.ring_v / edge.reference_v, edge.ring_tau_s
    s[L.EDGE_RING_W] = TWO_PI * edge.ring_hz
    s[L.EDGE_LOBE], s[L.EDGE_LOBE_S] = edge.lobe_v / edge.reference_v, edge.lobe_s
    s[L.EDGE_SLEW_S] = edge.slew_s
    s[L.EDGE_AMPERE], s[L.EDGE_AMPERE_S] = edge.current_step_a / edge.reference_v, edge.current_tau_s


def write_sensing(s: FloatArray, sensing: SensingParams, phases: int, seed: int) -> None:
    """Write converter parameters and the noise keys of a seed."""
    channels = 2 * phases + 3
    codes = 1 << sensing.bits
    s[L.POLE_S] = sensing.divider_pole_s
    s[L.ADC_MAX] = codes - 1
    s[L.NOISE_LSB] = sensing.noise_lsb_rms
    s[L.DECAY_H] = -1.0
    if sensing.edge is not None:
        write_edges(s, sensing.edge)
    gains = (*(sensing.divider_gain or (1.0,) * phases), *(1.0,) * (phases + 3))
    offsets = sensing.offset_lsb or (0.0,) * channels
    names = channel_names(phases)
    for channel in range(channels):
        source, factor = sensing.sources.get(names[channel], (names[channel], 1.0))
        bipolar = phases <= channel < 2 * phases or channel == 2 * phases + 1
        span = 2.0 * sensing.i_full_scale_a if bipolar else sensing.v_full_scale_v
        s[L.SOURCE + channel] = names.index(source)
        s[L.CODES_PER_UNIT + channel] = factor * gains[channel] * codes / span
        s[L.CODE_ZERO + channel] = (codes // 2 if bipolar else 0) + offsets[channel]
        s[L.STUCK + channel] = -1.0
    for key in range(1 + channels):
        digest = hashlib.sha256(f"{seed}:{key}".encode()).digest()
        s[L.NOISE_KEY + key] = int.from_bytes(digest[:4], "little")


def write_profile(s: FloatArray, profile: tuple[tuple[float, float], ...]) -> None:
    """Write the corners (s, mechanical rad/s) of an imposed speed."""
    s[L.PROFILE_N] = len(profile)
    s[L.PROFILE_AT] = 0
    for k, (t_s, omega_m) in enumerate(profile):
        s[L.PROFILE_T + k] = t_s
        s[L.PROFILE_W + k] = omega_m * s[L.POLE_PAIRS]


def initial_state(params: PlantParams, seed: int) -> FloatArray:
    """State at cycle 0: all gates off, no current, link charged, dividers settled."""
    recording = params.recording
    phases = params.machine.phases
    columns = L.WAVE_COLUMNS + 2 * phases
    rows = columns * (recording.wave_rows + recording.zoom_rows)
    s: FloatArray = np.zeros(L.BUFFERS + rows + L.EVENT_COLUMNS * recording.event_rows)
    s[L.CLOCK_S] = params.clock_period_s
    write_machine(s, params.machine)

    inverter = params.inverter
    s[L.R_ON] = inverter.r_on_ohm
    s[L.DIODE_V] = inverter.diode_drop_v
    s[L.DIODE_R] = inverter.diode_r_ohm
    s[L.SUPPLY_R] = inverter.supply_r_ohm
    if inverter.dc_link_c_f > 0.0:
        s[L.SUPPLY_G] = 1.0 / inverter.supply_r_ohm
        s[L.LINK_C_INV] = 1.0 / inverter.dc_link_c_f
    s[L.SUPPLY_DIODE] = inverter.supply_diode
    s[L.CHOPPER_ON_V] = inverter.chopper_on_v
    s[L.CHOPPER_OFF_V] = inverter.chopper_off_v
    s[L.CHOPPER_DRIVEN] = inverter.chopper_driven
    s[L.CHOPPER_G] = 1.0 / inverter.chopper_ohm if inverter.chopper_ohm > 0.0 else 0.0

    mechanics = params.mechanics
    s[L.MECHANICS] = MECHANICS_MODES[mechanics.mode]
    s[L.INERTIA] = mechanics.inertia_kgm2
    s[L.STICTION_RATIO] = mechanics.stiction_ratio
    s[L.STEP_MAX_S] = mechanics.step_max_s
    s[L.VALUE + L.FAN] = mechanics.fan_nm_s2_per_rad2
    s[L.VALUE + L.CONSTANT] = mechanics.constant_nm
    s[L.VALUE + L.VISCOUS] = mechanics.viscous_nm_s_per_rad
    s[L.VALUE + L.COULOMB] = mechanics.coulomb_nm
    s[L.VALUE + L.SUPPLY] = inverter.supply_v
    write_profile(s, mechanics.profile)
    s[L.OMEGA] = mechanics.omega_m_rad_s * params.machine.pole_pairs
    if mechanics.mode == "locked":
        s[L.OMEGA] = 0.0
    elif mechanics.mode == "imposed" and mechanics.profile:
        times, speeds = np.array(mechanics.profile).T
        s[L.OMEGA] = np.interp(0.0, times, speeds) * params.machine.pole_pairs
    s[L.TURNS] = math.floor(mechanics.theta_e_rad / TWO_PI)
    s[L.THETA] = mechanics.theta_e_rad - TWO_PI * s[L.TURNS]

    write_sensing(s, params.sensing, phases, seed)
    s[L.WAVE_EVERY] = recording.every_strobes
    s[L.ENERGY_ON] = recording.energies
    write_zoom(s, recording.zoom)
    s[L.WAVE_AT] = L.BUFFERS
    s[L.WAVE_ROWS] = recording.wave_rows
    s[L.ZOOM_AT] = L.BUFFERS + columns * recording.wave_rows
    s[L.ZOOM_ROWS] = recording.zoom_rows
    s[L.EVENT_AT] = L.BUFFERS + rows
    s[L.EVENT_ROWS] = recording.event_rows

    s[L.VDC] = inverter.supply_v
    s[L.SOURCE_ON] = 1.0
    s[L.H_LIMIT] = 1e-3
    view = view_of(s)
    kernel = interpreted(variant_of(params.machine))
    kernel[shape_now](view)
    kernel[connect](view, 0)
    kernel[terminals_now](view)
    s[L.FILTERED : L.FILTERED + phases] = s[L.VT : L.VT + phases]
    s[L.FILTERED + phases] = s[L.VDC]
    # The first event finds and logs again what conducts from the start.
    s[L.MODE : L.MODE + phases] = L.OPEN
    s[L.G_MASK] = -1.0
    s[L.EVENT_COUNT] = 0.0
    return s


def write_zoom(s: FloatArray, windows: tuple[tuple[int, int], ...]) -> None:
    """Write the zoom windows (first and last cycle)."""
    s[L.ZOOM_N] = len(windows)
    for k, (first, last) in enumerate(windows):
        s[L.ZOOM_T0 + k] = first
        s[L.ZOOM_T1 + k] = last
