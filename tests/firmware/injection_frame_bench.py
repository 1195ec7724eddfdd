# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's control of an injected machine on the bench: settings from those of the float model, courses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fluxlock.firmware import injection_formats as formats
from fluxlock.firmware.binding import constant, new, open_library
from fluxlock.firmware.block import gain
from fluxlock.firmware.vector_compiler import PI_INTEGRAL
from fluxlock.firmware.vector_formats import from_complex, observer_gains, vector_machine
from fluxlock.headers import CData
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.cases import IPM_BEST, TIAN_BEST, YU_BEST, ipm, tian, yu
from fluxlock.theory.injection.chain import HfMachine
from fluxlock.theory.injection.loop import CURVE_REACH
from fluxlock.theory.injection.machine import TORQUE_AT
from fluxlock.theory.injection.theory import amplitude as hf_amplitude
from fluxlock.theory.injection.theory import with_third_plane
from fluxverify.regression.five_phase.injection_bench import (
    CLOCK_HZ,
    Q25,
    Q32,
    Q36,
    TURN,
    InjectionBench,
    firmware_pll,
)
from tests.firmware.test_fw_injection_error import machine_for
from tests.firmware.test_fw_rest_position import Setting

SEED = 12
Q16, Q21 = 2**16, 2**21
HERTZ = Q36 / CLOCK_HZ / TURN  # of rad/s, in 2^-36 turn a clock


def tian_setting(dead_time_s: float) -> Setting:
    """Tian's machine, best scheme."""
    return Setting(tian(TIAN_BEST, dead_time_s), 3.0, 1500.0, 0.05)


def yu_setting(dead_time_s: float) -> Setting:
    """Yu's machine, best scheme."""
    return Setting(yu(YU_BEST, dead_time_s), 5.0, 2500.0, 0.008)


def ipm_setting(dead_time_s: float) -> Setting:
    """Three-phase IPM."""
    return Setting(ipm(IPM_BEST, dead_time_s), 10.0, 4000.0, 0.1, settle=6, frame_count=8, lock=20)


def frame_settings(setting: Setting) -> CData:
    """injection_frame_settings_t from the settings of the float model."""
    loop = setting.loop
    s, motor, full_scale_a = loop.settings, loop.motor, loop.inverter.current_full_scale_a
    bench = InjectionBench(loop)
    m, tick = bench.m, s.tick * s.ts_s
    hf = HfMachine(m.r, m.l_d, m.l_q)
    if m.phases == 5:
        hf = with_third_plane(hf, m.l_13, m.l_d3, m.l_q3)
    unit = Q21 / full_scale_a
    expected = hf_amplitude(hf, s.amplitude_v, s.period * s.ts_s).d
    if s.method == "iq":
        expected *= 8 / math.pi**2  # fundamental of a triangle
    ratio = hf.lq_h / hf.ld_h
    noise = hf.lq_h / (hf.lq_h - hf.ld_h) / (4 / math.sqrt(math.pi))
    saturation = motor.saturation
    curve, most = ((0.0,), 1.0)
    if saturation is not None:
        curve = saturation.angle_rad
        most = CURVE_REACH * (saturation.angle_current_a or saturation.current_a)
    hz = 1 / (s.period * s.ts_s)
    ampere_per_rad_s = Q25 / full_scale_a / HERTZ
    top = motor.omega_e(motor.max_speed_rpm)
    return new(
        "injection_frame_settings_t",
        error=formats.error_settings(
            s.method, hf.ld_h, hf.lq_h, r_ohm=m.r, injection_hz=hz, full_scale_a=full_scale_a, minimum_a=0.1 * expected
        )[0],
        rest=setting.firmware()[0],
        handover=formats.handover_settings(2 * top * HERTZ, top * HERTZ, 1 / Q16, 1)[0],
        validity=new(
            "injection_validity_settings_t",
            minimum_i_q21=round(0.2 * expected * unit),
            expected_i_q21=round(expected * unit),
            saliency_q16=round(ratio * Q16),
            derate_ratio_q16=round((0.4 * ratio + 0.6) * Q16),
            fault_ratio_q16=round((0.1 * ratio + 0.9) * Q16),
            noise_factor_q16=round(noise * Q16),
            derate_noise_q16=round(0.3 * Q16),
            fault_noise_q16=round(0.6 * Q16),
            filter_shift=6,
            fault_results=100,
        )[0],
        pll=firmware_pll(s.pll, tick, 2 * top)[0],
        sequence=constant("SEQUENCE", s.sequence),
        machine=machine_for(1.0, bench.cycles)[0],
        coupling=formats.cross_coupling_settings(
            curve, most, full_scale_a, 1 - math.exp(-TURN * s.curve_hz * tick), s.compensation == "following"
        )[0],
        speed=(gain(s.speed_p * ampere_per_rad_s), gain(s.speed_i * tick * ampere_per_rad_s * PI_INTEGRAL)),
        speed_filter_q16=round((1 - math.exp(-TURN * s.speed_hz * tick)) * Q16),
        third_q16=round(s.third_ratio * Q16),
        third=True,
        limit_i_q25=round(s.current_limit_a / full_scale_a * Q25),
    )


class EmfObserver:
    """The firmware's EMF observer beside it, stepped at every sample; knows R and L_q."""

    FULL_SCALE_V = 60.0
    REDESIGN = 20  # samples

    def __init__(self, chip: InjectionBench, pole: float = 0.9, least_v: float = 1.0) -> None:
        self.lib, self.chip, self.pole = open_library(), chip, pole
        s, m = chip.loop.settings, chip.m
        self.unit_v = Q25 / self.FULL_SCALE_V
        self.unit_a = 2**17 / chip.loop.inverter.current_full_scale_a
        self.least = round(least_v * self.unit_v)
        admittance = s.ts_s * self.FULL_SCALE_V / (m.l_q * chip.loop.inverter.current_full_scale_a)
        self.machine = vector_machine(m.r * s.ts_s / m.l_q, 1.0, admittance, chip.cycles, "exact")
        self.observer = new("emf_observer_t")
        self.gains = observer_gains(self.lib, self.machine, 0, pole, pole)

    def step(self, turn_q32: int) -> tuple[int, bool]:
        """Error and whether it counts, after a sample before which the frame was turned."""
        chip, observer = self.chip, self.observer
        speed = chip.command.speed_turn_q36
        if chip.step % self.REDESIGN == 0:
            self.gains = observer_gains(self.lib, self.machine, speed, self.pole, self.pole)
        if turn_q32:
            self.lib.emf_observer_turn(observer, self.lib.cis_q30(-turn_q32 & 0xFFFFFFFF))
        self.lib.emf_observer_step(observer, self.gains, from_complex(chip.current_a, self.unit_a), 0)
        self.lib.emf_observer_voltage(observer, self.gains, from_complex(chip.held, self.unit_v))
        emf = self.observer.emf_v_q25
        return self.lib.pll_error_q30(emf, speed, self.least), math.hypot(emf.re, emf.im) > 2 * self.least


@dataclass
class FrameBench:
    """Firmware and machine; wanted: speed (electrical rad/s) or None, i_q (A), at a time."""

    setting: Setting
    theta: float = 0.7
    error_rad: float = 0.0  # of the published angle at the start
    resting: bool = False
    speed_rad_s: float = 0.0
    wanted: Callable[[float], float | None] = lambda _: None
    i_q_a: Callable[[float], float] = lambda _: 0.0
    before: Callable[[FrameBench, float], None] = lambda *_: None  # a sample: loads
    time_s: list[float] = field(default_factory=list)
    published_rad: list[float] = field(default_factory=list)
    raw_rad: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.lib = open_library()
        self.settings = frame_settings(self.setting)
        self.chip = InjectionBench(self.setting.loop, self.theta, SEED, self.speed_rad_s)
        self.state = new("injection_frame_t")
        speed = round(self.speed_rad_s * HERTZ)
        self.lib.injection_frame_begin(self.state, self.settings, self.resting, speed)
        frame = self.theta + self.error_rad - self.state.curve_q32 / Q32 * TURN
        self.chip.nco_q36 = round(frame / TURN * Q36) % int(Q36)
        self.chip.command.speed_turn_q36 = speed
        self.amplitude: CData | None = None
        self.report = 0.0
        self.torques_nm: list[float] = []
        self.injecting: list[bool] = []
        self.emf: EmfObserver | None = None

    def run(self, seconds: float) -> None:
        """So long."""
        chip, s = self.chip, self.setting.loop.settings
        full_scale_a = self.setting.loop.inverter.current_full_scale_a
        ampere = Q25 / full_scale_a
        for _ in range(round(seconds / s.ts_s)):
            t = chip.step * s.ts_s
            self.before(self, t)
            turn = chip.command.turn_q32
            chip.sample()
            emf_q30, emf_there = self.emf.step(turn) if self.emf else (0, False)
            self.amplitude = chip.amplitude or self.amplitude
            if chip.step % s.tick == 0:
                wanted = self.wanted(t)
                given = new(
                    "injection_frame_input_t",
                    current_i_q25=from_complex(chip.current_a, ampere),
                    emf_error_q30=emf_q30,
                    emf_there=emf_there,
                    by_speed=wanted is not None,
                    speed_turn_q36=round((wanted or 0.0) * HERTZ),
                    current_wanted_i_q25=from_complex(1j * self.i_q_a(t), ampere),
                )
                if self.amplitude is not None:
                    given.fresh, given.amplitude = True, self.amplitude[0]
                self.amplitude = None
                made = new("injection_frame_command_t")
                self.lib.injection_frame_step(self.state, self.settings, given, made)
                c = chip.command
                c.turn_q32, c.speed_turn_q36 = made.turn_q32, made.speed_turn_q36
                c.lead_q32, c.inject = made.lead_q32, made.inject
                c.reference_a, c.third_a = (complex(z.re, z.im) / ampere for z in made.reference_i_q25)
                self.report = made.report_q32 / Q32 * TURN
            self.time_s.append(t)
            self.torques_nm.append(float(chip.state[TORQUE_AT]))
            self.injecting.append(chip.command.inject)
            self.raw_rad.append(chip.error_rad(self.report))
            self.published_rad.append(chip.error_rad(self.report + self.state.curve_q32 / Q32 * TURN))

    def errors_deg(self, begin_s: float, raw: bool = False) -> FloatArray:
        """From an instant on."""
        e = np.array(self.raw_rad if raw else self.published_rad)
        return np.degrees(e[np.array(self.time_s) >= begin_s])

    def largest_mean_deg(self, begin_s: float) -> float:
        """Largest 5 ms mean."""
        n = round(5e-3 / self.setting.loop.settings.ts_s)
        return float(np.abs(np.convolve(self.errors_deg(begin_s), np.full(n, 1 / n), mode="valid")).max())
