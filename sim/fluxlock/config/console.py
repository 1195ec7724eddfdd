"""Lines of the drive's console, checked before a run by the names of the firmware (sw/app)."""

from __future__ import annotations

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
    "irq_load",
)


def line_problem(line: str) -> str | None:
    """Why the console would refuse a line whatever the drive does: its form or a name. Values are not looked at."""
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
    words = line.split()
    if words[:2] != ["set", "speed_rpm"] or len(words) != 3:
        return None
    try:
        return float(int(words[2]))
    except ValueError:
        return None


def _setting_problem(words: list[str]) -> str | None:
    if len(words) != 2:
        return 'must have the form "set NAME VALUE"'
    if words[0] in VALUES:
        return f'"{words[0]}" is a value of the drive that cannot be set'
    if words[0] not in SETTINGS:
        return f'"{words[0]}" is no setting of the drive{_known(words[0], SETTINGS)}'
    return None


def _known(word: str, names: tuple[str, ...]) -> str:
    """The nearest name, else all of them."""
    return did_you_mean(word, names) or f", permitted: {', '.join(names)}"
