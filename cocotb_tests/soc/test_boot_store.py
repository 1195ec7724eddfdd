# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stored objects in the flash of a chip with Boot: the firmware with its CANopen node, a master on the bus, power-offs.

The RAM is filled from outside, and the ROM only jumps into it: the loader's copy takes longer than all the rest.
"""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import cocotb
from cocotb.triggers import Timer

from cocotb_tests.can.link import Wire
from cocotb_tests.soc.boot_bench import BootBench
from fluxlock.can.frame import Frame
from fluxlock.can.timing import chip_timing
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_scenario
from fluxlock.cosim.block import run_block_test
from fluxlock.cosim.chip import rtl_sources
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware import write_image
from fluxlock.firmware.toolchain import build_firmware
from fluxlock.flash.image import pack_can_setup
from fluxlock.memory import BOOT_BYTES, FLASH_CAN_SETUP, FLASH_STORE
from fluxlock.paths import BUILD, REGISTER_BLOCKS, ROOT, RTL

NODE, KBIT_PER_S = 5, 1000
FOLDER = BUILD / "block" / "boot_store"
JUMP = 0x08000067  # jalr x0, 0x80(x0)
BOOT_UP_MS = 20
SAVE = 0x65766173


class Master:
    """Another node on the chip's bus, with the requests of an SDO client."""

    def __init__(self, dut: Any) -> None:
        pins = SimpleNamespace(rx_i=dut.can_rx_i, tx_o=dut.can_tx_o)
        self.wire = Wire(pins, chip_timing(CLOCK_HZ, KBIT_PER_S), 1)
        self.mac = self.wire.node().mac
        self.dictionary = load_dictionary()

    async def frame(self, identifier: int, limit_ms: float = BOOT_UP_MS) -> bytes | None:
        """Data of the next frame with an identifier; None: it does not come in time."""
        for _ in range(round(10 * limit_ms)):
            for frame in self.mac.received:
                if frame.id == identifier:
                    self.mac.received.remove(frame)
                    return frame.data
            await Timer(100, "us")
        return None

    async def request(self, data: bytes) -> bytes:
        self.mac.queue.append(Frame(0x600 + NODE, dlc=8, data=data))
        answer = await self.frame(0x580 + NODE)
        assert answer is not None
        return answer

    async def write(self, name: str, value: int) -> bytes:
        """The answer to an expedited download."""
        entry = self.dictionary[name]
        command = 0x23 | 4 - entry.bytes << 2
        return await self.request(struct.pack("<BHBI", command, entry.index, entry.sub, value))

    async def read(self, name: str) -> int:
        entry = self.dictionary[name]
        answer = await self.request(struct.pack("<BHB4x", 0x40, entry.index, entry.sub))
        return int.from_bytes(answer[4 : 4 + entry.bytes], "little")


@cocotb.test()
async def objects_survive(dut: Any) -> None:
    tb, master = BootBench(dut), Master(dut)
    dut.can_rx_i.value = 1
    await tb.start()
    master.wire.join()
    assert await master.frame(0x700 + NODE, 10) is None, "a node without its ID sends"
    tb.fill(FLASH_CAN_SETUP, pack_can_setup(NODE, KBIT_PER_S))

    async def power_up() -> int:
        """The velocity window after power was off."""
        dut.flash_power_i.value = 0
        await tb.reset()
        assert await master.frame(0x700 + NODE) == b"\0"
        return await master.read("velocity_window")

    default = await power_up()
    assert default not in (77, 78)
    for window in (76, 77):
        assert (await master.write("velocity_window", window))[0] == 0x60
        assert (await master.write("store_parameters_save_all", SAVE))[0] == 0x60
    assert await power_up() == 77
    for operation in (1, 2):  # power goes in the erase, in the page
        await master.write("velocity_window", 78)
        before = tb.contents(FLASH_STORE, 8192)
        plug = cocotb.start_soon(tb.cut_power(operation))
        entry = master.dictionary["store_parameters_save_all"]
        command = struct.pack("<BHBI", 0x23, entry.index, entry.sub, SAVE)
        master.mac.queue.append(Frame(0x600 + NODE, dlc=8, data=command))
        await plug
        await Timer(1, "us")
        assert tb.contents(FLASH_STORE, 8192) != before
        master.mac.queue.clear()
        assert await power_up() == 77, f"cut in operation {operation}"
    await master.write("velocity_window", 79)
    assert (await master.write("store_parameters_save_all", SAVE))[0] == 0x60
    assert await power_up() == 79
    assert int(dut.gate_o.value) == 0


def test_boot_store() -> None:
    """What a master stores holds over a power-off, also if power goes while it is stored; without a node-ID silence.

    Verifies: CO-28
    """
    scenario = load_scenario(ROOT / "scenarios" / "demo.toml")
    image = write_image(FOLDER / "firmware.hex", build_firmware(can_method="six-step"), parameter_block(scenario))
    jump = FOLDER / "jump.hex"
    jump.write_text("".join(f"{word:08x}\n" for word in (JUMP, *[0] * (BOOT_BYTES // 4 - 1))))
    sources = [path for path in rtl_sources() if path.is_relative_to(RTL) or "VexRiscv" in path.name]
    bench = [ROOT / "cocotb_tests" / "soc" / name for name in ("fl_spi_flash_model.sv", "fl_boot_soc.sv")]
    run_block_test(
        "fl_boot_soc",
        [*(path for path in sources if path.parent.name != "pkg"), *bench],
        __name__,
        parameters={"Init": f'"{image}"', "BootInit": f'"{jump}"', "Can": 1},
        registers=REGISTER_BLOCKS,
        seen=["fl_spi_flash_model"],
    )
