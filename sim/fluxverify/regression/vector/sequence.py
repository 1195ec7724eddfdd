# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Vector control without a sensor through the whole range of speed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, console_word, event, timeline
from fluxverify.regression.vector.frames import angle_errors_deg, frame_changes_s, rms

SCENARIO = "vector/start.toml"
RMS_DEG, MAX_DEG = 1.0, 5.0
SPEED_SHARE = 0.01  # of the speed at the end of the ramps
TOP_RPM, QUICK_RPM = 90_000, 15_000
START_S, REVERSAL_S, STOP_S, END_S = 0.02, 1.20, 3.05, 3.90  # of the file
QUICK_END_S = 0.38
# The frame is forced until the rotor is aligned, at least.
ALIGNED_S = 0.08


def _values(run: Run, *spans_s: tuple[float, float]) -> dict[str, Number]:
    errors = angle_errors_deg(run, *spans_s)
    return {
        "angle_error_deg.mean": float(errors.mean()),
        "angle_error_deg.rms": rms(errors),
        "angle_error_deg.max": float(np.abs(errors).max()),
        "hand_over_s": spans_s[0][0],
        "trips": len(run.result["trips"]),
        "faults": int(run.data.fault is not None),
        "lost_locks": int(console_word(run, "lost_locks") or 0),
    }


def _limits() -> Limits:
    return {
        "angle_error_deg.rms": (None, RMS_DEG),
        "angle_error_deg.max": (None, MAX_DEG),
        "trips": (0, 0),
        "faults": (0, 0),
        "lost_locks": (0, 0),
    }


def _around(speed_rpm: float) -> tuple[float, float]:
    share = SPEED_SHARE * abs(speed_rpm)
    return speed_rpm - share, speed_rpm + share


@case("vector/sequence", long=True)
def sequence(runner: Runner) -> Iterator[Row]:
    """Sensorless on the chip: standstill, 90 000 r/min, reversal, stop, fan load; angle error after the hand-over."""
    conditions: dict[str, Condition] = {
        "motor": "Motor-I",
        "load": "fan 20 mN*m at 60 000 r/min",
        "carrier_hz": 20_000,
        "update": "double",
        "samples_a_tick": 4,
    }
    if runner.quick:
        events = [event(0.01, "speed_rpm", QUICK_RPM), event(START_S, "command", "start")]
        events.append(event(QUICK_END_S - 0.005, "command", "get lost_locks"))
        times = timeline(QUICK_END_S, events, [("end", QUICK_END_S - 0.02, QUICK_END_S)])
        run = runner.drive(SCENARIO, "start", *times, "expect=[]")
        (over_s,) = frame_changes_s(run, ALIGNED_S, QUICK_END_S, 1)
        values = _values(run, (over_s, QUICK_END_S)) | {"speed_rpm.mean": run.metrics["end"]["speed_rpm"]["mean"]}
        limits = _limits() | {"speed_rpm.mean": _around(QUICK_RPM)}
        yield Row("vector/sequence/start", conditions | {"speed_rpm": QUICK_RPM}, values, limits)
        return
    run = runner.drive(SCENARIO, "whole")  # as it is: one run with that of `vector/shipped`
    (first_s,) = frame_changes_s(run, ALIGNED_S, REVERSAL_S, 1)
    back_s, second_s = frame_changes_s(run, REVERSAL_S, STOP_S, 2)
    (last_s,) = frame_changes_s(run, STOP_S, END_S, 1)
    speeds = {name: run.metrics[name]["speed_rpm"]["mean"] for name in ("forward", "reverse")}
    values = _values(run, (first_s, back_s), (second_s, last_s)) | {
        "hand_back_s": back_s,
        "second_hand_over_s": second_s,
        "speed_rpm.forward": speeds["forward"],
        "speed_rpm.reverse": speeds["reverse"],
        "speed_rpm.end": run.metrics["end"]["speed_rpm"]["mean"],
        "stopped": int(console_word(run, "state") == "ready"),
    }
    limits = _limits() | {
        "speed_rpm.forward": _around(TOP_RPM),
        "speed_rpm.reverse": _around(-TOP_RPM),
        "stopped": (1, 1),
    }
    yield Row("vector/sequence/whole", conditions | {"speed_rpm": TOP_RPM}, values, limits)
