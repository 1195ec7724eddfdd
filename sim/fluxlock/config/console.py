# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Lines of the drive's console, checked before a run by the names of the firmware (sw/app)."""

from __future__ import annotations

import re

from fluxlock.config.errors import did_you_mean
from fluxlock.interface.settings import load_settings
from fluxlock.interface.values import load_values

# First words (console.c) and the longest line.
COMMANDS = ("help", "status", "get", "set", "start", "stop", "faults", "clear", "stats")
COMMAND_LENGTH = 79

# What the console reads alone, what it sets too.
VALUES = tuple(value.name for value in load_values())
SETTINGS = {setting.name: setting for setting in load_settings()}

NAMES = (*VALUES, *SETTINGS)

# Settings that vector control has too.
VECTOR_SETTINGS = tuple(name for name, setting in SETTINGS.items() if "vector" in setting.methods)

NUMBER_MAX = 2**31 - 1  # read into 32 bits, those with decimals in thousandths
CURRENT_LIMITS = ("current_limit_a", "dc_limit_a", "brake_limit_a")
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
    if command == "get" and names and names[0] not in NAMES:
        return f'"{names[0]}" is no value of the drive{_known(names[0], NAMES)}'
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
    form = _MILLI if SETTINGS[name].decimals else _WHOLE
    return float(words[2]) if form.fullmatch(words[2]) else None


def _setting_problem(words: list[str]) -> str | None:
    if len(words) != 2:
        return 'must have the form "set NAME VALUE"'
    if words[0] in VALUES:
        return f'"{words[0]}" is a value of the drive that cannot be set'
    if words[0] not in SETTINGS:
        return f'"{words[0]}" is no setting of the drive{_known(words[0], tuple(SETTINGS))}'
    permitted = _permitted_instead(*words)
    return permitted and f"'{words[1]}' is not permitted for {words[0]}, permitted: {permitted}"


def _permitted_instead(name: str, text: str) -> str | None:
    """What a setting takes if it never takes this value."""
    setting = SETTINGS[name]
    number = number_of_line(f"set {name} {text}", name)
    if text in setting.choices or (number == 0 and setting.zero):
        return None
    low, high = setting.min, setting.max
    if low is not None and high is not None:
        span = f"0 or from {low} to {high}" if setting.zero else f"{low} to {high}"
        inside = number is not None and low <= number <= high
        return None if inside else ", or ".join([*filter(None, [", ".join(setting.choices)]), span])
    form = "a number with at most three decimals" if setting.decimals else "a whole number"
    if number is None:
        return form
    if round(10**setting.decimals * abs(number)) > NUMBER_MAX:
        most = f", of at most {NUMBER_MAX / 1000:.3f}" if setting.decimals else f" of at most {NUMBER_MAX}"
        return f"{form}{most} in size"
    return None


def switch_of_line(line: str, name: str) -> bool | None:
    """What a line sets a switch, or the mode (True: torque), to; None if it sets another setting."""
    words = line.split()
    if words[:2] != ["set", name] or len(words) != 3:
        return None
    return words[2] == "torque" if words[2] in SETTINGS["mode"].choices else number_of_line(line, name) == 1


def _known(word: str, names: tuple[str, ...]) -> str:
    """The nearest name, else all of them."""
    return did_you_mean(word, names) or f", permitted: {', '.join(names)}"
