# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stimulus that breaks the contract of fl_sense: sets one clock too close. An assertion must stop it."""

from __future__ import annotations

from typing import Any

import cocotb

from cocotb_tests.sense.test_fl_sense import TB


@cocotb.test()
async def sets_one_clock_too_close(dut: Any) -> None:
    tb = TB(dut)
    await tb.start()
    for _ in range(2):
        await tb.strobe()
        await tb.valid([0] * tb.channels)
        await tb.clocks(tb.channels)
    await tb.clocks(40)
