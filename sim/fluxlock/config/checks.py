"""Checks of a scenario across its three files: what each file alone cannot know."""

from __future__ import annotations

from fluxlock.config.errors import Problem, did_you_mean
from fluxlock.config.fields import with_unit
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import Motor
from fluxlock.config.scenario import METRICS, Scenario


def required_voltage(motor: Motor, inverter: Inverter, speed_rpm: float, torque_nm: float) -> float:
    """Least DC voltage that holds a speed under a load torque in six-step operation.

    Mean line EMF over a sector plus the ohmic drops of two phases, two switches and the supply. Commutation
    costs some more, so a scenario above this bound cannot work; one just below it may still not.
    """
    current_a = abs(torque_nm) / motor.torque_per_amp_nm
    two_phases = 2 * sum(motor.resistance_ohm) / 3
    resistance = two_phases + 2 * inverter.on_resistance_ohm + inverter.supply_resistance_ohm
    return motor.line_flux_vs * abs(motor.omega_e(speed_rpm)) + current_a * resistance


def _times(s: Scenario) -> list[Problem]:
    file, problems = s.sources.scenario, []
    end = f"duration_s = {s.duration_s:g} s"
    for i, event in enumerate(s.event):
        if event.at_s + event.ramp_s > s.duration_s:
            text = f"{event.at_s + event.ramp_s:g} s is after the end of the run ({end})"
            problems.append(Problem(file, f"event[{i}].{'ramp_s' if event.ramp_s else 'at_s'}", text))
    names: set[str] = set()
    for i, window in enumerate(s.window):
        if window.to_s > s.duration_s:
            text = f"{window.to_s:g} s is after the end of the run ({end})"
            problems.append(Problem(file, f"window[{i}].to_s", text))
        if window.name in names:
            problems.append(Problem(file, f"window[{i}].name", f'"{window.name}" names two windows'))
        names.add(window.name)
    for i, expect in enumerate(s.expect):
        if expect.window not in names:
            text = f'no window is named "{expect.window}"{did_you_mean(expect.window, names)}'
            problems.append(Problem(file, f"expect[{i}].window", text))
        if expect.metric not in METRICS:
            hint = did_you_mean(expect.metric, METRICS) or f", permitted: {', '.join(METRICS)}"
            problems.append(Problem(file, f"expect[{i}].metric", f'"{expect.metric}" is no metric{hint}'))
    if s.record.zoom_to_s is not None and s.record.zoom_to_s > s.duration_s:
        text = f"{s.record.zoom_to_s:g} s is after the end of the run ({end})"
        problems.append(Problem(file, "record.zoom_to_s", text))
    return problems


def _speed(s: Scenario, key: str, speed_rpm: float) -> list[Problem]:
    """A speed target alone: the machine's limit and the carriers in a sector."""
    file, problems = s.sources.scenario, []
    if abs(speed_rpm) > s.motor.max_speed_rpm:
        limit = with_unit(s.motor.max_speed_rpm, "r/min")
        problems.append(
            Problem(file, key, f"{with_unit(speed_rpm, 'r/min')} is above max_speed_rpm of the motor ({limit})")
        )
    carriers = s.drive.carrier_hz / (6 * s.motor.electrical_hz(speed_rpm)) if speed_rpm else 1.0
    if carriers < 1.0:
        needed = with_unit(6 * s.motor.electrical_hz(speed_rpm), "Hz")
        text = (
            f"{with_unit(s.drive.carrier_hz, 'Hz')} is less than one carrier a sector at "
            f"{with_unit(speed_rpm, 'r/min')}, permitted from {needed}"
        )
        problems.append(Problem(file, "drive.carrier_hz", text))
    return problems


def _reach(s: Scenario) -> list[Problem]:
    """Follow the events: is every speed target within reach of the voltage and the current at that time?"""
    file, problems = s.sources.scenario, []
    speed_rpm, factor, supply_v = 0.0, 1.0, s.inverter.supply_v
    order = sorted(range(len(s.event)), key=lambda i: s.event[i].at_s)
    for i in order:
        event = s.event[i]
        key = f"event[{i}].{event.action}"
        if event.speed_rpm is not None:
            speed_rpm = event.speed_rpm
            problems += _speed(s, key, speed_rpm)
        elif event.load_factor is not None:
            factor = event.load_factor
        elif event.supply_v is not None:
            supply_v = event.supply_v
            if supply_v > s.inverter.sensing.voltage_full_scale_v:
                full = with_unit(s.inverter.sensing.voltage_full_scale_v, "V")
                problems.append(
                    Problem(
                        file,
                        key,
                        f"{with_unit(supply_v, 'V')} is above sensing.voltage_full_scale_v ({full})",
                    )
                )
        else:
            continue
        # A supply that is meant to collapse and a machine driven from outside are not promises to hold a
        # speed.
        if event.supply_v is not None or s.mechanics.mode != "free" or speed_rpm == 0:
            continue
        torque_nm = s.shaft_load.torque_nm(speed_rpm) * factor
        need_v = required_voltage(s.motor, s.inverter, speed_rpm, torque_nm)
        have_v = supply_v * s.drive.duty_max
        if need_v > have_v:
            text = (
                f"{with_unit(speed_rpm, 'r/min')} with {torque_nm:.3g} N*m needs at least {need_v:.1f} V "
                f"(back EMF and resistance), available {have_v:.1f} V (supply_v x drive.duty_max)"
            )
            problems.append(Problem(file, key, text))
        need_a = torque_nm / s.motor.torque_per_amp_nm
        if need_a > s.current_limit_a:
            text = (
                f"{with_unit(speed_rpm, 'r/min')} with {torque_nm:.3g} N*m needs {need_a:.1f} A, "
                f"permitted by drive.current_limit_a {s.current_limit_a:.1f} A"
            )
            problems.append(Problem(file, key, text))
    if s.initial.speed_rpm:
        problems += _speed(s, "initial.speed_rpm", s.initial.speed_rpm)
    return problems


def _power_stage(s: Scenario) -> list[Problem]:
    file, problems = s.sources.scenario, []
    period_s = 1.0 / s.drive.carrier_hz
    shortest_s = max(4 * s.inverter.min_pulse_s, s.inverter.sensing.sample_period_s)
    if period_s < shortest_s:
        text = (
            f"{with_unit(s.drive.carrier_hz, 'Hz')} leaves less than four minimum pulses or one sample in a "
            f"carrier, permitted up to {with_unit(1.0 / shortest_s, 'Hz')}"
        )
        problems.append(Problem(file, "drive.carrier_hz", text))
    if s.current_limit_a >= s.inverter.protection.phase_current_a:
        trip, limit = with_unit(s.inverter.protection.phase_current_a, "A"), with_unit(s.current_limit_a, "A")
        text = f"{limit} is not below protection.phase_current_a of the inverter ({trip})"
        problems.append(Problem(file, "drive.current_limit_a", text))
    start_a = s.drive.start.current_a
    if start_a is not None and start_a > s.current_limit_a:
        limit = with_unit(s.current_limit_a, "A")
        text = f"{with_unit(start_a, 'A')} is above drive.current_limit_a ({limit})"
        problems.append(Problem(file, "drive.start.current_a", text))
    return problems


def check_scenario(scenario: Scenario) -> list[Problem]:
    """Everything that does not fit together, without repetition."""
    problems = _times(scenario) + _power_stage(scenario) + _reach(scenario)
    return list(dict.fromkeys(problems))
