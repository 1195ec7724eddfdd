# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Spectra of gates, current and torque (chapter 6)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.patterns import Commutation
from fluxlock.theory.six_step.recording import (
    current_lines,
    expected_spectrum,
    recorded_spectrum,
    torque_lines,
    whole_turns,
)
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner

# 64 000 r/min at 20 kHz: N = 25/8, lines every 6/8 of the fundamental.
SPECTRUM_Q = 8
# The carrier is order 18.75. Sidebands of the current below the first torque line, and with those about the carrier;
# lines of the gates to beyond three times the carrier.
LOW_ORDER, CARRIER_ORDER, GATE_ORDER = 6, 25, 60
SPECTRUM_COMMUTATIONS: tuple[Commutation, ...] = ("RSC", "NSC", "CSC")


def sideband_orders(most: float) -> FloatArray:
    """Orders 1 + 0.75 k up to `most` that are not of the form 1 + 6 k."""
    steps = np.arange(-int(most * SPECTRUM_Q / 6) - 8, int(most * SPECTRUM_Q / 6) + 8)
    steps = steps[(steps % SPECTRUM_Q != 0) & (np.abs(1 + 6 / SPECTRUM_Q * steps) <= most)]
    orders: FloatArray = 1 + 6 / SPECTRUM_Q * steps
    return orders


def spectrum_run(runner: Runner, commutation: Commutation) -> tuple[Run, tuple[float, float]]:
    """Run at N = 25/8, and its span of held duty (s)."""
    short = ("duration_s=0.13", "window=[]") if runner.quick else ()
    run = runner.drive("six-step/spectrum.toml", commutation, f"drive.commutation={commutation}", *short)
    return run, (0.07, 0.125) if runner.quick else (0.07, 0.18)


@case("six-step/spectrum")
def spectrum(runner: Runner) -> Iterator[Row]:
    """64 000 r/min, N = 25/8: gate lines follow the theory; CSC's sidebands and torque ripple lie far below RSC's."""
    current_a: dict[str, float] = {}
    low_a: dict[str, float] = {}
    ripple_nm: dict[str, float] = {}
    for commutation in SPECTRUM_COMMUTATIONS:
        run, span = spectrum_run(runner, commutation)
        window = whole_turns(run.data, *span, SPECTRUM_Q)
        lines = current_lines(run.data, window, sideband_orders(CARRIER_ORDER))
        size = np.abs(lines.amplitude)
        current_a[commutation] = float(size.max())
        low_a[commutation] = float(size[np.abs(lines.order) <= LOW_ORDER].max())
        below = np.arange(1, 6 * SPECTRUM_Q // 6) * 6 / SPECTRUM_Q
        ripple_nm[commutation] = float(2 * np.max(np.abs(torque_lines(run.data, window, below).amplitude)))
        series = expected_spectrum(run.data, window, commutation, 20_000, GATE_ORDER)
        lines = recorded_spectrum(run.data, window, GATE_ORDER)
        found = np.interp(series.order, lines.order, np.abs(lines.amplitude))
        fundamental = float(np.abs(series.amplitude)[np.argmin(np.abs(series.order - 1))])
        worst = float(np.max(np.abs(found - np.abs(series.amplitude))))
        yield Row(
            f"six-step/spectrum/{commutation}",
            {
                "motor": "Motor-I",
                "speed_rpm": 64_000,
                "carrier_hz": 20_000,
                "pattern": "ON-PWM",
                "held": "speed imposed, duty frozen at 10 mN*m",
                "turns": window.turns,
                "current_orders": f"± {CARRIER_ORDER}",
                "gate_orders": f"± {GATE_ORDER}",
            },
            {
                "line_deviation_percent": 100 * worst / fundamental,
                "current_sideband_a": current_a[commutation],
                "current_sideband_below_6fe_a": low_a[commutation],
                "torque_ripple_below_6fe_mnm": 1000 * ripple_nm[commutation],
                "trips": len(run.result["trips"]),
            },
            {"line_deviation_percent": (None, 1.0), "trips": (0, 0)},
        )
    if not runner.quick:
        yield _mixed_pattern(runner)
    yield Row(
        "six-step/spectrum/CSC-against-RSC",
        {"motor": "Motor-I", "speed_rpm": 64_000, "carrier_hz": 20_000, "pattern": "ON-PWM"},
        {
            "current_sideband_db": 20 * math.log10(current_a["RSC"] / current_a["CSC"]),
            "current_sideband_below_6fe_db": 20 * math.log10(low_a["RSC"] / low_a["CSC"]),
            "torque_ripple_ratio": ripple_nm["RSC"] / ripple_nm["CSC"],
        },
        {
            "current_sideband_db": (40, None),
            "current_sideband_below_6fe_db": (40, None),
            "torque_ripple_ratio": (20, None),
        },
    )


# Of the current under CSC with commutations of two kinds: lines 1 + 3 k that are none of 1 + 6 k.
MIXED_ORDERS = np.array([-14.0, -8.0, -2.0, 4.0, 10.0, 16.0])


def _mixed_pattern(runner: Runner) -> Row:
    """H_PWM-L_ON under CSC: upper and lower commutations differ, so the current keeps its lines 1 + 3 k."""
    percent: dict[str, float] = {}
    trips = 0
    for name, pattern in (("CSC", "ON-PWM"), ("CSC-H_PWM-L_ON", "H_PWM-L_ON")):
        run = runner.drive("six-step/spectrum.toml", name, "drive.commutation=CSC", f"drive.pattern={pattern}")
        window = whole_turns(run.data, 0.07, 0.18, SPECTRUM_Q)
        lines = np.abs(current_lines(run.data, window, np.append(MIXED_ORDERS, 1.0)).amplitude)
        percent[pattern] = float(100 * lines[:-1].max() / lines[-1])
        trips += len(run.result["trips"])
    return Row(
        "six-step/spectrum/CSC-H_PWM-L_ON",
        {"motor": "Motor-I", "speed_rpm": 64_000, "carrier_hz": 20_000, "pattern": "H_PWM-L_ON"},
        {
            "current_1_3k_percent": percent["H_PWM-L_ON"],
            "current_1_3k_percent_on_pwm": percent["ON-PWM"],
            "trips": trips,
        },
        {"current_1_3k_percent": (1.0, None), "current_1_3k_percent_on_pwm": (None, 0.2), "trips": (0, 0)},
    )
