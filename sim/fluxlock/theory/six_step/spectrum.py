# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Line spectra of the six-step space vector under RSC, NSC and CSC, chapter 6, in closed form.

Double-sided, unit: Vdc vector. Order v = frequency / fundamental; negative orders rotate backwards. With N = p/q in
lowest terms every line lies at v = 1 + 6 k / q, (6.26). RSC and NSC are double Fourier series, (6.12) and (6.21), of
which infinitely many terms fall on each line, (6.29) and (6.31); these sums are carried out here in closed form. Where
a carrier start coincides with a commutation RSC jumps in the initial phase, and the series gives the mid-value.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from fluxlock.results.rundata import FloatArray, IntArray
from fluxlock.theory.six_step.fourier import ComplexArray
from fluxlock.theory.six_step.linearity import whole_and_rest
from fluxlock.theory.six_step.patterns import SECTORS, Commutation, check_operating_point

TURN = 2.0 * np.pi
# A phase of the lattice sums this close to a whole turn is on the jump.
SAME_PHASE = 1e-12
SECTOR_1 = np.exp(1j * np.pi / 6)  # V1 of (6.1)


@dataclass(frozen=True)
class Lines:
    """Lines of a spectrum: order [k] (multiples of the fundamental), complex amplitude [k] (unit: Vdc vector)."""

    order: FloatArray
    amplitude: ComplexArray

    @property
    def fundamental(self) -> complex:
        """Amplitude at order 1."""
        return complex(self.amplitude[np.argmin(np.abs(self.order - 1.0))])


def _pulse(duty: float, w: FloatArray) -> ComplexArray:
    """Integral of exp(-j w x) over the pulse 0 .. 2 pi M, (6.8) and (6.19): 2 pi M where w = 0."""
    return np.asarray(TURN * duty * np.exp(-1j * np.pi * duty * w) * np.sinc(duty * w), dtype=np.complex128)


def double_series(commutation: Commutation, n: float, duty: float, m: IntArray, h: IntArray) -> ComplexArray:
    """C_mn of NSC (6.12) or RSC (6.21) at the orders m N 6 + (1 + 6 h), for any real N and initial phase 0.

    m, h: broadcastable. Terms of a line that more than one (m, h) reaches (rational N) add up.
    """
    check_operating_point(n, duty)
    harmonic = 1.0 + SECTORS * np.asarray(h, dtype=np.float64)
    carrier = np.asarray(m, dtype=np.float64)
    if commutation == "CSC":
        raise ValueError("commutation = 'CSC': has no double series")
    w = carrier + harmonic / (SECTORS * n) if commutation == "RSC" else carrier + 0.0 * harmonic
    return np.asarray(_pulse(duty, w) * 6.0 / harmonic / TURN**2, dtype=np.complex128)


def _lattice(x: float, c: FloatArray) -> ComplexArray:
    """Sum over all whole l of exp(j l x) / (l + c), c not whole; the mid-value at x = 0.

    From the Fourier series of exp(-j c x) on 0 .. 2 pi.
    """
    x = x % TURN
    if min(x, TURN - x) < SAME_PHASE:
        return np.asarray(np.pi / np.tan(np.pi * c), dtype=np.complex128)
    return np.asarray(TURN * 1j * np.exp(-1j * c * x) / (1.0 - np.exp(-TURN * 1j * c)), dtype=np.complex128)


def _lattice_square(x: float, c: FloatArray) -> ComplexArray:
    """Sum over all whole l of exp(j l x) / (l + c)^2, c not whole: integral of `_lattice`."""
    x = x % TURN
    start = (np.pi / np.sin(np.pi * c)) ** 2
    return np.asarray(np.exp(-1j * c * x) * (start - TURN * x / (1.0 - np.exp(-TURN * 1j * c))), dtype=np.complex128)


def _sawtooth(x: float) -> complex:
    """Sum over whole l except 0 of exp(j l x) / l."""
    x = x % TURN
    return 0.0 if min(x, TURN - x) < SAME_PHASE else 1j * (np.pi - x)


def _bezout(ratio: Fraction, k: IntArray) -> tuple[FloatArray, FloatArray]:
    """One pair (m0, n0) with m0 p + h0 q = k, n0 = 1 + 6 h0, (6.27); others: m0 + l q, n0 - 6 l p."""
    p, q = ratio.numerator, ratio.denominator
    m0 = (k * pow(p, -1, q)) % q
    n0 = 1 + SECTORS * ((k - m0 * p) // q)
    return m0.astype(np.float64), n0.astype(np.float64)


def _rsc(ratio: Fraction, duty: float, k: IntArray, start_rad: float) -> ComplexArray:
    """(6.31): the pulse factor depends on the line only, the rest is one lattice sum."""
    p = ratio.numerator
    _, n0 = _bezout(ratio, k)
    order = 1.0 + SECTORS * k / ratio.denominator
    width = SECTORS * p
    total = np.exp(1j * n0 * start_rad) * _lattice(-width * start_rad, -n0 / width) / -width
    return np.asarray(6.0 / TURN**2 * _pulse(duty, order / (SECTORS * float(ratio))) * total, dtype=np.complex128)


def _nsc(ratio: Fraction, duty: float, k: IntArray, start_rad: float) -> ComplexArray:
    """(6.29) by partial fractions: with n = v - c m, c = 6 N, 1/(m n) = (1/m + c/n)/v; at v = 0 it is -1/(c m^2)."""
    p, q = ratio.numerator, ratio.denominator
    m0, n0 = _bezout(ratio, k)
    order = 1.0 + SECTORS * k / q
    per_turn, width = SECTORS * p / q, SECTORS * p
    baseband = k % q == 0  # the term m = 0 is on the line: it is the baseband harmonic, not part of the sums
    total = np.zeros(k.shape, dtype=np.complex128)
    for shift, sign in ((duty, 1.0), (0.0, -1.0)):
        # Factor exp(j n start) exp(-j 2 pi m shift) of a term: phase at l = 0, and advance x a step of l.
        phase = sign * np.exp(1j * (n0 * start_rad - TURN * m0 * shift))
        x = -width * start_rad - TURN * q * shift
        over_m = np.empty(k.shape, dtype=np.complex128)
        over_m[~baseband] = _lattice(x, m0[~baseband] / q) / q
        # m0 is 0 there: the sum runs over l != 0.
        over_m[baseband] = _sawtooth(x) / q
        over_n = _lattice(x, -n0 / width) / -width
        zero = order == 0.0
        total[~zero] += (phase * (over_m + per_turn * over_n))[~zero] / order[~zero]
        total[zero] -= phase[zero] * _lattice_square(x, m0[zero] / q) / (q * q * per_turn)
    lines = 6j / TURN**2 * total
    lines[baseband] += 3.0 * duty / np.pi * np.exp(1j * order[baseband] * start_rad) / order[baseband]
    return lines


def _csc(ratio: Fraction, duty: float, k: IntArray, start_rad: float) -> ComplexArray:
    """(6.39) and (6.41), the geometric sums written out: they have no 0/0 where n w_e / w_c is whole."""
    q = ratio.denominator
    lines = np.zeros(k.shape, dtype=np.complex128)
    own = k % q == 0
    n = 1.0 + SECTORS * (k[own] // q)
    pulses, rest = whole_and_rest(float(ratio))
    per_carrier = TURN / (SECTORS * float(ratio))

    def intervals(begin: FloatArray, width: float) -> ComplexArray:
        """Integral of exp(-j n y) over intervals of equal width (carriers)."""
        middle = np.exp(-1j * per_carrier * n[:, None] * (begin + width / 2)).sum(axis=1)
        return np.asarray(middle * per_carrier * width * np.sinc(per_carrier * n * width / TURN), dtype=np.complex128)

    whole = np.arange(int(pulses), dtype=np.float64)
    sector = intervals(whole, duty) + intervals(np.array([float(pulses)]), min(duty, float(rest)))
    # Six sectors, each a copy turned by 60 degrees, (6.10).
    lines[own] = 6.0 / TURN * SECTOR_1 * sector * np.exp(1j * n * start_rad)
    return lines


def analytic_lines(
    commutation: Commutation, ratio: Fraction, duty: float, k: IntArray, start_deg: float = 0.0
) -> Lines:
    """Lines at orders 1 + 6 k / q of ideal six-step operation with N = p/q carriers a sector.

    ratio: N in lowest terms; duty: 0..1; k: [n] line numbers; start_deg: initial phase phi_0 of the fundamental.
    """
    check_operating_point(float(ratio), duty)
    solve = {"RSC": _rsc, "NSC": _nsc, "CSC": _csc}[commutation]
    numbers = np.asarray(k, dtype=np.int64)
    order = 1.0 + SECTORS * numbers / ratio.denominator
    return Lines(order, solve(ratio, duty, numbers, float(np.radians(start_deg))))


def line_numbers(ratio: Fraction, max_order: float) -> IntArray:
    """Numbers k of all lines with |order| <= max_order, ascending."""
    q = ratio.denominator
    low, high = np.ceil((-max_order - 1) * q / SECTORS), np.floor((max_order - 1) * q / SECTORS)
    return np.arange(int(low), int(high) + 1, dtype=np.int64)


def weighted_distortion(lines: Lines) -> float:
    """Distortion weighted with 1/order, relative to the fundamental: sqrt(sum over v != 1 of |C_v / v|^2) / |C_1|.

    The ratio of harmonic to fundamental flux linkage, hence about that of the currents of an inductive machine (WTHD
    of section 5.4.2). Infinite if there is a line at order 0.
    """
    others = np.abs(lines.order - 1.0) > 1e-9
    order, size = lines.order[others], np.abs(lines.amplitude[others])
    if np.any(size[order == 0.0] > 1e-12):
        return float("inf")
    some = order != 0.0
    return float(np.sqrt(np.sum((size[some] / order[some]) ** 2)) / abs(lines.fundamental))
