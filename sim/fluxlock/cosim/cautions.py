# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is permitted in a scenario and will probably not work: said before the run, which may prove the opposite."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from fluxlock.config import Problem, Scenario, load_scenario
from fluxlock.config.fields import with_unit
from fluxlock.config.least_speed import least_six_step_rpm, least_vector_rpm
from fluxlock.config.motor import COMMUTATION_USUAL
from fluxlock.config.reach import lack, points, six_step_voltage
from fluxlock.config.settling import SAMPLES_AFTER_CLAMP, crossing_settling
from fluxlock.config.vector_design import handover_rpm
from fluxlock.cosim.parameters import check_parameters, parameter_block


def _speeds(s: Scenario) -> Iterator[tuple[str, float]]:
    """Keys and values of the speeds that a scenario states."""
    if s.initial.speed_rpm:
        yield "initial.speed_rpm", s.initial.speed_rpm
    for point in points(s):
        if point.target and point.speed_rpm:
            yield point.key, point.speed_rpm


def _little_voltage(s: Scenario) -> Iterator[Problem]:
    """Six-step operation takes somewhat more voltage than the least, below which the check refuses."""
    if s.drive.method != "six-step" or s.mechanics.mode != "free":
        return
    for point in points(s):
        text = six_step_voltage(s, point, COMMUTATION_USUAL) if point.speed_rpm else ""
        if text and not lack(s, point).text:
            cure = "lower the target or the load, or raise the supply"
            yield s.sources.problem(point.key, f"{point.text} {text}; {cure}")


def _emf_beyond_the_link(s: Scenario) -> Iterator[Problem]:
    """What the diodes do with the EMF of a speed once the gates are off."""
    inverter, motor = s.inverter, s.motor
    full_v, over_v = inverter.sensing.voltage_full_scale_v, inverter.over_voltage_v
    # Largest voltage between two terminals over a turn.
    shape = 2.0 if motor.emf == "trapezoidal" else math.sqrt(3.0) if motor.phases == 3 else 2 * math.cos(math.pi / 10)
    for key, speed_rpm in _speeds(s):
        peak_v = shape * sum(motor.psi_vs) / 3 * abs(motor.omega_e(speed_rpm))
        if peak_v <= over_v:
            continue
        beyond = f"over_voltage_v of the inverter ({with_unit(over_v, 'V')})"
        beyond += f" and its converter's range ({with_unit(full_v, 'V')})" if peak_v > full_v else ""
        there = "charge the DC link to it" if inverter.dc_link_f else "brake the rotor into the supply"
        text = (
            f"{with_unit(speed_rpm, 'r/min')} has a line EMF of {peak_v:.3g} V at its peak, above {beyond}: when the "
            f"gates turn off, the diodes {there}; lower the speed, or take an inverter for that voltage"
        )
        yield s.sources.problem(key, text)
        return


def _poles_alike(s: Scenario) -> Iterator[Problem]:
    """The search of the rotor tells the magnet's poles apart by saturation."""
    injection, saturation = s.drive.vector.injection, s.motor.saturation
    if injection is None or not injection.search or (saturation and saturation.plus != saturation.minus):
        return
    text = (
        "the machine of the motor file does not saturate, so the search cannot tell the magnet's poles apart and ends "
        "in polarity_unsure; add [saturation] to the motor file, or set this to false for a rotor that stands at 0"
    )
    yield s.sources.problem("drive.vector.injection.search", text)


def _slow(s: Scenario) -> Iterator[Problem]:
    """Speeds below what a drive without a sensor holds."""
    if s.drive.vector.injection is not None or s.mechanics.mode != "free":
        return
    if s.drive.method == "vector":
        if s.drive.vector.angle == "encoder":
            return
        least_rpm, why = least_vector_rpm(s.motor, s.inverter), "the voltage of rated current hides the EMF"
        cure = "use an encoder or injection"
    else:
        if s.drive.hall.mode == "sensored":
            return
        least_rpm, why = least_six_step_rpm(s.motor), "the speed changes between two crossings"
        cure = "add inertia, or use Hall sensors"
    for key, speed_rpm in _speeds(s):
        if abs(speed_rpm) < least_rpm:
            text = f"{with_unit(speed_rpm, 'r/min')} is below {least_rpm:.0f} r/min, under which {why}; {cure}"
            yield s.sources.problem(key, text)
            return


def _raised(s: Scenario) -> Iterator[Problem]:
    """Targets that the drive raises to its least speed."""
    vector = s.drive.vector
    if s.mechanics.mode != "free" or (s.drive.method == "vector" and (vector.injection or vector.angle == "encoder")):
        return
    least_rpm = parameter_block(s).number("stop_rpm")
    if s.drive.method == "vector":
        least_rpm = max(least_rpm, math.ceil(handover_rpm(s)))
    for point in points(s):
        if point.target and 0 < abs(point.speed_rpm) < least_rpm:
            shown = with_unit(point.speed_rpm, "r/min")
            text = f"{shown} is below the least speed of the drive, {least_rpm} r/min, at which it will run; raise it"
            yield s.sources.problem(point.key, text)
            return


def _unchecked(s: Scenario) -> Iterator[Problem]:
    """Speeds at which neither an index nor the EMF would show an encoder that counts wrongly."""
    vector, encoder, motor = s.drive.vector, s.motor.encoder, s.motor
    if s.drive.method != "vector" or vector.angle != "encoder" or encoder is None or encoder.index:
        return
    floor_v = parameter_block(s).number("vector_lost_floor_v_q25") / 2**25 * s.inverter.sensing.voltage_full_scale_v
    least_rpm = 2.0 * floor_v / abs(motor.omega_e(1.0)) / (sum(motor.psi_vs) / motor.phases)
    for point in points(s):
        if point.target and 0 < abs(point.speed_rpm) < least_rpm:
            text = (
                f"{with_unit(point.speed_rpm, 'r/min')} is below {least_rpm:.0f} r/min, under which the EMF is too "
                "small to show that an encoder counts wrongly; use one with an index (motor.encoder.index)"
            )
            yield s.sources.problem(point.key, text)
            return


def _slow_filter(s: Scenario) -> Iterator[Problem]:
    """Where a diode lets the open terminal go, the chip counts a few samples in place of the settle time."""
    if s.drive.method != "six-step" or s.drive.hall.mode == "sensored" or s.drive.zcd.sampling != "continuous":
        return
    settling, most_s = crossing_settling(s.drive, s.inverter), SAMPLES_AFTER_CLAMP * s.inverter.sensing.sample_period_s
    if settling.settle_s > most_s:
        text = (
            f"samples of a crossing count from {settling.settle_s * 1e6:.3g} us after an edge, but from "
            f"{most_s * 1e6:.3g} us on after a diode lets the terminal go: crossings may come early there; take a "
            "quicker filter (fluxlock inverter advise) or slower samples"
        )
        yield s.sources.problem("inverter.sensing.divider_pole_s", text)


def cautions(s: Scenario) -> list[Problem]:
    """Each by file and key, with what to do."""
    checks = (_little_voltage, _emf_beyond_the_link, _poles_alike, _slow, _raised, _unchecked, _slow_filter)
    return [problem for check in checks for problem in check(s)]


def checked(path: Path, set_: Iterable[str] = (), allow_overload: bool = False) -> Scenario:
    """A scenario that the firmware takes; what will probably not work is said on the error output."""
    loaded = load_scenario(path, set_, allow_overload=allow_overload)
    check_parameters(loaded)
    for problem in cautions(loaded):
        print(f"warning: {problem}", file=sys.stderr, flush=True)
    return loaded
