# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a scenario leaves open of the injection, by rule from machine and inverter: docs/theory/five-phase.md.

A loop goes through the demodulator: a change of i_q within an injection period T_h looks like an error of the angle,
that like a speed, and that makes i_q. With k_p (A s/rad) of the speed loop, w_n of the phase-locked loop, w_f of the
speed's filter and the HF current I_h its gain is

    S = k_p L_q / (L_q - L_d) / I_h T_h 3 w_n w_f

On ten machines it swings or loses the rotor from 17 on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.motor import Motor
from fluxlock.config.scenario import Scenario
from fluxlock.config.vector_design import circle, linear_voltage, told_machine
from fluxlock.config.vector_modes import PLL_BANDWIDTH
from fluxlock.config.vector_timing import vector_timing

PLL_HZ_MOST, PLL_PERIODS = 200.0, 12.5  # injection periods a period of the loop's bandwidth
# A rotor five times lighter than its file has a speed loop five times as fast, which loop and filter still follow.
PLL_OVER_SPEED = 30.0
FILTER_OVER_SPEED = 22.0
# S that is permitted, and by rule: with inductances that are a fifth off it is up to four times as large.
LOOP_MOST, LOOP_RULE = 16.0, 2.5
FUNDAMENTAL = 8 / math.pi**2  # of a triangle
GAMMA_PERIODS = 8.0  # injection periods a period of the regulators' bandwidth
# Growth of a light rotor's angle under -I: its logarithm until the search lets go of it.
GROWTH_MOST = 1.2
SEARCH_RESULTS_AT_I = 14  # left out and averaged at -I
SEARCH_RISE_S = 2e-3
SEARCH_SURE = 0.012  # least difference of the amplitudes at both poles over their sum
SEARCH_VOLTAGE_SHARE, SEARCH_TRIP_SHARE = 0.9, 0.9


@dataclass(frozen=True)
class Wave:
    """Inductances that the wave meets (H), its period (s), the peak of its current on d (A)."""

    l_d: float
    l_q: float
    period_s: float
    peak_a: float

    @property
    def ratio(self) -> float:
        """L_q / (L_q - L_d)."""
        return self.l_q / (self.l_q - self.l_d)


def wave_of(s: Scenario) -> Wave:
    """With five phases L - L_13^2 / L_3, for subspace 3 carries its share."""
    injection, m, third = s.drive.vector.injection, told_machine(s), s.motor.third
    assert injection is not None
    l_d, l_q = m.inductance_h - m.saliency_h / 2, m.inductance_h + m.saliency_h / 2
    if third is not None:
        mutual = third.mutual_h**2
        l_d, l_q = l_d - mutual / third.inductance_d_h, l_q - mutual / third.inductance_q_h
    period_s = injection.period * vector_timing(s.drive, s.inverter).sample_cycles / CLOCK_HZ
    return Wave(l_d, l_q, period_s, injection.amplitude_v * period_s / (4 * l_d))


def angle_noise_rad(s: Scenario, wave: Wave) -> float:
    """Noise of the angle of one result, rms, from that of the converter."""
    injection, sensing = s.drive.vector.injection, s.inverter.sensing
    assert injection is not None
    step_a = 2 * sensing.current_full_scale_a / 2.0**sensing.bits
    samples = injection.period * injection.samples
    noise_a = step_a * math.sqrt(2 / 3 * (sensing.noise_lsb**2 + 1 / 12) * 2 / samples)
    return noise_a * wave.ratio / (wave.peak_a * FUNDAMENTAL)


def loop_through_demodulator(s: Scenario, wave: Wave, pll_hz: float, speed_hz: float, filter_hz: float) -> float:
    """S."""
    k_p = 2 * math.pi * speed_hz * s.motor.inertia_kgm2 / (s.motor.pole_pairs * told_machine(s).torque_nm_per_a)
    order = s.drive.vector.pll_order
    omega_n = 2 * math.pi * pll_hz / PLL_BANDWIDTH[order]
    return k_p * wave.ratio / wave.peak_a * wave.period_s * order * omega_n * 2 * math.pi * filter_hz


@dataclass(frozen=True)
class InjectionLoops:
    """Bandwidths of loop, speed loop and its filter (Hz), gain of the current regulators."""

    pll_hz: float
    speed_hz: float
    filter_hz: float
    gamma: float


def injection_loops(s: Scenario) -> InjectionLoops:
    """The given ones, and by rule what is left out: all that is free slows down together until S is small enough."""
    v, injection, wave = s.drive.vector, s.drive.vector.injection, wave_of(s)
    assert injection is not None
    pll_hz = v.pll_hz or min(PLL_HZ_MOST, 1 / (PLL_PERIODS * wave.period_s))
    speed_hz = v.speed_hz or pll_hz / PLL_OVER_SPEED
    filter_hz = injection.speed_filter_hz or FILTER_OVER_SPEED * speed_hz
    free = [v.pll_hz is None, v.speed_hz is None, injection.speed_filter_hz is None]
    excess = loop_through_demodulator(s, wave, pll_hz, speed_hz, filter_hz) / LOOP_RULE
    slower = excess ** (-1.0 / sum(free)) if excess > 1.0 and any(free) else 1.0
    pll_hz, speed_hz, filter_hz = (
        value * slower if left else value for value, left in zip((pll_hz, speed_hz, filter_hz), free, strict=True)
    )
    return InjectionLoops(pll_hz, speed_hz, filter_hz, _gamma(s, wave))


def _gamma(s: Scenario, wave: Wave) -> float:
    """Of regulators that know the mean of both inductances: on the d axis they are faster than that."""
    v, injection = s.drive.vector, s.drive.vector.injection
    assert injection is not None
    if "gamma" in v.model_fields_set:
        return v.gamma
    fast = (wave.l_d + wave.l_q) / (2 * wave.l_d)
    return min(v.gamma, 2 * math.pi / (GAMMA_PERIODS * injection.period)) / fast


def polarity_signal(s: Scenario, current_a: float) -> float:
    """Difference of the amplitudes at +I and -I over their sum, for a small current; 0 without saturation."""
    saturation = s.motor.saturation
    if saturation is None:
        return 0.0
    return (saturation.minus - saturation.plus) / 2 * current_a / saturation.current_a


def _torque_growth(motor: Motor, psi_vs: float) -> float:
    """m/2 p^2 psi / J: square of the growth (1/s) of a rotor's angle under -I, an ampere."""
    return motor.phases / 2 * motor.pole_pairs**2 * psi_vs / motor.inertia_kgm2


def search_current(s: Scenario) -> float:
    """Current on the d axis that tells the magnet's poles apart (A).

    By rule it turns a light rotor by little, and voltage, limit and trip have room for it beside the wave.
    """
    injection, motor, protection = s.drive.vector.injection, s.motor, s.inverter.protection
    assert injection is not None
    if injection.search_current_a is not None:
        return injection.search_current_a
    current_a = motor.rated_current_a if motor.saturation is None else motor.saturation.current_a
    machine, wave = told_machine(s), wave_of(s)
    results_s = wave.period_s / (2 if injection.method == "separator" else 1)
    seconds = SEARCH_RESULTS_AT_I * results_s + 1.5 * SEARCH_RISE_S
    timing = vector_timing(s.drive, s.inverter)
    circle_v = circle(s.inverter, timing) * linear_voltage(motor.phases) * s.inverter.supply_v
    share = 0.5 / math.sin(math.pi / (2 * motor.phases))
    found = min(
        current_a,
        (GROWTH_MOST / seconds) ** 2 / _torque_growth(motor, machine.fundamental_vs),
        SEARCH_VOLTAGE_SHARE * (circle_v - injection.amplitude_v) / machine.resistance_ohm,
        s.current_limit_a,
        SEARCH_TRIP_SHARE * (protection.phase_current_a - wave.peak_a),
        SEARCH_TRIP_SHARE * (protection.dc_current_a / share - wave.peak_a),
    )
    return max(found, 0.0)
