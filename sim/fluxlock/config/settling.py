# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How long after an edge the samples of a crossing wait: `drive.zcd.settle_us`, or the rule in its place.

The rule knows two reasons to wait. The divider: 6 time constants of its pole, at least 0.4 us. The edge terms of
`[sensing.edge]`: until what an edge of the whole supply leaves in the open terminal's channel is below NOISES times the
noise of a sample. The open terminal may have an edge of its own with it: a diode that held it at a rail lets it go to
half the supply. Where the edges take more than CARRIER_SHARE of a carrier, the rule stops there: a pulse must hold
samples, and the drive stretches its carriers for them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluxlock.config.drive import Drive
from fluxlock.config.fields import with_unit
from fluxlock.config.inverter import Inverter, Sensing
from fluxlock.plant.edge_params import EdgeParams

SAMPLES_AFTER_CLAMP = 16  # at most, from a diode that lets the terminal go to the first sample that counts
SAMPLES_NEEDED = 3  # settled samples in the shortest pulse that shows a crossing
NOISES = 3.0  # of a sample's rms noise: what may be left of the edge terms
OWN_JUMP = 0.5  # of the supply: an open terminal that a diode lets go, while another leg makes the whole jump
CARRIER_SHARE = 0.15  # of a carrier, for the edge terms


@dataclass(frozen=True)
class Settling:
    """From a change of any gate to the first sample that counts. least_s: what a pulse must last for a crossing."""

    settle_s: float
    least_s: float
    reason: str


def residue_v(edge: EdgeParams, pole_s: float, jump_v: float, t_s: float) -> float:
    """Bound of what a jump (V) leaves in an open terminal's channel after t_s (s): envelopes behind the pole (V)."""

    def behind(tau_s: float) -> float:
        """exp(-t / tau_s) behind the pole."""
        if abs(tau_s - pole_s) < 1e-3 * tau_s:
            return t_s / pole_s * math.exp(-t_s / pole_s)
        own = math.exp(-t_s / tau_s)
        return tau_s / (tau_s - pole_s) * (own - (math.exp(-t_s / pole_s) if pole_s else 0.0))

    # When the slew is done, what it has sent through the pole is at most the area of the ramp over the time constant.
    late_s = t_s - edge.slew_s
    total = 0.0
    if edge.slew_s and late_s < 0.0:
        total = 1.0
    elif edge.slew_s and pole_s:
        total = min(1.0, 0.5 * edge.slew_s / pole_s) * math.exp(-late_s / pole_s)
    scale = (abs(edge.coupling) + OWN_JUMP * abs(edge.own)) / edge.reference_v
    if edge.step_v:
        total += scale * abs(edge.step_v) * behind(edge.step_tau_s)
    if edge.ring_v:
        gain = 1.0 / math.hypot(1.0 - pole_s / edge.ring_tau_s, 2.0 * math.pi * edge.ring_hz * pole_s)
        decays = math.exp(-t_s / edge.ring_tau_s) + (math.exp(-t_s / pole_s) if pole_s else 0.0)
        total += scale * abs(edge.ring_v) * gain * decays
    return total * jump_v


def edge_settling_s(sensing: Sensing, supply_v: float) -> float:
    """Time after an edge at which its terms are below NOISES times the noise of a sample (s); 0: there are none.

    The lobe does not count: it follows the edge that ends a pulse, and the samples of the next one come later.
    """
    edge = sensing.edge.params(sensing.current_full_scale_a)
    if edge is None:
        return 0.0
    wanted_v = NOISES * max(sensing.noise_lsb, 1.0) * sensing.step_v
    low, high = 0.0, 1e-2
    if residue_v(edge, sensing.divider_pole_s, supply_v, 0.0) <= wanted_v:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if residue_v(edge, sensing.divider_pole_s, supply_v, middle) > wanted_v:
            low = middle
        else:
            high = middle
    return high


def crossing_settling(drive: Drive, inverter: Inverter) -> Settling:
    """What the crossing finder waits, and why."""
    sensing = inverter.sensing
    sample_s, stated_us = sensing.sample_period_s, drive.zcd.settle_us
    needed_s = SAMPLES_NEEDED * sample_s
    if stated_us is not None:
        return Settling(1e-6 * stated_us, 1e-6 * stated_us + needed_s, "drive.zcd.settle_us")
    settle_s, reason = sensing.settling_s, "the pole of the dividers, and a sample"
    edges_s = edge_settling_s(sensing, inverter.supply_v)
    if edges_s > settle_s:
        room_s = CARRIER_SHARE / drive.carrier_hz
        reason = f"edges are below {NOISES:g} times the noise of a sample"
        if edges_s > room_s:
            reason = (
                f"{CARRIER_SHARE:.0%} of the carrier; edges need {edges_s * 1e6:.3g} us to fall below {NOISES:g} times "
                "the noise of a sample"
            )
        settle_s = max(settle_s, min(edges_s, room_s))
    return Settling(settle_s, settle_s + needed_s, reason)


def settling_text(drive: Drive, inverter: Inverter) -> str:
    """One line of what is waited, for people."""
    found = crossing_settling(drive, inverter)
    shown = with_unit(round(found.settle_s * 1e6, 2), "us")
    return f"samples of a crossing count from {shown} after a gate edge ({found.reason})"
