# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The four chopping patterns in closed loop (chapter 4)."""

from __future__ import annotations

from collections.abc import Iterator

from fluxlock.interface.settings import choices
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner

LIMIT_DEG = 0.3


@case("six-step/patterns", tested=True)
def patterns(runner: Runner) -> Iterator[Row]:
    """Every chopping pattern, with and without synchronous rectification, at 60 000 r/min and 40 kHz."""
    variants = [(pattern, sync_rect) for pattern in choices("pattern") for sync_rect in (False, True)]
    short = ("duration_s=0.1", "window.steady.from_s=0.07", "window.steady.to_s=0.1") if runner.quick else ()
    for pattern, sync_rect in [("PWM-ON", False), ("H_PWM-L_ON", True)] if runner.quick else variants:
        name = pattern + ("-sync-rect" if sync_rect else "")
        run = runner.drive(
            "six-step/patterns.toml",
            name,
            *short,
            f"drive.pattern={pattern}",
            f"drive.sync_rect={str(sync_rect).lower()}",
        )
        window = run.metrics["steady"]
        yield Row(
            f"six-step/patterns/{name}",
            {
                "motor": "Motor-I",
                "speed_rpm": 60_000,
                "carrier_hz": 40_000,
                "load": "fan 20 mN*m",
                "pattern": pattern,
                "sync_rect": sync_rect,
            },
            {
                "commutation_error_deg.mean": window["commutation_error_deg"]["mean"],
                "commutation_error_deg.rms": window["commutation_error_deg"]["rms"],
                "freewheel_deg.mean": window["freewheel_deg"]["mean"],
                "freewheel_deg.max": window["freewheel_deg"]["max"],
                "phase_current_pp_a": window["phase_current_pp_a"],
                "late_crossings": window["late_crossings"],
                "trips": len(run.result["trips"]),
            },
            {
                "commutation_error_deg.mean": (-LIMIT_DEG, LIMIT_DEG),
                "commutation_error_deg.rms": (None, LIMIT_DEG),
                "late_crossings": (0, 0),
                "trips": (0, 0),
            },
        )
