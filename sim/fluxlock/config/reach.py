# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Which speeds under which loads voltage and current reach, event by event."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from fluxlock.config.errors import Problem
from fluxlock.config.fields import with_unit
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import COMMUTATION_LEAST, COMMUTATION_USUAL, Motor
from fluxlock.config.scenario import Scenario
from fluxlock.config.vector_checks import lacking_vector, vector_speed

# As regulate.c: what freewheeling leaves before the crossing, of a sector and at least; its part of a sector where
# crossings are computed back; share of the EMF that drives it.
FREEWHEEL_SECTOR, FREEWHEEL_ROOM_S, FREEWHEEL_BACK = 1 / 16, 11e-6, 14 / 16
FREEWHEEL_EMF = 0.15
# The voltage that is needed is known to some percent.
FREEWHEEL_TOLERANCE = 1.03


def required_voltage(
    motor: Motor, inverter: Inverter, speed_rpm: float, torque_nm: float, commutation: float = COMMUTATION_LEAST
) -> float:
    """DC voltage that holds a speed under a load torque in six-step operation, without advance.

    Mean line EMF over a sector, ohmic drops of two phases, two switches and the supply, and the commutations. With
    COMMUTATION_LEAST the drive cannot do with less voltage, with COMMUTATION_USUAL it needs about that.
    """
    current_a = abs(torque_nm) / motor.torque_per_amp_nm
    omega = abs(motor.omega_e(speed_rpm))
    two_phases = 2 * sum(motor.resistance_ohm) / 3
    resistance = two_phases + 2 * inverter.on_resistance_ohm + inverter.supply_resistance_ohm
    return motor.line_flux_vs * omega + current_a * (resistance + commutation * omega * motor.mean_inductance_h)


@dataclass(frozen=True)
class Point:
    """What the drive is asked for from an event on. key: of the event; target: the event gives the speed."""

    key: str
    target: bool
    speed_rpm: float
    torque_nm: float
    supply_v: float

    @property
    def text(self) -> str:
        """Speed and load, as messages name them."""
        return f"{with_unit(self.speed_rpm, 'r/min')} with {self.torque_nm:.3g} N*m"


@dataclass(frozen=True)
class Lack:
    """What a point needs and does not have, in words; empty: it has that."""

    voltage: str
    current: str

    @property
    def text(self) -> str:
        """Both."""
        return " and ".join(part for part in (self.voltage, self.current) if part)


def points(s: Scenario) -> Iterator[Point]:
    """Speeds and loads by the events in the order of their times. A supply that falls on purpose asks for nothing."""
    speed_rpm, factor, supply_v = 0.0, 1.0, s.inverter.supply_v
    for i in sorted(range(len(s.event)), key=lambda i: s.event[i].at_s):
        event = s.event[i]
        target_rpm = event.speed_target_rpm
        if event.supply_v is not None:
            supply_v = event.supply_v
            continue
        if target_rpm is not None:
            speed_rpm = target_rpm
        elif event.load_factor is not None:
            factor = event.load_factor
        else:
            continue
        torque_nm = s.shaft_load.torque_nm(speed_rpm) * factor
        yield Point(f"event[{i}].{event.action}", target_rpm is not None, speed_rpm, torque_nm, supply_v)


def lack(s: Scenario, point: Point) -> Lack:
    """What a point lacks. A machine that is driven from outside, and one at rest, are no promise."""
    if s.mechanics.mode != "free" or point.speed_rpm == 0:
        return Lack("", "")
    if s.drive.method == "vector":
        return Lack(*lacking_vector(s, point.speed_rpm, point.torque_nm, point.supply_v))
    return Lack(six_step_voltage(s, point, COMMUTATION_LEAST), _six_step_current(s, point))


def _advance_deg(s: Scenario) -> float:
    """Advance of the commutations at most."""
    drive = s.drive
    return drive.advance_deg + drive.advance_deg_at_max_speed + drive.advance_deg_at_rated_current


def six_step_voltage(s: Scenario, point: Point, commutation: float) -> str:
    """Why the voltage does not hold a point; empty if it does."""
    drive = s.drive
    if _advance_deg(s) > 0:  # which takes back a part of the commutations and of the EMF
        return ""
    need_v = required_voltage(s.motor, s.inverter, point.speed_rpm, point.torque_nm, commutation)
    have_v = point.supply_v * min(1.0, drive.duty_max * _cut_pulses(s, point.speed_rpm))
    if need_v <= have_v:
        return ""
    least = "at least" if commutation == COMMUTATION_LEAST else "about"
    return (
        f"needs {least} {need_v:.1f} V (back EMF, resistance, commutations), available {have_v:.1f} V "
        "(from supply_v and drive.duty_max)"
    )


def _cut_pulses(s: Scenario, speed_rpm: float) -> float:
    """Mean over the duty, below 1: with CSC a sector's last carrier is cut at its end and its pulse is not."""
    carriers = s.drive.carrier_hz / (6 * s.motor.electrical_hz(speed_rpm))
    return math.ceil(carriers) / carriers if s.drive.commutation == "CSC" else 1.0


def _computes_back(s: Scenario) -> bool:
    """Crossings that are overridden are computed back: a key of the table of settings."""
    return bool(vars(s.drive.zcd)["compute_back"])


def freewheel_limit_a(s: Scenario, point: Point) -> float:
    """Current that freewheeling takes down before the crossing: what the drive keeps to at a point, inf without one.

    As `sw/drive/six_step/regulate.c` works it out, from the voltage that the point needs, whichever side of it permits
    more. Speed is not 0.
    """
    drive, motor = s.drive, s.motor
    if not drive.freewheel_limit or drive.hall.mode == "sensored":
        return math.inf
    sector_s = 1.0 / (6 * motor.electrical_hz(point.speed_rpm))
    room_s = min(max(FREEWHEEL_SECTOR * sector_s, FREEWHEEL_ROOM_S), sector_s / 4)
    time_s = FREEWHEEL_BACK * sector_s if _computes_back(s) else sector_s / 2 - room_s
    emf_v = motor.line_flux_vs * abs(motor.omega_e(point.speed_rpm))
    off_chops = drive.pattern == "ON-PWM"
    commutation = COMMUTATION_LEAST if off_chops else COMMUTATION_USUAL
    need_v = required_voltage(motor, s.inverter, point.speed_rpm, point.torque_nm, commutation)
    if off_chops and _advance_deg(s) > 0:  # which takes back a part of the voltage
        need_v = min(need_v, emf_v)
    on_v = min(need_v, point.supply_v)
    chopped_v = 2 * point.supply_v - on_v if off_chops else on_v
    return time_s * (chopped_v / 3 + FREEWHEEL_EMF * emf_v) / motor.mean_inductance_h


def _six_step_current(s: Scenario, point: Point) -> str:
    need_a = point.torque_nm / s.motor.torque_per_amp_nm
    if need_a > s.current_limit_a:
        return f"needs {need_a:.1f} A, permitted by drive.current_limit_a {s.current_limit_a:.1f} A"
    visible_a = freewheel_limit_a(s, point)
    if need_a <= FREEWHEEL_TOLERANCE * visible_a:
        return ""
    helps = "a higher supply_v" if s.drive.pattern == "ON-PWM" else 'drive.pattern = "ON-PWM"'
    # In shorter sectors crossings are not computed back in time either.
    if not _computes_back(s) and FREEWHEEL_SECTOR / (6 * s.motor.electrical_hz(point.speed_rpm)) >= FREEWHEEL_ROOM_S:
        helps += " or drive.zcd.compute_back = true"
    return f"needs {need_a:.3g} A, but freewheeling hides the crossing above {visible_a:.3g} A ({helps} helps)"


def _speed(s: Scenario, key: str, speed_rpm: float) -> list[Problem]:
    """A speed target alone: the machine's limit and the carriers in a sector, with vector control the ticks a turn."""
    file, problems = s.sources.scenario, []
    if abs(speed_rpm) > s.motor.max_speed_rpm:
        limit = with_unit(s.motor.max_speed_rpm, "r/min")
        text = f"{with_unit(speed_rpm, 'r/min')} is above max_speed_rpm of the motor ({limit})"
        return [Problem(file, key, text)]
    if s.drive.method == "vector":
        too_fast = vector_speed(s, speed_rpm)
        return [Problem(file, key, too_fast)] if too_fast else []
    carriers = s.drive.carrier_hz / (6 * s.motor.electrical_hz(speed_rpm)) if speed_rpm else 1.0
    if carriers < 1.0:
        needed = with_unit(6 * s.motor.electrical_hz(speed_rpm), "Hz")
        text = (
            f"{with_unit(s.drive.carrier_hz, 'Hz')} is less than one carrier a sector at "
            f"{with_unit(speed_rpm, 'r/min')}, permitted from {needed}"
        )
        problems.append(Problem(file, "drive.carrier_hz", text))
    return problems


def overloads(s: Scenario) -> list[str]:
    """Points beyond the limit of the current that the scenario accepts, a line each."""
    if not _accepted(s, "current"):
        return []
    found = ((point, lack(s, point).current) for point in points(s))
    return [f"{point.key}: {point.text} {current}" for point, current in found if current]


def _accepted(s: Scenario, limit: str) -> bool:
    """The scenario states that this limit of the drive may keep it from its speed."""
    return any(accept.what == limit for accept in s.accept)


def _refusal(s: Scenario, point: Point) -> str:
    """Why a point is out of reach and what to do; empty if it is not, or if the scenario accepts it."""
    missing = lack(s, point)
    # At the limit of the current the speed falls, and with it the voltage that it needs.
    if missing.current and _accepted(s, "current"):
        return ""
    voltage = "" if _accepted(s, "voltage") else missing.voltage
    if not voltage and not missing.current:
        return ""
    cure = '[[accept]] what = "current", or --allow-overload' if missing.current else '[[accept]] what = "voltage"'
    return f"{point.text} {Lack(voltage, missing.current).text}; on purpose: {cure}"


def _supplies(s: Scenario) -> Iterator[Problem]:
    full_v = s.inverter.sensing.voltage_full_scale_v
    for i, event in enumerate(s.event):
        if event.supply_v is not None and event.supply_v > full_v:
            full = with_unit(full_v, "V")
            text = f"{with_unit(event.supply_v, 'V')} is above sensing.voltage_full_scale_v ({full})"
            yield Problem(s.sources.scenario, f"event[{i}].supply_v", text)


def check_reach(s: Scenario) -> list[Problem]:
    """Is every speed target within reach of the voltage and the current at that time?

    One line a speed target: what else is wrong with it, also under a later load, follows from the same cause.
    """
    problems, refused = list(_supplies(s)), False
    for point in points(s):
        if point.target:
            found = _speed(s, point.key, point.speed_rpm)
            problems += found
            refused = bool(found)
        text = "" if refused else _refusal(s, point)
        if text:
            problems.append(Problem(s.sources.scenario, point.key, text))
            refused = True
    if s.initial.speed_rpm:
        problems += _speed(s, "initial.speed_rpm", s.initial.speed_rpm)
    return problems
