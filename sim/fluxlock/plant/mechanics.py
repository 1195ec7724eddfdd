# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Rotor: loads, free motion, imposed speed. Kernel code: see `build.py` for its rules.

J d(omega_m)/dt = T - constant - outer - viscous omega_m - fan omega_m |omega_m| - friction. Friction is Coulomb's: it
opposes motion, and at standstill it holds against anything up to its breakaway value and never drives. Outer: the
torque that whoever leads the run holds on the shaft.
"""

from __future__ import annotations

from . import layout as L
from .vector import Vector


def ramps(s: Vector, now_s: float) -> None:
    """Set the quantities that ramp (loads, supply) to their values at a time."""
    for k in range(L.RAMPS):
        if s[L.RAMP_BUSY + k] == 0.0:
            continue
        t0 = s[L.RAMP_T0 + k]
        t1 = s[L.RAMP_T1 + k]
        if now_s >= t1:
            s[L.VALUE + k] = s[L.RAMP_V1 + k]
            s[L.RAMP_BUSY + k] = 0.0
        elif now_s <= t0:
            s[L.VALUE + k] = s[L.RAMP_V0 + k]
        else:
            part = (now_s - t0) / (t1 - t0)
            s[L.VALUE + k] = s[L.RAMP_V0 + k] + part * (s[L.RAMP_V1 + k] - s[L.RAMP_V0 + k])


def driving_torque(s: Vector, omega_m: float) -> float:
    """Torque on the rotor without friction, N*m."""
    drag = (s[L.VALUE + L.VISCOUS] + s[L.VALUE + L.FAN] * abs(omega_m)) * omega_m
    return s[L.TORQUE] - s[L.VALUE + L.CONSTANT] - s[L.OUTER_NM] - drag


def direction(s: Vector, omega_m: float, drive: float) -> float:
    """Sign of the motion that friction opposes: of the speed, at standstill of the torque; 0: friction holds."""
    if omega_m < 0.0:
        return -1.0
    if omega_m == 0.0:
        if abs(drive) <= s[L.VALUE + L.COULOMB] * s[L.STICTION_RATIO]:
            return 0.0
        return 1.0 if drive > 0.0 else -1.0
    return 1.0


def kick(s: Vector, h: float) -> None:
    """Advance a free rotor's speed by h seconds at the present torque (half of a splitting step)."""
    if s[L.MECHANICS] != L.FREE:
        return
    friction = s[L.VALUE + L.COULOMB]
    poles = s[L.POLE_PAIRS]
    omega_m = s[L.OMEGA] / poles
    drive = driving_torque(s, omega_m)
    sign = direction(s, omega_m, drive)
    if sign == 0.0:
        return
    first = (drive - sign * friction) / s[L.INERTIA]
    second = (driving_torque(s, omega_m + h * first) - sign * friction) / s[L.INERTIA]
    change = 0.5 * h * (first + second)
    after = omega_m + change
    stopped = friction > 0.0 and after * sign <= 0.0
    if s[L.ENERGY_ON] != 0.0:
        # Work on the load: what the torque put in less what the rotor kept.
        new = 0.0 if stopped else after
        mean = 0.5 * (omega_m + new)
        stored = s[L.INERTIA] * mean * (new - omega_m)
        s[L.ENERGY + L.E_LOAD] = s[L.ENERGY + L.E_LOAD] + s[L.TORQUE] * mean * h - stored
    s[L.OMEGA] = 0.0 if stopped else after * poles


def step_limit(s: Vector, now_s: float, h: float) -> float:
    """The step h, shortened for the splitting and to end at a corner of the speed profile."""
    if s[L.MECHANICS] == L.LOCKED:
        return h
    if s[L.MECHANICS] == L.IMPOSED:
        count = int(s[L.PROFILE_N])
        at = int(s[L.PROFILE_AT])
        # The corner just reached counts as passed, within rounding of the time.
        while at < count and s[L.PROFILE_T + at] <= now_s + 1e-15 + 4e-16 * abs(now_s):
            at += 1
        s[L.PROFILE_AT] = at
        if at < count and now_s + h > s[L.PROFILE_T + at]:
            h = s[L.PROFILE_T + at] - now_s
        if at == count or at == 0 or s[L.PROFILE_W + at] == s[L.PROFILE_W + at - 1]:
            return h
    if h > s[L.STEP_MAX_S]:
        h = s[L.STEP_MAX_S]
    return h


def profile_speed(s: Vector, now_s: float) -> float:
    """Imposed electrical speed on the segment in force."""
    count = int(s[L.PROFILE_N])
    at = int(s[L.PROFILE_AT])
    if count == 0:
        return s[L.OMEGA]
    if at == 0:
        return s[L.PROFILE_W]
    if at == count:
        return s[L.PROFILE_W + count - 1]
    t0 = s[L.PROFILE_T + at - 1]
    part = (now_s - t0) / (s[L.PROFILE_T + at] - t0)
    return s[L.PROFILE_W + at - 1] + part * (s[L.PROFILE_W + at] - s[L.PROFILE_W + at - 1])


def acceleration(s: Vector) -> float:
    """Change of the electrical speed a second: at the present torque, or on the imposed segment in force."""
    if s[L.MECHANICS] == L.FREE:
        omega_m = s[L.OMEGA] / s[L.POLE_PAIRS]
        drive = driving_torque(s, omega_m)
        sign = direction(s, omega_m, drive)
        if sign == 0.0:
            return 0.0
        return (drive - sign * s[L.VALUE + L.COULOMB]) / s[L.INERTIA] * s[L.POLE_PAIRS]
    at = int(s[L.PROFILE_AT])
    if s[L.MECHANICS] == L.LOCKED or at == 0 or at >= int(s[L.PROFILE_N]):
        return 0.0
    return (s[L.PROFILE_W + at] - s[L.PROFILE_W + at - 1]) / (s[L.PROFILE_T + at] - s[L.PROFILE_T + at - 1])
