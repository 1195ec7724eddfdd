# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Sweep of a spindle
==================

For people who ask how an error of the drive depends on a value of the machine or on a setting.

A grid of one motor value and one setting. Each point is a run of its own on the twin, and one row of the table. A
call with `scheduler="tcp://..."` runs the points on Dask workers, and without `twin` on the chip.
"""

import matplotlib.pyplot as plt

import fluxlock

# A rotor that turns already is caught: the shortest run that holds a speed.
short = {
    "duration_s": 0.12,
    "initial.speed_rpm": 14_000.0,
    "event": [{"at_s": 0.004, "speed_rpm": 15_000.0}, {"at_s": 0.005, "command": "start"}],
    "window": [{"name": "held", "from_s": 0.08, "to_s": 0.12}],
    "expect": [],
}
scenario = fluxlock.scenario_of("scenarios/own-spindle.toml", short)
made = fluxlock.sweep(
    scenario,
    {"drive.commutation": ["RSC", "CSC"], "motor.inductance_h": [60e-6, 90e-6, 120e-6, 150e-6]},
    twin=True,
)
table = made.to_dataframe()
print(table[["drive.commutation", "motor.inductance_h", "status"]])

# %%
# Error of the commutation instant, rms over the window, for each way to commutate.
figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
for name, rows in table.groupby("drive.commutation", sort=False):
    axes.plot(rows["motor.inductance_h"] * 1e6, rows["held.commutation_error_deg.rms"], "o-", label=name)
axes.set(xlabel="inductance of a phase / uH", ylabel="commutation error, rms / deg")
axes.set_ylim(bottom=0.0)
axes.legend()
axes.grid(alpha=0.3)
plt.show()
