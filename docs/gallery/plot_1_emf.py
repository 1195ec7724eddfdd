# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
EMF, sectors and zero crossings
===============================

For readers who begin with six-step operation: when does which phase conduct, and where are the crossings?

Six-step operation lets two phases conduct and leaves the third one open. The EMF of the open phase changes sign in the
middle of its sector. This *zero crossing* is what the chip measures; the commutation follows 30 degrees later.
"""

import matplotlib.pyplot as plt
import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.theory.six_step.machine import Machine

motor = load_motor(ROOT / "motors" / "motor-1.toml")
machine = Machine.from_motor(motor)

# %%
# The flank of each phase crosses zero once per 180 electrical degrees.
angle = np.linspace(0.0, 360.0, 1441)
figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
for phase, shift in zip("ABC", (0.0, 120.0, 240.0), strict=True):
    axes.plot(angle, machine.emf_shape(angle - shift), label=f"phase {phase}")
for crossing in range(0, 361, 60):
    axes.plot(crossing, 0.0, "ko", markersize=5)
    axes.axvline(crossing + 30.0, color="0.7", linewidth=0.8)
axes.set(xlim=(0, 360), xticks=range(0, 361, 30), xlabel="angle of phase A's EMF / deg", ylabel="EMF / (psi omega)")
axes.set_title(f"{machine.name}: crossings (dots) and commutations (lines)")
axes.legend(loc="upper right", ncols=3)
plt.show()
