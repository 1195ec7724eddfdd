# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stimulus that breaks the contract of fl_injection: a first phase beyond the period. An assertion must stop it."""

from __future__ import annotations

from typing import Any

import cocotb

from cocotb_tests.injection.test_fl_injection import TB


@cocotb.test()
async def first_phase_beyond_the_period(dut: Any) -> None:
    tb = TB(dut)
    await tb.start()
    tb.configure(4, 4)
    dut.enable_i.value = 1
    await tb.update()
    await tb.update()
