# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The whole injection drive, a control period a step, compiled by numba: converter and control on `machine`.

Called by `loop`, which makes the arguments and says what the settings mean. Angles electrical, rad; SI units.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.machine import (
    OMEGA_AT,
    THETA_AT,
    TORQUE_AT,
    InverterSet,
    MachineSet,
    advance,
    axis_tables,
    compiled,
    converted,
    leg_voltages,
    phase_current,
    scratch,
    triangle,
)

LOCK_IN, CONVENTIONAL, IQ, SEPARATOR = range(4)
# Columns of the record.
THETA, RAW, PUBLISHED, OMEGA, OMEGA_EST, I_D, I_Q, TORQUE, EPSILON, HF_D, HF_Q, I_Q_REFERENCE, AMPLITUDE = range(13)
COLUMNS = 13


class ControlSet(NamedTuple):
    """See `loop.Settings`."""

    ts: float
    substeps: int
    over: int
    method: int
    period: int
    amplitude: float
    lead: float
    report: float
    remove: int
    hold: int
    tick: int
    band_g: float
    band_k: float
    low_g: float
    low_k: float
    r: float
    l_d: float
    l_q: float
    psi: float
    l_d3: float
    l_q3: float
    psi_3: float
    third_ratio: float
    current_w: float
    gain_d: float
    gain_q: float
    integral_d: float
    integral_q: float
    decouple: int
    pll_a: float
    pll_b: float
    pll_c: float
    feed: float
    speed_p: float
    speed_i: float
    speed_filter: float
    current_limit: float
    curve_0: float
    curve_1: float
    curve_2: float
    curve_3: float
    curve_limit: float
    compensate: int
    curve_filter: float


@compiled
def biquad(g: float, k: float, state: FloatArray, at: int, x: float) -> float:
    """Trapezoidal state-variable filter with its states at `at`: v1; state[at + 1] is kept for v2."""
    a1 = 1 / (1 + g * (g + k))
    v1 = a1 * state[at] + g * a1 * (x - state[at + 1])
    v2 = state[at + 1] + g * v1
    state[at] = 2 * v1 - state[at]
    state[at + 1] = 2 * v2 - state[at + 1]
    state[at + 2] = v2
    return float(v1)


@compiled
def curve_at(c: ControlSet, i_q: float) -> float:
    """Angle of the cross-coupling curve."""
    x = min(max(i_q, -c.curve_limit), c.curve_limit)
    angle: float = c.curve_0 + x * (c.curve_1 + x * (c.curve_2 + x * c.curve_3))
    return angle


@compiled
def run(
    m: MachineSet,
    inv: InverterSet,
    c: ControlSet,
    speed_reference: FloatArray,
    current_reference: FloatArray,
    d_reference: FloatArray,
    load: FloatArray,
    coulomb: FloatArray,
    imposed: FloatArray,
    theta_0: float,
    error_0: float,
    seed: int,
) -> FloatArray:
    """Follow the drive; references and loads a step each.

    speed_reference: electrical rad/s, NaN: current control by current_reference (A). imposed: mechanical speed
    (rad/s), NaN: free. error_0: of the estimate at the start, theta_hat - theta.
    """
    np.random.seed(seed)
    steps = speed_reference.size
    out = np.zeros((steps, COLUMNS))
    n = m.phases
    cosine, sine = axis_tables(n)
    share = 2.0 / n
    planes = 2 if n == 5 else 1
    state = np.zeros(7)
    i = state[:4]
    work = scratch()
    legs = np.zeros(n)  # mean voltages that act
    legs_next = np.zeros(n)
    edges = np.zeros((2, n))
    learned = np.zeros((c.period, 2, n))  # of the next period
    excursion = np.full((c.period, 2, n), np.nan)
    older_i = np.zeros((2, n))  # sampled one and two steps before
    seen_i = np.zeros(n)
    last_i = np.zeros(n)  # a sample before
    vector = np.zeros(4)
    filters = np.zeros(12)
    sums = np.zeros(4)
    sums_known = False
    last_phase = -1
    zero = np.zeros((2, 2))  # separator: d, q of the latest two zero-crossing samples
    peak = np.zeros(2)
    zeros = 0
    peak_phase = 0
    fundamental = np.zeros(2)
    held = np.zeros(4)
    integral = np.zeros(4)
    theta = theta_0
    omega = 0.0
    if not math.isnan(imposed[0]):
        omega = imposed[0] * m.pole_pairs
    state[THETA_AT] = theta
    state[OMEGA_AT] = omega
    estimate = theta_0 + error_0  # of this sample: Park's angle
    speed = omega
    acceleration = 0.0
    filtered_speed = omega
    speed_integral = 0.0
    i_q_wanted = 0.0
    curve = 0.0
    if c.compensate:
        curve = curve_at(c, 0.0)
        estimate -= curve
    curve_current = 0.0
    epsilon = 0.0
    amplitude_d = 0.0
    omega_h = 2 * math.pi / (c.period * c.ts)
    sub_over = c.substeps // c.over
    sampled_d = 0.0
    sampled_q = 0.0
    hf_d = 0.0
    hf_q = 0.0
    torque = 0.0
    for step in range(steps):
        # Interval <step - 1, step>: the legs' voltages act; step 0 only samples.
        phase = (step - 1 + c.period // 4) % c.period
        rising = step % 2 == 0
        for piece in range(c.over if step > 0 else 1):
            if step > 0:
                first = piece * sub_over
                advance(
                    m,
                    inv,
                    state,
                    legs,
                    c.ts,
                    c.substeps,
                    first,
                    first + sub_over,
                    rising,
                    load[step],
                    coulomb[step],
                    imposed[step],
                    cosine,
                    sine,
                    work,
                    edges,
                )
                theta = state[THETA_AT]
                omega = state[OMEGA_AT]
                torque = state[TORQUE_AT]
            # Converter and demodulation: `over` samples a period, the last one at its end.
            part = (piece + 1) * sub_over / c.substeps if step > 0 else 1.0
            for x in range(n):
                seen_i[x] = converted(inv, phase_current(i, theta, planes, cosine, sine, x))
            park = estimate - (1 - part) * speed * c.ts if step > 0 else estimate
            alpha = 0.0
            beta = 0.0
            for x in range(n):
                alpha += share * cosine[0, x] * seen_i[x]
                beta += share * sine[0, x] * seen_i[x]
            sampled_d = math.cos(park) * alpha + math.sin(park) * beta
            sampled_q = math.cos(park) * beta - math.sin(park) * alpha
            hf_d = c.band_k * biquad(c.band_g, c.band_k, filters, 0, sampled_d)
            hf_q = c.band_k * biquad(c.band_g, c.band_k, filters, 3, sampled_q)
            wave = omega_h * c.ts * (step - 1 + c.period // 4 + part)
            if c.method == LOCK_IN or c.method == CONVENTIONAL:
                reference = -math.cos(wave)
                if c.method == LOCK_IN:
                    reference = 1.0 if hf_d > 0 else -1.0 if hf_d < 0 else 0.0
                biquad(c.low_g, c.low_k, filters, 6, hf_d * reference)
                biquad(c.low_g, c.low_k, filters, 9, hf_q * reference)
                amplitude_d = filters[8]
                if filters[8] > 1e-3 * c.amplitude / (omega_h * c.l_d):
                    epsilon = filters[11] / filters[8] * c.l_q / (c.l_q - c.l_d)
            elif c.method == IQ:
                if phase < last_phase:
                    if sums_known:
                        # I_q / I_d times R + j w L_q.
                        power = sums[0] * sums[0] + sums[1] * sums[1]
                        re = (sums[2] * sums[0] + sums[3] * sums[1]) / power
                        im = (sums[3] * sums[0] - sums[2] * sums[1]) / power
                        x_im = im * c.r + re * omega_h * c.l_q
                        epsilon = x_im / (omega_h * (c.l_q - c.l_d))
                        amplitude_d = 2 * math.sqrt(power) / (c.period * c.over)
                    sums_known = True
                    sums[:] = 0.0
                last_phase = phase
                sums[0] += sampled_d * math.cos(wave)
                sums[1] -= sampled_d * math.sin(wave)
                sums[2] += sampled_q * math.cos(wave)
                sums[3] -= sampled_q * math.sin(wave)
            elif part == 1.0:
                if phase % 2 == 0:
                    zero[0] = zero[1]
                    zero[1, 0] = sampled_d
                    zero[1, 1] = sampled_q
                    zeros += 1
                    fundamental[0] = sampled_d
                    fundamental[1] = sampled_q
                    if zeros >= 3:
                        sign = 1.0 if peak_phase == 1 else -1.0
                        amplitude_d = sign * (peak[0] - 0.5 * (zero[0, 0] + zero[1, 0]))
                        q = sign * (peak[1] - 0.5 * (zero[0, 1] + zero[1, 1]))
                        hf_d, hf_q = amplitude_d, q
                        epsilon = q * 4 * c.l_d * c.l_q / (c.period * c.ts * c.amplitude * (c.l_q - c.l_d))
                        out[step, HF_D] = amplitude_d
                        out[step, HF_Q] = q
                else:
                    peak[0] = sampled_d
                    peak[1] = sampled_q
                    peak_phase = phase
                    out[step, HF_D] = out[step - 1, HF_D]
                    out[step, HF_Q] = out[step - 1, HF_Q]
        # The sample of this step is taken.
        if inv.edges and step > 2:
            for x in range(n):
                for edge in range(2):
                    before = excursion[phase, edge, x]
                    new = converted(inv, edges[edge, x]) - older_i[1, x]
                    excursion[phase, edge, x] = new
                    learned[phase, edge, x] = new if math.isnan(before) else 2 * new - before
        older_i[1, :] = older_i[0]
        older_i[0, :] = seen_i
        delta = speed * c.ts
        raw = estimate + c.report * delta
        published = raw + curve if c.compensate else raw
        out[step, THETA] = theta
        out[step, RAW] = raw
        out[step, PUBLISHED] = published
        out[step, OMEGA] = omega
        out[step, OMEGA_EST] = speed
        out[step, I_D] = i[0]
        out[step, I_Q] = i[1]
        out[step, TORQUE] = torque
        out[step, EPSILON] = epsilon
        out[step, AMPLITUDE] = amplitude_d
        if c.method != SEPARATOR:
            out[step, HF_D] = hf_d
            out[step, HF_Q] = hf_q
        out[step, I_Q_REFERENCE] = i_q_wanted
        i_d, i_q = sampled_d, sampled_q
        if c.method == SEPARATOR:
            i_d, i_q = fundamental[0], fundamental[1]
        elif c.remove:
            i_d -= hf_d
            i_q -= hf_q
        # References: the published frame is turned by the curve against that of the saliency.
        turn_c, turn_s = math.cos(curve), math.sin(curve)
        w_d = d_reference[step] * turn_c - i_q_wanted * turn_s
        w_q = d_reference[step] * turn_s + i_q_wanted * turn_c
        if c.method != SEPARATOR or not c.hold or phase % 2 == 1:
            gain_t = c.ts * (2 if c.method == SEPARATOR and c.hold else 1)
            e_d, e_q = w_d - i_d, w_q - i_q
            integral[0] += gain_t * c.integral_d * e_d
            integral[1] += gain_t * c.integral_q * e_q
            held[0] = c.gain_d * e_d + integral[0]
            held[1] = c.gain_q * e_q + integral[1]
            if c.decouple:
                back_d = -speed * c.l_q * i_q_wanted
                back_q = speed * (c.l_d * d_reference[step] + c.psi)
                held[0] += back_d * turn_c - back_q * turn_s
                held[1] += back_d * turn_s + back_q * turn_c
            size = math.hypot(held[0], held[1])
            reach = (0.5257 if n == 5 else 0.5774) * inv.vdc
            most = math.sqrt(max(reach * reach - c.amplitude * c.amplitude, 0.01 * reach * reach))
            if size > most:
                integral[0] -= held[0] * (1 - most / size)
                integral[1] -= held[1] * (1 - most / size)
                held[0] *= most / size
                held[1] *= most / size
        if n == 5:
            alpha = 0.0
            beta = 0.0
            for x in range(n):
                alpha += share * cosine[1, x] * seen_i[x]
                beta += share * sine[1, x] * seen_i[x]
            angle = 3 * (estimate + curve)
            i_d3 = math.cos(angle) * alpha + math.sin(angle) * beta
            i_q3 = math.cos(angle) * beta - math.sin(angle) * alpha
            e_d, e_q = -i_d3, c.third_ratio * i_q_wanted - i_q3
            integral[2] += c.ts * c.current_w * c.r * e_d
            integral[3] += c.ts * c.current_w * c.r * e_q
            held[2] = c.current_w * c.l_d3 * e_d + integral[2]
            held[3] = c.current_w * c.l_q3 * e_q + integral[3]
            if c.decouple:
                held[3] += 3 * speed * c.psi_3
        # The voltage computed now acts on <step + 1, step + 2>.
        inject_phase = (step + 1 + c.period // 4) % c.period
        inject = c.amplitude if inject_phase < c.period // 2 else -c.amplitude
        act = estimate + c.lead * delta
        u_d, u_q = held[0] + inject, held[1]
        alpha = math.cos(act) * u_d - math.sin(act) * u_q
        beta = math.sin(act) * u_d + math.cos(act) * u_q
        third = 3 * (act + curve)
        alpha3 = math.cos(third) * held[2] - math.sin(third) * held[3]
        beta3 = math.sin(third) * held[2] + math.cos(third) * held[3]
        move = 0.0
        if inv.model:
            peak_now = c.amplitude * c.ts * c.period / (4 * c.l_d)
            turns = (step + c.period // 4) / c.period
            move = peak_now * (triangle(turns + 1.5 / c.period) - triangle(turns))
        legs[:] = legs_next
        vector[0] = alpha
        vector[1] = beta
        vector[2] = alpha3
        vector[3] = beta3
        leg_voltages(
            inv, vector, seen_i, last_i, move, estimate, rising, learned[inject_phase], c.ts, cosine, sine, legs_next
        )
        # Firmware: loop of the angle, compensation, speed.
        estimate += delta
        if step % c.tick == 0:
            t = c.ts * c.tick
            estimate += c.pll_a * epsilon
            speed += t * (acceleration + c.feed * i_q_wanted) + c.pll_b * epsilon
            acceleration += c.pll_c * epsilon
            filtered_speed += (speed - filtered_speed) * c.speed_filter
            if math.isnan(speed_reference[step]):
                i_q_wanted = current_reference[step]
            else:
                error = speed_reference[step] - filtered_speed
                wanted = c.speed_p * error + speed_integral + c.speed_i * t * error
                i_q_wanted = min(max(wanted, -c.current_limit), c.current_limit)
                if wanted == i_q_wanted:
                    speed_integral += c.speed_i * t * error
            if c.compensate:
                source = -turn_s * i_d + turn_c * i_q
                curve_current += (source - curve_current) * c.curve_filter
                new = curve_at(c, curve_current)
                if c.compensate == 2:
                    estimate -= new - curve  # the frame follows: the published angle does not jump
                curve = new
    return out
