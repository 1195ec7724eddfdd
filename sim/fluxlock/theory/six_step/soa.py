# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Safe operating area of sensorless six-step operation: where freewheeling leaves the crossing visible, section 4.4.

A map holds freewheel angles over current (rows) and speed (columns). Operation is safe while the angle is at most 30
degrees, 25 with the thesis's sampling; with crossings computed back, up to `usable_freewheel_deg` of `override`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fluxlock.config.motor import Motor
from fluxlock.plant import InverterParams
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.freewheel import freewheel_angle_deg
from fluxlock.theory.six_step.machine import Machine
from fluxlock.theory.six_step.override import NEXT_DEG, SampleTiming, usable_freewheel_deg
from fluxlock.theory.six_step.patterns import Chopping, Commutation
from fluxlock.theory.six_step.switched import (
    SteadyState,
    duty_for_torque,
    steady_operation,
    worst_commutation_deg,
)

Progress = Callable[[float], None]
VISIBLE_DEG, SAMPLED_DEG = 30.0, 25.0


@dataclass(frozen=True)
class SafeMap:
    """Freewheel angles over speed and current.

    speed_rpm: [s] mechanical; current_a: [c] at the commutation; angle_deg: [c, s], infinite above 90, NaN where the
    supply cannot drive the current; duty: [c, s] of the periodic state; usable_deg: [c, s] largest angle at which a
    crossing computed back still comes in time.
    """

    speed_rpm: FloatArray
    current_a: FloatArray
    angle_deg: FloatArray
    duty: FloatArray
    usable_deg: FloatArray

    def current_limit_a(self, limit_deg: npt.ArrayLike) -> FloatArray:
        """Largest current [s] with angle <= limit (a number or [c, s]), interpolated.

        NaN where no current of the map exceeds the limit (the map or the supply ends first).
        """
        excess = self.angle_deg - np.broadcast_to(np.asarray(limit_deg, dtype=np.float64), self.angle_deg.shape)
        limits = np.full(self.speed_rpm.size, np.nan)
        for s in range(self.speed_rpm.size):
            column = excess[:, s]
            above = np.flatnonzero(column > 0.0)
            if above.size == 0:
                continue
            k = int(above[0])
            if k == 0:
                limits[s] = 0.0
            elif np.isinf(column[k]):
                limits[s] = self.current_a[k - 1]
            else:
                part = -column[k - 1] / (column[k] - column[k - 1])
                limits[s] = self.current_a[k - 1] + part * (self.current_a[k] - self.current_a[k - 1])
        return limits


def supply_current_a(machine: Machine, supply_v: float, speed_rpm: npt.ArrayLike) -> FloatArray:
    """Current at which the duty of the periodic state reaches 1; 0 where the EMF alone exceeds the supply."""
    omega = machine.omega_e(speed_rpm)
    at_zero = machine.steady_duty(supply_v, omega, 0.0)
    per_ampere = machine.steady_duty(supply_v, omega, 1.0) - at_zero
    return np.asarray(np.maximum(0.0, (1.0 - at_zero) / per_ampere))


def _frame(
    machine: Machine, supply_v: float, speeds: FloatArray, currents: FloatArray, carrier_hz: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Electrical speed, carriers a sector and duty, each [c, s]."""
    omega, current = np.meshgrid(machine.omega_e(speeds), currents)
    n = np.broadcast_to(machine.carriers_per_sector(speeds, carrier_hz), omega.shape)
    return omega, n, machine.steady_duty(supply_v, omega, current)


def bound_map(
    machine: Machine,
    supply_v: float,
    speed_rpm: FloatArray,
    current_a: FloatArray,
    *,
    carrier_hz: float,
    timing: SampleTiming,
    late_deg: float = 0.0,
) -> SafeMap:
    """Map of the upper bound (4.24), which holds for ON-PWM; speeds [s], currents [c].

    late_deg: latest commutation after the ideal instant; the bound grows with it.
    """
    omega, n, duty = _frame(machine, supply_v, speed_rpm, current_a, carrier_hz)
    angle = freewheel_angle_deg(machine, supply_v, omega, current_a[:, None], late_deg=late_deg)
    usable = usable_freewheel_deg(omega, n, duty, timing, back_computed=True, late_deg=late_deg)
    return SafeMap(speed_rpm, current_a, np.where(duty <= 1.0, angle, np.nan), duty, usable)


def simulated_map(
    motor: Motor,
    inverter: InverterParams,
    speed_rpm: FloatArray,
    current_a: FloatArray,
    *,
    chopping: Chopping,
    carrier_hz: float,
    timing: SampleTiming,
    late_deg: float = 0.0,
    phases: int = 8,
    progress: Progress | None = None,
) -> SafeMap:
    """Map from the switched circuit: largest angle over the carrier phases of single commutations."""
    machine = Machine.from_motor(motor)
    omega, n, duty = _frame(machine, inverter.supply_v, speed_rpm, current_a, carrier_hz)
    angle = np.full(duty.shape, np.nan)
    reachable = np.argwhere(duty <= 1.0)
    for done, (c, s) in enumerate(reachable):
        angle[c, s] = worst_commutation_deg(
            motor,
            inverter,
            float(speed_rpm[s]),
            float(current_a[c]),
            duty=float(duty[c, s]),
            carrier_hz=carrier_hz,
            chopping=chopping,
            late_deg=late_deg,
            phases=phases,
        )
        if progress:
            progress((done + 1) / len(reachable))
    usable = usable_freewheel_deg(omega, n, duty, timing, back_computed=True, late_deg=late_deg)
    return SafeMap(speed_rpm, current_a, angle, duty, usable)


def load_line(
    motor: Motor,
    inverter: InverterParams,
    speed_rpm: FloatArray,
    *,
    chopping: Chopping,
    carrier_hz: float,
    commutation: Commutation = "NSC",
    progress: Progress | None = None,
) -> list[SteadyState | None]:
    """Periodic states at the load torque of the motor file, an entry a speed; None where the supply does not suffice.

    Figure 4.13. NSC, and all carrier phases occur, as with the thesis's commutations.
    """
    states = []
    for k, speed in enumerate(speed_rpm.tolist()):
        torque = motor.load.torque_nm(speed)
        states.append(
            duty_for_torque(
                motor,
                inverter,
                speed,
                torque,
                carrier_hz=carrier_hz,
                commutation=commutation,
                chopping=chopping,
                all_phases=True,
            )
        )
        if progress:
            progress((k + 1) / speed_rpm.size)
    return states


@dataclass(frozen=True)
class TorqueLimits:
    """Largest mean torques (N m) of the periodic state, [s] each.

    sampled: freewheel angle at most 25 degrees; visible: 30; recovered: first valid sample, plus latency, before the
    next commutation; supply: at duty 1, or where the torque no longer grows with the duty.
    """

    speed_rpm: FloatArray
    sampled_nm: FloatArray
    visible_nm: FloatArray
    recovered_nm: FloatArray
    supply_nm: FloatArray


def _largest(torque: FloatArray, value: FloatArray, limit: float) -> float:
    """Largest torque at which a value is within a limit, interpolated to the next; 0 if at none."""
    within = np.flatnonzero(value <= limit)
    if within.size == 0:
        return 0.0
    k = int(within[-1])
    if k == torque.size - 1 or np.isinf(value[k + 1]):
        return float(torque[k])
    return float(np.interp(limit, value[k : k + 2], torque[k : k + 2]))


def torque_limits(
    motor: Motor,
    inverter: InverterParams,
    speed_rpm: FloatArray,
    *,
    chopping: Chopping,
    carrier_hz: float,
    timing: SampleTiming,
    commutation: Commutation = "NSC",
    steps: int = 33,
    progress: Progress | None = None,
) -> TorqueLimits:
    """Torque limits from sweeps of the duty, at ideal commutation; steps: duties a speed."""
    machine = Machine.from_motor(motor)
    rows = []
    for k, speed in enumerate(speed_rpm.tolist()):
        omega = float(machine.omega_e(speed))
        start = float(machine.steady_duty(inverter.supply_v, omega, 0.0))
        states: list[SteadyState] = []
        for duty in np.linspace(min(start, 1.0), 1.0, steps):
            state = steady_operation(
                motor,
                inverter,
                speed,
                float(duty),
                carrier_hz=carrier_hz,
                commutation=commutation,
                chopping=chopping,
                settle_s=timing.settle_s,
                all_phases=True,
            )
            if states and state.torque_nm <= states[-1].torque_nm:
                break
            states.append(state)
        torque = np.array([state.torque_nm for state in states])
        freewheel = np.array([state.freewheel_deg.max() for state in states])
        visible = np.array([state.visible_deg.max() for state in states])
        late_deg = float(np.degrees(omega * (timing.period_s + timing.latency_s)))
        limits = [_largest(torque, freewheel, limit) for limit in (SAMPLED_DEG, VISIBLE_DEG)]
        rows.append([*limits, _largest(torque, visible, NEXT_DEG - late_deg), float(torque[-1])])
        if progress:
            progress((k + 1) / speed_rpm.size)
    return TorqueLimits(speed_rpm, *np.array(rows).T)
