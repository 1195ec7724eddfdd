# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Firmware on the host, closed over the averaged model: machines to test with, running until something holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from fluxlock.firmware import DriveSpec, InverterSpec, MotorSpec
from fluxlock.native.averaged_motor import Load
from fluxlock.native.chip import AveragedChip

MOTOR_1 = MotorSpec(
    pole_pairs=1,
    resistance_ohm=20e-3,
    inductance_h=22e-6,
    psi_vs=1e-3,
    inertia_kgm2=5e-7,
    rated_current_a=20.0,
    max_speed_rpm=100_000.0,
)
INVERTER_1 = InverterSpec(
    supply_v=25.0,
    on_resistance_ohm=2e-3,
    voltage_full_scale_v=30.0,
    current_full_scale_a=50.0,
    phase_current_trip_a=45.0,
    dc_current_trip_a=45.0,
)
FAN_1 = Load(fan_torque_nm=20e-3, fan_speed_rpm=60_000.0)
# Machines of other pole pairs, voltages and EMF, with a speed (r/min) to hold.
OTHERS = [
    (
        MotorSpec(2, 0.15, 120e-6, 5e-3, 8e-6, 10.0, 22_000.0),
        InverterSpec(48.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 60.0, 25.0, 200e-9),
        Load(0.02, 15_000, 2e-3),
        15_000,
    ),
    (
        MotorSpec(4, 0.08, 80e-6, 2.4e-3, 2e-5, 12.0, 9_000.0, "trapezoidal"),
        InverterSpec(24.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 30.0, 30.0, 200e-9),
        Load(0.12, 8_000, 3e-3),
        6_000,
    ),
    (
        MotorSpec(7, 0.06, 30e-6, 7.8e-4, 1.5e-5, 20.0, 12_000.0),
        InverterSpec(14.8, 3e-3, 0.7, 200e-9, 400e-9, 12, 1e-6, 20.0, 60.0, 200e-9),
        Load(0.10, 9_000),
        8_000,
    ),
    (
        MotorSpec(4, 0.5, 1.2e-3, 14e-3, 6e-5, 6.0, 4_000.0),
        InverterSpec(48.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 60.0, 15.0, 200e-9),
        Load(0.2, 3_000, 0.02),
        3_000,
    ),
]


@dataclass
class Bench(AveragedChip):
    """One drive on one machine."""

    motor: MotorSpec = MOTOR_1
    inverter: InverterSpec = INVERTER_1
    drive: DriveSpec = field(default_factory=DriveSpec)
    load: Load = field(default_factory=lambda: replace(FAN_1))

    def __post_init__(self) -> None:
        super().__post_init__()
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


def fault_of(bench: Bench) -> str:
    """Name of the present fault."""
    return bench.fw.command("get fault")[0].split()[1]
