# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Firmware on the host, closed over the averaged model: machines to test with, running until something holds."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fluxlock.config import Inverter, Load, Motor
from fluxlock.config.drive import Drive
from fluxlock.native import averaged_motor as am
from fluxlock.native.chip import AveragedChip
from tests.firmware import machines
from tests.firmware.machines import inverter, motor

MOTOR_1 = motor()
INVERTER_1 = inverter()
FAN_1 = Load(fan_torque_nm=20e-3, fan_speed_rpm=60_000.0)
SLOW_STAGE = {"on_resistance_ohm": 5e-3, "dead_time_s": 300e-9, "min_pulse_s": 600e-9, "divider_pole_s": 200e-9}


def small_motor(p: int, r_ohm: float, l_h: float, psi_vs: float, j_kgm2: float, rated_a: float, rpm: float) -> Motor:
    """A machine by its main values; rated_a: DC current through two phases."""
    size = {"resistance_ohm": r_ohm, "inductance_h": l_h, "psi_vs": psi_vs, "inertia_kgm2": j_kgm2}
    return motor(pole_pairs=p, **size, rated_current_a=1.1027 * rated_a, max_speed_rpm=rpm)


def stage(supply_v: float, full_v: float, full_a: float, trip_a: float, **keys: float) -> Inverter:
    scales = {"voltage_full_scale_v": full_v, "current_full_scale_a": full_a}
    return inverter(supply_v=supply_v, **scales, phase_current_a=trip_a, dc_current_a=trip_a, **(SLOW_STAGE | keys))


# Machines of other pole pairs, voltages and EMF, with a speed (r/min) to hold.
OTHERS = [
    (
        small_motor(2, 0.15, 120e-6, 5e-3, 8e-6, 10.0, 22_000.0),
        stage(48.0, 60.0, 25.0, 24.0),
        Load(fan_torque_nm=0.02, fan_speed_rpm=15_000, coulomb_nm=2e-3),
        15_000,
    ),
    (
        small_motor(4, 0.08, 80e-6, 2.4e-3, 2e-5, 12.0, 9_000.0).model_copy(update={"emf": "trapezoidal"}),
        stage(24.0, 30.0, 30.0, 28.8),
        Load(fan_torque_nm=0.12, fan_speed_rpm=8_000, coulomb_nm=3e-3),
        6_000,
    ),
    (
        small_motor(7, 0.06, 30e-6, 7.8e-4, 1.5e-5, 20.0, 12_000.0),
        stage(14.8, 20.0, 60.0, 48.0, on_resistance_ohm=3e-3, dead_time_s=200e-9, min_pulse_s=400e-9),
        Load(fan_torque_nm=0.10, fan_speed_rpm=9_000),
        8_000,
    ),
    (
        small_motor(4, 0.5, 1.2e-3, 14e-3, 6e-5, 6.0, 4_000.0),
        stage(48.0, 60.0, 15.0, 14.4),
        Load(fan_torque_nm=0.2, fan_speed_rpm=3_000, coulomb_nm=0.02),
        3_000,
    ),
]


class Bench(AveragedChip):
    """One drive on one machine."""

    def __init__(
        self,
        motor: Motor = MOTOR_1,
        inverter: Inverter = INVERTER_1,
        drive: Drive | None = None,
        load: Load = FAN_1,
        theta_rad: float = 0.4,
        speed_rpm: float = 0.0,
        model_motor: Motor | None = None,
        library: Path | None = None,
        cut_pulses: bool = False,
    ) -> None:
        told = machines.scenario(motor, inverter, drive or machines.drive(), load, theta_rad, speed_rpm)
        super().__init__(told, model_motor, library, cut_pulses)
        self.trace: list[tuple[float, float, float, int, float]] = []

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Run for a time or until a condition; true if the condition came."""
        for _ in range(round(seconds / self.tick_s)):
            self.step()
            if self.ticks % 10 == 0:
                t = self.fw.telemetry()
                self.trace.append((self.now, self.model.rpm, t.speed_rpm_q8 / 256.0, t.state, t.duty_q30 / 2**30))
            if until is not None and until():
                return True
        return False

    def until_state(self, state: str, seconds: float) -> bool:
        """Run until the drive is in a state."""
        return self.run(seconds, lambda: self.fw.state == state)

    def start(self, rpm: int, seconds: float = 2.0) -> None:
        """Boot to ready, set the speed, start; fails the test if it does not come to run."""
        assert self.until_state("ready", 0.1), f"not ready: {self.fw.command('status')}"
        assert self.fw.command(f"set speed_rpm {rpm}") == ["ok"]
        assert self.fw.command("start") == ["ok"]
        assert self.until_state("running", seconds), f"not running: {self.fw.command('status')}"


def commutation_errors_deg(bench: Bench, ticks: int = 300) -> np.ndarray:
    """How late the commutations of a span come, from the model's true angle."""
    errors = []
    s, p = bench.model.s, bench.scenario.motor.pole_pairs
    direction = 1 if s[am.OMEGA] > 0 else -1
    before = s[am.T_COMM]
    for _ in range(ticks):
        bench.step()
        if s[am.T_COMM] != before:
            before = s[am.T_COMM]
            theta_deg = math.degrees(s[am.THETA] - (s[am.T] - before) * s[am.OMEGA] * p)
            ideal_deg = (30.0 if direction > 0 else 270.0) + 60.0 * s[am.SECTOR]
            errors.append(direction * ((theta_deg + 180.0 - ideal_deg + 180.0) % 360.0 - 180.0))
    return np.array(errors)


def fault_of(bench: Bench) -> str:
    """Name of the present fault."""
    return bench.fw.command("get fault")[0].split()[1]
