# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Motor file: the machine and the load that usually belongs to it."""

from __future__ import annotations

import math
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from fluxlock.config.fields import Model, PhaseOrder, PhaseValues, Powers, check_once, conflict, quantity
from fluxlock.config.stated import DataSheet
from fluxlock.plant.params import (
    EncoderParams,
    HallParams,
    MachineParams,
    SaturationParams,
    ThirdParams,
    positive_definite,
)

RPM_PER_RAD_S = 60.0 / (2.0 * math.pi)
ENCODER_EDGES_PER_S = 8e6  # six clocks of 50 MHz an edge, five at the over-speed limit
OVERSPEED_RATIO = 1.25  # over-speed limit over the motor's highest speed
# Six commutations a turn, each of which takes L I, act as a resistance of this times omega L: the least, and what the
# switched model has at full duty and little current (tests/config/test_cautions.py).
COMMUTATION_LEAST, COMMUTATION_USUAL = 3.0 / math.pi, 1.26
OVERLOAD_S = 2.0  # in which a machine bears twice its rated current where its file does not say


def line_mean(emf: str, flat_top_deg: float) -> float:
    """Mean line EMF over a sector, over the peak of the phase EMF."""
    if emf == "sinusoidal":
        return 3 * math.sqrt(3) / math.pi
    # Both EMFs sit on their flat tops through the sector if those are at least 120 degrees long; shorter
    # ones lose a triangle at each end: 2 psi (1 - mean relative drop).
    short_deg = max(0.0, 120.0 - flat_top_deg) / 2
    ramp_deg = (180.0 - flat_top_deg) / 2
    return 2 * (1 - short_deg * short_deg / (2 * ramp_deg * 60.0))


def fundamental(emf: str, flat_top_deg: float) -> float:
    """Fundamental of the phase EMF over its peak."""
    if emf == "sinusoidal":
        return 1.0
    ramp = math.radians(180.0 - flat_top_deg) / 2
    return 4 * math.sin(ramp) / (math.pi * ramp)


def listed(values: tuple[float, ...]) -> str:
    """Values per phase as a file states them: one number if they are equal."""
    return f"{values[0]:g}" if len(set(values)) == 1 else f"[{', '.join(f'{value:g}' for value in values)}]"


class Load(Model):
    """Load torque on the shaft. Parts add up; `load_factor` events scale all of them."""

    fan_torque_nm: float = quantity(
        "Fan torque at `fan_speed_rpm`, proportional to speed squared.", "N*m", 0, 1e4, default=0.0
    )
    fan_speed_rpm: float | None = quantity(
        "Speed at which the fan torque is stated.",
        "r/min",
        1,
        2e6,
        default=None,
        absent="needed with `fan_torque_nm`",
    )
    constant_nm: float = quantity(
        "Torque that always acts against positive rotation, also at standstill.",
        "N*m",
        -1e4,
        1e4,
        default=0.0,
    )
    viscous_nm_s_per_rad: float = quantity("Torque proportional to mechanical speed.", "N*m*s/rad", 0, 1e3, default=0.0)
    coulomb_nm: float = quantity(
        "Brake torque that opposes rotation and holds at standstill; it never drives.",
        "N*m",
        0,
        1e4,
        default=0.0,
    )
    stiction_ratio: float = quantity("Breakaway torque at standstill over `coulomb_nm`.", "", 1.0, 10.0, default=1.0)

    @model_validator(mode="after")
    def _fan_speed(self) -> Self:
        if self.fan_torque_nm > 0 and self.fan_speed_rpm is None:
            raise conflict("fan_torque_nm", "needs fan_speed_rpm beside it")
        return self

    @property
    def fan_nm_s2_per_rad2(self) -> float:
        """Fan torque over mechanical speed squared."""
        if self.fan_speed_rpm is None:
            return 0.0
        return self.fan_torque_nm / (self.fan_speed_rpm / RPM_PER_RAD_S) ** 2

    def torque_nm(self, speed_rpm: float) -> float:
        """Magnitude of the load torque at a steady speed."""
        omega = abs(speed_rpm) / RPM_PER_RAD_S
        return (
            self.fan_nm_s2_per_rad2 * omega * omega
            + self.constant_nm * (1.0 if speed_rpm >= 0 else -1.0)
            + self.viscous_nm_s_per_rad * omega
            + self.coulomb_nm
        )


class Hall(Model):
    """Hall sensors. Sensor A shows e_A > e_B, B e_B > e_C, C e_C > e_A: edges at the commutation angles."""

    offset_deg: PhaseValues = quantity(
        "Misplacement: how late the edges of a sensor come at positive speed, electrical. One number, or three "
        "for sensors A, B, C.",
        "deg",
        -60,
        60,
        default=(0.0, 0.0, 0.0),
    )
    order: PhaseOrder = Field(
        default="ABC",
        description='Sensors at the inputs A, B, C of the chip. The drive takes them for `"ABC"`: another order is a '
        "wrong wiring, which it finds.",
    )
    inverted: list[Literal["A", "B", "C"]] = Field(
        default_factory=list,
        description="Inputs that show the opposite of their sensor, a wrong wiring too.",
    )

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        check_once("inverted", self.inverted)
        return self

    @property
    def params(self) -> HallParams:
        """The sensors as the plant knows them."""
        return HallParams(self.offset_deg, self.order, "".join(self.inverted))


class Encoder(Model):
    """Incremental encoder with tracks A and B; A leads B at positive speed."""

    lines: int = quantity(
        "Lines: periods of A and B a mechanical turn. A counter sees four edges a line.", "", 1, 65536
    )
    inverted: bool = Field(
        default=False,
        description="The tracks are exchanged: B leads A at positive speed. The drive is not told, and finds it.",
    )
    index: bool = Field(
        default=True, description="Index Z, high for a quarter of a line once a turn; begins with A at positive speed."
    )
    missing_lines: int = quantity(
        "Lines before the index at which neither track changes, as on a dirty disc. The drive is not told, "
        "and finds them.",
        "",
        0,
        65535,
        default=0,
    )
    offset_deg: float = quantity(
        "Mounting: mechanical angle of the rotor (0: electrical angle 0) at which the index begins at positive speed.",
        "deg",
        -360,
        360,
        default=0.0,
    )


class Third(Model):
    """Third-harmonic plane of a five-phase machine, which turns three times as fast as the first."""

    inductance_d_h: float = quantity("Inductance on the d axis.", "H", 1e-8, 1.0)
    inductance_q_h: float = quantity("Inductance on the q axis.", "H", 1e-8, 1.0)
    mutual_h: float = quantity("Inductance between the planes, d to d and q to q.", "H", -1.0, 1.0, default=0.0)
    psi_vs: float = quantity(
        "Flux of the magnets; its phase EMF has the peak 3 `psi_vs` ω.", "V*s/rad", -10, 10, default=0.0
    )


class Saturation(Model):
    """Saturation of the first plane: incremental inductances that depend on i_d and i_q."""

    current_a: float = quantity("Current on the d axis at which `plus` and `minus` hold.", "A", 0.01, 2000)
    plus: float = quantity(
        "Change of the incremental L_d at +`current_a`, as a share of it (usually negative).",
        "",
        -0.8,
        0.8,
        default=0.0,
    )
    minus: float = quantity("The same at -`current_a`.", "", -0.8, 0.8, default=0.0)
    angle_rad: Powers = quantity(
        "Cross-saturation: angle by which the axes of the incremental inductance turn with i_q, "
        "½ atan(2 L_dq/(L_q - L_d)), as coefficients of the powers 0 to 3 of i_q in A.",
        "rad",
        -1e3,
        1e3,
        default=(0.0, 0.0, 0.0, 0.0),
    )
    angle_current_a: float | None = quantity(
        "Largest i_q of that curve; to twice this current L_dq levels out.",
        "A",
        0.01,
        2000,
        default=None,
        absent="`current_a`",
    )


class Motor(Model):
    """A star-connected permanent-magnet machine of three or five phases with isolated star point.

    A five-phase machine has equal phases, a sinusoidal EMF with a third harmonic, and `[third]`; it is driven by vector
    control with injection.

    >>> from fluxlock import load_motor
    >>> load_motor("motors/spindle-2pp.toml").resistance_ohm  # Ohm, phases A, B, C
    (0.15, 0.15, 0.15)
    """

    OF_A_FILE: ClassVar[bool] = True

    name: str = Field(min_length=1, description="Name for tables and plots.")
    description: str = Field(default="", description="Free text.")
    phases: int = quantity("Phases: 3 or 5.", "", 3, 5, default=3)
    pole_pairs: int = quantity("Pole pairs.", "", 1, 50)
    resistance_ohm: PhaseValues = quantity(
        "Phase resistance: one number, or three for phases A, B, C.", "Ohm", 1e-5, 1e3
    )
    inductance_h: PhaseValues = quantity(
        "Phase inductance, self minus mutual: one number, or three for phases A, B, C.", "H", 1e-8, 10.0
    )
    mutual_h: PhaseValues = quantity(
        "Mutual inductance between AB, BC and CA (usually negative): one number or three. Self inductance "
        "of a phase = `inductance_h` + mean of its two mutual inductances.",
        "H",
        -10.0,
        10.0,
        default=(0.0, 0.0, 0.0),
    )
    inductance_q_h: float | None = quantity(
        "Salient machine: inductance on the q axis. `inductance_h` is then that on the d axis (the magnet's), one "
        "number, and there is no `mutual_h`. Six-step parameters and analyses take the mean of both.",
        "H",
        1e-8,
        10.0,
        default=None,
        absent="not salient",
    )
    psi_vs: PhaseValues = quantity(
        "Flux: peak phase EMF over electrical speed. One number, or three for phases A, B, C.",
        "V*s/rad",
        1e-6,
        10,
    )
    emf: Literal["sinusoidal", "trapezoidal"] = Field(description="Shape of the EMF.")
    flat_top_deg: float = quantity(
        "Length of the flat top of a trapezoidal EMF, electrical.", "deg", 60, 170, default=120.0
    )
    inertia_kgm2: float = quantity("Inertia of rotor and load.", "kg*m^2", 1e-10, 10)
    rated_current_a: float = quantity(
        "Rated current: amplitude (peak) of sinusoidal phase currents that give the rated torque. 1.414 times an rms "
        "value, with a sinusoidal EMF 1.103 times a DC current through two phases; six-step operation takes the DC "
        "current of the same torque.",
        "A",
        0.01,
        2000,
    )
    overload_s: float | None = quantity(
        "Time for which twice the rated current may flow (I²t); 0 = for ever.",
        "s",
        0.0,
        600.0,
        default=None,
        absent="2 s",
    )
    max_speed_rpm: float = quantity("Highest speed, mechanical.", "r/min", 10, 2e6)
    hall: Hall | None = Field(default=None, description="Hall sensors, if there are any.")
    encoder: Encoder | None = Field(default=None, description="Incremental encoder, if there is one.")
    third: Third | None = Field(default=None, description="Third-harmonic plane of a five-phase machine.")
    saturation: Saturation | None = Field(default=None, description="Saturation, if there is any.")
    load: Load = Field(default_factory=Load, description="Load of a scenario that states none.")
    datasheet: DataSheet | None = Field(
        default=None,
        description="What the maker states, in the maker's terms, for `motor check`.",
    )

    @model_validator(mode="after")
    def _salient(self) -> Self:
        if self.inductance_q_h is None:
            return self
        if len(set(self.inductance_h)) > 1:
            raise conflict(
                "inductance_h",
                f"{listed(self.inductance_h)} H must be one number, that of the d axis, with inductance_q_h",
            )
        if any(self.mutual_h):
            raise conflict(
                "mutual_h", f"{listed(self.mutual_h)} H does not go with inductance_q_h; leave one of them out"
            )
        return self

    @model_validator(mode="after")
    def _phases(self) -> Self:
        if self.phases == 4:
            raise conflict("phases", "4 is not permitted, permitted: 3, 5")
        if self.third is not None and self.phases == 3:
            raise conflict("third", "belongs to phases = 5; leave it out, or set phases")
        if self.third is None and self.phases == 5:
            raise conflict("third", "required table is missing for phases = 5")
        if self.phases == 5 and self.hall is not None:
            raise conflict("hall", "does not go with phases = 5")
        if self.phases == 5 and self.datasheet is not None:
            raise conflict("datasheet", "does not go with phases = 5")
        if self.phases == 3 and self.saturation is None:
            return self
        reason = "phases = 5" if self.phases == 5 else "[saturation]"
        if self.emf != "sinusoidal":
            raise conflict("emf", f'must be "sinusoidal" with {reason}')
        if any(self.mutual_h):
            raise conflict("mutual_h", f"does not go with {reason}; leave it out")
        for key in ("inductance_h", "psi_vs", *(("resistance_ohm",) if self.phases == 5 else ())):
            if len(set(getattr(self, key))) > 1:
                raise conflict(key, f"{listed(getattr(self, key))} must be one number with {reason}")
        return self

    @model_validator(mode="after")
    def _planes(self) -> Self:
        if self.third is None:
            return self
        l_d, third = self.inductance_h[0], self.third
        l_q = l_d if self.inductance_q_h is None else self.inductance_q_h
        most = math.sqrt(min(l_d * third.inductance_d_h, l_q * third.inductance_q_h))
        if abs(third.mutual_h) >= most:
            raise conflict(
                "third.mutual_h",
                f"{third.mutual_h:g} H gives an inductance matrix that is not positive definite, permitted: less than "
                f"{most:.3g} H, the root of the inductances that it couples",
            )
        return self

    @model_validator(mode="after")
    def _saturates(self) -> Self:
        if self.saturation is None:
            return self
        try:
            machine_params(self)
        except ValueError as error:
            raise conflict("saturation", str(error)) from None
        return self

    @model_validator(mode="after")
    def _inductance_matrix(self) -> Self:
        least_h = min(self.self_inductance_h)
        if least_h <= 0:
            raise conflict("mutual_h", f"with inductance_h gives a self inductance of {least_h:g} H")
        if not positive_definite(self.self_inductance_h, self.mutual_h):
            raise conflict("mutual_h", "with inductance_h gives an inductance matrix that is not positive definite")
        return self

    @model_validator(mode="after")
    def _encoder_edges(self) -> Self:
        if self.encoder is None:
            return self
        if self.encoder.missing_lines >= self.encoder.lines:
            raise conflict("encoder.missing_lines", f"{self.encoder.missing_lines} leaves none of the encoder's lines")
        edges_per_s = self.encoder.lines * 4 * self.max_speed_rpm / 60
        most = math.floor(60 * ENCODER_EDGES_PER_S / (4 * self.max_speed_rpm))
        if self.encoder.lines > most:
            raise conflict(
                "encoder.lines",
                f"{self.encoder.lines} gives {edges_per_s:.3g} edges/s at max_speed_rpm, above "
                f"{ENCODER_EDGES_PER_S:g} edges/s; permitted up to {most} lines",
            )
        return self

    @property
    def mean_inductance_h(self) -> float:
        """Phase inductance, self minus mutual: mean of the phases, of a salient machine of its axes."""
        if self.inductance_q_h is not None:
            return (self.inductance_h[0] + self.inductance_q_h) / 2
        return sum(self.inductance_h) / 3

    @property
    def inductance_matrix_h(self) -> list[list[float]]:
        """Self and mutual inductances of three phases that are not salient."""
        own, (ab, bc, ca) = self.self_inductance_h, self.mutual_h
        return [[own[0], ab, ca], [ab, own[1], bc], [ca, bc, own[2]]]

    @property
    def self_inductance_h(self) -> tuple[float, float, float]:
        """Self inductances of A, B, C; of a salient machine their mean over a turn."""
        if self.inductance_q_h is not None:
            return (self.mean_inductance_h,) * 3
        mab, mbc, mca = self.mutual_h
        la, lb, lc = self.inductance_h
        return (la + (mab + mca) / 2, lb + (mab + mbc) / 2, lc + (mbc + mca) / 2)

    @property
    def line_flux_vs(self) -> float:
        """Mean line EMF over a sector divided by electrical speed (mean of the phases); of five phases the peak."""
        psi = sum(self.psi_vs) / 3
        if self.phases == 5:
            return psi * 2 * math.cos(math.pi / 10)
        return psi * line_mean(self.emf, self.flat_top_deg)

    def emf_harmonic(self, order: int) -> float:
        """Harmonic of odd order > 1 of the phase EMF over its fundamental, with the sign of sin(order * angle)."""
        if self.third is not None and order == 3:
            return 3 * self.third.psi_vs / self.psi_vs[0]
        if self.emf == "sinusoidal":
            return 0.0
        ramp = math.radians(180.0 - self.flat_top_deg) / 2
        return math.sin(order * ramp) / (order**2 * math.sin(ramp))

    @property
    def emf_fundamental(self) -> float:
        """Fundamental of the phase EMF over its peak."""
        return fundamental(self.emf, self.flat_top_deg)

    @property
    def torque_per_amp_nm(self) -> float:
        """Mean torque per ampere of DC current in six-step operation; of five phases per ampere of i_q."""
        if self.phases == 5:
            return 2.5 * self.pole_pairs * self.psi_vs[0]
        return self.pole_pairs * self.line_flux_vs

    @property
    def rated_torque_nm(self) -> float:
        """Torque of sinusoidal phase currents with the rated amplitude, along the EMF."""
        psi = sum(self.psi_vs) / 3 * self.emf_fundamental
        return self.phases / 2 * self.pole_pairs * psi * self.rated_current_a

    @property
    def rated_dc_current_a(self) -> float:
        """DC current through two phases with the rated torque, for six-step operation; of five phases the amplitude.

        To four digits, as a file would state it.
        """
        return float(f"{self.rated_torque_nm / self.torque_per_amp_nm:.4g}")

    def omega_e(self, speed_rpm: float) -> float:
        """Electrical speed in rad/s."""
        return speed_rpm / RPM_PER_RAD_S * self.pole_pairs

    def electrical_hz(self, speed_rpm: float) -> float:
        """Fundamental frequency at a mechanical speed."""
        return abs(speed_rpm) / 60.0 * self.pole_pairs


def machine_params(m: Motor) -> MachineParams:
    """The machine as the plant knows it."""
    n, third, saturation = m.phases, m.third, m.saturation

    def of_phases(values: tuple[float, ...]) -> tuple[float, ...]:
        return values if n == 3 else (values[0],) * n

    return MachineParams(
        pole_pairs=m.pole_pairs,
        r_ohm=of_phases(m.resistance_ohm),
        l_h=of_phases(m.inductance_h if m.inductance_q_h or n == 5 else m.self_inductance_h),
        l_q_h=m.inductance_q_h,
        m_h=m.mutual_h,
        psi_vs=of_phases(m.psi_vs),
        emf=m.emf,
        flat_top_deg=m.flat_top_deg,
        hall=m.hall.params if m.hall else None,
        encoder=EncoderParams(**m.encoder.model_dump()) if m.encoder else None,
        phases=n,
        third=ThirdParams(third.inductance_d_h, third.inductance_q_h, third.mutual_h, third.psi_vs) if third else None,
        saturation=SaturationParams(
            current_a=saturation.current_a,
            plus=saturation.plus,
            minus=saturation.minus,
            angle_rad=saturation.angle_rad,
            angle_current_a=saturation.angle_current_a or saturation.current_a,
        )
        if saturation
        else None,
    )
