# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The default time of a crossing, averaged, against the interpolated one: the same runs in pairs.

Judged by the crossings that are seen: neither method times one that freewheeling hides (`late`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fluxlock.interface.settings import choices
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, in_window, timeline

METHODS = ("interpolated", "averaged")
LIMIT_DEG = 0.3
# Below this both are as good: what is left is the clock.
FLOOR_DEG = 0.03
COMMUTATION = "six-step/commutation-error.toml"
TOP_RPM = "motor.max_speed_rpm=125000"  # above the motor file's


@dataclass(frozen=True)
class Point:
    """A pair of runs, caught at speed. begin_rpm: of the rotor; from_s, to_s: window; limit_deg: of the averaged rms.

    Short: the speed still settles in the window, in both runs alike.
    """

    name: str
    scenario: str
    speed_rpm: int
    overrides: tuple[str, ...] = ()
    begin_rpm: int | None = None
    from_s: float = 0.03
    to_s: float = 0.06
    limit_deg: float = LIMIT_DEG


def _flux(speed_rpm: int, factor: float) -> Point:
    name = f"flux{100 * (factor - 1):+.0f}%-{speed_rpm}"
    return Point(name, COMMUTATION, speed_rpm, (TOP_RPM, f"drive.motor_error.flux={factor}"))


def _pattern(alignment: str, pattern: str) -> Point:
    # N = 3.39 carriers a sector. RSC adds its delay to every commutation, whatever the crossing. With PWM-ON it loses
    # the lock by either method unless the crossings that freewheeling hides are computed back.
    back = ("drive.zcd.compute_back=true",) if (alignment, pattern) == ("RSC", "PWM-ON") else ()
    overrides = (f"drive.commutation={alignment}", f"drive.pattern={pattern}", *back)
    return Point(
        f"{alignment}-{pattern}", "patterns.toml", 59_000, overrides, limit_deg=12.0 if alignment == "RSC" else 0.3
    )


POINTS = (
    *(Point(f"motor-1-{rpm}", COMMUTATION, rpm, (TOP_RPM,)) for rpm in (20_000, 60_000, 120_000)),
    # Caught at 20 000 r/min: more slowly the drive waits for the rotor to stop. Continuous current by sync_rect.
    Point(
        "motor-1-10000", COMMUTATION, 10_000, ("load.constant_nm=0.002", "drive.sync_rect=true"), 20_000, 0.3, 0.34, 0.6
    ),
    Point("reverse-60000", COMMUTATION, -60_000, (TOP_RPM,)),
    *(_flux(rpm, factor) for rpm in (20_000, 60_000) for factor in (0.8, 1.2)),
    *(_pattern(alignment, pattern) for alignment in ("RSC", "NSC", "CSC") for pattern in choices("pattern")),
    *(
        Point(f"{source}-60000", COMMUTATION, 60_000, (TOP_RPM, f"drive.zcd.source={source}"))
        for source in ("star_point", "mean")
    ),
    Point("spindle-15000", "own-spindle.toml", 15_000),
    Point("pump-6000", "own-pump.toml", 6_000),
    Point("outrunner-8000", "own-outrunner.toml", 8_000),
    # From standstill: too fast to be caught.
    Point("highest-600000", "six-step/highest-speed.toml", 605_000, (), 0, 0.18, 0.2, 3.0),
)
QUICK = ("motor-1-20000", "flux-20%-60000")


def _measured(runner: Runner, point: Point, method: str) -> dict[str, Number]:
    begin_rpm = point.speed_rpm if point.begin_rpm is None else point.begin_rpm
    target = f"set speed_rpm {point.speed_rpm}"
    events = [event(0.003, "command", target), event(0.004, "command", "start")]
    run = runner.drive(
        point.scenario,
        f"{point.name}-{method}",
        f"initial.speed_rpm={begin_rpm}",
        "expect=[]",
        f"drive.zcd.method={method}",
        *timeline(point.to_s, events, [("steady", point.from_s, point.to_s)]),
        *point.overrides,
    )
    window = run.metrics["steady"]
    crossings = in_window(run, run.analysis.crossings, "steady")
    late = crossings.late.astype(bool)
    seen = crossings.error_deg[~late & np.isfinite(crossings.error_deg)]  # behind the last record there is no angle
    return {
        f"{method}.seen_deg.mean": float(seen.mean()) if seen.size else None,
        f"{method}.seen_deg.rms": float(np.sqrt(np.mean(seen**2))) if seen.size else None,
        f"{method}.late": int(late.sum()),
        f"{method}.commutation_deg.mean": window["commutation_error_deg"]["mean"],
        f"{method}.commutation_deg.std": window["commutation_error_deg"]["std"],
        f"{method}.commutation_deg.rms": window["commutation_error_deg"]["rms"],
        f"{method}.speed_rpm": window["speed_rpm"]["mean"],
        f"{method}.trips": len(run.result["trips"]),
    }


@case("six-step/zcd-methods")
def zcd_methods(runner: Runner) -> Iterator[Row]:
    """Interpolated and averaged in pairs: speeds, a wrong flux, patterns, alignments, signals, other machines."""
    for point in POINTS:
        if runner.quick and point.name not in QUICK:
            continue
        values: dict[str, Number] = {}
        for method in METHODS:
            values |= _measured(runner, point, method)
        before, after = (values[f"{method}.seen_deg.rms"] for method in METHODS)
        values["seen_deg.rms.worse"] = None if before is None or after is None else after - max(before, FLOOR_DEG)
        conditions: dict[str, Condition] = {"scenario": point.scenario, "speed_rpm": point.speed_rpm}
        for override in point.overrides:
            key, _, setting = override.partition("=")
            conditions[key] = setting
        slower, faster = (values[f"{method}.speed_rpm"] for method in METHODS)
        values["speed_rpm.apart"] = None if slower is None or faster is None else abs(faster - slower)
        yield Row(
            f"six-step/zcd-methods/{point.name}",
            conditions,
            values,
            {
                "seen_deg.rms.worse": (None, 0.0),
                "averaged.commutation_deg.rms": (None, point.limit_deg),
                "speed_rpm.apart": (None, 0.01 * abs(point.speed_rpm)),
                "averaged.trips": (0, 0),
            },
        )
