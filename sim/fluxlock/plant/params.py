# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the plant: frozen records with units in their names, checked when they are made.

Per-phase values are in the order A, B, C(, D, E). Converter channels are in the order of `channel_names`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from . import layout as L
from .edge_params import EdgeParams
from .magnetics import FluxMap
from .require import finite_at_least, require

Triple = tuple[float, float, float]
Phases = tuple[float, ...]
PHASE_COUNTS = (3, 5)


def channel_names(phases: int) -> tuple[str, ...]:
    """Converter channels of an inverter with so many legs."""
    letters = "abcde"[:phases]
    return (*(f"v{x}" for x in letters), *(f"i{x}" for x in letters), "vdc", "idc", "vsm")


CHANNEL_NAMES = channel_names(3)


def positive_definite(l_h: Phases, m_h: Triple) -> bool:
    """Whether the energy of any currents without a sum is positive: 2 x 2 matrix of (i_a, i_b), i_c = -i_a - i_b."""
    (la, lb, lc), (mab, mbc, mca) = l_h, m_h
    aa, bb, ab = la + lc - 2 * mca, lb + lc - 2 * mbc, mab + lc - mca - mbc
    return aa > 0.0 and aa * bb - ab * ab > 0.0


@dataclass(frozen=True)
class HallParams:
    """Three Hall sensors, A shows e_A > e_B, B e_B > e_C, C e_C > e_A.

    offset_deg: how late the edges of sensors A, B, C come, electrical. order: sensors at the inputs A, B, C. inverted:
    inputs that show the opposite.
    """

    offset_deg: Triple = (0.0, 0.0, 0.0)
    order: str = "ABC"
    inverted: str = ""

    def __post_init__(self) -> None:
        require(all(abs(d) <= 60.0 for d in self.offset_deg), "hall.offset_deg", self.offset_deg, "-60 to 60")
        require(sorted(self.order) == list("ABC"), "hall.order", self.order, "an order of ABC")
        require(set(self.inverted) <= set("ABC"), "hall.inverted", self.inverted, "letters of ABC")

    @property
    def rise_rad(self) -> Triple:
        """Electrical angle at which each input rises at positive speed; it falls half a turn later."""
        places = ["ABC".index(sensor) for sensor in self.order]
        a, b, c = (
            math.radians(120.0 * k - 210.0 + self.offset_deg[k] + 180.0 * (letter in self.inverted))
            for k, letter in zip(places, "ABC", strict=True)
        )
        return (a, b, c)


@dataclass(frozen=True)
class EncoderParams:
    """Incremental encoder; A leads B at positive speed, B leads A if inverted.

    lines: periods of A and B a mechanical turn. missing_lines: so many of them, before the index, change no track.
    offset_deg: mechanical angle of the rotor (0: electrical angle 0) at
    which the first track rises at positive speed and the index, if there is one, begins; it lasts a quarter of a line.
    """

    lines: int
    index: bool = True
    offset_deg: float = 0.0
    inverted: bool = False
    missing_lines: int = 0

    def __post_init__(self) -> None:
        require(1 <= self.lines <= 1 << 20, "lines", self.lines, f"1 to {1 << 20}")
        require(0 <= self.missing_lines < self.lines, "missing_lines", self.missing_lines, f"0 to {self.lines - 1}")
        require(abs(self.offset_deg) <= 360.0, "offset_deg", self.offset_deg, "-360 to 360")


@dataclass(frozen=True)
class ThirdParams:
    """What a five-phase machine is in the plane that turns three times as fast.

    mutual_h: inductance L_13 between the planes, d to d and q to q. psi_vs: magnet flux, its EMF is 3 psi_vs omega.
    """

    l_d_h: float
    l_q_h: float
    mutual_h: float = 0.0
    psi_vs: float = 0.0

    def __post_init__(self) -> None:
        for key in ("l_d_h", "l_q_h"):
            value = getattr(self, key)
            require(value > 0.0 and math.isfinite(value), key, value, "above 0")
        for key in ("mutual_h", "psi_vs"):
            require(math.isfinite(getattr(self, key)), key, getattr(self, key), "finite")


@dataclass(frozen=True)
class SaturationParams:
    """Saturation of the first plane.

    plus, minus: change of the incremental L_d, as a share of it, at i_d = +current_a and -current_a, i_q = 0; beyond it
    levels out. angle_rad: powers 0 .. 3 of i_q (rad, A) of the angle by which the axes of the incremental inductance at
    i_d = 0 turn, ½ atan(2 L_dq / (L_q - L_d)), up to |i_q| = angle_current_a; from there to twice this current L_dq
    levels out.
    """

    current_a: float
    plus: float = 0.0
    minus: float = 0.0
    angle_rad: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    angle_current_a: float = 1.0

    def __post_init__(self) -> None:
        for key in ("current_a", "angle_current_a"):
            value = getattr(self, key)
            require(value > 0.0 and math.isfinite(value), key, value, "above 0")
        for key in ("plus", "minus"):
            require(abs(getattr(self, key)) < 0.9, key, getattr(self, key), "between -0.9 and 0.9")
        require(len(self.angle_rad) == 4, "angle_rad", self.angle_rad, "4 values")
        currents = [self.angle_current_a * k / 100.0 for k in range(-100, 101)]
        largest = max(abs(self.angle_at(i)) for i in currents)
        require(largest <= 0.7, "angle_rad", self.angle_rad, "within ±0.7 rad up to angle_current_a")

    def angle_at(self, i_q_a: float) -> float:
        """Angle of the curve, rad."""
        c0, c1, c2, c3 = self.angle_rad
        return c0 + i_q_a * (c1 + i_q_a * (c2 + i_q_a * c3))

    def angle_slope_at(self, i_q_a: float) -> float:
        """Slope of the curve, rad/A."""
        _, c1, c2, c3 = self.angle_rad
        return c1 + i_q_a * (2.0 * c2 + i_q_a * 3.0 * c3)


@dataclass(frozen=True)
class MachineParams:
    """Star-connected machine of three or five phases with isolated star point.

    l_h: self inductances; m_h: mutual inductances of the pairs AB, BC, CA. l_q_h: a salient machine's inductance on the
    q axis; l_h is then that on the d axis, equal for all phases, m_h zero. None: not salient. psi_vs: peak phase EMF
    divided by electrical speed (for a trapezoid: height of the flat top). flat_top_deg: trapezoid only.
    hall, encoder: None: there is none. third: of a five-phase machine, and only of it; its l_h and psi_vs are those of
    the first plane.
    saturation: None: there is none. Both need a sinusoidal EMF and equal phases but for the resistance.
    """

    pole_pairs: int
    r_ohm: Phases
    l_h: Phases
    psi_vs: Phases
    m_h: Triple = (0.0, 0.0, 0.0)
    emf: Literal["sinusoidal", "trapezoidal"] = "sinusoidal"
    flat_top_deg: float = 120.0
    hall: HallParams | None = None
    l_q_h: float | None = None
    encoder: EncoderParams | None = None
    phases: int = 3
    third: ThirdParams | None = None
    saturation: SaturationParams | None = None

    def __post_init__(self) -> None:
        require(self.phases in PHASE_COUNTS, "phases", self.phases, "3 or 5")
        for key in ("r_ohm", "l_h", "psi_vs"):
            require(len(getattr(self, key)) == self.phases, key, getattr(self, key), f"{self.phases} values")
        require(self.pole_pairs >= 1, "pole_pairs", self.pole_pairs, "at least 1")
        require(finite_at_least(0.0, *self.r_ohm), "r_ohm", self.r_ohm, "at least 0")
        require(finite_at_least(0.0, *self.psi_vs), "psi_vs", self.psi_vs, "at least 0")
        require(self.emf in ("sinusoidal", "trapezoidal"), "emf", self.emf, "sinusoidal or trapezoidal")
        require(0.0 <= self.flat_top_deg <= 175.0, "flat_top_deg", self.flat_top_deg, "0 to 175")
        if self.l_q_h is not None:
            require(self.l_q_h > 0.0 and math.isfinite(self.l_q_h), "l_q_h", self.l_q_h, "above 0")
            require(len(set(self.l_h)) == 1, "l_h", self.l_h, "equal three times beside l_q_h")
            require(self.m_h == (0.0, 0.0, 0.0), "m_h", self.m_h, "zero beside l_q_h")
        require(
            (self.third is not None) == (self.phases == 5), "third", self.third, "given with 5 phases and only there"
        )
        if self.by_flux:
            self._check_by_flux()
            return
        definite = positive_definite(self.l_h, self.m_h)
        require(definite, "l_h, m_h", (self.l_h, self.m_h), "a positive definite inductance matrix")

    @property
    def by_flux(self) -> bool:
        """Whether the kernel takes the machine by its flux linkages (`flux.py`)."""
        return self.phases != 3 or self.saturation is not None

    def _check_by_flux(self) -> None:
        for key in ("l_h", "psi_vs"):
            require(len(set(getattr(self, key))) == 1, key, getattr(self, key), "equal for all phases")
        require(self.l_h[0] > 0.0, "l_h", self.l_h, "above 0")
        require(self.m_h == (0.0, 0.0, 0.0), "m_h", self.m_h, "zero with 5 phases or saturation")
        require(self.emf == "sinusoidal", "emf", self.emf, "sinusoidal with 5 phases or saturation")
        require(self.phases == 3 or self.hall is None, "hall", self.hall, "None with 5")
        least = FluxMap(self).least_inductance_h()
        keys = "saturation" if self.third is None else "l_h, l_q_h, third" + (", saturation" if self.saturation else "")
        require(least > 0.0, keys, f"least incremental inductance {least:.3g} H", "positive definite at any current")


@dataclass(frozen=True)
class InverterParams:
    """Two switches with diodes a leg, supply and DC link.

    Without capacitor (dc_link_c_f = 0) the supply and its resistance feed the legs directly and take energy
    back. The chopper turns on at chopper_on_v and off at chopper_off_v, with chopper_driven by `Plant.set_brake` or the
    chip's brake pin instead; chopper_ohm = 0: there is none.
    """

    supply_v: float
    r_on_ohm: float = 0.0
    diode_drop_v: float = 0.7
    diode_r_ohm: float = 0.0
    supply_r_ohm: float = 0.0
    dc_link_c_f: float = 0.0
    supply_diode: bool = False
    chopper_ohm: float = 0.0
    chopper_on_v: float = 0.0
    chopper_off_v: float = 0.0
    chopper_driven: bool = False

    def __post_init__(self) -> None:
        require(finite_at_least(0.0, self.supply_v), "supply_v", self.supply_v, "at least 0")
        for key in ("r_on_ohm", "diode_drop_v", "diode_r_ohm", "supply_r_ohm", "dc_link_c_f", "chopper_ohm"):
            require(finite_at_least(0.0, getattr(self, key)), key, getattr(self, key), "at least 0")
        capacitor = self.dc_link_c_f > 0.0
        require(
            not capacitor or self.supply_r_ohm > 0.0,
            "supply_r_ohm",
            self.supply_r_ohm,
            "above 0 with a DC-link capacitor",
        )
        require(capacitor or not self.supply_diode, "dc_link_c_f", self.dc_link_c_f, "above 0 with a supply diode")
        require(
            capacitor or self.chopper_ohm == 0.0,
            "dc_link_c_f",
            self.dc_link_c_f,
            "above 0 with a brake chopper",
        )
        if self.chopper_ohm > 0.0 and not self.chopper_driven:
            ordered = 0.0 < self.chopper_off_v < self.chopper_on_v
            require(ordered, "chopper_off_v", self.chopper_off_v, "above 0 and below chopper_on_v")


@dataclass(frozen=True)
class SensingParams:
    """Converter and dividers. Noise is white, per sample. conversion_s is information for the simulator.

    divider_gain: one value a leg, empty: all 1. offset_lsb: one a channel, empty: all 0. edge: None: terminals jump and
    the channels show nothing else of it. sources: signal at the input of a channel, by their names, and its factor; a
    channel that is not there has its own.
    """

    v_full_scale_v: float
    i_full_scale_a: float
    bits: int = 12
    divider_gain: Phases = ()
    offset_lsb: tuple[float, ...] = ()
    divider_pole_s: float = 0.0
    noise_lsb_rms: float = 1.0
    conversion_s: float = 0.0
    sources: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    edge: EdgeParams | None = None

    def __post_init__(self) -> None:
        require(self.v_full_scale_v > 0.0, "v_full_scale_v", self.v_full_scale_v, "above 0")
        require(self.i_full_scale_a > 0.0, "i_full_scale_a", self.i_full_scale_a, "above 0")
        require(4 <= self.bits <= 24, "bits", self.bits, "4 to 24")
        for key in ("divider_pole_s", "noise_lsb_rms", "conversion_s"):
            require(finite_at_least(0.0, getattr(self, key)), key, getattr(self, key), "at least 0")


@dataclass(frozen=True)
class MechanicsParams:
    """Rotor and load; speeds are mechanical.

    constant_nm acts against positive rotation at any speed; coulomb_nm opposes motion, holds at standstill up
    to stiction_ratio times its value and never drives. profile: corners (t_s, omega_m) of an imposed speed.
    """

    inertia_kgm2: float
    mode: Literal["free", "imposed", "locked"] = "free"
    fan_nm_s2_per_rad2: float = 0.0
    constant_nm: float = 0.0
    viscous_nm_s_per_rad: float = 0.0
    coulomb_nm: float = 0.0
    stiction_ratio: float = 1.0
    theta_e_rad: float = 0.0
    omega_m_rad_s: float = 0.0
    profile: tuple[tuple[float, float], ...] = ()
    step_max_s: float = 1e-6

    def __post_init__(self) -> None:
        require(self.inertia_kgm2 > 0.0, "inertia_kgm2", self.inertia_kgm2, "above 0")
        require(self.mode in MECHANICS_MODES, "mode", self.mode, " or ".join(MECHANICS_MODES))
        for key in ("fan_nm_s2_per_rad2", "viscous_nm_s_per_rad", "coulomb_nm"):
            require(finite_at_least(0.0, getattr(self, key)), key, getattr(self, key), "at least 0")
        require(self.stiction_ratio >= 1.0, "stiction_ratio", self.stiction_ratio, "at least 1")
        require(self.step_max_s > 0.0, "step_max_s", self.step_max_s, "above 0")
        check_profile(self.profile)


@dataclass(frozen=True)
class RecordingParams:
    """What the plant records of itself. zoom: windows (first, last cycle) with a row for every event."""

    every_strobes: int = 10
    zoom: tuple[tuple[int, int], ...] = ()
    energies: bool = False
    wave_rows: int = 1 << 15
    zoom_rows: int = 1 << 15
    event_rows: int = 1 << 14

    def __post_init__(self) -> None:
        require(self.every_strobes >= 0, "every_strobes", self.every_strobes, "at least 0 (0: no records)")
        require(len(self.zoom) <= L.ZOOM_MAX, "zoom", self.zoom, f"at most {L.ZOOM_MAX} windows")
        for key in ("wave_rows", "zoom_rows", "event_rows"):
            require(getattr(self, key) >= 1, key, getattr(self, key), "at least 1")


@dataclass(frozen=True)
class PlantParams:
    """The whole plant."""

    machine: MachineParams
    inverter: InverterParams
    sensing: SensingParams
    mechanics: MechanicsParams
    recording: RecordingParams = field(default_factory=RecordingParams)
    clock_period_s: float = 20e-9

    def __post_init__(self) -> None:
        require(self.clock_period_s > 0.0, "clock_period_s", self.clock_period_s, "above 0")
        phases, sensing = self.machine.phases, self.sensing
        for key, count in (("divider_gain", phases), ("offset_lsb", len(channel_names(phases)))):
            values = getattr(sensing, key)
            require(len(values) in (0, count), key, values, f"{count} values, or none")
        names = channel_names(phases)
        for channel, (source, _) in sensing.sources.items():
            require(channel in names and source in names, "sources", (channel, source), "names of channels")


MECHANICS_MODES = {"free": L.FREE, "imposed": L.IMPOSED, "locked": L.LOCKED}


def check_profile(profile: tuple[tuple[float, float], ...]) -> None:
    """Raise unless a speed profile fits and its times do not decrease."""
    require(
        len(profile) <= L.PROFILE_MAX,
        "profile",
        f"{len(profile)} corners",
        f"at most {L.PROFILE_MAX} corners",
    )
    times = [t for t, _ in profile]
    require(times == sorted(times), "profile", profile, "in order of time")
