# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection with inductances that the file has wrong: the search has measured both axes, and no file is asked."""

from __future__ import annotations

import re
from collections.abc import Iterator

from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.ipm import SCENARIO
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

# Inductances that the firmware believes over the true ones: by the file the saliency would look half as large at 0.5.
BELIEVED = (1.0, 0.6, 0.5)
LEAST_SHARE = 0.95
ASKED_S, END_S = 0.085, 0.09


@case("five-phase/ipm-saliency")
def saliency(runner: Runner) -> Iterator[Row]:
    """Three-phase IPM, inductances believed smaller than they are: no current is derated, and there is no fault."""
    for believed in BELIEVED:
        if runner.quick and believed != BELIEVED[-1]:
            continue
        events = [
            event(0.002, "speed_rpm", 200.0),
            event(0.004, "command", "start"),
            event(ASKED_S, "command", "get injection"),
        ]
        overrides = [*timeline(END_S, events, []), "expect=[]", f"drive.motor_error.inductance={believed:g}"]
        run = runner.drive(SCENARIO, f"{believed:g}", *overrides)
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
        yield Row(
            f"five-phase/ipm-saliency/{believed:g}",
            {"motor": "IPM", "believed_inductance": believed},
            values,
            {"share": (LEAST_SHARE, None), "named": (0, 0), "trips": (0, 0)},
        )
