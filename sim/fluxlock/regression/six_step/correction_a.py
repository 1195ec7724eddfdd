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
    interval_values,
    timeline,
)

# Speed, r/min: no whole number of carriers a sector. Permitted deviation of an interval when interpolated, deg.
SPEEDS = {20_060: 0.8, 40_130: 0.4, 60_170: 0.3}
FIRST_DEG = 4.0
METHODS = ("first", "interpolated", "averaged")
CARRIER_HZ = 40_000


@dataclass(frozen=True)
class _Length:
    """Times of a run: first window, number of intervals in each, settling after a change."""

    from_s: float
    intervals: int
    settle_s: float


FULL = _Length(0.20, 1010, 0.08)
QUICK = _Length(0.12, 250, 0.03)


def _run(runner: Runner, speed_rpm: int, methods: tuple[str, ...], length: _Length) -> Outcome:
    """Correction A off with interpolated crossings, then on with each of the methods."""
    span_s = length.intervals / (6 * speed_rpm / 60)
    at_s = length.from_s + span_s
    events: list[tuple[float, str, object]] = [(0.003, "speed_rpm", speed_rpm), (0.004, "command", "start")]
    windows = [("off", length.from_s, at_s)]
    events.append((at_s, "command", "set correction_a 1"))
    for method in methods:
        events.append((at_s + 0.001, "command", f"set zcd_method {method}"))
        begin_s = at_s + length.settle_s
        at_s = begin_s + span_s
        windows.append((method, begin_s, at_s))
    return runner.drive(
        "six-step/correction-a.toml",
        f"{speed_rpm}",
        f"initial.speed_rpm={speed_rpm}",
        *timeline(at_s, events, windows),
    )


def _rows(run: Outcome, speed_rpm: int, methods: tuple[str, ...]) -> Iterator[Row]:
    off_a = run.metrics["off"]["phase_current_pp_a"]
    for window in ("off", *methods):
        intervals = commutation_intervals(run, window)
        crossings = crossing_intervals(run, window)
        current_a = run.metrics[window]["phase_current_pp_a"]
        values: dict[str, Number] = {
            **interval_values(intervals, "commutation_interval_deg"),
            **interval_values(crossings, "crossing_interval_deg"),
            "intervals": int(intervals.size),
            "phase_current_pp_a": current_a,
            "trips": len(run.result["trips"]),
        }
        limits: Limits = {"trips": (0, 0)}
        if window != "off":
            allowed_deg = FIRST_DEG if window == "first" else SPEEDS[speed_rpm]
            limits["commutation_interval_deg.min"] = (60 - allowed_deg, None)
            limits["commutation_interval_deg.max"] = (None, 60 + allowed_deg)
            if window != "first":
                limits["commutation_interval_deg.rms"] = (None, 0.2)
            values["current_pp_fall_a"] = off_a - current_a
            limits["current_pp_fall_a"] = (0.0, None)
        conditions: dict[str, Condition] = {
            "motor": "Motor-I, 5 uH in A",
            "supply_v": 15,
            "carrier_hz": CARRIER_HZ,
            "speed_rpm": speed_rpm,
            "carriers_per_sector": round(CARRIER_HZ / (speed_rpm / 10), 3),
            "correction_a": window != "off",
            "method": "interpolated" if window == "off" else window,
        }
        yield Row(f"six-step/correction-a/{speed_rpm}-{window}", conditions, values, limits)


@case("six-step/correction-a")
def correction_a(runner: Runner) -> Iterator[Row]:
    """5 uH in phase A: correction A evens out the commutations, whatever the time of the crossings."""
    speeds = (60_170,) if runner.quick else tuple(SPEEDS)
    methods = METHODS[:2] if runner.quick else METHODS
    for speed_rpm in speeds:
        run = _run(runner, speed_rpm, methods, QUICK if runner.quick else FULL)
        yield from _rows(run, speed_rpm, methods)
