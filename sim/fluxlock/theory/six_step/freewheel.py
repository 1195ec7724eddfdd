# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Freewheel angle from the decay voltages of the outgoing phase, section 4.3.

After a commutation the current of the outgoing phase decays through a diode. Counted so that it is positive at the
commutation (instant 0), in the frame of a sector with the lower diode:

    L di/dt = -k Vdc - e(t) - R i,    e: EMF of the outgoing phase less the mean of the three

            pulse on   pulse off
    mode 1  k = 1/3    k = 2/3         (4.13), (4.14)
    mode 2  k = 1/3    k = 0           (4.20), (4.21)

e is psi w sin(150 deg + w t) for sinusoidal EMF, (4.10). "bound" keeps k = 1/3 throughout, (4.24): with mode 1 the true
angle is not above it. The thesis gives e = 2/3 psi w for trapezoidal EMF, (4.25); that holds at the commutation only,
after it the flat top has ended and e falls to zero within 30 degrees, so that (4.25) is no bound (Emf "thesis").

Neglected here: the current of the incoming phase can end in the off time, after which only two phases conduct. In
mode 2 the decay is faster then (up to 3 degrees at 60 000 r/min, 14 A); `switched` has it.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.machine import Machine

Decay = Literal["bound", "mode 1", "mode 2"]
Emf = Literal["machine", "thesis"]

ENTRY_DEG = 150.0  # theta' of the outgoing phase's own EMF at the ideal commutation
STEP_DEG = 0.05
LIMIT_DEG = 90.0  # beyond, the next commutation is long due
ON, OFF = 1.0 / 3.0, {"bound": 1.0 / 3.0, "mode 1": 2.0 / 3.0, "mode 2": 0.0}


def decay_emf(machine: Machine, angle_deg: npt.ArrayLike, emf: Emf = "machine") -> FloatArray:
    """EMF of the outgoing phase less the mean of the three, over psi * omega; positive helps the decay.

    angle_deg: since the ideal commutation. emf "thesis": (4.10) and (4.25).
    """
    angle = ENTRY_DEG + np.asarray(angle_deg, dtype=np.float64)
    if machine.emf == "trapezoidal" and emf == "thesis":
        return np.full(angle.shape, 2.0 / 3.0)
    phases = [machine.emf_shape(angle - lag) for lag in (0.0, 120.0, 240.0)]
    return np.asarray(phases[0] - sum(phases) / 3.0)


def _on_time(carriers: FloatArray, duty: FloatArray) -> FloatArray:
    """Time the pulse is on from 0 to a time, all in carriers."""
    whole = np.floor(carriers)
    return np.asarray(whole * duty + np.minimum(carriers - whole, duty))


def freewheel_angle_deg(
    machine: Machine,
    supply_v: float,
    omega: npt.ArrayLike,
    current_a: npt.ArrayLike,
    decay: Decay = "bound",
    *,
    duty: npt.ArrayLike = 1.0,
    n: npt.ArrayLike = 10.0,
    carrier_phase: npt.ArrayLike = 0.0,
    late_deg: npt.ArrayLike = 0.0,
    emf: Emf = "machine",
) -> FloatArray:
    """Angle (deg) until the current of the outgoing phase is zero; infinite if it is not within 90 degrees.

    omega: electrical speed, rad/s, above 0; current_a: at the commutation, >= 0; duty, n (carriers a sector),
    carrier_phase (0..1, carrier at the commutation, pulse from 0 to duty): modes only; late_deg: commutation after the
    ideal instant. All broadcast; the result has their shape. Steps of 0.05 degrees, exact but for the EMF's curvature.
    """
    arrays = (omega, current_a, duty, n, carrier_phase, late_deg)
    w, i, m, per_sector, phase, late = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in arrays))
    if np.any(w <= 0.0) or np.any(i < 0.0):
        raise ValueError("omega must be above 0 and current_a at least 0")
    step_s = np.radians(STEP_DEG) / w
    z = machine.r_ohm * step_s / machine.l_h
    keep = np.exp(-z)
    gain = step_s / machine.l_h * np.where(z > 0.0, -np.expm1(-z) / np.where(z > 0.0, z, 1.0), 1.0)
    found = np.where(i > 0.0, np.inf, 0.0)
    current = i.astype(np.float64)
    step_carriers = STEP_DEG / 60.0 * per_sector
    on_before = _on_time(phase, m)
    for k in range(round(LIMIT_DEG / STEP_DEG)):
        on_after = _on_time(phase + (k + 1) * step_carriers, m)
        on = (on_after - on_before) / step_carriers
        on_before = on_after
        voltage = (ON * on + OFF[decay] * (1.0 - on)) * supply_v
        help_v = machine.psi_vs * w * decay_emf(machine, late + (k + 0.5) * STEP_DEG, emf)
        following = keep * current - gain * (voltage + help_v)
        ends = (following <= 0.0) & np.isinf(found)
        part = current[ends] / (current[ends] - following[ends])
        found[ends] = (k + part) * STEP_DEG
        current = np.asarray(following)
        if np.all(np.isfinite(found)):
            break
    return found


def worst_over_carrier(
    machine: Machine,
    supply_v: float,
    omega: npt.ArrayLike,
    current_a: npt.ArrayLike,
    decay: Decay,
    *,
    duty: npt.ArrayLike,
    n: npt.ArrayLike,
    late_deg: npt.ArrayLike = 0.0,
    phases: int = 16,
) -> tuple[FloatArray, FloatArray]:
    """Least and largest freewheel angle (deg) over the carrier phase at the commutation, section 4.4.1.

    Arguments as of `freewheel_angle_deg`; phases: number of equally spaced carrier phases.
    """
    least, largest = None, None
    for phase in np.arange(phases) / phases:
        angle = freewheel_angle_deg(
            machine, supply_v, omega, current_a, decay, duty=duty, n=n, carrier_phase=phase, late_deg=late_deg
        )
        least = angle if least is None else np.minimum(least, angle)
        largest = angle if largest is None else np.maximum(largest, angle)
    assert least is not None and largest is not None, "phases must be at least 1"
    return least, largest
