# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A run of the checkout's chip at its pins, as `sim/export/fl_replay.sv` reads it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from heapq import merge
from itertools import groupby
from pathlib import Path

import numpy as np

from fluxlock.base.stage import Progress, tell_building
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import RAW_FILE, RECORDING_FILE, SessionPlan
from fluxlock.cosim.run import chip_of, prepare
from fluxlock.results.rundata import IntArray, LogKind

CODE_BITS = 12
# Bits of the pin word below the codes: `word_t` of the bench.
VALID, UART, CAN, FAULT, HALL, ENCODER, CODES = 0, 1, 2, 3, 4, 7, 10
CONSOLE_BYTE = 0  # kinds of a recorded input: the console's byte begins, levels of fault pin, Hall sensors and encoder
DATA_BITS = 8

Change = tuple[int, int, int]  # clock, mask of the word, levels


@dataclass(frozen=True)
class Recording:
    """pins, gates: what changes at a clock, (clock, word)."""

    clocks: int
    pins: list[tuple[int, int]]
    gates: list[tuple[int, int]]


def record(scenario: Scenario, clocks: int, folder: Path, progress: Progress | None = None) -> Recording:
    """Run the scenario's first clocks, at most all, on the checkout's chip; its files go into `folder`."""
    tell_building(progress, min(clocks / CLOCK_HZ, scenario.duration_s), "chip")
    plan = prepare(scenario, folder, scenario.seed, recording=True, log_strobes=True, stop_cycle=clocks)
    meta = run_plan(replace(plan, log_can=True), chip_of(scenario), progress)
    if meta["fault"]:
        raise RuntimeError(meta["fault"])
    return read_recording(plan, 2 * scenario.motor.phases + 3)


def read_recording(plan: SessionPlan, channels: int) -> Recording:
    """What a recorded run left in the plan's folder, level by level."""
    with np.load(plan.folder / RAW_FILE) as raw:
        log = raw["log"]
    data = (plan.folder / RECORDING_FILE).read_bytes()
    count = int(np.frombuffer(data, np.int64, 1)[0])
    inputs = np.frombuffer(data, np.int64, 3 * count, 16).reshape(-1, 3)
    codes = np.frombuffer(data, np.uint16, -1, 16 + inputs.nbytes).astype(np.int64).reshape(-1, channels)
    changes = merge(
        _conversions(rows(log, LogKind.STROBE), codes, plan.conversion_cycles),
        _console(inputs[inputs[:, 1] == CONSOLE_BYTE], plan.bit_cycles),
        ((int(at), 0x7F << FAULT, int(levels) << FAULT) for at, kind, levels in inputs if kind != CONSOLE_BYTE),
        ((int(at), 1 << CAN, int(levels) >> 1 << CAN) for at, _, levels, _ in rows(log, LogKind.CAN)),
        key=lambda change: change[0],
    )
    word = 1 << UART | 1 << CAN
    pins = [(0, word)]
    for at, together in groupby(changes, key=lambda change: change[0]):
        for _, mask, levels in together:
            word = word & ~mask | levels
        if at <= plan.duration_cycles:
            pins.append((at, word))
    gates = [(int(at), int(on)) for at, _, on, _ in rows(log, LogKind.GATES) if at <= plan.duration_cycles]
    return Recording(plan.duration_cycles, pins, gates)


def rows(log: IntArray, kind: LogKind) -> IntArray:
    """Rows of one kind."""
    found: IntArray = log[log[:, 1] == kind]
    return found


def _conversions(strobes: IntArray, codes: IntArray, conversion_cycles: int) -> Iterator[Change]:
    """Codes come with a pulse of one clock, so long after the strobe that they belong to."""
    shifts = CODE_BITS * np.arange(codes.shape[1])
    mask = (1 << CODE_BITS * codes.shape[1]) - 1 << CODES | 1 << VALID
    for (at, *_), values in zip(strobes, codes, strict=False):
        word = sum(int(value) << int(shift) for value, shift in zip(values, shifts, strict=True))
        yield int(at) + conversion_cycles, mask, word << CODES | 1 << VALID
        yield int(at) + conversion_cycles + 1, 1 << VALID, 0


def _console(inputs: IntArray, bit_cycles: int) -> Iterator[Change]:
    """Start bit, data from the lowest bit on, stop bit."""
    for at, _, byte in inputs:
        frame = int(byte) << 1 | 1 << DATA_BITS + 1
        for bit in range(DATA_BITS + 2):
            yield int(at) + bit * bit_cycles, 1 << UART, (frame >> bit & 1) << UART


def text(changes: list[tuple[int, int]]) -> str:
    """Lines that `$fscanf` reads."""
    return "".join(f"{at} {word:x}\n" for at, word in changes)


def package(scenario: Scenario, recording: Recording) -> str:
    """`fl_recording_pkg`: which chip was recorded, and for how long."""
    polarity = scenario.inverter.gate_polarity
    return f"""// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// The recorded run: scenario {scenario.name}.
package fl_recording_pkg;
  localparam int unsigned Clocks = {recording.clocks};
  localparam int unsigned Phases = {scenario.motor.phases};
  localparam bit Injection = {int(scenario.drive.vector.injection is not None)};
  localparam bit Can = {int(scenario.can is not None)};
  localparam bit HighActiveLow = {polarity & 1};
  localparam bit LowActiveLow = {polarity >> 1};
endpackage
"""
