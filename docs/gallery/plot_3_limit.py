# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""
Largest freewheel angle of each commutation
===========================================

For readers who choose between RSC, NSC and CSC: how much freewheeling does each one stand?

The closed form of the stability limit over the number of carriers per sector. RSC loses most where a fraction of a
carrier is left over in each sector. A crossing that is computed back from later samples moves the limit up by 30
degrees.
"""

import matplotlib.pyplot as plt
import numpy as np

from fluxlock.theory.six_step.stability import freewheel_limit_deg

carriers = np.linspace(1.0, 8.0, 1401)

# %%
# CSC starts the carrier with the sector, NSC commutates inside a carrier: both keep the whole sector visible.
figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
axes.plot(carriers, freewheel_limit_deg(carriers), label="RSC")
axes.plot(carriers, freewheel_limit_deg(carriers, commutation="CSC"), label="NSC, CSC")
axes.plot(carriers, freewheel_limit_deg(carriers, back_computed=True), "--", label="RSC, computed back")
axes.set(xlim=(1, 8), ylim=(0, 65), xlabel="carriers per sector N", ylabel="largest freewheel angle / deg")
axes.legend(loc="lower right")
axes.grid(alpha=0.3)
plt.show()
