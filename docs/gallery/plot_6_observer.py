# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Wrong motor values, wrong angle
===============================

For readers who tune an EMF observer: how far is the angle off when resistance, inductance or flux are wrong?

The observer believes a machine that differs from the true one. In steady state the angle error follows from both
models in closed form. A wrong inductance turns the angle with the current, at every speed alike. With the current on
q, a wrong resistance or flux turns nothing: the voltages of both lie in the direction of the EMF.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.theory.vector.model import Sampling, SmoothMachine, coefficients
from fluxlock.theory.vector.observer import steady_state

motor = load_motor(ROOT / "motors" / "motor-1.toml")
machine = SmoothMachine.from_motor(motor)
sampling = Sampling.at(20_000.0, 1.0)
speed_rpm = np.linspace(1_000.0, 40_000.0, 300)

# %%
# Each line is one value that is 20 % too large in the observer. Left: rated current on q. Right: 20 000 r/min.
beliefs = {
    "resistance": machine.changed(r=1.2),
    "inductance": machine.changed(l=1.2),
    "flux": machine.changed(psi=1.2),
}
rated_a = motor.rated_current_a
current_a = np.linspace(0.0, 1.5 * rated_a, 300)


def error_deg(believed: SmoothMachine, rpm: np.ndarray | float, current: np.ndarray | float) -> np.ndarray:
    """Steady angle error, electrical deg, at a speed in r/min and a current on q in A."""
    omega = np.asarray(rpm) * 2.0 * math.pi / 60.0 * motor.pole_pairs
    models = (coefficients(one, omega, sampling) for one in (machine, believed))
    return steady_state(machine, *models, omega, 1j * np.asarray(current)).error_deg


figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.8), sharey=True, layout="constrained")
for style, (name, believed) in zip(("-", "-", "--"), beliefs.items(), strict=True):
    left.plot(speed_rpm / 1000.0, error_deg(believed, speed_rpm, rated_a), style, label=name)
    right.plot(current_a, error_deg(believed, 20_000.0, current_a), style, label=name)
left.set(xlabel="speed / (1000 r/min)", ylabel="angle error / deg")
right.set(xlabel="current / A")
right.legend(title="20 % too large")
for axes in (left, right):
    axes.grid(alpha=0.3)
plt.show()
