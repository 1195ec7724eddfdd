# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Open phases of the five-phase machine at speed: found and named, ridden through, a second one stopped."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import LogKind
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.driven import angle_values
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

SCENARIO = "five-phase/yu.toml"
FIRST, SECOND = "C", "E"
TURNS = 1.0
LEAST_SHARE = 0.9  # of the speed, ridden through
SETTLED_S = 0.02  # after the phase opened


def found_turns(run: Run, first_s: float, second_s: float, rpm: float) -> tuple[Number, Number]:
    """From each phase's opening until it is in the fault log, electrical turns; the second one takes the gates off."""
    ticks = sorted(int(n) for n in re.findall(r"^fault open_phases? tick (\d+)", run.console(), re.MULTILINE))
    gates = run.data.rows(LogKind.GATES)
    if len(ticks) < 2 or gates[-1, 2] != 0:
        return None, None
    tick_s = 1 / (2 * run.scenario.drive.carrier_hz)  # double update, a tick at each
    off_s = float(gates[-1, 0]) / CLOCK_HZ
    per_s = run.scenario.motor.electrical_hz(rpm)
    return (off_s - (ticks[1] - ticks[0]) * tick_s - first_s) * per_s, (off_s - second_s) * per_s


@case("five-phase/open-phase")
def open_phase(runner: Runner) -> Iterator[Row]:
    """Phase C opens at speed: found within a turn, ridden through; then phase E: stopped. Both by name."""
    yield opened(runner, 0.0)
    if not runner.quick:
        yield opened(runner, 2.0)


def opened(runner: Runner, dead_time_us: float) -> Row:
    """One run and its row."""
    rpm, load_nm = 600.0, 3.0
    first_s, second_s, end_s = (0.29, 0.33, 0.345) if runner.quick else (0.32, 0.44, 0.46)
    events = [
        event(0.0, "load_factor", 0.0),
        event(0.002, "speed_rpm", rpm),
        event(0.004, "command", "start"),
        {**event(0.07, "load_factor", 1.0), "ramp_s": 0.06},
        event(first_s, "fault", {"kind": "open_phase", "phases": [FIRST]}),
        event(second_s - 2e-3, "command", "get open_phases"),
        event(second_s, "fault", {"kind": "open_phase", "phases": [SECOND]}),
    ]
    overrides = [
        *timeline(end_s, events, [("steady", first_s + SETTLED_S, second_s)]),
        "expect=[]",
        "drive.vector.handover_rpm=450",
        "drive.accel_rpm_per_s=3000",
        "drive.vector.speed_hz=8",
        f"load.coulomb_nm={load_nm:g}",
        f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
    ]
    ending = f"/{dead_time_us:g}us" if dead_time_us else ""
    may = {"fault": "open_phases, which the row asks for"}
    run = runner.drive(SCENARIO, "run" + ending.replace("/", "-"), *overrides, accept=may)
    first, second = found_turns(run, first_s, second_s, rpm)
    records = run.data.records
    time_s = records["t_cycle"] / run.data.clock_hz
    inside = (time_s > first_s) & (time_s < second_s)
    settled = inside & (time_s > first_s + SETTLED_S)
    console = run.console()
    values: dict[str, Number] = {
        "found_turns": first,
        "named": int(f"open_phases {FIRST}" in console),
        "second.found_turns": second,
        "second.named": int(bool(re.search(r"^now open_phases", console, re.MULTILINE))),
        "speed_rpm.min": float(records["omega_e"][inside].min()) / run.data.pole_pairs * RPM_PER_RAD_S,
        "torque_nm.mean": float(records["torque_nm"][settled].mean()),
        "torque_nm.rms": float(np.std(records["torque_nm"][settled])),
        "phase_current_a.max": float(np.abs([records[f"i{x}"][settled] for x in "abde"]).max()),
        **angle_values(run),
    }
    return Row(
        f"five-phase/open-phase{ending}",
        {"motor": "Yu", "speed_rpm": rpm, "load_nm": load_nm, "dead_time_us": dead_time_us},
        values,
        {
            "found_turns": (0, TURNS),
            "named": (1, 1),
            "second.found_turns": (0, TURNS),
            "second.named": (1, 1),
            "speed_rpm.min": (LEAST_SHARE * rpm, None),
            "trips": (0, 0),
        },
    )
