# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a scenario leaves open of vector control and what limits its voltage. Equations: docs/theory/vector.md."""

from __future__ import annotations

import math

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.inverter import Inverter
from fluxlock.config.machine import Machine
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Scenario
from fluxlock.config.vector import Vector
from fluxlock.config.vector_timing import VectorTiming

# Share of the start current's torque with which the forced frame accelerates: the rest is the margin against load.
START_TORQUE_SHARE = 0.3
START_CURRENT_SHARE = 0.35  # of the rated current
# Hand-over: EMF over the converter's step and over the drop of the start current in R; speed over the highest.
HANDOVER_LSB = 40.0
HANDOVER_DROPS = 3.0
HANDOVER_SPEED_SHARE = 0.1
HANDOVER_SPEED_LIMIT = 0.3
WEAKENING_CURRENT_SHARE = 0.8
# Of the current loop's bandwidth gamma / T_s, the least decay of what regulator C does not know: docs/theory/vector.md.
DAMPING_SHARE = 0.125
ENCODER_QUARTERS_MIN = 36  # an electrical turn: a coarser encoder is left aside


def told_machine(s: Scenario) -> Machine:
    """The machine of a scenario as its firmware is told it."""
    return Machine.of(s.motor, s.inverter, s.drive.motor_error)


def told_lines(s: Scenario) -> int:
    """Lines of the encoder as the drive knows them; 0: there is none."""
    return round(s.motor.encoder.lines * s.drive.motor_error.encoder_lines) if s.motor.encoder else 0


def start_current_a(s: Scenario) -> float:
    """Amplitude of the current that aligns and pulls the rotor along (A)."""
    if s.drive.vector.start_current_a is not None:
        return s.drive.vector.start_current_a
    return min(START_CURRENT_SHARE * s.motor.rated_current_a, 0.6 * s.current_limit_a)


def start_accel_rpm_per_s(s: Scenario) -> float:
    """Acceleration of the forced frame, mechanical (r/min/s)."""
    if s.drive.vector.start_accel_rpm_per_s is not None:
        return s.drive.vector.start_accel_rpm_per_s
    torque_nm = told_machine(s).torque_nm_per_a * start_current_a(s)
    return START_TORQUE_SHARE * torque_nm / s.motor.inertia_kgm2 * RPM_PER_RAD_S


def handover_rpm(s: Scenario) -> float:
    """Speed of the hand-over, mechanical (r/min)."""
    if s.drive.vector.handover_rpm is not None:
        return s.drive.vector.handover_rpm
    m = told_machine(s)
    drop_v = m.resistance_ohm * start_current_a(s)
    least_v = max(HANDOVER_LSB * s.inverter.sensing.step_v, HANDOVER_DROPS * drop_v)
    omega = max(least_v / m.fundamental_vs, HANDOVER_SPEED_SHARE * m.omega_max)
    return min(omega, HANDOVER_SPEED_LIMIT * m.omega_max) / s.motor.pole_pairs * RPM_PER_RAD_S


def regulator_damping(machine: Machine, vector: Vector, sample_s: float) -> float:
    """Zero of regulator C over the machine's pole: as if R were R' = max(R, 0.125 gamma L / T_s).

    Where something else tells the angle (encoder, injection) and where the axes differ it stays on the pole.
    """
    if vector.regulator != "C" or vector.angle == "encoder" or vector.injection or machine.saliency_h:
        return 1.0
    decay = machine.resistance_ohm / machine.inductance_h * sample_s
    return math.exp(min(0.0, decay - DAMPING_SHARE * vector.gamma))


def dead_time_cycles(inverter: Inverter) -> int:
    """Dead time of the chip."""
    return max(2, math.ceil(inverter.dead_time_s * CLOCK_HZ - 1e-6))


def min_pulse_cycles(inverter: Inverter) -> int:
    """Shortest pulse of the chip."""
    return max(1, math.ceil(inverter.min_pulse_s * CLOCK_HZ - 1e-6))


def margin_cycles(inverter: Inverter) -> int:
    """Least time of each switch in a carrier: the shortest pulse after the dead time has been taken off."""
    return dead_time_cycles(inverter) + min_pulse_cycles(inverter)


def linear_voltage(phases: int) -> float:
    """Largest amplitude of the phase voltage without distortion over vdc: 1 / sqrt(3), of five phases 0.5257."""
    return 0.5 / math.cos(math.pi / (2 * phases))


def circle(inverter: Inverter, timing: VectorTiming) -> float:
    """Largest voltage over the linear one: what the margins leave."""
    return 1.0 - 2.0 * margin_cycles(inverter) / timing.carrier_cycles
