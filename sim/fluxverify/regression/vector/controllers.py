# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Steps of i_d with the firmware's regulator on the host and the hardware's in simulation, on the exact machine."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_motor
from fluxlock.firmware.binding import open_library
from fluxlock.theory.vector.controllers import KINDS, Kind, cross_peak, settling_samples
from fluxlock.theory.vector.model import PARKS, ComplexArray, Park, SmoothMachine
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.vector.fixed_loops import FixedLoop, hardware
from fluxverify.regression.vector.specified import FS_HZ, PEAKS_PERCENT, SETTLING_SAMPLES

PEAK_LIMIT_PERCENT = 0.5  # of the step
AGREE_LIMIT_PERCENT = 0.1
STEP_A = 20.0
FOLLOWED = 80
WHERE = ("host", "rtl")
NOTE = (
    "Worst over both directions. held_exact_percent: largest distance of the currents with held and exact inverse Park "
    "(B and C; A knows no delay and answers otherwise with the exact one), limit as in the test of the block. "
    "deviation_percent: largest distance from the exact discrete model in floating point."
)


@case("vector/controllers")
def controllers(runner: Runner) -> Iterator[Row]:
    """Peak of i_q after a step of i_d within 0.5 % of the table, C and RTL; C settles to 5 % in seven samples."""
    machine = SmoothMachine.from_motor(load_motor(ROOT / "motors" / "motor-1.toml"))
    lib, period = open_library(), round(CLOCK_HZ / FS_HZ)
    points = [p for p in PEAKS_PERCENT if not runner.quick or p[0] == 0.1]
    loops = {
        (speed, delay, kind, park, sign): FixedLoop(machine, kind, sign * speed, delay, park, period)
        for speed, delay in points
        for kind in KINDS
        for park in (PARKS[:1] if kind == "A" else PARKS)
        for sign in ((1,) if runner.quick else (1, -1))
    }
    reference: ComplexArray = np.full(FOLLOWED, STEP_A, dtype=np.complex128)
    found = {
        "host": {key: loop.host(lib, reference) / STEP_A for key, loop in loops.items()},
        "rtl": dict(zip(loops, (i / STEP_A for i in hardware(lib, list(loops.values()), reference)), strict=True)),
    }
    for speed, delay in points:
        values: dict[str, Number] = {}
        limits: dict[str, tuple[float | None, float | None]] = {}
        for where in WHERE:
            runs = {key[2:]: i for key, i in found[where].items() if key[:2] == (speed, delay)}
            for kind in KINDS:
                specified = PEAKS_PERCENT[speed, delay][kind]
                peaks = [100.0 * cross_peak(i) for (k, park, _), i in runs.items() if k == kind and park == "held"]
                name = f"peak_iq_percent.{kind}.{where}"
                values[name] = max((abs(peak - specified), peak) for peak in peaks)[1]
                limits[name] = (specified - PEAK_LIMIT_PERCENT, specified + PEAK_LIMIT_PERCENT)
            settled = [settling_samples(i) for (k, _, _), i in runs.items() if k == "C"]
            apart = [_apart(runs, kind, sign) for kind, park, sign in runs if park == "exact"]
            exact = {key[2:]: loops[key].exact(reference) / STEP_A for key in loops if key[:2] == (speed, delay)}
            deviation = max(float(np.abs(i - exact[key]).max()) for key, i in runs.items())
            values |= {
                f"settling_samples.C.{where}": max(settled),
                f"held_exact_percent.{where}": 100.0 * max(apart),
                f"deviation_percent.{where}": 100.0 * deviation,
            }
            limits |= {
                f"settling_samples.C.{where}": (None, SETTLING_SAMPLES),
                f"held_exact_percent.{where}": (None, AGREE_LIMIT_PERCENT),
            }
        yield Row(
            f"vector/controllers/{speed * FS_HZ:.0f}-hz-{100 * delay:.0f}",
            {
                "motor": "Motor-I",
                "fundamental_hz": speed * FS_HZ,
                "sample_hz": FS_HZ,
                "delay_over_ts": delay,
                "step_a": STEP_A,
                "directions": len({sign for *_, sign in loops}),
            },
            values,
            limits,
            NOTE,
        )


def _apart(runs: dict[tuple[Kind, Park, int], ComplexArray], kind: Kind, sign: int) -> float:
    """Largest distance of the currents with held and exact inverse Park over the step."""
    return float(np.abs(runs[kind, "held", sign] - runs[kind, "exact", sign]).max())
