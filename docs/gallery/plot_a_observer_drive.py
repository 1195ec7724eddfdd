# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Observer design against the firmware
====================================

For designers of observers: does the firmware's angle err as the design says?

The design gives the steady angle error of a wrong inductance in closed form. Here the firmware runs with that wrong
value, in fixed point, at the same operating point, on the twin. Without `twin` the same call runs on the chip.
"""

import matplotlib.pyplot as plt
import numpy as np

import fluxlock
from fluxlock.clock import CLOCK_HZ
from fluxlock.config.vector_timing import vector_timing
from fluxlock.theory.vector.model import Sampling, SmoothMachine, coefficients
from fluxlock.theory.vector.observer import steady_state

# A servo motor holds 3000 r/min when its rated load comes.
short = {
    "duration_s": 0.4,
    "event": [{"at_s": 0.01, "speed_rpm": 3e3}, {"at_s": 0.02, "command": "start"}, {"at_s": 0.3, "load_factor": 10.0}],
    "window": [{"name": "rated", "from_s": 0.37, "to_s": 0.4}],
    "expect": [],
}
scenario = fluxlock.scenario_of("scenarios/vector/load-step.toml", short)

# %%
# Firmware: one run for each of five factors. The true angle is that of the rotor, which the firmware does not know.
tried = [0.8, 0.9, 1.0, 1.1, 1.2]
made = fluxlock.sweep(scenario, {"drive.motor_error.inductance": tried}, twin=True).to_dataframe()
current_a = made["rated.iq_a"].mean()
print(made[["status", "rated.angle_error_deg.mean"]])

# %%
# Design: the observer believes an inductance that is wrong by a factor. The current lies on the q axis.
machine, timing = SmoothMachine.from_motor(scenario.motor), vector_timing(scenario.drive, scenario.inverter)
sampling = Sampling.at(CLOCK_HZ / timing.sample_cycles, min(timing.delay, 1.0))
omega = scenario.motor.omega_e(3_000.0)
factors = np.linspace(0.8, 1.2, 41)
pairs = [[coefficients(one, omega, sampling) for one in (machine, machine.changed(l=f))] for f in factors]
design = [float(steady_state(machine, *pair, omega, 1j * current_a).error_deg) for pair in pairs]

figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
axes.plot(factors, design, label="design")
axes.plot(tried, made["rated.angle_error_deg.mean"], "o", label="firmware")
axes.set(xlabel="inductance in the firmware / true inductance", ylabel="angle error / deg")
axes.legend()
axes.grid(alpha=0.3)
plt.show()
