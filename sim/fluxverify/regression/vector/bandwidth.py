# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Bandwidth of the current loop at 20 kHz with double update, from sines of the reference on the chip."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.theory.vector import frequency
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.vector.current_bench import Ground, Setting
from fluxverify.regression.vector.sines import measure, phase_bandwidth, phase_margin_deg

LEAST_HZ = 5000.0
CARRIER_HZ = 20e3
SPEED = 0.05  # over 15 kHz: 750 Hz
POINTS = {"shortest": (0.1, 0.45), "quarter": (0.25, 0.5), "default": (1.0, 0.35)}  # T_d over T_s, gamma
LIMITED = ("shortest", "quarter")
TONES = [sign * k for k in (2, 4, 5, 6, 7, 8, 9, 10, 12) for sign in (1, -1)]
NOTE = (
    "T_d = 1 T_s is the default with double update: sampled where the carrier has no ripple. It keeps gamma = 0.35 and "
    "is stated without a limit; 5 kHz need a shorter delay. Elsewhere the sample holds ripple of the voltage of now, "
    "which counts as current: measured and exact differ by it. largest_h_deviation_percent: from the exact model."
)


@case("vector/bandwidth", tested=True)
def bandwidth(runner: Runner) -> Iterator[Row]:
    """Current bandwidth by the 90 degree rule at 20 kHz, double update: at least 5 kHz, with its phase margin."""
    for name, (delay, gamma) in POINTS.items():
        if runner.quick and name != "quarter":
            continue
        setting = Setting("C", SPEED, delay, "exact", update="double", carrier_hz=CARRIER_HZ, gamma=gamma)
        theory, found = Ground.of(setting).theory, measure(runner, setting, TONES)
        exact = theory.loop.closed(frequency.on_circle(found.frequency))
        yield Row(
            f"vector/bandwidth/{name}",
            {
                "motor": "Motor-I",
                "fundamental_hz": setting.fundamental_hz,
                "carrier_hz": CARRIER_HZ,
                "update": "double",
                "delay_over_ts": theory.sampling.delay,
                "gamma": gamma,
                "regulator": "C",
                "amplitude_a": found.amplitude_a,
                "tones": len(TONES),
            },
            {
                "bandwidth_hz": theory.fs_hz * phase_bandwidth(found),
                "phase_margin_deg": phase_margin_deg(found),
                "bandwidth_hz.exact": theory.fs_hz * frequency.phase_bandwidth(theory.loop),
                "phase_margin_deg.exact": frequency.phase_margin_deg(theory.loop),
                "largest_h_deviation_percent": 100.0 * float(np.abs(found.h - exact).max()),
                "largest_voltage_v": found.voltage_v,
                "trips": found.trips,
            },
            {**({"bandwidth_hz": (LEAST_HZ, None)} if name in LIMITED else {}), "trips": (0, 0)},
            NOTE,
        )
