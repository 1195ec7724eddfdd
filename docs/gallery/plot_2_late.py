# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Why a late commutation gets later
=================================

For readers who want to know why fast motors fall out of step: the loop of crossing, commutation and freewheeling.

After a commutation the current of the switched-off phase runs on through a diode. While it *freewheels* it hides the
crossing. Where a commutation waits for the next carrier (RSC), a hidden crossing makes the next commutation later
still. Below a limit the error stays small; above the limit it grows without end.
"""

import matplotlib.pyplot as plt
import numpy as np

from fluxlock.theory.six_step.stability import commutation_errors_deg, freewheel_limit_deg

carriers_per_sector = 2.7
limit_deg = float(freewheel_limit_deg(carriers_per_sector))
angles_deg = limit_deg + np.array([-4.0, -0.5, 0.5, 2.0])

# %%
# One line per freewheel angle, two on either side of the closed form's limit.
errors = commutation_errors_deg(carriers_per_sector, angles_deg, 60)
figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
for angle_deg, error in zip(angles_deg, errors.T, strict=True):
    axes.plot(np.arange(1, 61), error, ".-", label=f"{angle_deg:.1f} deg")
axes.set(xlabel="commutation", ylabel="lateness / deg", ylim=(0, 120))
axes.set_title(f"RSC, {carriers_per_sector} carriers per sector: limit {limit_deg:.1f} deg")
axes.legend(title="freewheel angle")
plt.show()
