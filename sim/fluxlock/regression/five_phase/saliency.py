# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection whose saliency looks smaller than it should: derated, then a fault by name."""

from __future__ import annotations

import re
from collections.abc import Iterator

from fluxlock.regression.case import Number, Row, case
from fluxlock.regression.five_phase.ipm import SCENARIO
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.measures import event, timeline

# Inductances that the firmware believes over the true ones: it expects an HF current larger by as much, and sees the
# ratio of the inductances, 2, smaller by as much. Derated from 1.4 on, a fault at 1.1.
BELIEVED = (1.0, 0.6, 0.5)
ASKED_S, END_S = 0.085, 0.09


def expected_share(ratio: float) -> float:
    """Share of the current that is left at a ratio."""
    return min(1.0, max(0.0, (ratio - 1.1) / (1.4 - 1.1)))


@case("five-phase/ipm-saliency", tested=True)
def saliency(runner: Runner) -> Iterator[Row]:
    """Three-phase IPM, inductances believed smaller than they are: current derated, then the fault no_saliency."""
    for believed in BELIEVED:
        if runner.quick and believed != BELIEVED[-1]:
            continue
        events = [
            event(0.002, "speed_rpm", 200.0),
            event(0.004, "command", "start"),
            event(ASKED_S, "command", "get injection"),
        ]
        overrides = [*timeline(END_S, events, []), "expect=[]", f"drive.motor_error.inductance={believed:g}"]
        fault = believed == BELIEVED[-1]
        may = {"fault": "no_saliency, which the row asks for"} if fault else None
        run = runner.drive(SCENARIO, f"{believed:g}", *overrides, accept=may)
        console = run.console()
        found = re.search(r"^injection (\S+) \S+ (\S+)", console, re.MULTILINE)
        assert found is not None
        share, ratio = float(found[1]), float(found[2])
        values: dict[str, Number] = {
            "share": share,
            "seen_ratio": ratio,
            "named": int(bool(re.search(r"^now no_saliency", console, re.MULTILINE))),
            "trips": len(run.result["trips"]),
        }
        wanted = expected_share(2.0 * believed)
        yield Row(
            f"five-phase/ipm-saliency/{believed:g}",
            {"motor": "IPM", "believed_inductance": believed},
            values,
            {
                "share": (max(0.0, wanted - 0.2), min(1.0, wanted + 0.2)),
                "named": (int(fault), int(fault)),
                "trips": (0, 0),
            },
        )
