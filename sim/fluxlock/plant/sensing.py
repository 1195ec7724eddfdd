# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sense chain: divider pole, noise, quantisation. Kernel code: see `build.py` for its rules.

A voltage channel is unipolar: code = V * gain / (full scale / 2^bits) + offset. A current channel is offset
binary: code = 2^(bits-1) + I / (2 full scale / 2^bits) + offset. Both then get noise, are rounded and
clipped. The virtual star point is the mean of the terminals behind the same pole, gain 1. `edge.py` adds what
switching edges leave in the channels.
"""

from __future__ import annotations

import math

from . import layout as L
from .edge import edge_advance
from .series import series_end
from .vector import IntVector, Vector

PHASES = 3
FILTER_ORDER = 5  # of the terminal voltage in a sub-interval: (angle of the step)^6 / 720 is far below a code
MASK32 = 0xFFFFFFFF


def filter_input(s: Vector, channel: int) -> int:
    """Series that feeds a filter: those of the terminals, then that of vdc."""
    return L.SERIES_D if channel == PHASES else L.SERIES_V + L.NK * channel


def filter_step(s: Vector, order: int, h: float) -> None:
    """Advance the divider outputs over a sub-interval of h seconds, exactly for a polynomial input.

    tau y' = v - y has the polynomial solution p with p_n = v_n - (tau / h) (n + 1) p_(n+1) and the decaying
    rest.
    """
    tau = s[L.POLE_S]
    if tau == 0.0:
        for x in range(PHASES + 1):
            s[L.FILTERED + x] = series_end(s, filter_input(s, x), order)
        return
    if s[L.DECAY_H] != h:
        s[L.DECAY_H] = h
        s[L.DECAY] = math.exp(-h / tau)
    decay = s[L.DECAY]
    ratio = tau / h
    top = order if order < FILTER_ORDER else FILTER_ORDER
    for x in range(PHASES + 1):
        base = filter_input(s, x)
        p = s[base + top]
        end = p
        for n in range(top - 1, -1, -1):
            p = s[base + n] - ratio * (n + 1) * p
            end += p
        s[L.FILTERED + x] = end + (s[L.FILTERED + x] - p) * decay


def mixed(x: int) -> int:
    """Bijective mixing of 32 bits. Python and compiled integers agree because every product is masked."""
    x = ((x ^ (x >> 16)) * 0x7FEB352D) & MASK32
    x = ((x ^ (x >> 15)) * 0x846CA68B) & MASK32
    return x ^ (x >> 16)


def normal_quantile(p: float) -> float:
    """Inverse of the normal distribution function, to 1e-7 (Wichura 1988, AS 241, PPND7)."""
    q = p - 0.5
    if -0.425 <= q <= 0.425:
        r = 0.180625 - q * q
        top = ((59.109374720 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179
        return q * top / (((67.187563600 * r + 78.757757664) * r + 17.895169469) * r + 1.0)
    r = math.sqrt(-math.log(p if q < 0.0 else 1.0 - p))
    if r <= 5.0:
        r = r - 1.6
        top = ((0.17023821103 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777
        z = top / ((0.12021132975 * r + 0.73700164250) * r + 1.0)
    else:
        r = r - 5.0
        top = ((0.017337203997 * r + 0.42868294337) * r + 3.0812263860) * r + 6.6579051150
        z = top / ((0.012258202635 * r + 0.24197894225) * r + 1.0)
    return -z if q < 0.0 else z


def sample_bits(s: Vector, sample: int) -> int:
    """32 bits of (seed, sample number), shared by the channels."""
    low = mixed((sample ^ int(s[L.NOISE_KEY])) & MASK32)
    high = (sample >> 32) * 0x9E3779B1
    return (low + high) & MASK32


def noise(s: Vector, channel: int, bits: int) -> float:
    """Standard normal number of (seed, channel, sample number), from `sample_bits`."""
    own = mixed(bits ^ int(s[L.NOISE_KEY + 1 + channel]))
    return normal_quantile((own + 0.5) / 4294967296.0)


def channel_value(s: Vector, channel: int) -> float:
    """Analog value of a converter channel, V or A."""
    if channel < PHASES:
        return s[L.FILTERED + channel]
    if channel < 2 * PHASES:
        return s[L.I + channel - PHASES]
    if channel == 2 * PHASES:
        return s[L.FILTERED + PHASES]
    if channel == 2 * PHASES + 1:
        return s[L.IDC]
    total = s[L.FILTERED]
    for x in range(1, PHASES):
        total += s[L.FILTERED + x]
    return total / PHASES


def edge_value(s: Vector, channel: int) -> float:
    """What the edges add to a converter channel, V or A."""
    if channel < PHASES:
        return s[L.EDGE_OUT + channel]
    if channel < 2 * PHASES:
        return s[L.EDGE_CURRENT + channel - PHASES]
    if channel == 2 * PHASES:
        return 0.0
    if channel == 2 * PHASES + 1:
        return s[L.EDGE_DC]
    total = s[L.EDGE_OUT]
    for x in range(1, PHASES):
        total += s[L.EDGE_OUT + x]
    return total / PHASES


def convert(s: Vector, io: IntVector) -> None:
    """Sample and hold: put the code of every channel into io."""
    sample = int(s[L.SAMPLE])
    s[L.SAMPLE] = s[L.SAMPLE] + 1.0
    noisy = s[L.NOISE_LSB] != 0.0
    bits = sample_bits(s, sample)
    top = s[L.ADC_MAX]
    edges = s[L.EDGE] != 0.0
    if edges:
        edge_advance(s)
    for channel in range(2 * PHASES + 3):
        source = int(s[L.SOURCE + channel])
        value = channel_value(s, source)
        if edges:
            value += edge_value(s, source)
        value = value * s[L.CODES_PER_UNIT + channel] + s[L.CODE_ZERO + channel]
        if noisy:
            value += s[L.NOISE_LSB] * noise(s, channel, bits)
        if s[L.STUCK + channel] >= 0.0:
            value = s[L.STUCK + channel]
        value += 0.5
        if value < 0.0:
            value = 0.0
        elif value > top:
            value = top
        io[channel] = int(value)
