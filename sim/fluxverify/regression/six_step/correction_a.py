# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Correction A: the delay to the commutation from three crossing intervals, against unequal inductances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fluxlock.cosim.outcome import Run
from fluxlock.theory.six_step.unequal import (
    commutation_intervals_deg,
    crossing_intervals_deg,
    sector_errors_deg,
)
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import (
    Limits,
    commutation_intervals,
    crossing_intervals,
    event,
    extremes_about,
    interval_values,
    line_drop_v,
    phase_crossing_errors,
    theory_errors,
    timeline,
    turn_peak_to_peak_a,
)

# Speed, r/min: no whole number of carriers a sector. Permitted deviation of an interval when interpolated, deg.
SPEEDS = {20_060: 0.8, 40_130: 0.4, 60_170: 0.3}
FIRST_DEG = 4.0
NOTE = (
    "The thresholds stay, so by theory the crossings keep their spread with A on: 60 deg plus the difference of two "
    "phases' errors. Only commutations can be 60 deg apart. The thesis calls one trace (figures 2.11 to 2.13) both ZCP "
    "and commutation interval; its 45 to 80 deg without A are near the crossings' (49 to 81 by theory, 20 060 r/min), "
    "not the commutations' (33 to 97: half a wrong interval after a wrong crossing), its 60 deg with A can only be the "
    "commutations'. Both are limited. phase_current_pp_a: of the whole window, with the ripple's beat with the rotor; "
    "phase_current_pp_turn_a: of a turn, mean over the turns."
)
CARRIER_HZ = 40_000
# Caught above the target the rotor only slows down to it: crossings by the first sample carry no run-up at the current
# limit at 60 000 r/min.
BEGIN_ABOVE = 1.06
# A window is that many intervals longer than what it must hold: its ends cut some, the speed is not quite the set one.
SPARE = 10

# Windows: correction A, method.
Stage = tuple[bool, str]
FULL: tuple[Stage, ...] = (
    (False, "first"),
    (False, "interpolated"),
    (True, "first"),
    (True, "interpolated"),
    (True, "averaged"),
)
QUICK: tuple[Stage, ...] = ((False, "interpolated"), (True, "interpolated"), (True, "first"))


@dataclass(frozen=True)
class _Length:
    """Times of a run: first window, number of intervals in each, settling after a change."""

    from_s: float
    intervals: int
    settle_s: float


def _name(stage: Stage) -> str:
    return f"{'on' if stage[0] else 'off'}-{stage[1]}"


def _run(runner: Runner, speed_rpm: int, stages: tuple[Stage, ...], length: _Length) -> Run:
    """One window a stage, changed on the console."""
    span_s = round(length.intervals / (6 * speed_rpm / 60), 6)
    events = [event(0.003, "speed_rpm", speed_rpm), event(0.004, "command", "start")]
    windows = []
    at_s = 0.005
    for k, (corrected, method) in enumerate(stages):
        events.append(event(at_s, "command", f"set correction_a {int(corrected)}"))
        events.append(event(at_s + 0.001, "command", f"set zcd_method {method}"))
        begin_s = round(length.from_s if k == 0 else at_s + length.settle_s, 6)
        at_s = round(begin_s + span_s, 6)
        windows.append((_name((corrected, method)), begin_s, at_s))
    return runner.drive(
        "six-step/correction-a.toml",
        f"{speed_rpm}",
        f"initial.speed_rpm={BEGIN_ABOVE * speed_rpm:.0f}",
        *timeline(at_s, events, windows),
    )


def _current(run: Run, window: str) -> dict[str, Number]:
    """Peak-to-peak values of the current; none if the drive did not run in the window."""
    running = commutation_intervals(run, window).size > 0
    return {
        "phase_current_pp_a": run.metrics[window]["phase_current_pp_a"] if running else None,
        "phase_current_pp_turn_a": turn_peak_to_peak_a(run, window) if running else None,
    }


def _row(run: Run, speed_rpm: int, stage: Stage, least_intervals: int) -> Row:
    corrected, method = stage
    name = _name(stage)
    intervals, current_a = commutation_intervals(run, name), _current(run, name)
    values: dict[str, Number] = {
        **interval_values(intervals, "commutation_interval_deg"),
        **interval_values(crossing_intervals(run, name), "crossing_interval_deg"),
        "intervals": int(intervals.size),
        "commutation_error_deg.mean": run.metrics[name]["commutation_error_deg"]["mean"],
        **current_a,
        "trips": len(run.result["trips"]),
    }
    allowed_deg = FIRST_DEG if method == "first" else SPEEDS[speed_rpm]
    supply_v = run.scenario.inverter.supply_v
    errors = sector_errors_deg(run.scenario.motor, supply_v, speed_rpm, drop_v=line_drop_v(run, name))
    limits: Limits = {"trips": (0, 0), "intervals": (least_intervals, None)}
    limits |= extremes_about(crossing_intervals_deg(errors), allowed_deg, "crossing_interval_deg")
    if not corrected:
        values |= phase_crossing_errors(run, name) | theory_errors(run, name, speed_rpm)
        # 3/2 of an interval less 1/2 of the one before: of their deviations, up to twice.
        limits |= extremes_about(commutation_intervals_deg(errors), 2 * allowed_deg, "commutation_interval_deg")
    else:
        limits["commutation_interval_deg.min"] = (60 - allowed_deg, None)
        limits["commutation_interval_deg.max"] = (None, 60 + allowed_deg)
        if method != "first":
            limits["commutation_interval_deg.rms"] = (None, 0.2)
        without = _name((False, "interpolated" if method == "averaged" else method))
        if without in run.metrics:
            for key, before_a in _current(run, without).items():
                name_of_fall, own_a = key.replace("phase_", "").replace("_a", "_fall_a"), current_a[key]
                values[name_of_fall] = None if before_a is None or own_a is None else before_a - own_a
                limits[name_of_fall] = (0.0, None)
    conditions: dict[str, Condition] = {
        "motor": "Motor-I, 5 uH in A",
        "supply_v": 15,
        "carrier_hz": CARRIER_HZ,
        "speed_rpm": speed_rpm,
        "carriers_per_sector": round(CARRIER_HZ / (speed_rpm / 10), 3),
        "correction_a": corrected,
        "method": method,
    }
    return Row(f"six-step/correction-a/{speed_rpm}-{name}", conditions, values, limits, NOTE)


@case("six-step/correction-a")
def correction_a(runner: Runner) -> Iterator[Row]:
    """5 uH in phase A: correction A evens out the commutations, whatever the time of the crossings."""
    speeds = (60_170,) if runner.quick else tuple(SPEEDS)
    stages = QUICK if runner.quick else FULL
    length = _Length(0.12, 250, 0.03) if runner.quick else _Length(0.20, 1010, 0.08)
    for speed_rpm in speeds:
        run = _run(runner, speed_rpm, stages, length)
        yield from (_row(run, speed_rpm, stage, length.intervals - SPARE) for stage in stages)
