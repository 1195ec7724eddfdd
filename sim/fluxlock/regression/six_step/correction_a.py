"""Correction A: the delay to the commutation from three crossing intervals, against unequal inductances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fluxlock.cosim.outcome import Outcome
from fluxlock.regression.case import Condition, Number, Row, case
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.measures import (
    Limits,
    commutation_intervals,
    crossing_intervals,
    event,
    interval_values,
    phase_crossing_errors,
    theory_errors,
    timeline,
    turn_peak_to_peak_a,
)

# Speed, r/min: no whole number of carriers a sector. Permitted deviation of an interval when interpolated, deg.
SPEEDS = {20_060: 0.8, 40_130: 0.4, 60_170: 0.3}
FIRST_DEG = 4.0
NOTE = (
    "The thresholds stay: the crossings keep their spread, the commutations are even; their intervals are judged. The "
    "current's peak-to-peak is that of a turn, mean over the turns; over a whole window it is the ripple's beat."
)
CARRIER_HZ = 40_000

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


def _run(runner: Runner, speed_rpm: int, stages: tuple[Stage, ...], length: _Length) -> Outcome:
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
        "six-step/correction-a.toml", f"{speed_rpm}", f"initial.speed_rpm={speed_rpm}", *timeline(at_s, events, windows)
    )


def _row(run: Outcome, speed_rpm: int, stage: Stage) -> Row:
    corrected, method = stage
    name = _name(stage)
    intervals = commutation_intervals(run, name)
    current_a = turn_peak_to_peak_a(run, name)
    values: dict[str, Number] = {
        **interval_values(intervals, "commutation_interval_deg"),
        **interval_values(crossing_intervals(run, name), "crossing_interval_deg"),
        "intervals": int(intervals.size),
        "commutation_error_deg.mean": run.metrics[name]["commutation_error_deg"]["mean"],
        "phase_current_pp_a": run.metrics[name]["phase_current_pp_a"],
        "phase_current_pp_turn_a": current_a,
        "trips": len(run.result["trips"]),
    }
    limits: Limits = {"trips": (0, 0)}
    if not corrected:
        values |= phase_crossing_errors(run, name) | theory_errors(run, speed_rpm)
    else:
        allowed_deg = FIRST_DEG if method == "first" else SPEEDS[speed_rpm]
        limits["commutation_interval_deg.min"] = (60 - allowed_deg, None)
        limits["commutation_interval_deg.max"] = (None, 60 + allowed_deg)
        if method != "first":
            limits["commutation_interval_deg.rms"] = (None, 0.2)
        without = _name((False, "interpolated" if method == "averaged" else method))
        if without in run.metrics:
            values["current_pp_turn_fall_a"] = turn_peak_to_peak_a(run, without) - current_a
            limits["current_pp_turn_fall_a"] = (0.0, None)
    conditions: dict[str, Condition] = {
        "motor": "Motor-I, 5 uH in A",
        "supply_v": 15,
        "carrier_hz": CARRIER_HZ,
        "speed_rpm": speed_rpm,
        "carriers_per_sector": round(CARRIER_HZ / (speed_rpm / 10), 3),
        "correction_a": corrected,
        "method": method,
    }
    note = NOTE if stage == (True, "interpolated") else ""
    return Row(f"six-step/correction-a/{speed_rpm}-{name}", conditions, values, limits, note)


@case("six-step/correction-a")
def correction_a(runner: Runner) -> Iterator[Row]:
    """5 uH in phase A: correction A evens out the commutations, whatever the time of the crossings."""
    speeds = (60_170,) if runner.quick else tuple(SPEEDS)
    stages = QUICK if runner.quick else FULL
    length = _Length(0.12, 250, 0.03) if runner.quick else _Length(0.20, 1010, 0.08)
    for speed_rpm in speeds:
        run = _run(runner, speed_rpm, stages, length)
        yield from (_row(run, speed_rpm, stage) for stage in stages)
