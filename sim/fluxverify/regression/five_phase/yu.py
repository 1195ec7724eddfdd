# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine of Yu 2022: angle sequences, cross-coupling under load."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import Motor, load_scenario
from fluxlock.config.injection import SEQUENCES, Sequence
from fluxlock.cosim.outcome import Run
from fluxlock.theory.injection.chain import HfMachine
from fluxlock.theory.injection.theory import sequence_error
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.driven import angle_values, driven
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits

SCENARIO = "five-phase/yu.toml"
SAMPLE_S = 125e-6
SETTLED_S = 0.19
# Electrical turns in the window: least, at the lowest speed, with dead time: least, at the highest speed.
TURNS, NOISE_TURNS = 4, 32
DEAD_TIME_TURNS, FAST_DEAD_TIME_TURNS = 16, 64
SPEEDS_RPM = (50.0, 150.0, 300.0, 600.0)
FORM_PERCENT = 3.0
EXACT_RAD = 0.005
LINEAR = ("motor.saturation.plus=0", "motor.saturation.minus=0", "motor.saturation.angle_rad=[0.0]")


def closed_form_rad(motor: Motor, rpm: float, sequence: Sequence) -> float:
    """Error of the reported angle at rest of the loop."""
    assert motor.inductance_q_h is not None
    machine = HfMachine(motor.resistance_ohm[0], motor.inductance_h[0], motor.inductance_q_h)
    return sequence_error(machine, motor.omega_e(rpm) * SAMPLE_S, sequence)


def turns(sequence: Sequence, rpm: float, dead_time_us: float) -> int:
    """Electrical turns of the window: whole ones, and so many that the converters' noise weighs the same at all speeds.

    The closed forms are proportional to the speed, the noise of a mean falls with the root of its time. The limit of
    the exact sequence is the same at all speeds. What a dead time leaves differs from turn to turn, and more so the
    faster they are: 0.009 rad rms at 600 r/min, so that 16 turns cannot judge a limit of 0.005 rad.
    """
    if dead_time_us:
        return max(DEAD_TIME_TURNS, math.ceil(FAST_DEAD_TIME_TURNS * rpm / SPEEDS_RPM[-1]))
    if sequence == "exact":
        return TURNS
    return max(TURNS, math.ceil(NOISE_TURNS * SPEEDS_RPM[0] / rpm))


def noise_of_mean(run: Run, count: int) -> float:
    """Standard error of the angle error's mean over the window (deg), from the means of its `count` turns."""
    angles = run.analysis.angles
    error = angles.error_deg[angles.cycle >= SETTLED_S * run.data.clock_hz]
    means = [float(part.mean()) for part in np.array_split(error, count)]
    return float(np.std(means, ddof=1)) / math.sqrt(count)


def sequence_run(runner: Runner, sequence: Sequence, rpm: float, dead_time_us: float = 0.0) -> Run:
    """Driven at a speed without current and saturation, from a known rest."""
    motor = load_scenario(ROOT / "scenarios" / SCENARIO).motor
    end_s = round(SETTLED_S + turns(sequence, rpm, dead_time_us) * math.tau / motor.omega_e(rpm), 5)
    overrides = [
        *driven(rpm, 0.0, SETTLED_S, end_s),
        *LINEAR,
        f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
        "initial.theta_deg=0",
        "drive.vector.injection.search=false",
        f"drive.vector.injection.sequence={sequence}",
    ]
    name = f"{sequence}-{rpm:g}" + (f"-{dead_time_us:g}us" if dead_time_us else "")
    return runner.drive(SCENARIO, name, *overrides)


@case("five-phase/yu-sequences", long=True)
def sequences(runner: Runner) -> Iterator[Row]:
    """Driven shaft, no saturation, no current: reported angle of each sequence against its closed form.

    The closed forms know no dead time: what is left of 2 us comes on top of them, and is shown.
    """
    for dead_time_us in (0.0, 2.0):
        for sequence in SEQUENCES[1:]:
            for rpm in SPEEDS_RPM:
                short = rpm == SPEEDS_RPM[-1] and sequence != "held" and not dead_time_us
                if short or not runner.quick:
                    yield sequence_row(runner, sequence, rpm, dead_time_us)


def sequence_row(runner: Runner, sequence: Sequence, rpm: float, dead_time_us: float) -> Row:
    """One sequence at one speed."""
    run = sequence_run(runner, sequence, rpm, dead_time_us)
    count = turns(sequence, rpm, dead_time_us)
    values: dict[str, Number] = angle_values(run)
    in_degrees = values.pop("angle_error_deg.mean")
    mean = None if in_degrees is None else math.radians(in_degrees)
    values["angle_error_rad.mean"] = mean
    noise = math.radians(noise_of_mean(run, count))
    limits: Limits = {"trips": (0, 0)}
    if sequence == "exact":
        values["standard_error_rad"] = noise
        limits["angle_error_rad.mean"] = (-EXACT_RAD, EXACT_RAD)
    else:
        form = closed_form_rad(run.scenario.motor, rpm, sequence)
        values["closed_form_rad"] = form
        values["over_closed_form_percent"] = None if mean is None else 100 * (mean / form - 1)
        values["standard_error_percent"] = 100 * abs(noise / form)
        if dead_time_us:
            values["beyond_closed_form_rad"] = None if mean is None else mean - form
        else:
            limits["over_closed_form_percent"] = (-FORM_PERCENT, FORM_PERCENT)
    return Row(
        f"five-phase/yu-sequences/{sequence}/{rpm:g}rpm" + (f"-{dead_time_us:g}us" if dead_time_us else ""),
        {"motor": "Yu", "sequence": sequence, "speed_rpm": rpm, "dead_time_us": dead_time_us, "turns": count},
        values,
        limits,
        "the closed form knows no dead time: docs/theory/five-phase.md" if dead_time_us and sequence != "exact" else "",
    )
