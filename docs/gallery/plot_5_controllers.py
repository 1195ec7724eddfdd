# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Current controllers at a low sampling ratio
===========================================

For readers who design vector control: what happens to a step of the current when only a few samples fit into a turn?

Controller A is a vector PI that knows no delay. B and C are designed with the exact discrete model, delay included. At
20 samples per turn all three work; at 6 samples per turn A rings and couples into the other axis.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.theory.vector.controllers import KINDS, gains, step_response
from fluxlock.theory.vector.model import Sampling, SmoothMachine, coefficients

machine = SmoothMachine.from_motor(load_motor(ROOT / "motors" / "motor-1.toml"))
sampling = Sampling.at(20_000.0, 1.0)

# %%
# The reference steps by 1 A along q; what moves on d is the coupling between the axes.
figure, rows = plt.subplots(2, 2, figsize=(8, 5), sharex=True, sharey="row", layout="constrained")
for column, samples_per_turn in enumerate((20, 6)):
    omega = 2.0 * math.pi * 20_000.0 / samples_per_turn
    model = coefficients(machine, omega, sampling)
    for kind in KINDS:
        current = step_response(model, gains(kind, machine, omega, sampling), 40, step=1j)
        rows[0, column].step(np.arange(40), current.imag, where="post", label=kind)
        rows[1, column].step(np.arange(40), current.real, where="post", label=kind)
    rows[0, column].set(title=f"{samples_per_turn} samples per turn", ylim=(-0.5, 2.5))
    rows[1, column].set(xlabel="sample", ylim=(-1.5, 1.5))
rows[0, 0].set_ylabel("current on q / A")
rows[1, 0].set_ylabel("current on d / A")
rows[0, 1].legend(title="controller")
plt.show()
