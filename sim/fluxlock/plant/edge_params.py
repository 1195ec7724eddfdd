# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a switching edge leaves in the sense chain (`edge.py` has the equations)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .require import finite_at_least, require

AMPLITUDES = ("step_v", "ring_v", "lobe_v", "own", "coupling", "current_step_a")
TIMES = ("step_tau_s", "ring_tau_s", "lobe_s", "slew_s", "current_tau_s")


@dataclass(frozen=True)
class EdgeParams:
    """Edge terms. Amplitudes hold for a terminal that jumps by reference_v (V) and scale with the jump, sign included.

    step_v, step_tau_s: decaying step. ring_v, ring_hz, ring_tau_s: damped cosine. lobe_v, lobe_s: height and time of
    the lobe's peak, after edges at which a switch turns off. slew_s: time in which a terminal goes to its new voltage,
    in a straight line. own, coupling: share of these terms, but not of the slew, that reaches the channel of the leg
    that switches, and of each other leg. current_step_a, current_tau_s: common-mode error of the current channel of the
    leg that switches, and its time constant, with which a step of the link's current arrives too. Zero: no such term.
    """

    reference_v: float = 48.0
    step_v: float = 0.0
    step_tau_s: float = 0.0
    ring_v: float = 0.0
    ring_hz: float = 0.0
    ring_tau_s: float = 0.0
    lobe_v: float = 0.0
    lobe_s: float = 0.0
    slew_s: float = 0.0
    own: float = 0.0
    coupling: float = 1.0
    current_step_a: float = 0.0
    current_tau_s: float = 0.0

    def __post_init__(self) -> None:
        require(self.reference_v > 0.0 and math.isfinite(self.reference_v), "reference_v", self.reference_v, "above 0")
        for key in AMPLITUDES:
            require(math.isfinite(getattr(self, key)), key, getattr(self, key), "finite")
        for key in (*TIMES, "ring_hz"):
            require(finite_at_least(0.0, getattr(self, key)), key, getattr(self, key), "at least 0")
        for amplitude, others in (
            ("step_v", ("step_tau_s",)),
            ("ring_v", ("ring_hz", "ring_tau_s")),
            ("lobe_v", ("lobe_s",)),
            ("current_step_a", ("current_tau_s",)),
        ):
            for key in others if getattr(self, amplitude) != 0.0 else ():
                require(getattr(self, key) > 0.0, key, getattr(self, key), f"above 0 beside {amplitude}")
