# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Closed forms of the injection: what sets the angle error, amplitude and normalisation, cross-coupling, largest speed.

Errors are theta_hat - theta, electrical rad; machines are `HfMachine` (plane 1, L_q above L_d). delta = omega T_s.
Sources: Tian 2019, Yu 2022 with the errors of print corrected; derivations: docs/theory/five-phase.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fluxlock.theory.injection.chain import HfMachine

LoopSequence = Literal["held-tian", "held", "half-step", "exact"]
# Inverse Park ahead of Park, and reported angle ahead of Park, in delta.
LEAD_AND_REPORT: dict[LoopSequence, tuple[float, float]] = {
    "held-tian": (0.0, 0.0),
    "held": (1.0, 1.0),
    "half-step": (1.5, 1.5),
    "exact": (1.5, 0.0),
}
ACTION = 1.5  # delta from a sample to the middle of its voltage


def amplification(machine: HfMachine) -> float:
    """What a lag of the injected axis is multiplied by, small errors: (L_sum / L_dif - 1) / 2."""
    return 0.5 * (machine.sum_h / machine.difference_h - 1.0)


def lag_error(machine: HfMachine, lag: float) -> float:
    """Angle of Park against the rotor at which no HF q current is seen if the voltage acts `lag` (rad) too late.

    sin(2 x - lag) = -(L_sum / L_dif) sin(lag); about -amplification * lag. Resistance neglected. Raises ValueError if
    the loop does not settle.
    """
    s = machine.sum_h / machine.difference_h * math.sin(lag)
    if abs(s) > 1.0:
        raise ValueError(f"lag = {lag:g}: no rest, (L_sum / L_dif) sin(lag) is beyond 1")
    return 0.5 * lag - 0.5 * math.asin(s)


def sequence_error(machine: HfMachine, delta: float, sequence: LoopSequence) -> float:
    """Error of the reported angle at rest for a sequence; delta in rad, of either sign. Raises as `lag_error`."""
    lead, report = LEAD_AND_REPORT[sequence]
    return lag_error(machine, (ACTION - lead) * delta) + report * delta


def sequence_slope(machine: HfMachine, sequence: LoopSequence) -> float:
    """Its derivative at delta = 0: Tian -3.7 * 1.5, Yu's held sequence 1.25 - 0.25 L_sum / L_dif, 1.5, 0."""
    lead, report = LEAD_AND_REPORT[sequence]
    return report - amplification(machine) * (ACTION - lead)


def largest_delta(machine: HfMachine, sequence: LoopSequence) -> float:
    """The delta beyond which the loop has no rest (rad); inf where there is none."""
    lag = ACTION - LEAD_AND_REPORT[sequence][0]
    return math.inf if lag == 0.0 else math.asin(machine.difference_h / machine.sum_h) / lag


def reference_phase_error(machine: HfMachine, omega: float, omega_h: float, phase: float) -> float:
    """Error by a reference that leads the q signal by `phase` (rad): omega L_d / (omega_h L_dif) tan(phase).

    In Tian's words phase = phi_reference - phi_q, of the lock-in phi_d - phi_q: what the current regulators turn one HF
    current against the other.
    """
    return omega * machine.ld_h / (omega_h * machine.difference_h) * math.tan(phase)


def sign_grid_phase(samples: int) -> float:
    """Uncertainty of sign() on the sample grid (rad), half a sample of `samples` an injection period."""
    return math.pi / samples


def acceleration_lag(acceleration: float, ki: float) -> float:
    """Error of a second-order loop at constant acceleration (rad/s^2), ki in 1/s^2; a third-order one has none."""
    return -acceleration / ki


@dataclass(frozen=True)
class HfAmplitude:
    """Yu (5): amplitudes (A) of the triangular HF current in the estimated frame; per_rad: of q for small errors."""

    d: float
    q: float
    per_rad: float


def amplitude(machine: HfMachine, u_v: float, period_s: float, error: float = 0.0) -> HfAmplitude:
    """For a square wave of u_v (V) and its period T_h (s), resistance neglected; error = theta_hat - theta (rad)."""
    scale = period_s * u_v / (8.0 * machine.ld_h * machine.lq_h)
    d = scale * (machine.sum_h + machine.difference_h * math.cos(2 * error))
    q = -scale * machine.difference_h * math.sin(2 * error)
    return HfAmplitude(d, q, 2.0 * scale * machine.difference_h)


def normalisation(machine: HfMachine, u_v: float, period_s: float) -> float:
    """K_norm (rad/A): amplitude of q to angle for small errors."""
    return 1.0 / amplitude(machine, u_v, period_s).per_rad


def noise_error(machine: HfMachine, u_v: float, period_s: float, current_rms_a: float, phases: int) -> float:
    """Rms of the separator's angle of one peak (rad) from the rms noise of a phase current: peak and two zeros."""
    return normalisation(machine, u_v, period_s) * current_rms_a * math.sqrt(2.0 / phases) * math.sqrt(1.5)


def loop_noise(rms: float, rate_hz: float, kp: float, ki: float) -> float:
    """Rms of the angle of a second-order loop (1/s, 1/s^2) from white errors of `rms` at a rate far above it."""
    return rms * math.sqrt(0.5 * (kp + ki / kp) / rate_hz)


def cross_coupling_shift(machine: HfMachine, l_dq_h: float) -> float:
    """Error of the raw estimate by the mutual inductance of the axes: -atan(2 L_dq / L_dif) / 2."""
    return -0.5 * math.atan2(2.0 * l_dq_h, machine.difference_h)


def with_third_plane(machine: HfMachine, l_13_h: float, ld3_h: float, lq3_h: float) -> HfMachine:
    """Inductances that the injection meets if plane 3 carries its share: L - L_13^2 / L_3 on each axis."""
    return HfMachine(machine.r_ohm, machine.ld_h - l_13_h * l_13_h / ld3_h, machine.lq_h - l_13_h * l_13_h / lq3_h)


def dead_time_voltage(supply_v: float, dead_time_s: float, carrier_hz: float) -> float:
    """What a leg loses against its current (V), mean over a carrier."""
    return supply_v * dead_time_s * carrier_hz
