# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the injection from machine, inverter and drive. Equations: docs/theory/five-phase.md.

Symbols as in vector_compiler; T_h injection period, w its angular frequency, L_d, L_q inductances that the wave meets:
with five phases L - L_13^2 / L_3, for subspace 3 carries its share.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import get_args

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.injection import SEQUENCES, Injection, InjectionMethod
from fluxlock.config.injection_rules import SEARCH_SURE, injection_loops, search_current, wave_of
from fluxlock.config.vector import Vector
from fluxlock.config.vector_timing import VectorTiming
from fluxlock.firmware.block import Value, gain
from fluxlock.firmware.design import Q16, Q17, Q21, Q22, Q25, Q29, Q30, Q32, Q36, Design

BAND_K = 0.45  # of the band-pass: its bandwidth over its frequency
LOW_K = math.sqrt(2.0)
# Mean of a rectified sine, fundamental of a triangle of height 1.
RECTIFIED, FUNDAMENTAL = 2 / math.pi, 8 / math.pi**2
NOISE_SCATTER = 4 / math.sqrt(math.pi)
CURVE_REACH = 1.25  # of the current up to which the motor file states the curve
CURVE_HZ = 200.0
ACTION = 1.5  # samples to the middle of its voltage's effect
LEAST_SHARE = 0.2  # of the expected amplitude: less is no signal
# Seen ratio of the inductances over what L_q / L_d has above 1.
DERATE_RATIO, FAULT_RATIO = 0.4, 0.1
FAULT_S = 0.01
SEARCH_S = 2e-3
SEARCH_LEAST = 0.05  # amplitude of the saliency over the expected one
# Results left out, a frame, the loop, left out at a new i_d, averaged at each: separator, others.
SEARCH_RESULTS = {"separator": (8, 16, 24, 6, 8)}
SEARCH_RESULTS_OTHERS = (6, 8, 20, 6, 8)
LOCK_IN_TIME_CONSTANTS = 4.0
HANDOVER_S = 0.02  # in which the EMF takes the injection's place


def averaged_over(time_s: float, period_s: float) -> int:
    """Shift of a mean over about a time of values every period."""
    return max(1, min(15, round(math.log2(max(2.0, time_s / period_s)))))


@dataclass(frozen=True)
class _Wave:
    """Inductances that the wave meets (H), amplitude on d that the demodulator shows (A), results a second."""

    l_d: float
    l_q: float
    expected_a: float
    results_hz: float
    hz: float

    @staticmethod
    def of(d: Design, injection: Injection, sample_s: float) -> _Wave:
        met, gamma = wave_of(d.s), injection_loops(d.s).gamma
        turned = _turned(d.machine.winding_ohm, met.l_d, d.s.drive.vector, injection, sample_s, gamma)
        # The sine reference stands where the current of an inductance does.
        shown = {
            "separator": 1.0,
            "iq": FUNDAMENTAL,
            "lock-in": FUNDAMENTAL * RECTIFIED * abs(turned),
            "conventional": FUNDAMENTAL * max(turned.real, LEAST_SHARE) / 2,
        }[injection.method]
        hz = 1 / met.period_s
        results_hz = {"separator": 2 * hz, "iq": hz}.get(injection.method, 1 / sample_s)
        # Of a result every tick the frame judges every second one.
        return _Wave(met.l_d, met.l_q, met.peak_a * shown, min(results_hz, 1 / (2 * d.tick_s)), hz)

    @property
    def ratio(self) -> float:
        """L_q / (L_q - L_d)."""
        return self.l_q / (self.l_q - self.l_d)


def _turned(r_ohm: float, l_h: float, vector: Vector, injection: Injection, sample_s: float, gamma: float) -> complex:
    """HF current over that of an inductance alone: resistance, and the regulators unless they do not see it."""
    s = 2j * math.pi / (injection.period * sample_s)
    loop_rad_s = 2 * math.pi * vector.bandwidth_hz if vector.regulator == "A" else gamma / sample_s
    open_loop = 0.0 if injection.remove else loop_rad_s / s * cmath.exp(-ACTION * sample_s * s)
    return s * l_h / (r_ohm + s * l_h) / (1 + open_loop)


def _q17(value: float, one: int = Q17) -> int:
    return max(-Q17, min(Q17 - 1, round(value * one)))


def _filter(tangent: float, k: float) -> tuple[tuple[int, int, int], bool]:
    """a1, a2, g of a trapezoidal state-variable filter; whether a2 and g are in 2^-22."""
    a1 = 1 / (1 + tangent * (tangent + k))
    fine = max(tangent, tangent * a1) < (Q17 - 1) / Q22
    one = Q22 if fine else Q17
    return (_q17(a1), _q17(tangent * a1, one), _q17(tangent, one)), fine


def _filters(injection: Injection, sample_s: float) -> dict[str, Value]:
    band, band_fine = _filter(math.tan(math.pi / injection.period), BAND_K)
    low, low_fine = _filter(math.tan(math.pi * injection.low_hz * sample_s), LOW_K)
    return {
        "injection_fine": int(band_fine) + 2 * int(low_fine),
        "injection_band": (*band, _q17(BAND_K, Q16)),
        "injection_low": low,
    }


def _search(d: Design, injection: Injection, wave: _Wave, sample_s: float) -> dict[str, Value]:
    # Of a machine that does not saturate no current tells the poles apart.
    current = search_current(d.s) if injection.search or d.s.motor.saturation else 0.0
    rise = injection.search_rise_a_per_s or current / SEARCH_S
    counts = SEARCH_RESULTS.get(injection.method, SEARCH_RESULTS_OTHERS)
    if injection.method in ("lock-in", "conventional"):
        settle = math.ceil(LOCK_IN_TIME_CONSTANTS / (2 * math.pi * injection.low_hz * sample_s))
        counts = (settle, 50, 2 * settle, settle, 50)
    least_a = SEARCH_LEAST * wave.expected_a / wave.ratio
    return {
        "injection_search": int(injection.search),
        "injection_search_results": counts,
        "injection_search_i_q25": round(current * d.ampere),
        "injection_search_rise_i_q25": max(1, round(rise * d.tick_s * d.ampere)),
        "injection_search_sure_q16": round(SEARCH_SURE * Q16),
        "injection_search_least_i_q21": round(least_a * Q21 / d.s.inverter.sensing.current_full_scale_a),
    }


def _validity(d: Design, wave: _Wave) -> dict[str, Value]:
    over = wave.l_q / wave.l_d - 1
    unit = Q21 / d.s.inverter.sensing.current_full_scale_a
    return {
        "injection_least_i_q21": round(LEAST_SHARE * wave.expected_a * unit),
        "injection_expected_i_q21": max(1, round(wave.expected_a * unit)),
        "injection_saliency_q16": round((1 + over) * Q16),
        "injection_derate_ratio_q16": round((1 + DERATE_RATIO * over) * Q16),
        "injection_fault_ratio_q16": round((1 + FAULT_RATIO * over) * Q16),
        "injection_noise_factor_q16": round(wave.ratio / NOISE_SCATTER * Q16),
        "injection_filter_shift": averaged_over(FAULT_S, 1 / wave.results_hz),
        "injection_fault_results": max(10, round(FAULT_S * wave.results_hz)),
    }


def _curve(d: Design, injection: Injection) -> dict[str, Value]:
    saturation, most_a, powers = d.s.motor.saturation, d.s.motor.rated_current_a, (0.0,) * 4
    if saturation:
        most_a, powers = saturation.angle_current_a or saturation.current_a, saturation.angle_rad
    most_a *= CURVE_REACH
    on = injection.compensation != "off"
    turns = [power * most_a**k / (2 * math.pi) if on else 0.0 for k, power in enumerate(powers)]
    current = Q29 / (most_a / d.s.inverter.sensing.current_full_scale_a * Q25)
    return {
        "injection_curve_q32": tuple(round(turn * Q32) for turn in turns),
        "injection_curve_current": gain(current, "injection_curve_current"),
        "injection_curve_filter_q16": round(-math.expm1(-2 * math.pi * CURVE_HZ * d.tick_s) * Q16),
        "injection_following": int(injection.compensation == "following"),
    }


def _third(d: Design, injection: Injection, sample_s: float) -> dict[str, Value]:
    resistance, admittance, impedance, flux = 0, 0.0, 0.0, 0.0
    third, sensing = d.s.motor.third, d.s.inverter.sensing
    if third is not None:
        inductance = (third.inductance_d_h + third.inductance_q_h) / 2
        admittance = sample_s * sensing.voltage_full_scale_v / (inductance * sensing.current_full_scale_a)
        impedance = 1 / admittance
        resistance = round(d.machine.resistance_ohm / inductance * sample_s * Q30)
        # From a speed of 2^-36 turn a clock to v_q25.
        flux = 3 * third.psi_vs * (2 * math.pi * CLOCK_HZ / Q36 * d.volt)
    return {
        "injection_third_q16": round(injection.third_ratio * Q16),
        "injection_third_resistance_q30": resistance,
        "injection_third_admittance": gain(admittance, "injection_third_admittance"),
        "injection_third_impedance": gain(impedance, "injection_third_impedance"),
        "injection_third_flux": gain(flux, "injection_third_flux"),
    }


def injection_parameters(d: Design, timing: VectorTiming) -> dict[str, Value]:
    """All parameters of the injection, none without one. Values that do not fit raise ParameterError when packed."""
    injection = d.s.drive.vector.injection
    if injection is None:
        return {}
    sample_s = timing.sample_cycles / CLOCK_HZ
    wave = _Wave.of(d, injection, sample_s)
    loss = d.machine.resistance_ohm / (2 * math.pi * wave.hz * (wave.l_q - wave.l_d))
    amplitude = injection.amplitude_v / d.s.inverter.sensing.voltage_full_scale_v
    by_emf = d.s.drive.vector.handover_rpm is not None
    return {
        "injection": 1 + get_args(InjectionMethod).index(injection.method),
        "catch": 0,
        "injection_period": injection.period,
        "injection_rate_turn_q36": round(Q36 / (injection.period * timing.sample_cycles)),
        "injection_v_q17": round(amplitude * Q17),
        "injection_remove": int(injection.remove),
        "injection_sequence": SEQUENCES.index(injection.sequence),
        "injection_ratio": gain(wave.ratio, "injection_ratio"),
        "injection_loss": gain(loss, "injection_loss"),
        "injection_fade_q16": max(1, round(d.tick_s / HANDOVER_S * Q16)) if by_emf else 0,
        "injection_speed_filter_q16": round(
            -math.expm1(-2 * math.pi * injection_loops(d.s).filter_hz * d.tick_s) * Q16
        ),
        **_filters(injection, sample_s),
        **_search(d, injection, wave, sample_s),
        **_validity(d, wave),
        **_curve(d, injection),
        **_third(d, injection, sample_s),
    }
