# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fixed point of the lock-in: position that the RTL finds against floating point, from a cocotb test of the block."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxverify.regression.block_test import measure
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner

SOURCES: list[str | Path] = [
    "injection/fl_injection_pkg.sv",
    "injection/fl_injection_mac.sv",
    "injection/fl_lock_in.sv",
    ROOT / "cocotb_tests" / "injection" / "fl_lock_in_bench.sv",
]
LIMIT_DEG = 0.05


@case("five-phase/lock-in-fixed-point")
def fixed_point(runner: Runner) -> Iterator[Row]:
    """Tian's machine, 0 to 100 r/min, estimate off by 0 to 20 degrees: largest difference of RTL and floating point."""
    found = measure(
        "fl_lock_in_bench",
        SOURCES,
        "cocotb_tests.injection.test_fl_lock_in",
        "position_is_that_of_floating_point",
        runner.seed,
        {},
    )
    values = {f"position_{kind}": found[kind] for kind in ("sign_deg", "sine_deg")}
    yield Row(
        "five-phase/lock-in-fixed-point",
        {"motor": "Tian", "operating_points": 16, "sample_khz": "10.3 and 82.4"},
        dict(values),
        {name: (None, LIMIT_DEG) for name in values},
        "sign: reference of the lock-in; sine: that of the conventional method",
    )
