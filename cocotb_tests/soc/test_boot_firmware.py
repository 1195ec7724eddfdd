# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware itself from the flash, by the loader, on the whole chip: it answers on the console.

Takes minutes of processor time, most of them for the copy of 115 KB: only with FLUXLOCK_BOOT_FIRMWARE set, as
`make regression` does.
"""

from __future__ import annotations

import os
from typing import Any

import cocotb
import pytest
from cocotb.triggers import Timer
from cocotb.utils import get_sim_time

from cocotb_tests.soc.boot_bench import BootBench
from fluxlock.base.paths import REGISTER_BLOCKS, ROOT, RTL
from fluxlock.config import load_scenario
from fluxlock.cosim.block import run_block_test
from fluxlock.cosim.chip import rtl_sources
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware.toolchain import build_firmware, build_loader
from fluxlock.flash.image import pack_image
from fluxlock.generate.memory import FLASH_BLOCK, FLASH_IMAGE, RAM_WORDS

PHASES = 3
SMALL_WORDS = 18432  # of a chip for six-step operation only
LISTEN_MS = 1
# By then the flash has been read at 12.5 MHz and the CRC made.
LOADED_MS = 150


@cocotb.test()
async def firmware_answers(dut: Any) -> None:
    tb = BootBench(dut)
    small = dut.RamWords.value == SMALL_WORDS
    image = build_firmware(method="six-step", ram_words=SMALL_WORDS) if small else build_firmware(phases=PHASES)
    tb.fill(FLASH_IMAGE, pack_image(image.read_bytes(), PHASES))
    tb.fill(FLASH_BLOCK, parameter_block(load_scenario(ROOT / "scenarios" / "demo.toml")).pack())
    await tb.start()
    await Timer(LOADED_MS, "ms")
    said = ""
    for _ in range(20):
        await tb.send(b"status\n")
        said = await tb.line(limit_s=0.01)
        if said:
            break
    dut._log.info("after %d ns: %s", get_sim_time("ns"), said)
    assert said.startswith("state "), said
    assert int(dut.gate_o.value) == 0


@pytest.mark.skipif(not os.environ.get("FLUXLOCK_BOOT_FIRMWARE"), reason="long: make regression")
@pytest.mark.parametrize(("vector", "ram_words"), [(1, RAM_WORDS), (0, SMALL_WORDS)])
def test_boot_firmware(vector: int, ram_words: int) -> None:
    """Firmware and parameter block of the demo start from the flash, also on a chip with less RAM and one method.

    Verifies: BOOT-02
    """
    sources = [path for path in rtl_sources() if path.is_relative_to(RTL) or "VexRiscv" in path.name]
    bench = [ROOT / "cocotb_tests" / "soc" / name for name in ("fl_spi_flash_model.sv", "fl_boot_soc.sv")]
    run_block_test(
        "fl_boot_soc",
        [*(path for path in sources if path.parent.name != "pkg"), *bench],
        __name__,
        parameters={"BootInit": f'"{build_loader(LISTEN_MS)}"', "Vector": vector, "RamWords": ram_words},
        registers=REGISTER_BLOCKS,
        seen=["fl_spi_flash_model"],
    )
