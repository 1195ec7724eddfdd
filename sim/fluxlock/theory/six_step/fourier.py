# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fourier coefficients of piecewise-constant signals, integrated exactly: no sampling, no window, no leakage.

Takes generated gate sequences and gate edges recorded from the chip alike. The space vector of gates is the excitation
f of (6.1): unit length while an upper and a lower switch of different legs conduct, zero while the current freewheels.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import FloatArray, IntArray
from fluxlock.theory.six_step.patterns import GateSequence

ComplexArray = npt.NDArray[np.complex128]

GATE_STATES = 64
BLOCK = 4_000_000  # matrix elements worked on at a time


def _excitation_table() -> ComplexArray:
    legs = np.exp(2j * np.pi / 3 * np.arange(3))
    state = np.arange(GATE_STATES)[:, None]
    high = (state >> 2 * np.arange(3)) & 1
    low = (state >> 2 * np.arange(3) + 1) & 1
    excited = high.any(axis=1) & low.any(axis=1)
    table: ComplexArray = np.where(excited, (high - low) @ legs / np.sqrt(3.0), 0.0)
    return table


EXCITATION = _excitation_table()


def space_vector(gates: IntArray) -> ComplexArray:
    """Excitation of gate states [k], unit: Vdc vector (length 1 for a pair of phases).

    f = (sum of a^X over conducting upper switches - the same over lower ones) / sqrt(3), a = exp(j 120 deg): A+C-
    stands at 30 degrees as in (6.1). Zero unless an upper and a lower switch are on: dead times count as freewheeling.
    """
    return np.asarray(EXCITATION[gates], dtype=np.complex128)


def line_amplitudes(at: FloatArray, values: ComplexArray, length: float, orders: FloatArray) -> ComplexArray:
    """Fourier coefficients of a signal with values[k] from at[k] to at[k + 1], the last one until `length`.

    at: [k] times in electrical turns, ascending, at[0] = 0; length: the period, in turns; orders: [n] frequencies as
    multiples of the fundamental; those must fit the period, order * length whole, for the signal to be the sum of its
    lines. Returns [n].

    c(v) = 1/T sum over edges of (value after - value before) exp(-j 2 pi v t) / (j 2 pi v), the mean at v = 0.
    """
    if at.size == 0 or at[0] != 0.0 or np.any(np.diff(at) < 0) or not length > at[-1]:
        raise ValueError("at: must start at 0, ascend and end before length")
    steps = values - np.roll(values, 1)
    mean = complex(values @ np.diff(at, append=length)) / length
    found = np.empty(orders.shape, dtype=np.complex128)
    rows = max(1, BLOCK // at.size)
    for k in range(0, orders.size, rows):
        v = orders[k : k + rows]
        sums = np.exp(-2j * np.pi * v[:, None] * at) @ steps
        zero = v == 0.0
        found[k : k + rows] = np.where(zero, mean, sums / (2j * np.pi * length * np.where(zero, 1.0, v)))
    return found


def sequence_lines(sequence: GateSequence, orders: FloatArray) -> ComplexArray:
    """Lines [n] of a generated gate sequence at the given orders [n]."""
    return line_amplitudes(sequence.at, space_vector(sequence.gates), sequence.length, orders)


def cut_edges(
    cycles: IntArray, gates: IntArray, first_cycle: float, last_cycle: float, turns: float
) -> tuple[FloatArray, IntArray]:
    """Edges of a recording between two clock cycles as times in turns from the first one.

    cycles: [k] clock cycle of each change, ascending; gates: [k] gates from then on; turns: electrical turns between
    the two cycles. Gates before the first recorded edge count as off.
    """
    if not first_cycle < last_cycle:
        raise ValueError(f"first_cycle = {first_cycle!r}: must be before last_cycle = {last_cycle!r}")
    start = int(np.searchsorted(cycles, first_cycle, side="right"))
    stop = int(np.searchsorted(cycles, last_cycle, side="left"))
    before = int(gates[start - 1]) if start else 0
    inside = (cycles[start:stop] - first_cycle) / (last_cycle - first_cycle) * turns
    return np.concatenate([[0.0], inside]), np.concatenate([[before], gates[start:stop]]).astype(np.int64)


def recorded_lines(
    cycles: IntArray, gates: IntArray, first_cycle: float, last_cycle: float, turns: int, orders: FloatArray
) -> ComplexArray:
    """Lines [n] of recorded gate edges over a whole number of turns; arguments as of `cut_edges`."""
    at, cut = cut_edges(cycles, gates, first_cycle, last_cycle, turns)
    return line_amplitudes(at, space_vector(cut), float(turns), orders)
