# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Timing contracts of `docs/architecture.md` as diagrams, each from the trace of a block bench."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from cocotb_tests.foc.test_fl_foc_wb import CHAIN_REGISTERS
from cocotb_tests.foc.test_fl_foc_wb import SOURCES as VECTOR_SOURCES
from cocotb_tests.pwm.chain import SOURCES as PWM_SOURCES
from cocotb_tests.soc.test_fl_safety_wb import build_arguments
from cocotb_tests.timing.recorder import FOLDER, shown
from cocotb_tests.zcd.timer_bench import TIMER_SOURCES
from cocotb_tests.zcd.zcd_bench import ZCD_SOURCES
from fluxlock.base.paths import ROOT
from fluxlock.cosim.block import run_block_test

PAGE = ROOT / "docs" / "architecture.md"
SAFETY, SIX_STEP, VECTOR = (f"cocotb_tests.timing.{name}_traces" for name in ("safety", "six_step", "vector"))


@dataclass(frozen=True)
class Bench:
    """A build and the traces that are recorded on it; more: further arguments of `run_block_test`."""

    top: str
    module: str
    traces: tuple[str, ...]
    more: dict[str, Any]

    @property
    def files(self) -> list[str]:
        """Names of the diagrams."""
        return [trace.replace("_", "-") for trace in self.traces]


def sources(*names: Any) -> dict[str, Sequence[str | Path]]:
    """The argument of that name."""
    return {"sources": names}


BENCHES = (
    Bench(
        "fl_gate_guard",
        SAFETY,
        ("dead_time",),
        {
            **sources("safety/fl_gate_guard.sv"),
            "parameters": {"Phases": 3, "HighActiveLow": 0, "LowActiveLow": 0},
            "extra_env": {"GUARD_POLARITY": "0"},
        },
    ),
    Bench(
        "fl_safety_chain",
        SAFETY,
        ("over_current", "fault_pin", "software_trip"),
        sources(
            *("common/fl_sync.sv", "safety/fl_trip.sv", "safety/fl_gate_guard.sv"),
            ROOT / "cocotb_tests" / "safety" / "fl_safety_chain.sv",
        ),
    ),
    Bench("fl_safety_wb", SAFETY, ("watchdog",), build_arguments(0)),
    Bench("fl_brake", SAFETY, ("brake",), sources("safety/fl_brake.sv")),
    Bench("fl_pwm_chain", SIX_STEP, ("scheduled_commutation", "carrier_settings"), sources(*PWM_SOURCES)),
    Bench("fl_sample_scheduler", SIX_STEP, ("sample_strobe",), sources("sense/fl_sample_scheduler.sv")),
    Bench("fl_sense", SIX_STEP, ("sample_set",), sources("sense/fl_auto_zero.sv", "sense/fl_sense.sv")),
    Bench("fl_zcd", SIX_STEP, ("crossing_first", "crossing_interpolated"), sources(*ZCD_SOURCES)),
    Bench("timer_bench", SIX_STEP, ("earliest_commutation",), sources(*TIMER_SOURCES)),
    Bench("fl_leg_carrier", VECTOR, ("leg_compares",), sources("pwm/fl_leg_carrier.sv")),
    Bench(
        "fl_foc_chain",
        VECTOR,
        ("vector_step", "vector_mean"),
        {**sources(*VECTOR_SOURCES), "registers": CHAIN_REGISTERS, "parameters": {"Phases": 3}},
    ),
    Bench(
        "fl_timer_wb",
        VECTOR,
        ("update_event", "tick_by_samples"),
        {
            **sources("soc/fl_bus_pkg.sv", "soc/fl_interval.sv", "soc/fl_timer.sv", "soc/fl_timer_wb.sv"),
            "registers": ["timer"],
        },
    ),
)


@pytest.mark.parametrize("bench", BENCHES, ids=lambda bench: bench.top)
def test_diagrams(bench: Bench) -> None:
    """The timing diagrams of the pages are what the RTL does, and meet the contract that they illustrate.

    Verifies: DOC-14
    """
    run_block_test(bench.top, test_module=bench.module, testcase=list(bench.traces), **bench.more)


def test_every_contract_has_its_diagram() -> None:
    """Each row of the page's table names a trace, and each trace is of a bench and stands on a page.

    Verifies: DOC-14
    """
    text = PAGE.read_text(encoding="utf-8")
    table = text.split("## Timing contract")[1].split("\n\n")[2]
    rows = [row for row in table.splitlines() if row.startswith("|")][2:]
    named = [re.findall(r"\]\(images/timing/([\w-]+)\.svg\)", row) for row in rows]
    assert rows and all(named), [row for row, names in zip(rows, named, strict=True) if not names]
    known = {file for bench in BENCHES for file in bench.files}
    assert {name for names in named for name in names} <= known
    assert {path.stem for path in FOLDER.glob("*.json")} == known
    pages = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md"))
    assert [name for name in known if not re.search(rf"!\[[^]]+\]\([./]*images/timing/{name}\.svg\)", pages)] == []


def test_gaps() -> None:
    """Only clocks in which nothing changes are left out; the rows of a committed diagram are of one length.

    Verifies: DOC-14
    """
    assert shown([[0, 1, 1, 1, 1, 0]]) == [0, 1, 2, 3, 4, 5]
    assert shown([[0, 1, 1, 1, 1, 1, 0]]) == [0, 1, None, 5, 6]
    assert shown([[0] * 9 + [1] * 9]) == [8, 9, 10]
    assert shown([[0] * 14, [0, 1] + [0] * 6 + [1] * 6]) == [0, 1, 2, None, 7, 8, 9]
    for path in FOLDER.glob("*.json"):
        rows = json.loads(path.read_text(encoding="utf-8"))["signal"]
        assert len({len(row["wave"]) for row in rows}) == 1, path.name
