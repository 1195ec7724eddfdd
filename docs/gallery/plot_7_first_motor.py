# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
First motor from a data sheet
=============================

For people who have a data sheet and want to see their motor start.

The sheet's values become a motor file, as `fluxlock motor new` writes it. The twin then starts this motor: the firmware
as a program of this machine, on an averaged inverter and motor. Gains and start-up follow from the file.
"""

import tomllib

import matplotlib.pyplot as plt

import fluxlock
from fluxlock.datasheet.convert import Sheet, motor_text
from fluxlock.datasheet.entries import BY_OPTION, read_value

sheet = {
    "poles": "4",
    "kv": "577",
    "resistance": "0.30 ohm",
    "inductance": "240 uH",
    "inertia": "80 gcm2",
    "rated-current": "10 A dc",
    "max-speed": "22000",
}
text = motor_text(Sheet("my motor", {name: read_value(BY_OPTION[name], value) for name, value in sheet.items()}))
motor = fluxlock.Motor.model_validate(tomllib.loads(text))

# %%
# The scenario of a spindle that ships, with this motor in place of its own. What differs is a key.
short = {
    "duration_s": 0.55,
    "event": [{"at_s": 0.01, "speed_rpm": 5_000.0}, {"at_s": 0.02, "command": "start"}],
    "window": [{"name": "end", "from_s": 0.50, "to_s": 0.55}],
    "expect": [],
}
run = fluxlock.simulate("scenarios/own-spindle.toml", twin=True, motor=motor, **short)
print(run.verdict.lines[0])

# %%
# Aligned, accelerated in open loop, locked on its own EMF: the drive's account of the speed beside the true one.
states = run.data.states()
figure, (upper, lower) = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, layout="constrained")
upper.plot(run.traces["t_s"], run.traces["speed_rpm"], label="true")
upper.plot(states["t_s"], states["speed_rpm"], "--", label="by the drive")
upper.set_ylabel("speed / (r/min)")
upper.legend(loc="upper left")
lower.plot(run.traces["t_s"], run.traces["ia"], linewidth=0.6)
lower.set(xlabel="time / s", ylabel="current of phase A / A")
for axes in (upper, lower):
    axes.grid(alpha=0.3)
plt.show()
