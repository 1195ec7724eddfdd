# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Everything the command `spectrum` shows of one commutation alignment."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from fluxlock.theory.six_step.fourier import sequence_lines
from fluxlock.theory.six_step.patterns import Commutation, GateSequence, gate_sequence
from fluxlock.theory.six_step.recording import harmonics
from fluxlock.theory.six_step.spectrum import Lines, analytic_lines, line_numbers, weighted_distortion

# The distortion needs more lines than the figure shows: their weight falls with the order squared.
DISTORTION_ORDER = 300.0


@dataclass(frozen=True)
class AlignmentSpectrum:
    """One commutation alignment at one operating point.

    lines: of the series; gates: of the generated gates, at the same orders; sequence: those gates; distortion:
    weighted; others_rms: lines other than 1 + 6 k, unit Vdc.
    """

    commutation: Commutation
    duty: float
    lines: Lines
    gates: Lines
    sequence: GateSequence
    distortion: float
    others_rms: float

    @property
    def largest_difference(self) -> float:
        """Between series and gates, unit Vdc."""
        return float(np.abs(self.lines.amplitude - self.gates.amplitude).max())


def alignment_spectrum(
    commutation: Commutation, ratio: Fraction, duty: float, start_deg: float, max_order: float
) -> AlignmentSpectrum:
    """Series and gates of an alignment up to max_order; arguments as of `analytic_lines`."""
    lines = analytic_lines(commutation, ratio, duty, line_numbers(ratio, max_order), start_deg)
    sequence = gate_sequence(commutation, float(ratio), duty, turns=ratio.denominator, start_deg=start_deg)
    wide = analytic_lines(commutation, ratio, duty, line_numbers(ratio, DISTORTION_ORDER), start_deg)
    return AlignmentSpectrum(
        commutation=commutation,
        duty=duty,
        lines=lines,
        gates=Lines(lines.order, sequence_lines(sequence, lines.order)),
        sequence=sequence,
        distortion=weighted_distortion(wide),
        others_rms=harmonics(lines)[1],
    )
