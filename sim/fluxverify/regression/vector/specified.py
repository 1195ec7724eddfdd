# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers of the specification that several vector cases hold against."""

from __future__ import annotations

from fluxlock.theory.vector.controllers import KINDS, Kind

# Peak of |i_q| at the samples in per cent of a step of i_d: speed and delay over f_s and T_s -> A, B, C.
_PEAKS = {
    (0.05, 0.25): (10.4, 3.9, 2.0),
    (0.05, 0.5): (15.3, 9.0, 2.8),
    (0.05, 0.75): (22.7, 15.9, 2.1),
    (0.05, 1.0): (32.4, 0.0, 0.0),
    (0.1, 0.25): (28.0, 7.5, 4.1),
    (0.1, 0.5): (40.4, 17.6, 5.7),
    (0.1, 0.75): (57.0, 31.2, 4.2),
    (0.1, 1.0): (80.3, 0.0, 0.0),
}
PEAKS_PERCENT: dict[tuple[float, float], dict[Kind, float]] = {
    point: dict(zip(KINDS, peaks, strict=True)) for point, peaks in _PEAKS.items()
}
FS_HZ = 15e3
SETTLING_SAMPLES = 7  # of C, to 5 per cent
