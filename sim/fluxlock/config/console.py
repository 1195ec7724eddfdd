# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Lines of the drive's console, checked before a run by the names of the firmware (sw/app)."""

from __future__ import annotations

import re

from fluxlock.config.errors import did_you_mean

# First words (console.c) and the longest line.
COMMANDS = ("help", "status", "get", "set", "start", "stop", "faults", "clear", "stats")
COMMAND_LENGTH = 79

# Names in the order of console_items.c: those that can only be read, those that can be set too.
VALUES = (
    "state",
    "phase",
    "fault",
    "limit",
    "measured_rpm",
    "reference_rpm",
    "duty",
    "vdc_v",
    "idc_a",
    "motor_a",
    "lost_locks",
    "threshold_pu",
    "catches",
    "line_a",
    "reference_a",
    "freewheel_deg",
    "hall_state",
    "hall_offset_deg",
    "hall_handovers",
    "commutated_by",
    "id_ma",
    "iq_ma",
    "angle_deg",
    "observed_ahead_deg",
    "encoder_ahead_deg",
    "encoder_faults",
    "open_phases",
    "injection",
    "idle",
)
SETTINGS = (
    "speed_rpm",
    "accel_rpm_s",
    "advance_q16",
    "advance_speed_q16",
    "advance_current_q16",
    "commutation",
    "pattern",
    "carrier_hz",
    "sync_rect",
    "current_limit_a",
    "dc_limit_a",
    "brake_limit_a",
    "freeze",
    "catch",
    "balance",
    "linearity",
    "zcd_method",
    "zcd_source",
    "compute_back",
    "correction_a",
    "current_loop",
    "mode",
    "torque_mnm",
    "current_ma",
    "hall_learn",
    "command_timeout_ms",
    "irq_load",
)

# Settings that vector control has too.
VECTOR_SETTINGS = (
    "speed_rpm",
    "accel_rpm_s",
    "current_limit_a",
    "brake_limit_a",
    "catch",
    "command_timeout_ms",
    "irq_load",
)

# Values that the firmware takes whatever the drive is: words or their number (console_items.c), ranges.
CHOICES = {
    "commutation": ("RSC", "NSC", "CSC"),
    "pattern": ("ON-PWM", "H_PWM-L_ON", "PWM-ON", "H_ON-L_PWM"),
    "balance": ("none", "vertical", "both"),
    "mode": ("speed", "torque"),
    "zcd_method": ("first", "interpolated", "averaged"),
    "zcd_source": ("terminal", "star_point", "mean"),
}
NUMBER_MAX = 2**31 - 1  # read into 32 bits, those with decimals in thousandths
RANGES = {
    "accel_rpm_s": (1, 100_000_000),
    "carrier_hz": (1, NUMBER_MAX),
    "advance_q16": (-0x8000, 0x7FFF),
    "advance_speed_q16": (-0x8000, 0x7FFF),
    "advance_current_q16": (-0x8000, 0x7FFF),
    "sync_rect": (0, 1),
    "freeze": (0, 1),
    "catch": (0, 1),
    "linearity": (0, 1),
    "compute_back": (0, 1),
    "correction_a": (0, 1),
    "current_loop": (0, 1),
    "hall_learn": (0, 1),
    "command_timeout_ms": (0, 600_000),
}
LOAD_PERIOD_MIN = 500
# Read with up to three decimals, all other numbers without.
CURRENT_LIMITS = ("current_limit_a", "dc_limit_a", "brake_limit_a")
DECIMALS = (*CURRENT_LIMITS, "torque_mnm")
_WHOLE = re.compile(r"-?\d+", re.ASCII)
_MILLI = re.compile(r"-?(\d+\.?\d{0,3}|\.\d{1,3})", re.ASCII)


def line_problem(line: str) -> str | None:
    """Why the console would refuse a line whatever the drive does: its form, a name or a value."""
    if not (line.isascii() and line.isprintable() and len(line) <= COMMAND_LENGTH):
        return f"must be one line of at most {COMMAND_LENGTH} printable ASCII characters"
    words = line.split()
    command, names = (words[0], words[1:]) if words else ("", [])
    if command not in COMMANDS:
        hint = did_you_mean(command, COMMANDS)
        return f'"{command}" is no command of the drive, permitted: {", ".join(COMMANDS)}{hint}'
    if command == "stop" and names not in ([], ["now"]):
        return 'must have the form "stop" or "stop now"'
    if command == "get" and len(names) > 1:
        return 'must have the form "get" or "get NAME"'
    if command == "get" and names and names[0] not in (*VALUES, *SETTINGS):
        return f'"{names[0]}" is no value of the drive{_known(names[0], (*VALUES, *SETTINGS))}'
    if command == "set":
        return _setting_problem(names)
    return None


def speed_of_line(line: str) -> float | None:
    """Speed target (r/min, signed) that a line sets; None if it sets none."""
    return number_of_line(line, "speed_rpm")


def number_of_line(line: str, name: str) -> float | None:
    """Number that a line sets a setting to, in the setting's unit; None if it sets another or no number."""
    words = line.split()
    if words[:2] != ["set", name] or len(words) != 3:
        return None
    form = _MILLI if name in DECIMALS else _WHOLE
    return float(words[2]) if form.fullmatch(words[2]) else None


def _setting_problem(words: list[str]) -> str | None:
    if len(words) != 2:
        return 'must have the form "set NAME VALUE"'
    if words[0] in VALUES:
        return f'"{words[0]}" is a value of the drive that cannot be set'
    if words[0] not in SETTINGS:
        return f'"{words[0]}" is no setting of the drive{_known(words[0], SETTINGS)}'
    permitted = _permitted_instead(*words)
    return permitted and f"'{words[1]}' is not permitted for {words[0]}, permitted: {permitted}"


def _permitted_instead(name: str, text: str) -> str | None:
    """What a setting takes if it never takes this value."""
    choices = CHOICES.get(name, ())
    low, high = (0, len(choices) - 1) if choices else RANGES.get(name, (None, None))
    number = number_of_line(f"set {name} {text}", name)
    if text in choices:
        return None
    if low is not None and high is not None:
        inside = number is not None and low <= number <= high
        return None if inside else ", or ".join([*filter(None, [", ".join(choices)]), f"{low} to {high}"])
    if name == "irq_load":
        inside = number is not None and (number == 0 or LOAD_PERIOD_MIN <= number <= NUMBER_MAX)
        return None if inside else f"0 or from {LOAD_PERIOD_MIN} to {NUMBER_MAX}"
    if number is None:
        return "a number with at most three decimals" if name in DECIMALS else "a whole number"
    if name in DECIMALS and round(1000 * abs(number)) > NUMBER_MAX:
        return f"a number with at most three decimals, of at most {NUMBER_MAX / 1000:.3f} in size"
    if name not in DECIMALS and abs(number) > NUMBER_MAX:
        return f"a whole number of at most {NUMBER_MAX} in size"
    return None


def switch_of_line(line: str, name: str) -> bool | None:
    """What a line sets a switch, or the mode (True: torque), to; None if it sets another setting."""
    words = line.split()
    if words[:2] != ["set", name] or len(words) != 3:
        return None
    return words[2] == "torque" if words[2] in CHOICES["mode"] else number_of_line(line, name) == 1


def _known(word: str, names: tuple[str, ...]) -> str:
    """The nearest name, else all of them."""
    return did_you_mean(word, names) or f", permitted: {', '.join(names)}"
