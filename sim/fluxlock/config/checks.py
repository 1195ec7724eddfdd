# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Checks of a scenario across its three files: what each file alone cannot know."""

from __future__ import annotations

import math

from fluxlock.config.console import CURRENT_LIMITS, number_of_line, switch_of_line
from fluxlock.config.errors import Problem, did_you_mean
from fluxlock.config.fields import with_unit
from fluxlock.config.motor import OVERSPEED_RATIO
from fluxlock.config.reach import check_reach
from fluxlock.config.scenario import METHOD_METRICS, METRICS, Scenario
from fluxlock.config.settling import SAMPLES_NEEDED, crossing_settling
from fluxlock.config.vector_checks import (
    check_vector,
    other_method,
    other_methods_keys,
)


def _beyond_the_end(s: Scenario) -> list[Problem]:
    """Entries after the end of the run, in one message: a shortened run has many, and one cause."""
    ends = [(f"event[{i}].{'ramp_s' if e.ramp_s else 'at_s'}", e.at_s + e.ramp_s) for i, e in enumerate(s.event)]
    ends += [(f"window[{i}].to_s", w.to_s) for i, w in enumerate(s.window)]
    ends += [("record.zoom_to_s", s.record.zoom_to_s or 0.0)]
    late = [(key, end_s) for key, end_s in ends if end_s > s.duration_s]
    if not late:
        return []
    enough = f"set duration_s to at least {max(end_s for _, end_s in late):g} s"
    if len(late) == 1:
        key, end_s = late[0]
        text = f"{end_s:g} s is after the end of the run (duration_s = {s.duration_s:g} s); {enough} or this earlier"
        return [Problem(s.sources.scenario, key, text)]
    listed = ", ".join(f"{key} ({end_s:g} s)" for key, end_s in late)
    arrays = [name for name in ("event", "window") if any(key.startswith(name) for key, _ in late)]
    arrays += ["expect"] if "window" in arrays and s.expect else []
    shorter = " ".join(f"--set '{name}=[...]'" for name in arrays)
    change = f"{enough}, or change these" + (f", all at once with {shorter}" if arrays else "")
    return [Problem(s.sources.scenario, "duration_s", f"{s.duration_s:g} s ends before {listed}; {change}")]


def _times(s: Scenario) -> list[Problem]:
    file, problems = s.sources.scenario, _beyond_the_end(s)
    names: dict[str, None] = {}
    for i, window in enumerate(s.window):
        if window.name in names:
            problems.append(Problem(file, f"window[{i}].name", f'"{window.name}" names two windows'))
        names[window.name] = None
    for i, expect in enumerate(s.expect):
        if expect.window not in names:
            known = f"permitted: {', '.join(names)}" if names else "the scenario has no [[window]]"
            text = f'no window is named "{expect.window}", {known}{did_you_mean(expect.window, names)}'
            problems.append(Problem(file, f"expect[{i}].window", text))
        if expect.metric not in METRICS:
            hint = did_you_mean(expect.metric, METRICS) or f", permitted: {', '.join(METRICS)}"
            problems.append(Problem(file, f"expect[{i}].metric", f'"{expect.metric}" is no metric{hint}'))
        elif expect.metric.partition(".")[0] in METHOD_METRICS[other_method(s)]:
            text = (
                f'"{expect.metric}" belongs to drive.method = "{other_method(s)}", the scenario has "{s.drive.method}"'
            )
            problems.append(Problem(file, f"expect[{i}].metric", text))
    for i, accept in enumerate(s.accept):
        if accept.window is not None and accept.window not in names:
            known = f"permitted: {', '.join(names)}" if names else "the scenario has no [[window]]"
            text = f'no window is named "{accept.window}", {known}{did_you_mean(accept.window, names)}'
            problems.append(Problem(file, f"accept[{i}].window", text))
    return problems


def _short_circuit(s: Scenario) -> list[Problem]:
    """An active short circuit lasts only where its current, flux over inductance at speed, is below the trip."""
    if s.inverter.protection.safe_state == "off":
        return []
    motor = s.motor
    current_a = max(psi / h for psi, h in zip(motor.psi_vs, motor.inductance_h, strict=True))
    if motor.third is not None:
        current_a += abs(motor.third.psi_vs) / motor.third.inductance_d_h
    limit_a = s.inverter.protection.phase_current_a
    if current_a < limit_a:
        return []
    text = (
        f"the short-circuit current of the motor ({current_a:.1f} A) trips phase_current_a ({with_unit(limit_a, 'A')})"
    )
    return [Problem(s.sources.inverter, "protection.safe_state", text)]


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
    if trips := _trips(s, s.current_limit_a):
        problems.append(Problem(file, "drive.current_limit_a", trips))
    problems += _samples(s, period_s)
    torque_nm = 1e-3 * (s.drive.torque_mnm or 0.0)
    torque_a = abs(torque_nm) / s.motor.torque_per_amp_nm
    if torque_a > s.current_limit_a:
        text = (
            f"{with_unit(s.drive.torque_mnm or 0.0, 'mN*m')} needs {torque_a:.1f} A, "
            f"permitted by drive.current_limit_a {s.current_limit_a:.1f} A"
        )
        problems.append(Problem(file, "drive.torque_mnm", text))
    start_a = s.drive.start.current_a
    if start_a is not None and start_a > s.current_limit_a:
        limit = with_unit(s.current_limit_a, "A")
        text = f"{with_unit(start_a, 'A')} is above drive.current_limit_a ({limit})"
        problems.append(Problem(file, "drive.start.current_a", text))
    problems += _search_current(s)
    start_hz = s.drive.start.carrier_hz
    if start_hz is not None and start_hz > s.drive.carrier_hz:
        limit = with_unit(s.drive.carrier_hz, "Hz")
        text = f"{with_unit(start_hz, 'Hz')} is above drive.carrier_hz ({limit})"
        problems.append(Problem(file, "drive.start.carrier_hz", text))
    return problems


def _search_current(s: Scenario) -> list[Problem]:
    """Search of the rotor: its current is below the drive's limit, and the trip of the link does not come before it."""
    injection = s.drive.vector.injection
    if injection is None or not injection.search:
        return []
    current_a, key = injection.search_current_a, "drive.vector.injection.search_current_a"
    if current_a is None:  # by rule it has room
        return []
    shown = with_unit(current_a, "A")
    problems = []
    if current_a > s.current_limit_a:
        text = f"{shown} is above drive.current_limit_a ({with_unit(s.current_limit_a, 'A')})"
        problems.append(s.sources.problem(key, text))
    # Phases of one sign that the link carries together, at the worst angle: sum of |cos|, halved.
    share = 0.5 / math.sin(math.pi / (2 * s.motor.phases))
    trip_a = s.inverter.protection.dc_current_a
    if share * current_a >= trip_a:
        text = (
            f"{shown} and protection.dc_current_a of the inverter ({with_unit(trip_a, 'A')}): the "
            f"legs of one side carry {share * current_a:.1f} A together at some angles; permitted below "
            f"{trip_a / share:.2f} A, less what the injected wave needs"
        )
        problems.append(s.sources.problem(key, text))
    return problems


def _samples(s: Scenario, period_s: float) -> list[Problem]:
    """A crossing, needed without Hall sensors in six-step operation, is found if a pulse can hold settled samples."""
    sensing, zcd = s.inverter.sensing, s.drive.zcd
    needed_s = crossing_settling(s.drive, s.inverter).least_s
    if period_s >= needed_s or s.drive.hall.mode == "sensored" or s.drive.method == "vector":
        return []
    if zcd.settle_us is not None:
        most_us = math.floor(1e7 * (period_s - SAMPLES_NEEDED * sensing.sample_period_s)) / 10
        text = f"{with_unit(zcd.settle_us, 'us')} leaves no samples in a carrier of "
        text += f"{with_unit(s.drive.carrier_hz, 'Hz')}: permitted up to {most_us:g} us, or a slower carrier"
        return [s.sources.problem("drive.zcd.settle_us", text)]
    text = (
        f"{with_unit(s.drive.carrier_hz, 'Hz')} leaves no room for the samples of a crossing: settling and three "
        f"samples at inverter.sensing.sample_period_s = {with_unit(sensing.sample_period_s, 's')} "
        f"take {needed_s:.3g} s, permitted up to {1.0 / needed_s:.0f} Hz"
    )
    return [Problem(s.sources.scenario, "drive.carrier_hz", text)]


def _console(s: Scenario) -> list[Problem]:
    """Currents and torques that console lines ask for, each under the limit that the lines before it have set."""
    problems, limit_a = [], s.current_limit_a
    full_a = s.inverter.sensing.current_full_scale_a
    for i in sorted(range(len(s.event)), key=lambda i: s.event[i].at_s):
        line, text = s.event[i].command or "", ""
        for name in CURRENT_LIMITS:
            asked_a = number_of_line(line, name)
            if asked_a is not None and not 0 < asked_a <= full_a:
                full = f"sensing.current_full_scale_a of the inverter ({with_unit(full_a, 'A')})"
                text = f"{with_unit(asked_a, 'A')} is not permitted, permitted: above 0 up to {full}"
            elif asked_a is not None and name == "current_limit_a":
                text = _trips(s, asked_a)
                limit_a = asked_a
        limit = f"the limit of the current, {with_unit(limit_a, 'A')}"
        torque_mnm, current_ma = number_of_line(line, "torque_mnm"), number_of_line(line, "current_ma")
        needed_a = abs(1e-3 * (torque_mnm or 0.0)) / s.motor.torque_per_amp_nm
        if torque_mnm is not None and needed_a > limit_a:
            text = f"{with_unit(torque_mnm, 'mN*m')} needs {needed_a:.1f} A, permitted by {limit}"
        if current_ma is not None and abs(current_ma) / 1000 > limit_a:
            text = f"{with_unit(current_ma, 'mA')} is beyond {limit}"
        if text:
            problems.append(Problem(s.sources.scenario, f"event[{i}].command", text))
    return problems


def _trips(s: Scenario, limit_a: float) -> str:
    """What is wrong with a limit of the current that the trip comes before; empty if nothing is."""
    trip_a = s.inverter.protection.phase_current_a
    if limit_a < trip_a:
        return ""
    trip = with_unit(trip_a, "A")
    return f"{with_unit(limit_a, 'A')} is not below protection.phase_current_a of the inverter ({trip})"


def _switches(s: Scenario) -> list[Problem]:
    """Console lines that need a setting, and a key that needs a line: the settings as the lines before left them."""
    problems = []
    settings = {
        "sync_rect": bool(s.drive.sync_rect),
        "current_loop": s.drive.current_loop,
        "mode": s.drive.mode == "torque",
    }
    ever_rectifies = bool(s.drive.sync_rect)
    for i in sorted(range(len(s.event)), key=lambda i: s.event[i].at_s):
        line, text = s.event[i].command or "", ""
        for name, unit in (("torque_mnm", "mN*m"), ("current_ma", "mA")):
            target = number_of_line(line, name)
            if target is not None and target < 0 and not settings["sync_rect"]:
                text = f"{with_unit(target, unit)} brakes: needs drive.sync_rect = true, or set sync_rect 1 before"
        wanted = {name: switch_of_line(line, name) for name in settings}
        if wanted["mode"] and not settings["current_loop"]:
            text = "torque mode needs drive.current_loop = true, or set current_loop 1 before"
        elif wanted["current_loop"] is False and settings["mode"]:
            text = "the torque mode needs the current loop: set mode speed before"
        else:
            settings |= {name: value for name, value in wanted.items() if value is not None}
        ever_rectifies |= settings["sync_rect"]
        if text:
            problems.append(Problem(s.sources.scenario, f"event[{i}].command", text))
    if s.drive.brake_current_limit_a is not None and not ever_rectifies and s.drive.method == "six-step":
        text = "has no effect without sync_rect = true: set it, or leave this out"
        problems.append(Problem(s.sources.scenario, "drive.brake_current_limit_a", text))
    return problems


def _initial(s: Scenario) -> list[Problem]:
    """An imposed speed begins where its profile does: a stated initial speed may not say otherwise."""
    if not s.mechanics.profile or "speed_rpm" not in s.initial.model_fields_set:
        return []
    begins_rpm = s.mechanics.profile[0][1]  # holds before the first point too
    if s.initial.speed_rpm == begins_rpm:
        return []
    text = (
        f"{with_unit(s.initial.speed_rpm, 'r/min')} is not where mechanics.profile begins "
        f"({with_unit(begins_rpm, 'r/min')}); set it to that, or leave it out"
    )
    return [Problem(s.sources.scenario, "initial.speed_rpm", text)]


def _hall(s: Scenario) -> list[Problem]:
    if s.drive.hall.mode == "off" or s.drive.method == "vector":
        return []
    file, problems = s.sources.scenario, []
    if s.motor.hall is None:
        text = f'"{s.drive.hall.mode}" needs Hall sensors: [hall] in the motor file ({s.sources.motor})'
        problems.append(Problem(file, "drive.hall.mode", text))
    highest_rpm = OVERSPEED_RATIO * s.motor.max_speed_rpm
    sector_s = 1.0 / (6 * s.motor.electrical_hz(highest_rpm))
    if s.drive.hall.filter_s >= sector_s:
        text = (
            f"{with_unit(s.drive.hall.filter_s, 's')} is not below a sector at the over-speed limit of "
            f"{with_unit(highest_rpm, 'r/min')} ({with_unit(sector_s, 's')})"
        )
        problems.append(Problem(file, "drive.hall.filter_s", text))
    return problems


def _told_encoder(s: Scenario) -> list[Problem]:
    """A wrong index needs one that the frame follows, wrong lines an encoder."""
    encoder, vector, error = s.motor.encoder, s.drive.vector, s.drive.motor_error
    followed = s.drive.method == "vector" and vector.angle == "encoder" and encoder is not None
    found = []
    if error.encoder_offset_deg and not (followed and vector.mounting == "given" and encoder and encoder.index):
        text = "has no effect without an index that gives the frame its angle"
        found.append(Problem(s.sources.scenario, "drive.motor_error.encoder_offset_deg", text))
    if error.encoder_lines != 1.0 and not followed:
        text = "has no effect without an encoder that gives the frame its angle"
        found.append(Problem(s.sources.scenario, "drive.motor_error.encoder_lines", text))
    return found


def _phases(s: Scenario) -> list[Problem]:
    """Machine and inverter have the chip's number of phases."""
    if s.motor.phases != s.inverter.legs:
        text = f"{s.inverter.legs} does not fit the motor ({s.sources.motor}), which has {s.motor.phases} phases"
        return [s.sources.problem("inverter.legs", text)]
    if s.motor.phases == 5 and (s.drive.method != "vector" or s.drive.vector.injection is None):
        text = '5 needs drive.method = "vector" and [drive.vector.injection]'
        return [s.sources.problem("motor.phases", text)]
    letters = "ABCDE"[: s.motor.phases]
    problems = []
    for i, event in enumerate(s.event):
        named = event.fault.phases or [] if event.fault is not None else []
        for letter in (x for x in named if x not in letters):
            text = f"{letter} is no phase of the motor, permitted: {', '.join(letters)}"
            problems.append(Problem(s.sources.scenario, f"event[{i}].fault.phases", text))
    return problems


def _can(s: Scenario) -> list[Problem]:
    if s.can is None or s.drive.vector.injection is None:
        return []
    text = "the image with the CANopen node has no room for the injection; leave one of the two out"
    return [s.sources.problem("can", text)]


def check_scenario(scenario: Scenario) -> list[Problem]:
    """Everything that does not fit together, without repetition."""
    if problems := _phases(scenario):
        return problems
    checks = (
        *(other_methods_keys, check_vector, _times, _power_stage, _console, _switches),
        *(_short_circuit, _hall, _told_encoder, _initial, check_reach, _can),
    )
    problems = [problem for check in checks for problem in check(scenario)]
    return list(dict.fromkeys(problems))
