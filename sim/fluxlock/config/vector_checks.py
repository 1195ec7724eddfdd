# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Checks of a scenario with vector control across its three files."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import vector_design, vector_loops, vector_timing
from fluxlock.config.console import VECTOR_SETTINGS
from fluxlock.config.drive import Drive, Start
from fluxlock.config.errors import Problem
from fluxlock.config.fields import plain, with_unit
from fluxlock.config.injection_checks import check_injection, too_fast_for_wave
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Scenario
from fluxlock.config.vector_design import told_machine
from fluxlock.interface.settings import load_settings

# Keys of the drive that both methods know.
SHARED_KEYS = {
    "method",
    "carrier_hz",
    "current_limit_a",
    "accel_rpm_per_s",
    "brake_current_limit_a",
    "start",
    "motor_error",
    *(s.file for s in load_settings() if "vector" in s.methods),
}
SHARED_START_KEYS = {"catch", "retries", "restart_retries"}

TURN_A_TICK = 0.25  # electrical
TIME_CONSTANTS_A_TICK = 1.9  # the format of R T / L ends at 2
BANDWIDTH_A_MAX = 0.15  # of regulator A over 1 / T_s
MARGIN_MIN_DEG = 30.0  # of two bandwidths that are both given; the rule keeps more
START_TORQUE_SHARE_MAX = 0.9  # of the torque at 90 degrees: beyond it the rotor falls out of step
EMF_LSB_MIN = 10.0


def other_method(s: Scenario) -> str:
    """The method that the scenario does not have."""
    return "six-step" if s.drive.method == "vector" else "vector"


def other_methods_keys(s: Scenario) -> list[Problem]:
    """Keys that the scenario's method does not have."""
    file = s.sources.scenario
    if s.drive.method == "six-step":
        if "vector" not in s.drive.model_fields_set:
            return []
        text = 'belongs to drive.method = "vector", the scenario has "six-step"; set drive.method or leave it out'
        return [Problem(file, "drive.vector", text)]
    keys = [name for name in Drive.model_fields if name in s.drive.model_fields_set - SHARED_KEYS - {"vector"}]
    given = s.drive.start.model_fields_set - SHARED_START_KEYS
    keys += [f"start.{name}" for name in Start.model_fields if name in given]
    text = 'belongs to drive.method = "six-step", the scenario has "vector"; leave it out'
    return [Problem(file, f"drive.{key}", text) for key in keys]


def _tick_hz(s: Scenario) -> float:
    return vector_timing.update_hz(s.drive) / vector_timing.tick_samples(s.drive)


def _times(s: Scenario) -> Iterator[Problem]:
    """Carrier, window and delay: what the chip can do between two updates."""
    file, carrier_hz, v = s.sources.scenario, s.drive.carrier_hz, s.drive.vector
    update_hz = vector_timing.update_hz(s.drive)
    updates = f'{with_unit(carrier_hz, "Hz")} with drive.vector.update = "{v.update}"'
    most_hz = vector_timing.update_hz_max(s.drive)
    if update_hz > most_hz:
        most = with_unit(most_hz * carrier_hz / update_hz, "Hz")
        where = ' on the core (drive.vector.current_regulator = "c")' if v.current_regulator == "c" else ""
        yield Problem(
            file,
            "drive.carrier_hz",
            f"{updates} needs {update_hz:.0f} regulator steps a second{where}, permitted {most_hz:.0f}: carrier up to "
            f"{most}",
        )
        return
    count = vector_timing.window_samples(s.drive, s.inverter)
    if v.window == "carrier" and not 2 <= count <= vector_timing.WINDOW_SAMPLES_MAX:
        yield Problem(
            file,
            "drive.vector.window",
            f'"carrier" takes {count} samples in T_s = {1e6 / update_hz:.4g} us at inverter.sensing.sample_period_s = '
            f"{with_unit(s.inverter.sensing.sample_period_s, 's')}, permitted 2 to {vector_timing.WINDOW_SAMPLES_MAX}",
        )
        return
    shortest = vector_timing.shortest_delay(s.drive, s.inverter)
    what = f"window, conversion, {vector_timing.latency_cycles(s.drive)} clocks and the way to the gates"
    if shortest > 1.0:
        hint = ', drive.vector.window = "sample"' if v.window == "carrier" else ""
        if v.injection is not None and v.injection.samples > 1:
            hint += f", or lower drive.vector.injection.samples = {v.injection.samples}"
        yield Problem(
            file,
            "drive.carrier_hz",
            f"{updates} leaves no room for a delay of at most T_s: {what} take {1e6 * shortest / update_hz:.3g} us, "
            f"T_s is {1e6 / update_hz:.3g} us; lower the carrier or take single update{hint}",
        )
    elif v.delay is not None and v.delay < shortest:
        yield Problem(
            file,
            "drive.vector.delay",
            f"{v.delay:g} is shorter than what the chip needs: {what} take {shortest:.3f} of T_s = "
            f"{1e6 / update_hz:.4g} us, permitted {math.ceil(1000 * shortest) / 1000:g} to 1",
        )


def _encoder(s: Scenario) -> Iterator[Problem]:
    """An encoder that the frame can follow."""
    v, encoder, file = s.drive.vector, s.motor.encoder, s.sources.scenario
    if v.angle == "encoder" and encoder is None:
        yield Problem(file, "drive.vector.angle", '"encoder" needs one: the motor file has no [encoder]')
    least = math.ceil(vector_design.ENCODER_QUARTERS_MIN * s.motor.pole_pairs / 4)
    lines = vector_design.told_lines(s)
    if v.angle == "encoder" and encoder is not None and lines < least:
        yield Problem(
            s.sources.motor,
            "encoder.lines",
            f'{lines} lines are too few for drive.vector.angle = "encoder", needed at least {least}: '
            f"{vector_design.ENCODER_QUARTERS_MIN} edges an electrical turn",
        )
    if "mounting" in v.model_fields_set and v.angle != "encoder":
        yield Problem(file, "drive.vector.mounting", 'belongs to drive.vector.angle = "encoder"')


def _loops(s: Scenario) -> Iterator[Problem]:
    """Control tick and bandwidths."""
    file, v, tick_hz = s.sources.scenario, s.drive.vector, _tick_hz(s)
    update_hz = vector_timing.update_hz(s.drive)
    if tick_hz > vector_timing.TICK_HZ_MAX:
        least = math.ceil(update_hz / vector_timing.TICK_HZ_MAX)
        yield Problem(
            file,
            "drive.vector.observer_every",
            f"{v.observer_every} gives a control tick of {tick_hz:.0f} Hz, permitted "
            f"{vector_timing.TICK_HZ_MAX:.0f} Hz: at least {least}",
        )
    m = told_machine(s)
    if m.resistance_ohm / m.inductance_h / tick_hz > TIME_CONSTANTS_A_TICK:
        yield Problem(
            file,
            "drive.carrier_hz",
            f"{with_unit(s.drive.carrier_hz, 'Hz')} gives a control tick of {1e6 / tick_hz:.3g} us, longer than "
            f"{TIME_CONSTANTS_A_TICK} times L/R of the motor ({1e6 * m.inductance_h / m.resistance_ohm:.3g} us); it "
            f"runs with inductance_h from {m.resistance_ohm / tick_hz / TIME_CONSTANTS_A_TICK:.3g} H",
        )
    if v.regulator == "A" and v.bandwidth_hz > BANDWIDTH_A_MAX * update_hz:
        yield Problem(
            file,
            "drive.vector.bandwidth_hz",
            f"{with_unit(v.bandwidth_hz, 'Hz')} is too fast for {update_hz:.0f} samples a second, permitted up to "
            f"{BANDWIDTH_A_MAX * update_hz:.0f} Hz",
        )
    most_hz = vector_loops.PLL_MAX * (1.0 - v.observer_pole) * tick_hz
    if v.pll_hz is not None and v.pll_hz > most_hz:
        yield Problem(
            file,
            "drive.vector.pll_hz",
            f"{with_unit(v.pll_hz, 'Hz')} is too fast for a control tick of {tick_hz:.0f} Hz with "
            f"drive.vector.observer_pole = {v.observer_pole:g}, permitted up to {most_hz:.0f} Hz",
        )
    if s.mechanics.mode == "free" and v.injection is None and v.speed_hz is not None:
        yield from _margin(s, v.speed_hz)


def _margin(s: Scenario, speed_hz: float) -> Iterator[Problem]:
    """A bandwidth of the speed loop that no phase-locked loop, or not the given one, goes with."""
    found = vector_loops.loops_of(s)
    if found.nominal_deg >= MARGIN_MIN_DEG:
        return
    rule = vector_loops.loops(vector_loops.plant_of(s))
    yield Problem(
        s.sources.scenario,
        "drive.vector.speed_hz",
        f"{with_unit(speed_hz, 'Hz')} with drive.vector.pll_hz = {found.pll_hz:.4g} Hz leaves a phase margin of "
        f"{found.nominal_deg:.0f} degrees, permitted from {MARGIN_MIN_DEG:.0f} on; left out, both come by rule: "
        f"{rule.speed_hz:.3g} Hz and {rule.pll_hz:.3g} Hz with {rule.nominal_deg:.0f} degrees",
    )


def _handover(s: Scenario) -> Iterator[Problem]:
    """The speed of the hand-over to the EMF, and the EMF there."""
    file, rpm = s.sources.scenario, vector_design.handover_rpm(s)
    if rpm > s.motor.max_speed_rpm:
        most = with_unit(s.motor.max_speed_rpm, "r/min")
        yield Problem(
            file,
            "drive.vector.handover_rpm",
            f"{with_unit(rpm, 'r/min')} is above max_speed_rpm of the motor ({most})",
        )
        return
    step_v = s.inverter.sensing.step_v
    emf_v = told_machine(s).fundamental_vs * s.motor.omega_e(rpm)
    if emf_v < EMF_LSB_MIN * step_v:
        least = math.ceil(rpm * EMF_LSB_MIN * step_v / emf_v)
        yield Problem(
            file,
            "drive.vector.handover_rpm",
            f"{rpm:.0f} r/min has an EMF of {1e3 * emf_v:.3g} mV, less than {EMF_LSB_MIN:g} steps of the converter, "
            f"permitted from {least} r/min",
        )


def _start(s: Scenario) -> Iterator[Problem]:
    """The forced start: its current, the hand-over, its torque against load and inertia."""
    file, current_a = s.sources.scenario, vector_design.start_current_a(s)
    if current_a > s.current_limit_a:
        limit = with_unit(s.current_limit_a, "A")
        yield Problem(
            file,
            "drive.vector.start_current_a",
            f"{with_unit(current_a, 'A')} is above drive.current_limit_a ({limit})",
        )
    yield from _handover(s)
    rpm = vector_design.handover_rpm(s)
    if rpm > s.motor.max_speed_rpm or s.mechanics.mode != "free":
        return
    accel = vector_design.start_accel_rpm_per_s(s)
    most_nm = START_TORQUE_SHARE_MAX * told_machine(s).torque_nm_per_a * current_a
    start_s = s.start_s()
    load_nm = s.shaft_load.torque_nm(rpm) * s.largest_load_factor(start_s, start_s + rpm / accel)
    inertia_nm = s.motor.inertia_kgm2 * accel / RPM_PER_RAD_S
    if load_nm + inertia_nm > most_nm:
        chosen = s.drive.vector.start_accel_rpm_per_s is not None and load_nm < most_nm
        yield Problem(
            file,
            "drive.vector.start_accel_rpm_per_s" if chosen else "drive.vector.start_current_a",
            f"the start needs {1e3 * load_nm:.3g} mN*m for the load at {rpm:.0f} r/min and {1e3 * inertia_nm:.3g} mN*m "
            f"to accelerate by {plain(round(accel))} r/min/s, {with_unit(round(current_a, 3), 'A')} pull with at most "
            f"{1e3 * most_nm:.3g} mN*m",
        )


def _injection(s: Scenario) -> Iterator[Problem]:
    """Saliency, voltage, current and samples that the wave needs."""
    file, motor, vector = s.sources.scenario, s.motor, s.drive.vector
    spec = vector.injection
    assert spec is not None
    l_d, l_q = motor.inductance_h[0], motor.inductance_q_h
    if l_q is None or l_q <= l_d:
        text = f"is not above inductance_h ({l_d:g} H), as drive.vector.injection needs it"
        yield Problem(s.sources.motor, "inductance_q_h", f"{'left out' if l_q is None else f'{l_q:g} H'} {text}")
        return
    if vector.handover_rpm is not None:
        yield from _handover(s)
    if spec.third_ratio and motor.phases == 3:
        yield Problem(file, "drive.vector.injection.third_ratio", "belongs to a motor of five phases")
    timing = vector_timing.vector_timing(s.drive, s.inverter)
    if spec.method == "separator" and (timing.tick_samples != 1 or round(timing.delay, 2) != 1.0):
        text = '"separator" needs drive.vector.observer_every = 1 and drive.vector.delay = 1'
        yield Problem(file, "drive.vector.injection.method", text)
    margin = vector_design.circle(s.inverter, timing)
    most_v = margin * vector_design.linear_voltage(motor.phases) * s.inverter.supply_v
    if spec.amplitude_v >= most_v:
        text = f"{with_unit(spec.amplitude_v, 'V')} is not below the largest voltage, {most_v:.4g} V"
        yield Problem(file, "drive.vector.injection.amplitude_v", text)
        return
    peak_a = spec.amplitude_v * spec.period * timing.sample_cycles / CLOCK_HZ / (4 * l_d)
    most_a = s.inverter.protection.phase_current_a - s.current_limit_a
    if most_a > peak_a or most_a <= 0.0:  # a limit of the current beyond the trip is a problem of its own
        yield from check_injection(s)
        return
    text = (
        f"{with_unit(spec.amplitude_v, 'V')} over {spec.period} updates makes {peak_a:.3g} A, beside "
        f"drive.current_limit_a permitted up to {most_a:.3g} A (protection.phase_current_a of the inverter), "
        f"{spec.amplitude_v * most_a / peak_a:.3g} V"
    )
    yield Problem(file, "drive.vector.injection.amplitude_v", text)


def _console(s: Scenario) -> Iterator[Problem]:
    """Settings of console lines that only six-step operation has."""
    for i, event in enumerate(s.event):
        words = (event.command or "").split()
        if words[:1] == ["set"] and words[1] not in VECTOR_SETTINGS:
            text = f'"{words[1]}" is no setting of vector control, permitted: {", ".join(VECTOR_SETTINGS)}'
            yield Problem(s.sources.scenario, f"event[{i}].command", text)


def check_vector(s: Scenario) -> list[Problem]:
    """What does not fit together with drive.method = "vector"."""
    if s.drive.method != "vector":
        return []
    start = _injection if s.drive.vector.injection else _start
    return [*_times(s), *_encoder(s), *_loops(s), *start(s), *_console(s)]


def vector_speed(s: Scenario, speed_rpm: float) -> str | None:
    """Why the estimate cannot follow a speed."""
    turn = s.motor.electrical_hz(speed_rpm) / _tick_hz(s)
    if turn <= TURN_A_TICK:
        return too_fast_for_wave(s, speed_rpm)
    return (
        f"{with_unit(speed_rpm, 'r/min')} turns the rotor by {turn:.2f} of an electrical turn in a control tick, "
        f"permitted {TURN_A_TICK:g}; raise drive.carrier_hz or lower drive.vector.observer_every"
    )


def _injected_v(s: Scenario, speed_rpm: float) -> float:
    """Amplitude of the wave at a speed (V)."""
    v = s.drive.vector
    if v.injection is None or (v.handover_rpm is not None and abs(speed_rpm) > v.handover_rpm):
        return 0.0
    return v.injection.amplitude_v


def lacking_vector(s: Scenario, speed_rpm: float, torque_nm: float, supply_v: float) -> tuple[str, str]:
    """What a speed under a load needs and does not have: phase voltage, current; empty where it has it.

    |u| = |(R + j w L) i + j w psi| at i = i_d + j i_q; i_d is 0, or with field weakening what the current leaves.
    """
    m, v = s.motor, s.drive.vector
    r = sum(m.resistance_ohm) / 3 + s.inverter.on_resistance_ohm
    psi, inductance = sum(m.psi_vs) / 3 * m.emf_fundamental, m.mean_inductance_h
    omega = abs(m.omega_e(speed_rpm))
    i_q = abs(torque_nm) / (m.phases / 2 * m.pole_pairs * psi)
    voltage, current, i_d = "", "", 0.0
    if v.weakening and i_q < s.current_limit_a:
        room_a = vector_design.WEAKENING_CURRENT_SHARE * s.current_limit_a
        i_d = -min(room_a, math.sqrt(s.current_limit_a**2 - i_q**2), psi / inductance)
    margins = 2.0 * vector_design.margin_cycles(s.inverter) * s.drive.carrier_hz / CLOCK_HZ
    needs = []
    for d in {0.0, i_d}:
        u = complex(r, omega * inductance) * complex(d, i_q) + 1j * omega * psi
        drop_v = s.inverter.supply_resistance_ohm * m.phases / 2 * (u * complex(d, -i_q)).real / max(supply_v, 1e-9)
        circle_v = (1.0 - margins) * (supply_v - drop_v) * vector_design.linear_voltage(m.phases)
        circle_v = math.sqrt(max(0.0, circle_v**2 - _injected_v(s, speed_rpm) ** 2))
        needs.append((abs(u), circle_v))
    need_v, have_v = min(needs, key=lambda pair: pair[0] - pair[1])
    if need_v > have_v:
        hint = "" if v.weakening or v.injection is not None else "; drive.vector.weakening = true needs less"
        if _injected_v(s, speed_rpm):
            hint = ", beside drive.vector.injection.amplitude_v"
        voltage = (
            f"needs a phase voltage of {need_v:.1f} V (EMF, inductance, resistance), available {have_v:.1f} V "
            f"({'vdc / sqrt(3)' if m.phases == 3 else '0.5257 vdc'} less the shortest pulses{hint})"
        )
    if i_q > s.current_limit_a:
        current = f"needs {i_q:.1f} A, permitted by drive.current_limit_a {s.current_limit_a:.1f} A"
    return voltage, current
