# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Lines of the voltage: RSC, NSC, CSC
===================================

For readers who care about torque ripple and noise: which lines does each alignment put into the voltage?

The space vector of six-step operation has lines at the orders 1 + 6 k / q, where N = p/q is the number of carriers per
sector. With N = 25/8, RSC and NSC also make lines between the fundamental and zero: slow ripple of the torque. CSC
has none of them, because every sector is alike.
"""

from fractions import Fraction

import matplotlib.pyplot as plt
import numpy as np

from fluxlock.theory.six_step.spectrum import analytic_lines, line_numbers, weighted_distortion

ratio, duty = Fraction(25, 8), 0.6
numbers = line_numbers(ratio, 25.0)

# %%
# Weighted distortion in each title: lines divided by their order, relative to the fundamental.
figure, rows = plt.subplots(3, figsize=(8, 6), sharex=True, sharey=True, layout="constrained")
for axes, commutation in zip(rows, ("RSC", "NSC", "CSC"), strict=True):
    lines = analytic_lines(commutation, ratio, duty, numbers)
    size = np.maximum(np.abs(lines.amplitude), 1e-5)
    axes.vlines(lines.order, 1e-5, size, color="C0")
    axes.set(yscale="log", ylim=(1e-4, 1), ylabel="line / Vdc")
    axes.set_title(f"{commutation}: weighted distortion {100 * weighted_distortion(lines):.2f} %")
rows[-1].set_xlabel("order (negative: turns backwards)")
plt.show()
