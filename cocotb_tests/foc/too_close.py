# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stimulus that breaks the contract of fl_modulator: vectors one clock too close. An assertion must stop it."""

from __future__ import annotations

from typing import Any

import cocotb

from cocotb_tests.foc.test_fl_modulator import TB


@cocotb.test()
async def vectors_one_clock_too_close(dut: Any) -> None:
    tb = TB(dut)
    await tb.start()
    await tb.pulse([0] * tb.phases, [0] * tb.phases)
    await tb.clocks(tb.latency - 2)
    await tb.pulse([0] * tb.phases, [0] * tb.phases)
    await tb.clocks(40)
