# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What switching edges leave in the sense chain. Kernel code: see `build.py` for its rules.

An edge of leg y is an event at which its connection changes: a switch, a diode that begins or ends to conduct. The jump
of its terminal times `own` (channel of y itself) or `coupling` (every other leg) starts, in each voltage channel
    decaying step  s' = -s / tau_s
    ring           r' = (-1 / tau_r + i w) r, of which the channel has the real part
    lobe           m' = -m / tau_l, l' = (m - l) / tau_l: height times t / tau_l exp(1 - t / tau_l); only where the leg
                   leaves a switch
and whatever makes a terminal jump, it goes to its new voltage in a straight line within the slew time: a ramp from
minus the jump to 0. These disturb the channel, not the circuit. Their sum d passes the divider's pole, tau y' = d - y,
which being linear keeps y apart from the divider outputs of `sensing.py`.

Exact: between edges each part has a closed form, with the pole's integral of it
    lag(tau_x) = (1 / tau) int_0^h exp(-(h - u) / tau) exp(-u / tau_x) du.
The current channel of leg y gets a step in proportion to the jump, that of the link minus the step of the link's
current; both decay with the amplifier's time constant.
"""

from __future__ import annotations

import math

from . import layout as L
from .circuit import connect, couple, terminals_now
from .vector import Vector

PHASES = 3
EULER = 2.718281828459045
MOVED_V = 1e-6  # jumps below this do not begin a new ramp
SERIES_BELOW = 0.05


def lag(h: float, tau: float, other: float) -> float:
    """The pole's integral of exp(-u / other) over 0 .. h, divided by tau; without a pole its integrand at h."""
    if tau == 0.0:
        return math.exp(-h / other)
    z = h / tau - h / other
    if z > 0.0:
        return h / tau * math.exp(-h / other) * -math.expm1(-z) / z
    if z < 0.0:
        return h / tau * math.exp(-h / tau) * math.expm1(z) / z
    return h / tau * math.exp(-h / tau)


def lag_rising(h: float, tau: float, other: float) -> float:
    """The same for u / other exp(-u / other)."""
    if tau == 0.0:
        return h / other * math.exp(-h / other)
    z = h / tau - h / other
    scale = h / tau * h / other
    if z > SERIES_BELOW or z < -SERIES_BELOW:
        return scale * (math.exp(-h / other) * (z - 1.0) + math.exp(-h / tau)) / (z * z)
    # int_0^1 w exp(z w) dw = sum z^n / (n! (n + 2))
    total = 0.0
    term = 1.0
    for n in range(8):
        total += term / (n + 2)
        term = term * z / (n + 1)
    return scale * math.exp(-h / tau) * total


def advance_steps(s: Vector, h: float) -> None:
    """Decaying steps and lobes: let h seconds pass and add what passes the pole to EDGE_OUT."""
    tau = s[L.POLE_S]
    if s[L.EDGE_STEP] != 0.0:
        kept = math.exp(-h / s[L.EDGE_STEP_S])
        passed = lag(h, tau, s[L.EDGE_STEP_S])
        for x in range(PHASES):
            s[L.EDGE_OUT + x] = s[L.EDGE_OUT + x] + s[L.EDGE_STEPS + x] * passed
            s[L.EDGE_STEPS + x] = s[L.EDGE_STEPS + x] * kept
    if s[L.EDGE_LOBE] != 0.0:
        kept = math.exp(-h / s[L.EDGE_LOBE_S])
        passed = lag(h, tau, s[L.EDGE_LOBE_S])
        rising = lag_rising(h, tau, s[L.EDGE_LOBE_S])
        grown = h / s[L.EDGE_LOBE_S] * kept
        for x in range(PHASES):
            feed = s[L.EDGE_FEED + x]
            lobe = s[L.EDGE_LOBES + x]
            s[L.EDGE_OUT + x] = s[L.EDGE_OUT + x] + lobe * passed + feed * rising
            s[L.EDGE_LOBES + x] = lobe * kept + feed * grown
            s[L.EDGE_FEED + x] = feed * kept


def advance_rings(s: Vector, h: float) -> None:
    """Rings, the same: behind the pole a phasor r is r / (1 + tau lambda) and a part that decays with the pole."""
    if s[L.EDGE_RING] == 0.0:
        return
    tau = s[L.POLE_S]
    w = s[L.EDGE_RING_W]
    kept = math.exp(-h / s[L.EDGE_RING_S])
    c = kept * math.cos(w * h)
    d = kept * math.sin(w * h)
    real = 1.0 - tau / s[L.EDGE_RING_S]
    imaginary = tau * w
    size = real * real + imaginary * imaginary
    decay = math.exp(-h / tau) if tau > 0.0 else 0.0
    for x in range(PHASES):
        a = s[L.EDGE_COS + x]
        b = s[L.EDGE_SIN + x]
        begin = (a * real + b * imaginary) / size
        s[L.EDGE_COS + x] = a * c - b * d
        s[L.EDGE_SIN + x] = a * d + b * c
        end = (s[L.EDGE_COS + x] * real + s[L.EDGE_SIN + x] * imaginary) / size
        s[L.EDGE_OUT + x] = s[L.EDGE_OUT + x] + end - begin * decay


def advance_ramps(s: Vector, h: float) -> None:
    """Slewing terminals, the same."""
    tau = s[L.POLE_S]
    for x in range(PHASES):
        left = s[L.EDGE_LEFT + x]
        if left <= 0.0:
            continue
        ramp = s[L.EDGE_RAMP + x]
        lead = ramp * tau / left  # the ramp behind the pole is ahead of it by this
        within = h if h < left else left
        s[L.EDGE_LEFT + x] = left - within
        s[L.EDGE_RAMP + x] = ramp * (left - within) / left
        out = s[L.EDGE_RAMP + x]
        if tau > 0.0:
            out = out + lead - (ramp + lead) * math.exp(-within / tau)
            if h > left:
                out = out * math.exp(-(h - left) / tau)
        s[L.EDGE_OUT + x] = s[L.EDGE_OUT + x] + out


def edge_advance(s: Vector) -> None:
    """Advance all edge terms to T_BASE."""
    h = (s[L.T_BASE] - s[L.EDGE_AT]) * s[L.CLOCK_S]
    s[L.EDGE_AT] = s[L.T_BASE]
    if h > 0.0:
        decay = math.exp(-h / s[L.POLE_S]) if s[L.POLE_S] > 0.0 else 0.0
        for x in range(PHASES):
            s[L.EDGE_OUT + x] = s[L.EDGE_OUT + x] * decay
        advance_steps(s, h)
        advance_rings(s, h)
        advance_ramps(s, h)
        if s[L.EDGE_AMPERE_S] > 0.0:
            kept = math.exp(-h / s[L.EDGE_AMPERE_S])
            s[L.EDGE_DC] = s[L.EDGE_DC] * kept
            for x in range(PHASES):
                s[L.EDGE_CURRENT + x] = s[L.EDGE_CURRENT + x] * kept


def start_terms(s: Vector, y: int, jump: float) -> None:
    """Start the terms of a jump (V) of leg y."""
    off = s[L.EDGE_MODE + y] == L.HIGH or s[L.EDGE_MODE + y] == L.LOW
    s[L.EDGE_CURRENT + y] = s[L.EDGE_CURRENT + y] + s[L.EDGE_AMPERE] * jump
    for x in range(PHASES):
        share = jump * (s[L.EDGE_OWN] if x == y else s[L.EDGE_COUPLING])
        s[L.EDGE_STEPS + x] = s[L.EDGE_STEPS + x] + share * s[L.EDGE_STEP]
        s[L.EDGE_COS + x] = s[L.EDGE_COS + x] + share * s[L.EDGE_RING]
        if off:
            s[L.EDGE_FEED + x] = s[L.EDGE_FEED + x] + EULER * share * s[L.EDGE_LOBE]
        if s[L.POLE_S] == 0.0:
            s[L.EDGE_OUT + x] = s[L.EDGE_OUT + x] + share * (s[L.EDGE_STEP] + s[L.EDGE_RING])


def start_ramp(s: Vector, x: int, jump: float) -> None:
    """The terminal of leg x jumps: from where its channel sees it now it goes to its new voltage."""
    s[L.EDGE_RAMP + x] = s[L.EDGE_RAMP + x] - jump
    if jump > MOVED_V or jump < -MOVED_V:
        s[L.EDGE_LEFT + x] = s[L.EDGE_SLEW_S]
    if s[L.POLE_S] == 0.0:
        s[L.EDGE_OUT + x] = s[L.EDGE_OUT + x] - jump


def reconnect(s: Vector, gates: int) -> int:
    """Connect the legs (`circuit.connect`) and start what their edges leave in the channels."""
    if s[L.EDGE] == 0.0:
        return connect(s, gates)
    couple(s)
    terminals_now(s)
    idc = s[L.IDC]
    for x in range(PHASES):
        s[L.EDGE_VT + x] = s[L.VT + x]
        s[L.EDGE_MODE + x] = s[L.MODE + x]
    code = connect(s, gates)
    changed = False
    for x in range(PHASES):
        if s[L.MODE + x] != s[L.EDGE_MODE + x]:
            changed = True
    if code != L.OK or not changed:
        return code
    edge_advance(s)
    terminals_now(s)
    for x in range(PHASES):
        jump = s[L.VT + x] - s[L.EDGE_VT + x]
        if s[L.MODE + x] != s[L.EDGE_MODE + x]:
            start_terms(s, x, jump)
        if s[L.EDGE_SLEW_S] > 0.0:
            start_ramp(s, x, jump)
    if s[L.EDGE_AMPERE_S] > 0.0:
        s[L.EDGE_DC] = s[L.EDGE_DC] - (s[L.IDC] - idc)
    return L.OK
