# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Console lines without pause at 1 Mbaud while the core is busy: each is carried out, or refused by name."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_scenario
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import Action
from fluxlock.cosim.run import BIT_CYCLES, chip_of, parse_statistics, prepare

BYTE_CYCLES = 10 * BIT_CYCLES
LINE_BYTES = 80  # LINE_LENGTH of sw/console/console.c
RX_DEPTH = 128  # RxDepth of rtl/soc/fl_uart_wb.sv
# The longest that a handler of the firmware was ever seen to hold off the UART's: the gain design.
LONGEST_CYCLES = 38_321
LOST = "error: bytes lost"


def run(name: str, duration_s: float, *steps: tuple[float, list[str]]) -> tuple[dict[str, Any], list[str]]:
    """Start a vector drive; lines of a step go out back to back at its time. What the run tells, and its console."""
    overrides = (f"duration_s={duration_s}", "window=[]", "expect=[]", "event=[]")
    scenario = load_scenario(ROOT / "scenarios" / "vector" / "start.toml", overrides)
    plan = prepare(scenario, BUILD / "closed_loop" / name / "simulator", 1)
    start = [(0.01, "set speed_rpm 12000"), (0.011, "start")]
    actions = [Action(round(at * CLOCK_HZ), "console", {"line": line}) for at, line in start]
    for at, lines in steps:
        actions += [Action(round(at * CLOCK_HZ), "console", {"line": line, "burst": True}) for line in lines]
    meta = run_plan(replace(plan, actions=tuple(actions)), chip_of(scenario))
    text = meta["uart"].splitlines()
    print("\n".join(text))
    assert meta["fault"] is None
    sent = [line for _, line in start] + [line for _, lines in steps for line in lines]
    assert [line for _, line, _ in meta["sent"]] == sent
    assert text[:2] == ["ok", "ok"]
    return meta, text[2:]


def counts(meta: dict[str, Any], name: str) -> list[int]:
    found = re.search(rf"^{name} (\d+) (\d+) (\d+)$", meta["uart"], re.MULTILINE)
    assert found is not None
    return [int(x) for x in found.groups()]


def settings(count: int, first: int = 100_000) -> list[str]:
    """Settings of different values, as long as a line can be."""
    return [f"set accel_rpm_s {first + n:>{LINE_BYTES - 1 - len('set accel_rpm_s ')}}" for n in range(count)]


def test_busy_core_loses_no_line() -> None:
    """Lines of full length back to back: 24 beside the gain design, four beside handlers as long as its longest.

    The four and a short one fit into FIFO and ring, the FIFO alone holds what arrives in the longest handler.

    Verifies: SOC-31
    """
    many, few = [*settings(24), "get accel_rpm_s"], [*settings(4, 200_000), "get accel_rpm_s"]
    load = f"set irq_load {2 * LONGEST_CYCLES}"
    meta, replies = run("lines-busy", 0.075, (0.03, many), (0.06, [load]), (0.065, few))
    expected = [*["ok"] * 24, "accel_rpm_s 100023", "ok", "ok", *["ok"] * 4, "accel_rpm_s 200003", "ok"]
    assert replies[: len(expected)] == expected
    assert {answer for _, _, answer in meta["sent"]} == {"ok"}
    assert counts(meta, "bytes_lost") == counts(meta, "lines_refused") == [0, 0, 0]
    handlers, _ = parse_statistics(meta["uart"])
    assert handlers["load"]["max"] >= LONGEST_CYCLES and handlers["load"]["count"] > 5
    assert handlers["design"]["max"] < LONGEST_CYCLES < (RX_DEPTH - 32) * BYTE_CYCLES


def test_overrun_hurts_lines_by_name() -> None:
    """A handler that lasts 500 bytes: one answer a line, the hurt ones refused by name, their neighbours carried out.

    Verifies: SOC-31, FW-53
    """
    before = ["set accel_rpm_s 50000", "set irq_load 500000"]
    burst = [line for pair in zip(settings(12), ["get accel_rpm_s"] * 12, strict=True) for line in pair]
    meta, replies = run("lines-overrun", 0.06, (0.02, before), (0.03, burst))
    assert replies[:2] == ["ok", "ok"]
    value, answers = "50000", iter(replies[2:])
    hurt = []
    for n, line in enumerate(burst):
        answer = next(answers)
        if answer == LOST:
            hurt.append(n)
            continue
        if line.startswith("get"):
            assert answer == f"accel_rpm_s {value}", f"line {n}"
            answer = next(answers)
        else:
            value = line.split()[-1]
        assert answer == "ok", f"line {n}: {line!r}"
    print(f"hurt: {hurt}")
    assert [n for n, (_, _, answer) in enumerate(meta["sent"][-len(burst) :]) if answer == LOST] == hurt
    assert 2 <= len(hurt) < len(burst) - 2 and 0 not in hurt
    fifo, frame, _ = counts(meta, "bytes_lost")
    assert fifo > 0 and frame == 0
    assert counts(meta, "lines_refused") == [len(hurt), 0, 0]
