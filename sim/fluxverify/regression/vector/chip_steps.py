# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Steps of i_d on the chip with the switched inverter, less the same run without the step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from fluxlock.theory.vector.controllers import KINDS, cross_peak
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.vector.current_bench import FOLLOWED, STEP_A, Ground, Setting, Step, id_step
from fluxverify.regression.vector.specified import FS_HZ, PEAKS_PERCENT

LIMIT_PERCENT = 3.0  # of the step
INSTANT_LIMIT_CLOCKS = 5.0  # half a dead time: the edges' middles are known to no more
QUICK_POINTS = ((0.1, 0.5),)
WINDOWS: tuple[Literal["sample", "carrier"], ...] = ("sample", "carrier")
AVERAGED_DELAY = 0.75  # ripple at a single sample, and room for the window
RIPPLE_NOTE = (
    "Away from 0.5 T_s and T_s the sample lies beside the middle of pulse and gap, and what the step changes of the "
    "voltage changes its ripple too: the run without the step takes only the rest away. peak_iq_percent_model: of the "
    "exact model with the T_s and T_d of the chip's clocks. deviation_percent: largest distance of the current from "
    "it. sample_instant_error_clocks: of the samples from where T_d puts them, against the middle of the pulses. "
    "angle_error_deg: of the chip's angle."
)
AVERAGED_NOTE = (
    "ripple_a: without a step, rms around the mean, of what the regulators see of the carrier; deviation_percent: "
    "largest distance of the step's response from the exact model, which knows no window."
)


def deviation_percent(step: Step, ground: Ground) -> float:
    """Largest distance from the exact model, per cent of the step."""
    exact = ground.theory.response(np.ones(FOLLOWED, dtype=np.complex128))
    return 100.0 * float(np.abs(step.current[:FOLLOWED] - exact).max())


@case("vector/chip-steps", long=True)
def chip_steps(runner: Runner) -> Iterator[Row]:
    """Step of i_d with A, B, C at 750 and 1500 Hz and four delays: peak of i_q within 3 % of the table, C <= B < A."""
    for (speed, delay), specified in PEAKS_PERCENT.items():
        if runner.quick and (speed, delay) not in QUICK_POINTS:
            continue
        values: dict[str, Number] = {}
        limits: dict[str, tuple[float | None, float | None]] = {}
        peaks = {}
        trips, instants, angles = 0, [], []
        for kind in KINDS:
            setting = Setting(kind, speed, delay)
            ground, step = Ground.of(setting), id_step(runner, setting)
            peaks[kind] = 100.0 * cross_peak(step.current)
            exact = ground.theory.response(np.ones(FOLLOWED, dtype=np.complex128))
            name = f"peak_iq_percent.{kind}"
            values[name] = peaks[kind]
            limits[name] = (max(0.0, specified[kind] - LIMIT_PERCENT), specified[kind] + LIMIT_PERCENT)
            values[f"peak_iq_percent_model.{kind}"] = 100.0 * cross_peak(exact)
            values[f"deviation_percent.{kind}"] = deviation_percent(step, ground)
            trips += step.trips
            instants.append(step.instant_error_cycles)
            angles.append(step.angle_error_deg)
        values |= {
            "sample_instant_error_clocks": max(instants, key=abs),
            "angle_error_deg": max(angles),
            "a_above_b_percent": peaks["A"] - peaks["B"],
            "b_above_c_percent": peaks["B"] - peaks["C"],
            "trips": trips,
        }
        limits |= {"a_above_b_percent": (0.0, None), "b_above_c_percent": (0.0, None), "trips": (0, 0)}
        limits["sample_instant_error_clocks"] = (-INSTANT_LIMIT_CLOCKS, INSTANT_LIMIT_CLOCKS)
        yield Row(
            f"vector/chip-steps/{speed * FS_HZ:.0f}-hz-{100 * delay:.0f}",
            {
                "motor": "Motor-I",
                "fundamental_hz": speed * FS_HZ,
                "carrier_hz": FS_HZ,
                "delay_over_ts": delay,
                "step_a": STEP_A,
                "park": "held",
                "window": "sample",
            },
            values,
            limits,
            RIPPLE_NOTE,
        )


@case("vector/averaging")
def averaging(runner: Runner) -> Iterator[Row]:
    """What the mean over the carrier gains: ripple that the regulators see, and the step of i_d with C."""
    for speed in (0.1,) if runner.quick else (0.05, 0.1):
        values: dict[str, Number] = {}
        trips = 0
        for window in WINDOWS:
            setting = Setting("C", speed, AVERAGED_DELAY, window=window)
            ground, step = Ground.of(setting), id_step(runner, setting)
            values[f"ripple_a.{window}"] = float(np.std(step.ripple_a))
            values[f"peak_iq_percent.{window}"] = 100.0 * cross_peak(step.current)
            values[f"deviation_percent.{window}"] = deviation_percent(step, ground)
            trips += step.trips
        values["trips"] = trips
        yield Row(
            f"vector/averaging/{speed * FS_HZ:.0f}-hz",
            {
                "motor": "Motor-I",
                "fundamental_hz": speed * FS_HZ,
                "carrier_hz": FS_HZ,
                "delay_over_ts": AVERAGED_DELAY,
                "step_a": STEP_A,
                "park": "held",
                "regulator": "C",
            },
            values,
            {"trips": (0, 0)},
            AVERAGED_NOTE,
        )
