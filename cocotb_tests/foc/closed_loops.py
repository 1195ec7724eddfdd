# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Current loops of fl_foc with a machine in floating point, as a file asks for: not a test, rows are made of it.

The machine is solved in the stationary frame, its voltage held from T_d after a sample to T_d after the next; it knows
nothing of the regulators' frame. In: a list of loops. Out: each one's current at the samples in the rotor's frame.
"""

from __future__ import annotations

import cmath
import json
import math
import os
from pathlib import Path
from typing import Any

import cocotb

from cocotb_tests.foc.foc_bench import FULL_SCALE, TB, TURN, park, phases_of


async def closed(tb: TB, loop: dict[str, Any]) -> list[list[float]]:
    """Currents (A, pairs d and q) after the references of a loop."""
    rate, period, late = loop["resistance_ohm"] / loop["inductance_h"], loop["period_s"], loop["delay_s"]
    before, whole = math.exp(-rate * (period - late)), math.exp(-rate * period)
    (regulator,) = tb.regulators
    regulator.gain, regulator.hold, regulator.shift = tuple(loop["gain"]), tuple(loop["hold"]), loop["shift"]
    regulator.ratio = tuple(loop["ratio"])
    regulator.enable, regulator.preset, regulator.reference = 0, (0, 0), (0, 0)
    await tb.run([0] * tb.phases, 0)
    regulator.enable = 1
    current, voltage = 0j, 0j
    found = []
    for k, reference in enumerate(loop["references_i_q17"]):
        regulator.reference = tuple(reference)
        turned = current * cmath.exp(-2j * math.pi * loop["turns_a_period"] * k)
        found.append([turned.real, turned.imag])
        codes = [round(x / loop["full_scale_a"] * FULL_SCALE) for x in phases_of([current], 0, tb.phases)]
        out = await tb.run(codes, round(loop["turns_a_period"] * k * TURN), loop["lead_q32"])
        new = park(out.voltage, 0, 1) / FULL_SCALE * loop["full_scale_v"]
        drop = loop["resistance_ohm"]
        current = whole * current + (before - whole) / drop * voltage + (1 - before) / drop * new
        voltage = new
    return found


@cocotb.test()
async def loops_of_a_file(dut: Any) -> None:
    """Close the loops of FLUXLOCK_LOOPS, write FLUXLOCK_RESPONSES."""
    tb = TB(dut)
    await tb.start()
    loops = json.loads(Path(os.environ["FLUXLOCK_LOOPS"]).read_text(encoding="utf-8"))
    responses = [await closed(tb, loop) for loop in loops]
    Path(os.environ["FLUXLOCK_RESPONSES"]).write_text(json.dumps(responses), encoding="utf-8")
