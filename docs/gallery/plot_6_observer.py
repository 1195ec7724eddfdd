# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Wrong motor values, wrong angle
===============================

For readers who tune an EMF observer: how far is the angle off when resistance, inductance or flux are wrong?

The observer believes a machine; the true one differs. In steady state the angle error follows from both models in
closed form. An error of the inductance matters most at low speed and high current.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from fluxlock.analysis.vector.model import Sampling, SmoothMachine, coefficients
from fluxlock.analysis.vector.observer import steady_state
from fluxlock.config import load_motor
from fluxlock.paths import ROOT

motor = load_motor(ROOT / "motors" / "motor-1.toml")
machine = SmoothMachine.from_motor(motor)
sampling = Sampling.at(20_000.0, 1.0)
speed_rpm = np.linspace(5_000.0, 80_000.0, 300)
omega = speed_rpm * 2.0 * math.pi / 60.0 * motor.pole_pairs

# %%
# The drive holds the rated current on q; each line is one value that is 20 % too large in the observer.
true = coefficients(machine, omega, sampling)
beliefs = {
    "resistance": machine.changed(r=1.2),
    "inductance": machine.changed(l=1.2),
    "flux": machine.changed(psi=1.2),
}
figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
for name, believed in beliefs.items():
    rest = steady_state(machine, true, coefficients(believed, omega, sampling), omega, 1j * motor.rated_current_a)
    axes.plot(speed_rpm / 1000.0, rest.error_deg, label=f"{name} + 20 %")
axes.set(xlabel="speed / (1000 r/min)", ylabel="angle error / deg")
axes.legend()
axes.grid(alpha=0.3)
plt.show()
