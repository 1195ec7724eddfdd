# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Bench of the loader: chip with a flash, a UART at its pins, and what the flash is filled with."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import cocotb
from cocotb.queue import Queue
from cocotb.task import resume
from cocotb.triggers import FallingEdge, First, Timer

from cocotb_tests.soc.bench import CLOCK_NS, Bench
from fluxlock.base.paths import BUILD, content_hash
from fluxlock.base.writable import file_lock
from fluxlock.firmware.schema import MAGIC, load_schema
from fluxlock.firmware.toolchain import TARGET_FLAGS, flat_binary

HERE = Path(__file__).parent
BIT_NS = 50 * CLOCK_NS
BYTE_NS = 10 * BIT_NS


def build_program() -> bytes:
    """Flat binary of boot_program.S for address 0 on."""
    sources = [HERE / "boot_program.S", HERE / "soc_program.ld"]
    folder = BUILD / "block" / "boot_program"
    binary = folder / f"{content_hash(sources, TARGET_FLAGS)}.bin"
    with file_lock(folder / ".lock"):
        if not binary.exists():
            elf = binary.with_suffix(".elf")
            command = [sys.executable, "-m", "ziglang", "cc", *TARGET_FLAGS, str(sources[0]), "-T", str(sources[1])]
            subprocess.run([*command, "-o", str(elf)], check=True)
            binary.write_bytes(flat_binary(elf))
    return bytes(0x80) + binary.read_bytes()


def make_block(words: int = 80, version: int | None = None) -> bytes:
    """A parameter block of its outer form: the loader looks no deeper."""
    payload = struct.pack(f"<{words}I", *range(words))
    version = load_schema().version_word if version is None else version
    return struct.pack("<4I", MAGIC, version, len(payload), zlib.crc32(payload)) + payload


class BootBench:
    """Chip, flash and line."""

    def __init__(self, dut: Any) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.received: Queue[int] = Queue()

    async def start(self) -> None:
        """Power on."""
        await self.bench.start(uart_rx_i=1, flash_power_i=1)
        cocotb.start_soon(self._receive())

    async def reset(self) -> None:
        """A reset of the chip; what it has sent before is forgotten."""
        self.dut.rst_i.value = 1
        await Timer(2 * BYTE_NS, "ns")
        await FallingEdge(self.dut.clk_i)
        while not self.received.empty():
            self.received.get_nowait()
        self.dut.flash_power_i.value = 1
        self.dut.rst_i.value = 0

    async def cut_power(self, operations: int) -> None:
        """Power goes off, and the chip into reset, within the given erase or write from now on."""
        flash = self.dut.u_flash
        limit = int(flash.programs.value) + int(flash.erases.value) + operations
        while int(flash.programs.value) + int(flash.erases.value) < limit:
            await Timer(2, "us")
        self.dut.flash_power_i.value = 0
        self.dut.rst_i.value = 1

    def fill(self, address: int, data: bytes) -> None:
        """Contents of the flash from outside."""
        for i, byte in enumerate(data):
            self.dut.u_flash.mem[address + i].value = byte

    def contents(self, address: int, count: int) -> bytes:
        """Contents of the flash."""
        return bytes(int(self.dut.u_flash.mem[address + i].value) for i in range(count))

    async def _receive(self) -> None:
        while True:
            await FallingEdge(self.dut.uart_tx_o)
            await Timer(BIT_NS + BIT_NS // 2, "ns")
            byte = 0
            for bit in range(8):
                byte |= int(self.dut.uart_tx_o.value) << bit
                await Timer(BIT_NS, "ns")
            self.received.put_nowait(byte)

    async def send(self, data: bytes) -> None:
        """Bytes to the chip."""
        for byte in data:
            for bit in (0, *(byte >> i & 1 for i in range(8)), 1):
                self.dut.uart_rx_i.value = bit
                await Timer(BIT_NS, "ns")

    async def take(self, count: int, limit_s: float) -> bytes:
        """Bytes from the chip, less than `count` of them if the time is over."""
        end = Timer(max(1, round(limit_s * 1e9)), "ns")
        data = bytearray()
        while len(data) < count:
            if self.received.empty():
                got = cocotb.start_soon(self.received.get())
                if await First(got, end) is not got.complete and not got.done():
                    got.cancel()
                    break
                data.append(got.result())
            else:
                data.append(self.received.get_nowait())
        return bytes(data)

    async def line(self, limit_s: float = 0.02) -> str:
        """The next line of text, or what of it came in time."""
        text = b""
        while not text.endswith(b"\n"):
            byte = await self.take(1, limit_s)
            if not byte:
                break
            text += byte
        return text.decode("latin1").strip()


class Line:
    """The UART as the host's loader code uses a port, from a thread beside the simulation (cocotb's `bridge`)."""

    def __init__(self, bench: BootBench) -> None:
        self.write = resume(bench.send)
        self._take = resume(bench.take)

    def read(self, count: int, timeout_s: float) -> bytes:
        """See `fluxlock.flash.loader.Port`; an answer comes far sooner in this flash than in a real one."""
        return bytes(self._take(count, min(timeout_s, 0.003)))
