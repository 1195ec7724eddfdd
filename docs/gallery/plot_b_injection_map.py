# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Map of the injection's angle error
==================================

For readers who choose an injection scheme: how far is the angle off over speed and saliency?

The voltage of a sample acts 1.5 periods after the angle that it was computed with. So the injected axis lags, and a
machine of small saliency multiplies the lag. Yu 2022 names three sequences; `held` is the first one. It is compared
with a simulation of the loop, sample by sample.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import fluxlock
from fluxlock.base.paths import ROOT
from fluxlock.theory.injection.chain import ExactHfCurrent, HfMachine, Injection, Pll, Separator, settled_error, track

motor = fluxlock.load_motor(ROOT / "motors" / "five-phase-yu.toml")
yu = HfMachine(motor.resistance_ohm[0], motor.inductance_h[0], motor.inductance_q_h)
wave, pll = Injection(u_v=60.0, period=4, ts_s=125e-6), Pll(kp=115.0, ki=3306.0)
rpm = np.linspace(10.0, 1_200.0, 120)
saliency = np.linspace(1.05, 2.0, 96)


def held_deg(speed_rpm: float, ratio: float) -> float:
    """Error of the sequence `held` in electrical deg, nan where the loop does not settle; ratio: L_q over L_d."""
    omega = motor.omega_e(speed_rpm)
    try:
        return math.degrees(settled_error(HfMachine(yu.r_ohm, yu.ld_h, ratio * yu.ld_h), omega * wave.ts_s, "held"))
    except ValueError:
        return math.nan


# %%
# Left: the closed form. White: the loop does not settle. A machine of L_q = 1.5 L_d hardly errs, for two lags cancel.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
errors = np.array([[held_deg(speed, ratio) for speed in rpm] for ratio in saliency])
filled = left.contourf(rpm, saliency, errors, levels=np.arange(-6.0, 31.0, 3.0), extend="max")
figure.colorbar(filled, ax=left, label="angle error / deg")
left.set(xlabel="speed / (r/min)", ylabel="L_q / L_d")

# %%
# Right: the paper's machine along one line of the map, and the loop in simulation.
right.plot(rpm, [held_deg(speed, yu.lq_h / yu.ld_h) for speed in rpm], label="closed form")
tried = (100.0, 300.0, 600.0, 900.0, 1_150.0)
for speed in tried:
    omega = motor.omega_e(speed)
    current, separator = ExactHfCurrent(yu, omega, wave.ts_s), Separator(yu, wave)
    found = track(current, separator, wave, pll, omega=omega, sequence="held", seconds=0.4)
    right.plot(speed, math.degrees(found.mean), "ko", label="simulation" if speed == tried[0] else None)
right.set(xlabel="speed / (r/min)", ylabel="angle error / deg")
right.legend()
right.grid(alpha=0.3)
plt.show()
