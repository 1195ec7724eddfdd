# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Hall sensors: start and run by misplaced ones, before and after learning; fallback for lost crossings."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, console_word, event, timeline

CONDITIONS: dict[str, Condition] = {
    "motor": "Motor-I",
    "fan_mnm_at_60000": 20,
    "carrier_hz": 40_000,
    "hall_offset_deg": "6/-4/3",
}
LEARNT_DEG = 0.5
# Lateness of the edges into sectors I to VI at positive speed.
EDGES_DEG = (3.0, -4.0, 6.0, 3.0, -4.0, 6.0)
# Of what the edges' stamps, up to a sample period late, allow.
PLACE_DEG = 0.6
SPEEDS_RPM = (20_000, 40_000, 80_000)
FAILED_S, CLEARED_S = 0.10, 0.15
FALLBACK_NOTE = (
    "A trip: the commutations of the false crossings come up to 70 deg early and drive the current against the EMF; it "
    "may reach the limit of the protection before a Hall edge shows the error, a sector later, and a control tick has "
    "acted. The gates open, the edges catch the rotor: no start from standstill, which the speed would show."
)
CODES = (0, 1000, 2400, 4095)


def _errors(run: Run, window: str) -> dict[str, Number]:
    """Statistics of the commutation error in a window."""
    errors = run.metrics[window]["commutation_error_deg"]
    return {f"commutation_error_deg.{kind}": errors[kind] for kind in ("mean", "rms", "max")}


def _learnt_limits() -> Limits:
    return {
        "commutation_error_deg.mean": (-LEARNT_DEG, LEARNT_DEG),
        "commutation_error_deg.rms": (None, LEARNT_DEG),
        "trips": (0, 0),
    }


def _places(run: Run, direction: int = 1) -> dict[str, Number]:
    """Largest difference between the learnt places and the true ones."""
    found = re.findall(r"^hall_offset_deg((?: -?[\d.]+){6})$", run.console(), re.MULTILINE)
    if not found:
        return {"place_error_deg": None}
    # Backward the edge into sector p + 2 is the one that leads into p forward, as early as that is late.
    true = EDGES_DEG if direction > 0 else tuple(-EDGES_DEG[(s - 2) % 6] for s in range(6))
    learnt = np.array([float(word) for word in found[-1].split()])
    return {"place_error_deg": float(np.max(np.abs(learnt - true)))}


@case("six-step/hall")
def hall(runner: Runner) -> Iterator[Row]:
    """Sensored from standstill to 60 000 r/min by misplaced Hall sensors: errors before and after learning."""
    run = runner.drive("six-step/hall.toml", "start")
    trips = len(run.result["trips"])
    backward_rpm = float(np.min(run.data.records["omega_e"])) * 30 / np.pi
    conditions = CONDITIONS | {"speed_rpm": 60_000, "start": "standstill, no alignment"}
    yield Row(
        "six-step/hall/before",
        conditions | {"learning": False},
        {**_errors(run, "before"), "speed_rpm.min": run.metrics["before"]["speed_rpm"]["min"], "trips": trips}
        | {"backward_rpm": backward_rpm},
        {"speed_rpm.min": (59_400, None), "backward_rpm": (-100, None), "trips": (0, 0)},
    )
    yield Row(
        "six-step/hall/after",
        conditions | {"learning": True},
        {**_errors(run, "after"), **_places(run), "trips": trips},
        _learnt_limits() | {"place_error_deg": (None, PLACE_DEG)},
    )
    if runner.quick:
        return
    for speed_rpm in SPEEDS_RPM:
        yield _at_speed(runner, speed_rpm)
    yield _reversed(runner)


def _at_speed(runner: Runner, speed_rpm: int) -> Row:
    """Caught by its edges at the speed, learning from there on."""
    times = timeline(
        0.45,
        [
            event(0.003, "speed_rpm", speed_rpm),
            event(0.004, "command", "start"),
            event(0.445, "command", "get hall_offset_deg"),
        ],
        [("learnt", 0.35, 0.445)],
    )
    run = runner.drive(
        "six-step/hall.toml",
        f"{speed_rpm}",
        "drive.hall.learn=true",
        f"initial.speed_rpm={speed_rpm}",
        "inverter.supply_v=30",
        "inverter.sensing.voltage_full_scale_v=40",
        "expect=[]",
        *times,
    )
    return Row(
        f"six-step/hall/{speed_rpm}",
        CONDITIONS | {"speed_rpm": speed_rpm, "supply_v": 30, "start": "caught by the edges", "learning": True},
        {**_errors(run, "learnt"), **_places(run), "trips": len(run.result["trips"])},
        _learnt_limits() | {"place_error_deg": (None, PLACE_DEG)},
    )


def _reversed(runner: Runner) -> Row:
    """Learnt forward, turned, learnt backward."""
    times = timeline(
        1.7,  # the fan brakes the last 5000 r/min but slowly
        [
            event(0.003, "speed_rpm", 20_000),
            event(0.004, "command", "start"),
            event(0.25, "command", "set speed_rpm -20000"),
            event(1.69, "command", "get hall_offset_deg"),
        ],
        [("learnt", 1.60, 1.69)],
    )
    sets = ("drive.hall.learn=true", "drive.sync_rect=true", "initial.speed_rpm=20000", "expect=[]")
    run = runner.drive("six-step/hall.toml", "reversal", *sets, *times)
    return Row(
        "six-step/hall/reversal",
        CONDITIONS | {"speed_rpm": -20_000, "start": "at 20 000 r/min, turned", "learning": True},
        {
            **_errors(run, "learnt"),
            **_places(run, -1),
            "speed_rpm.mean": run.metrics["learnt"]["speed_rpm"]["mean"],
            "trips": len(run.result["trips"]),
        },
        _learnt_limits() | {"place_error_deg": (None, PLACE_DEG), "speed_rpm.mean": (-20_200, -19_800)},
    )


@case("six-step/hall-fallback", tested=True)
def hall_fallback(runner: Runner) -> Iterator[Row]:
    """A voltage channel fails at 60 000 r/min: the Hall edges take over and give back."""
    failures = [("vb", 2400)] if runner.quick else [(f"v{x}", code) for x in "abc" for code in CODES]
    for channel, code in failures:
        changed = (f"event[3].fault.channel={channel}", f"event[3].fault.code={code}", "expect=[]")
        may = {"trip": FALLBACK_NOTE, "lost_angle": "false crossings commutate until an edge shows the error"}
        may["lost_lock"] = "the crossings are lost, the edges take over"
        run = runner.drive("six-step/hall-fallback.toml", f"{channel}-{code}", *changed, accept=may)
        console = re.findall(r"^commutated_by (\w+)", run.console(), re.MULTILINE)
        yield Row(
            f"six-step/hall-fallback/{channel}-{code}",
            CONDITIONS
            | {"speed_rpm": 60_000, "failure": f"{channel} keeps code {code} for {CLEARED_S - FAILED_S:g} s"}
            | {"commutated_by": " ".join(console)},
            {
                **_errors(run, "hall"),
                "commutation_error_deg.rms_after": run.metrics["back"]["commutation_error_deg"]["rms"],
                "speed_rpm.min": run.metrics["failing"]["speed_rpm"]["min"],
                "phase_current_pp_a": run.metrics["failing"]["phase_current_pp_a"],
                "handovers": int(console_word(run, "hall_handovers") or 0),
                "back": int(console == ["crossings", "hall", "crossings"]),
                "trips": len(run.result["trips"]),
            },
            _learnt_limits()
            | {"trips": (0, 1)}
            | {"commutation_error_deg.rms_after": (None, LEARNT_DEG), "handovers": (1, 1), "back": (1, 1)}
            | {"speed_rpm.min": (57_000, None)},
            FALLBACK_NOTE,
        )
