# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The parameter block of a scenario, and what only the block can tell of a scenario before it runs."""

from __future__ import annotations

from pydantic import BaseModel

from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.config.checks import check_scenario
from fluxlock.config.console import number_of_line
from fluxlock.config.fields import with_unit
from fluxlock.firmware import ParameterBlock, ParameterError, compile_parameters

# Keys that a parameter follows from, by the beginning of its name; the first match counts. All others are charged to
# the drive as a whole.
_SPEED_LOOP = ("motor.inertia_kgm2", "motor.psi_vs", "drive.speed_bandwidth_hz")
_START = ("motor.inertia_kgm2", "motor.psi_vs", "drive.start.current_a")
_CURRENT_LOOP = ("motor.inductance_h", "motor.resistance_ohm", "drive.current_bandwidth_hz")
_RESISTANCE = ("motor.resistance_ohm", "inverter.on_resistance_ohm", "motor.inductance_h")
_HANDOVER = ("motor.max_speed_rpm", "motor.pole_pairs", "motor.psi_vs")
_VECTOR_START = ("motor.inertia_kgm2", "drive.vector.start_current_a")
_SAMPLING = ("inverter.sensing.divider_pole_s", "inverter.sensing.sample_period_s")
FOLLOWS_FROM: dict[str, tuple[str, ...]] = {
    "speed_to_current": _SPEED_LOOP,
    "speed_k": _SPEED_LOOP,
    "speed_ratio": ("motor.max_speed_rpm",),
    "accel_rpm_s": ("drive.accel_rpm_per_s", "motor.inertia_kgm2", "motor.psi_vs", "motor.rated_current_a"),
    "hall_start_ticks": _START,
    "start_accel_rpm_q20": _START,
    "start_first_cycles": _START,
    "align": ("motor.resistance_ohm", "inverter.on_resistance_ohm", "drive.start.current_a"),
    "start_v_q25": ("motor.resistance_ohm", "inverter.on_resistance_ohm", "drive.start.current_a"),
    "resistance": _RESISTANCE,
    "limiter_k": _RESISTANCE,
    "current_kp": _CURRENT_LOOP,
    "handover": _HANDOVER,
    "lock_timeout": _HANDOVER,
    "emf": ("motor.psi_vs", "motor.pole_pairs"),
    "zcd_peak": ("motor.psi_vs", "motor.pole_pairs"),
    "torque_to_current": ("motor.psi_vs", "motor.pole_pairs"),
    "diode_v_q25": ("inverter.diode_drop_v", "inverter.sensing.voltage_full_scale_v"),
    "duty_max_q30": ("drive.duty_max",),
    "current_full_scale_ma": ("inverter.sensing.current_full_scale_a",),
    "voltage_full_scale_mv": ("inverter.sensing.voltage_full_scale_v",),
    "sample_": _SAMPLING,
    "sense_delay": _SAMPLING,
    "zcd_settle": ("drive.zcd.settle_us", *_SAMPLING),
    "zcd_blank": ("drive.zcd.settle_us", *_SAMPLING),
    "vector_speed_k": ("motor.inertia_kgm2", "motor.psi_vs", "drive.vector.speed_hz"),
    "vector_start_accel": ("drive.vector.start_accel_rpm_per_s", *_VECTOR_START),
    "vector_start": _VECTOR_START,
    "vector_resistance_q30": ("motor.resistance_ohm", "motor.inductance_h", "drive.carrier_hz"),
    "injection_search_rise_i_q25": ("drive.vector.injection.search_rise_a_per_s",),
    "vector_bandwidth_q30": ("drive.vector.bandwidth_hz",),
}


def parameter_block(scenario: Scenario) -> ParameterBlock:
    """What the firmware is told in a scenario; a value that no parameter can hold raises ConfigError."""
    try:
        block = compile_parameters(scenario)
        block.pack()
    except ParameterError as error:
        raise ConfigError([_problem(scenario, error)]) from error
    return block


def check_parameters(scenario: Scenario) -> None:
    """Raise ConfigError if the firmware would refuse the scenario's parameters, or a console line because of them."""
    problems = _carriers(scenario, parameter_block(scenario))
    if problems:
        raise ConfigError(problems)


def refusals(scenario: Scenario) -> list[str]:
    """Why file checks and firmware refuse a scenario that was made from objects, a line each; empty: they do not."""
    problems = check_scenario(scenario)
    if not problems:
        try:
            check_parameters(scenario)
        except ConfigError as error:
            problems = error.problems
    return [f"{problem.key}: {problem.message}" for problem in problems]


def _problem(s: Scenario, error: ParameterError) -> Problem:
    """The error at the key that it most likely comes from: one of `--set` before those of the files."""
    keys = next((k for name, k in FOLLOWS_FROM.items() if error.parameter.startswith(name)), ())
    if not keys:
        return Problem(s.sources.scenario, "drive", f"does not fit the firmware ({error})")
    first, *others = sorted(keys, key=lambda key: not s.sources.is_override(key))
    cure = f"change it or {' or '.join(f'{key} ({_shown(s, key)})' for key in others)}" if others else "change it"
    return s.sources.problem(first, f"{_shown(s, first)} does not fit the firmware ({error}); {cure}")


def _shown(s: Scenario, key: str) -> str:
    """Value of a key as messages print it."""
    here: object = s
    unit: object = ""
    for part in key.split("."):
        assert isinstance(here, BaseModel)
        extra = type(here).model_fields[part].json_schema_extra
        unit = extra["unit"] if isinstance(extra, dict) else ""
        here = getattr(here, part)
    if isinstance(here, tuple):
        return ", ".join(with_unit(value, str(unit)) for value in dict.fromkeys(here))
    return with_unit(here, str(unit)) if isinstance(here, (int, float)) else "left out"


def _carriers(s: Scenario, block: ParameterBlock) -> list[Problem]:
    """Lines `set carrier_hz`: the firmware takes periods from four least pulses to the longest carrier."""
    clock_hz = block.number("clock_hz")
    least, most = 4 * block.number("min_pulse_cycles"), block.number("carrier_longest_cycles")

    def period(hz: int) -> int:
        return (clock_hz + hz // 2) // hz

    low, high = max(1, round(clock_hz / (most + 0.5))), round(clock_hz / (least - 0.5))
    low = next(hz for hz in range(max(1, low - 2), low + 3) if period(hz) <= most)
    high = next(hz for hz in range(high + 2, high - 3, -1) if period(hz) >= least)
    problems = []
    for i, event in enumerate(s.event):
        hz = number_of_line(event.command or "", "carrier_hz")
        if hz is not None and not low <= hz <= high:
            text = f"{with_unit(hz, 'Hz')} is not a carrier of this drive, permitted {low} to {high} Hz"
            problems.append(s.sources.problem(f"event[{i}].command", text))
    return problems
