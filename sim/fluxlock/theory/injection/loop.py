# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The whole drive with injection in floating point, sample by sample: settings, courses, what they show.

Machine in two planes with saturation, injection on the estimated axis, current regulators, inverter as mean voltages a
sample period with dead time, converter with noise, demodulators, angle sequences, phase-locked loop of second or third
order, cross-coupling curve, speed loop, mechanics. The kernel stands in `kernel`. Errors are theta_hat -
theta; sequences are stated by `lead` and `report`, in sample periods of rotation:

    Park at the estimate of the sample; inverse Park `lead` omega T_s further; reported angle `report` omega T_s further
    held as in Tian: 0, 0     held as in Yu: 1, 1     half-step: 1.5, 1.5     exact: 1.5, 0

The voltage of a sample acts from one to two periods after it, its centre 1.5 omega T_s further on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from fluxlock.config import Motor
from fluxlock.config.motor import machine_params
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.machine import InverterSet, machine_set
from fluxlock.theory.injection.theory import LEAD_AND_REPORT, LoopSequence

Method = Literal["lock-in", "conventional", "iq", "separator"]
METHODS: tuple[Method, ...] = ("lock-in", "conventional", "iq", "separator")
CURVE_REACH = 1.25  # of the current up to which the file states the curve
SUBSTEPS = 8  # Runge-Kutta steps a sample period, at least


@dataclass(frozen=True)
class Inverter:
    """Supply (V), dead time (s) and its compensation, converter.

    zone_a: current (A) above which the dead time is lost whole, the ripple of a real inverter. compensation_zone_a:
    where the compensation is whole. predict: samples by which the compensation extrapolates the current, for it acts
    later; 1.5 is the middle. model: it moves the known HF current on instead. current_full_scale_a 0: exact currents.
    average: converter samples a current. switched: every edge of the legs at its instant, zone_a does not count; edges:
    then the compensation takes the currents at the same edges, extrapolated from one and two injection periods before,
    moved by what the sampled current has changed.
    """

    supply_v: float
    dead_time_s: float = 0.0
    zone_a: float = 0.02
    compensate: bool = True
    compensation_zone_a: float = 0.1
    predict: float = 0.0
    model: bool = False
    switched: bool = False
    edges: bool = False
    current_full_scale_a: float = 0.0
    bits: int = 12
    noise_lsb: float = 1.0
    average: int = 1

    def kernel_set(self, double: bool) -> InverterSet:
        """The same as the kernel takes it; double: two updates a carrier."""
        return InverterSet(
            vdc=self.supply_v,
            dead_vs=self.supply_v * self.dead_time_s,
            zone=self.zone_a,
            compensate=int(self.compensate and self.dead_time_s > 0.0),
            compensation_zone=self.compensation_zone_a,
            predict=self.predict,
            model=int(self.model),
            double=int(double),
            lsb=self.current_full_scale_a / 2.0 ** (self.bits - 1),
            full_scale=2.0 ** (self.bits - 1) - 1.0,
            noise_lsb=self.noise_lsb,
            average=self.average,
            switched=int(self.switched),
            edges=int(self.edges),
        )


@dataclass(frozen=True)
class Settings:
    """Control. Gains not given follow from bandwidths.

    ts_s: sample period, an update each. double: two updates a carrier. period: samples an injection period (even).
    over: current samples a period that the demodulator sees. remove: the band-passed part is kept from the regulators.
    hold: separator only, voltages change at the zero crossings alone. current_hz: bandwidth of the current regulators,
    or gains (V/A, V/(A s)) of d and q. pll: gains a, b (1/s), c (1/s^2) a firmware tick. feed: share of the
    acceleration that the torque of i_q gives, fed to the loop. speed_p (A s/rad), speed_i (A/rad): on electrical speed.
    third_ratio: i_q3 over i_q. compensation: cross-coupling curve: off, on, or following (the frame of the injection
    moves with it). curve_hz: filter of its current.
    """

    method: Method
    sequence: LoopSequence
    ts_s: float
    period: int
    amplitude_v: float
    pll: tuple[float, float, float]
    double: bool = False
    over: int = 1
    remove: bool = False
    hold: bool = True
    tick: int = 1
    band_k: float = 0.45
    low_hz: float = 51.5
    low_k: float = math.sqrt(2)
    current_hz: float = 30.0
    current_gains: tuple[float, float, float, float] | None = None
    decouple: bool = True
    feed: float = 0.0
    speed_p: float = 0.044
    speed_i: float = 0.1
    speed_hz: float = 15.0
    current_limit_a: float = 3.0
    third_ratio: float = 0.0
    compensation: Literal["off", "on", "following"] = "off"
    curve_hz: float = 200.0
    machine_r_ohm: float | None = None

    def __post_init__(self) -> None:
        if self.period < 4 or self.period % 2:
            raise ValueError(f"period = {self.period}: must be an even number of samples from 4 on")
        if self.method == "separator" and self.period != 4:
            raise ValueError(f"period = {self.period}: the separator needs 4 samples")
        if self.over < 1 or self.tick < 1:
            raise ValueError(f"over = {self.over}, tick = {self.tick}: must be at least 1")


@dataclass
class Schedule:
    """References and loads at each sample; scalars hold for ever.

    speed_rad_s: electrical, NaN: current control. load_nm: constant torque; coulomb_nm: brake. imposed_rad_s:
    electrical speed of a driven shaft, NaN: free. theta_rad: angle at the start; error_rad: of the estimate there.
    """

    seconds: float
    speed_rad_s: float | FloatArray = math.nan
    i_q_a: float | FloatArray = 0.0
    i_d_a: float | FloatArray = 0.0
    load_nm: float | FloatArray = 0.0
    coulomb_nm: float | FloatArray = 0.0
    imposed_rad_s: float | FloatArray = math.nan
    theta_rad: float = 0.7
    error_rad: float = 0.0


@dataclass(frozen=True)
class Loop:
    """Drive of a motor: settings, inverter. saturated: with the motor file's saturation, if it has one."""

    motor: Motor
    inverter: Inverter
    settings: Settings
    saturated: bool = True
    viscous: float | None = None

    def times(self, seconds: float) -> FloatArray:
        """Instants of the samples (s)."""
        return np.asarray(np.arange(round(seconds / self.settings.ts_s)) * self.settings.ts_s, np.float64)

    def run(self, schedule: Schedule, seed: int = 1) -> Course:
        """Follow the drive."""
        from fluxlock.plant.magnetics import FluxMap
        from fluxlock.theory.injection import kernel

        s, motor, inv = self.settings, self.motor, self.inverter
        params = machine_params(motor)
        flux = FluxMap(params)
        ts = s.ts_s
        saturation = params.saturation
        machine = machine_set(motor, self.saturated, self.viscous)
        inverter = inv.kernel_set(s.double)
        substeps = s.over * math.ceil(SUBSTEPS / s.over / 4) * (4 if s.over % 4 else 1)
        substeps = substeps if substeps % 4 == 0 else substeps * 4
        fs = s.over / ts
        w = 2 * math.pi * s.current_hz
        gains = s.current_gains or (w * flux.l_d, w * params.r_ohm[0], w * flux.l_q, w * params.r_ohm[0])
        lead, report = LEAD_AND_REPORT[s.sequence]
        torque_to_accel = 0.5 * motor.phases * motor.pole_pairs**2 * flux.psi_1 / motor.inertia_kgm2
        curve = saturation.angle_rad if saturation else (0.0, 0.0, 0.0, 0.0)
        tick = s.tick * ts
        control = kernel.ControlSet(
            ts=ts,
            substeps=substeps,
            over=s.over,
            method=METHODS.index(s.method),
            period=s.period,
            amplitude=s.amplitude_v,
            lead=lead,
            report=report,
            remove=int(s.remove),
            hold=int(s.hold),
            tick=s.tick,
            band_g=math.tan(math.pi / (s.period * s.over)),
            band_k=s.band_k,
            low_g=math.tan(math.pi * s.low_hz / fs),
            low_k=s.low_k,
            r=params.r_ohm[0] if s.machine_r_ohm is None else s.machine_r_ohm,
            l_d=flux.l_d,
            l_q=flux.l_q,
            psi=flux.psi_1,
            l_d3=machine.l_d3,
            l_q3=machine.l_q3,
            psi_3=flux.psi_3,
            third_ratio=s.third_ratio,
            current_w=w,
            gain_d=gains[0],
            integral_d=gains[1],
            gain_q=gains[2],
            integral_q=gains[3],
            decouple=int(s.decouple),
            pll_a=s.pll[0],
            pll_b=s.pll[1],
            pll_c=s.pll[2],
            feed=s.feed * torque_to_accel,
            speed_p=s.speed_p,
            speed_i=s.speed_i,
            speed_filter=1.0 - math.exp(-2 * math.pi * s.speed_hz * tick),
            current_limit=s.current_limit_a,
            curve_0=curve[0],
            curve_1=curve[1],
            curve_2=curve[2],
            curve_3=curve[3],
            curve_limit=CURVE_REACH * saturation.angle_current_a if saturation else 1.0,
            compensate=("off", "on", "following").index(s.compensation),
            curve_filter=1.0 - math.exp(-2 * math.pi * s.curve_hz * tick),
        )
        count = self.times(schedule.seconds).size

        def course(value: float | FloatArray) -> FloatArray:
            return np.array(np.broadcast_to(value, (count,)), float)

        record = kernel.run(
            machine,
            inverter,
            control,
            course(schedule.speed_rad_s),
            course(schedule.i_q_a),
            course(schedule.i_d_a),
            course(schedule.load_nm),
            course(schedule.coulomb_nm),
            course(schedule.imposed_rad_s) / motor.pole_pairs,
            schedule.theta_rad,
            schedule.error_rad,
            seed,
        )
        return Course(record, ts, motor.pole_pairs)


def printed_pll(kp: float, ki: float, tick_s: float) -> tuple[float, float, float]:
    """Gains of a tick from those of a paper, kp (1/s) and ki (1/s^2)."""
    return (kp * tick_s, ki * tick_s, 0.0)


def designed_pll(
    order: Literal[2, 3], bandwidth_hz: float, tick_s: float, damping: float = 1.0
) -> tuple[float, float, float]:
    """Gains of a tick from a -3 dB bandwidth (Hz)."""
    from fluxlock.theory.vector.pll import pll_gains

    made = pll_gains(order, bandwidth_hz, tick_s, damping)
    return (made.a, made.b, made.c)


@dataclass(frozen=True)
class Statistics:
    """Of an angle error (rad)."""

    mean: float
    rms: float
    largest: float

    def degrees(self) -> Statistics:
        """The same in degrees."""
        return Statistics(*(math.degrees(x) for x in (self.mean, self.rms, self.largest)))


@dataclass
class Course:
    """Record of a run: columns of the kernel, a row a sample."""

    record: FloatArray
    ts_s: float
    pole_pairs: int
    time_s: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.time_s = np.asarray(np.arange(self.record.shape[0]) * self.ts_s, np.float64)

    def column(self, index: int) -> FloatArray:
        """A column by its index in the kernel."""
        return np.asarray(self.record[:, index])

    @property
    def speed_rpm(self) -> FloatArray:
        """True mechanical speed."""
        from fluxlock.theory.injection.kernel import OMEGA

        return self.column(OMEGA) / self.pole_pairs * 30.0 / math.pi

    @property
    def i_q_a(self) -> FloatArray:
        """True q current."""
        from fluxlock.theory.injection.kernel import I_Q

        return self.column(I_Q)

    def error(self, raw: bool = False) -> FloatArray:
        """Estimate less truth (rad), within a half turn."""
        from fluxlock.theory.injection.kernel import PUBLISHED, RAW, THETA

        found = self.column(RAW if raw else PUBLISHED) - self.column(THETA)
        return np.asarray(np.remainder(found + math.pi, 2 * math.pi) - math.pi)

    def statistics(self, begin_s: float = 0.0, end_s: float = math.inf, raw: bool = False) -> Statistics:
        """Of the error in a window; rms about zero."""
        e = self.error(raw)[(self.time_s >= begin_s) & (self.time_s < end_s)]
        return Statistics(float(e.mean()), float(np.sqrt(np.mean(e * e))), float(np.abs(e).max()))

    def largest_mean(
        self, begin_s: float = 0.0, end_s: float = math.inf, window_s: float = 5e-3, raw: bool = False
    ) -> float:
        """Largest size of the mean over a sliding window (rad)."""
        e = self.error(raw)[(self.time_s >= begin_s) & (self.time_s < end_s)]
        n = max(round(window_s / self.ts_s), 1)
        return float(np.abs(np.convolve(e, np.full(n, 1.0 / n), mode="valid")).max())

    def first_within(self, limit_rad: float) -> float:
        """Instant (s) at which the error is within the limit for the first time; inf: never."""
        inside = np.flatnonzero(np.abs(self.error()) <= limit_rad)
        return float(self.time_s[inside[0]]) if inside.size else math.inf

    def settled(self, limit_rad: float, window_s: float = 5e-3) -> float:
        """Instant (s) after which the sliding mean of the error stays within the limit; inf: never."""
        n = max(round(window_s / self.ts_s), 1)
        e = np.abs(np.convolve(self.error(), np.full(n, 1.0 / n), mode="full")[: self.time_s.size])
        outside = np.flatnonzero(e[: self.time_s.size] > limit_rad)
        if outside.size == 0:
            return 0.0
        return math.inf if outside[-1] >= e.size - n else float(self.time_s[outside[-1]] + self.ts_s)
