# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection that would not work on this machine with this inverter, told before anything is built."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fluxlock.config.errors import Problem
from fluxlock.config.fields import with_unit
from fluxlock.config.injection_rules import (
    LOOP_MOST,
    SEARCH_SURE,
    InjectionLoops,
    Wave,
    angle_noise_rad,
    injection_loops,
    loop_through_demodulator,
    polarity_signal,
    search_current,
    wave_of,
)
from fluxlock.config.scenario import Scenario
from fluxlock.config.vector_modes import PLL_BANDWIDTH

KEY = "drive.vector.injection"
PLL_PERIODS_LEAST = 6.0  # injection periods a period of the loop's bandwidth
# A filter at the loop's own bandwidth lags 45 degrees there, the integral 14: 31 are left of its phase margin of 90.
FILTER_OVER_SPEED_LEAST = 1.0
GAMMA_MOST = 0.8  # over the gain of the d axis' regulator; from 1.05 on machines tripped
OMEGA_OVER_SPEED_LEAST = 1.5  # w_n over 2 pi speed_hz
WAVE_OVER_SPEED_LEAST = 10.0  # frequencies, B. Tian et al., IEEE Access 2019, (30)
SALIENT_STEPS = 2.0  # steps of the converter that the saliency must make
# A third of that from which the drive derates its current.
NOISE_MOST_RAD = 0.1
RISE_LEAST_S, RISE_MOST_S = 0.2e-3, 20e-3  # of the search current
STRONG_SALIENCY, STRONG_LOOP_MOST = 2.0, 26.0


def too_fast_for_wave(s: Scenario, speed_rpm: float) -> str | None:
    """Why a wave is too slow for a speed that it has to follow, up to that of the hand-over."""
    v = s.drive.vector
    if v.injection is None or s.motor.inductance_q_h is None:
        return None
    met_rpm = abs(speed_rpm) if v.handover_rpm is None else min(abs(speed_rpm), v.handover_rpm)
    wave_hz = 1 / wave_of(s).period_s
    if wave_hz >= WAVE_OVER_SPEED_LEAST * s.motor.electrical_hz(met_rpm):
        return None
    most_rpm = wave_hz / WAVE_OVER_SPEED_LEAST / s.motor.electrical_hz(1.0)
    return (
        f"{with_unit(met_rpm, 'r/min')} is {s.motor.electrical_hz(met_rpm):.0f} Hz electrical, permitted with a wave "
        f"of {wave_hz:.0f} Hz up to a tenth of it, {most_rpm:.0f} r/min; state drive.vector.handover_rpm up to there, "
        f"or lower {KEY}.period"
    )


def check_injection(s: Scenario) -> list[Problem]:
    """One line each, with what would make it run."""
    wave, loops = wave_of(s), injection_loops(s)
    return [*_signal(s, wave), *_loops(s, wave, loops), *_search(s)]


def _signal(s: Scenario, wave: Wave) -> Iterator[Problem]:
    """The saliency's share of the HF current is more than steps of the converter."""
    injection, sensing = s.drive.vector.injection, s.inverter.sensing
    assert injection is not None
    seen_a, step_a = wave.peak_a / (2 * wave.ratio), 2 * sensing.current_full_scale_a / 2.0**sensing.bits
    if seen_a < SALIENT_STEPS * step_a:
        text = (
            f"{with_unit(injection.amplitude_v, 'V')} lets the saliency of {wave.l_q / wave.l_d:.3f} make "
            f"{1e3 * seen_a:.3g} mA, less than {SALIENT_STEPS:g} steps of the converter ({1e3 * step_a:.3g} mA each); "
            f"permitted from {injection.amplitude_v * SALIENT_STEPS * step_a / seen_a:.3g} V on"
        )
        yield Problem(s.sources.scenario, f"{KEY}.amplitude_v", text)
        return
    noise_rad = angle_noise_rad(s, wave)
    if injection.method in {"iq", "separator"} and noise_rad > NOISE_MOST_RAD:
        text = (
            f"{with_unit(injection.amplitude_v, 'V')} and inverter.sensing.noise_lsb = {sensing.noise_lsb:g} leave "
            f"{math.degrees(noise_rad):.3g} deg rms of noise in each angle, permitted up to "
            f"{math.degrees(NOISE_MOST_RAD):.2g} deg, from "
            f"{injection.amplitude_v * noise_rad / NOISE_MOST_RAD:.3g} V on"
        )
        yield Problem(s.sources.scenario, f"{KEY}.amplitude_v", text)


def _loops(s: Scenario, wave: Wave, loops: InjectionLoops) -> Iterator[Problem]:
    """Bandwidths that are given where the loop through the demodulator, or loop and speed loop, would swing."""
    file, v, injection = s.sources.scenario, s.drive.vector, s.drive.vector.injection
    most_hz = 1 / (PLL_PERIODS_LEAST * wave.period_s)
    if v.pll_hz is not None and v.pll_hz > most_hz:
        text = f"{with_unit(v.pll_hz, 'Hz')} is too fast for a wave of {1 / wave.period_s:.0f} Hz"
        yield Problem(file, "drive.vector.pll_hz", f"{text}, permitted up to {most_hz:.0f} Hz")
    fast = (wave.l_d + wave.l_q) / (2 * wave.l_d)
    if loops.gamma * fast > GAMMA_MOST:
        text = (
            f"{loops.gamma:g} makes regulators {fast:.3g} times as fast on the d axis, permitted up to "
            f"{GAMMA_MOST / fast:.3g}; left out it follows by rule"
        )
        yield Problem(file, "drive.vector.gamma", text)
    if s.mechanics.mode != "free":
        return
    most_hz = loops.pll_hz / PLL_BANDWIDTH[v.pll_order] / OMEGA_OVER_SPEED_LEAST
    if v.speed_hz is not None and v.speed_hz > most_hz:
        text = f"{with_unit(v.speed_hz, 'Hz')} is too fast for drive.vector.pll_hz = {loops.pll_hz:.4g} Hz"
        yield Problem(file, "drive.vector.speed_hz", f"{text}, permitted up to {most_hz:.3g} Hz")
    least_hz = FILTER_OVER_SPEED_LEAST * loops.speed_hz
    given = injection is not None and injection.speed_filter_hz is not None
    if given and loops.filter_hz < least_hz:
        text = (
            f"{with_unit(loops.filter_hz, 'Hz')} is too slow for a speed loop of {loops.speed_hz:.3g} Hz, permitted "
            f"from {least_hz:.3g} Hz on"
        )
        yield Problem(file, f"{KEY}.speed_filter_hz", text)
        return
    found = loop_through_demodulator(s, wave, loops.pll_hz, loops.speed_hz, loops.filter_hz)
    most = STRONG_LOOP_MOST if wave.l_q / wave.l_d >= STRONG_SALIENCY else LOOP_MOST
    if found > most:
        text = (
            f"{loops.speed_hz:.3g} Hz with drive.vector.pll_hz = {loops.pll_hz:.4g} Hz, {KEY}.speed_filter_hz = "
            f"{loops.filter_hz:.4g} Hz and this amplitude closes a loop through the demodulator, S = {found:.1f}, "
            f"permitted up to {most:g}; leave them out or raise {KEY}.amplitude_v"
        )
        yield Problem(file, "drive.vector.speed_hz", text)


def _search(s: Scenario) -> Iterator[Problem]:
    """The search can tell the magnet's poles apart."""
    injection, saturation = s.drive.vector.injection, s.motor.saturation
    assert injection is not None
    if not injection.search or saturation is None:  # cautions.py says so
        return
    current_a = search_current(s)
    rise = injection.search_rise_a_per_s
    if rise is not None and not current_a / RISE_MOST_S <= rise <= current_a / RISE_LEAST_S:
        text = (
            f"{with_unit(rise, 'A/s')} takes {current_a / rise:.3g} s to the search current of "
            f"{with_unit(round(current_a, 3), 'A')}, permitted {current_a / RISE_MOST_S:.3g} to "
            f"{current_a / RISE_LEAST_S:.3g} A/s"
        )
        yield Problem(s.sources.scenario, f"{KEY}.search_rise_a_per_s", text)
    share = polarity_signal(s, 1.0)
    if share <= 0.0:
        text = "is not below minus: the axis must saturate along the magnet, or the search takes the wrong pole"
        yield Problem(s.sources.motor, "saturation.plus", text)
    elif share * current_a < SEARCH_SURE:
        text = (
            f"{with_unit(round(current_a, 3), 'A')} of the search change the HF current by "
            f"{100 * share * current_a:.2g} %, permitted from {100 * SEARCH_SURE:g} % on, {SEARCH_SURE / share:.3g} A; "
            "by rule voltage, trips and a light rotor bound it: a shorter injection period or a heavier rotor permits "
            f"more, or state {KEY}.search_current_a"
        )
        yield Problem(s.sources.scenario, f"{KEY}.search_current_a", text)
