# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
A paper's figure, made again and varied
=======================================

For readers of a paper who ask: what does its figure say about my machine and my speed?

Tian 2019 maps the least injection frequency over wrong inductances and a wrong angle, for one machine at one speed. The
rule is a function of the package, so the figure takes three lines. The second panel varies it: the same machine at more
speeds. The third one has another machine.
"""

import matplotlib.pyplot as plt
import numpy as np

import fluxlock
from fluxlock.base.paths import ROOT
from fluxlock.theory.injection.frequency import Rule, bound_map


def rule_and_speed(name: str, rpm: float) -> tuple[Rule, float]:
    """Rule of a shipped motor, and its electrical speed in rad/s."""
    motor = fluxlock.load_motor(ROOT / "motors" / f"{name}.toml")
    return Rule.from_motor(motor), motor.omega_e(rpm)


# %%
# Left: the paper's figure 4. Each colour is one least frequency. Middle: the worst corner grows slowly with the speed;
# without an error the speed does not count. Right: the machine that ships as an example of saliency.
figure, (paper, speeds, other) = plt.subplots(1, 3, figsize=(11, 3.8), layout="constrained")
for axes, name, rpm in ((paper, "five-phase-tian", 100.0), (other, "ipm-4pp", 300.0)):
    found = bound_map(*rule_and_speed(name, rpm))
    filled = axes.contourf(found.angle_deg, found.inductance_percent, found.bound_hz, levels=12)
    figure.colorbar(filled, ax=axes, label="least frequency / Hz")
    axes.set(xlabel="angle error / deg", ylabel="error of the inductances / %", title=f"{name}, {rpm:g} r/min")

rpm = np.linspace(10.0, 300.0, 30)
maps = [bound_map(*rule_and_speed("five-phase-tian", each)).bound_hz for each in rpm]
speeds.plot(rpm, [one.max() for one in maps], label="worst error")
speeds.plot(rpm, [one[one.shape[0] // 2, one.shape[1] // 2] for one in maps], label="no error")
speeds.set(xlabel="speed / (r/min)", ylabel="least frequency / Hz", title="five-phase-tian")
speeds.legend()
speeds.grid(alpha=0.3)
plt.show()
