# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Register blocks behind the bus, each `fl_*_wb` alone, against the register map.

The map is read from its source by the SystemRDL compiler, not from what is generated from it. The other inputs are
idle, so that settings do nothing.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import cocotb
import pytest
from cocotb.triggers import Timer
from systemrdl import RDLCompiler
from systemrdl.node import AddrmapNode, RegNode

from cocotb_tests.can.bench import CAN_SOURCES
from cocotb_tests.foc.test_fl_foc_wb import SOURCES as FOC_SOURCES
from cocotb_tests.injection.test_fl_injection_path import PATH_SOURCES as INJECTION_SOURCES
from cocotb_tests.pwm.chain import SOURCES as PWM_SOURCES
from cocotb_tests.soc.bench import CLOCK_NS, Bench, request
from cocotb_tests.zcd.zcd_bench import ZCD_SOURCES
from fluxlock.base.paths import RTL
from fluxlock.cosim.block import run_block_test

FOC_TYPES = ["foc/fl_foc_pkg.sv", "soc/fl_vector_pkg.sv"]
SOURCES = {
    "can": CAN_SOURCES,
    "capture": ["soc/fl_capture.sv"],
    "comm": ["zcd/fl_interval_meter.sv", "zcd/fl_commutation_timer.sv"],
    "encoder": ["common/fl_sync.sv", "encoder/fl_encoder.sv"],
    "foc": [name for name in FOC_SOURCES if isinstance(name, str) and ("soc/" not in name or "/fl_vector" in name)],
    "freewheel": ["zcd/fl_interpolator.sv", "zcd/fl_freewheel.sv"],
    "injection": [*FOC_TYPES, *INJECTION_SOURCES],
    "hall": ["common/fl_sync.sv", "zcd/fl_hall.sv"],
    "irq": ["soc/fl_irq.sv"],
    "pwm": PWM_SOURCES[:3],
    "safety": [
        "common/fl_sync.sv",
        *(f"safety/fl_{name}.sv" for name in ("trip", "gate_guard", "watchdog", "settings_lock", "brake")),
        "safety/fl_driver_enable.sv",
    ],
    "sense": ["sense/fl_sample_scheduler.sv", "sense/fl_auto_zero.sv", "sense/fl_sense.sv"],
    "spi": ["soc/fl_spi.sv"],
    "sys": [],
    "timer": ["soc/fl_interval.sv", "soc/fl_timer.sv"],
    "uart": [
        *("common/fl_sync.sv", "common/fl_fifo.sv"),
        *(f"soc/fl_{name}.sv" for name in ("uart_rx", "uart_tx", "uart")),
    ],
    "zcd": ZCD_SOURCES,
}
NOW = 0x9E37_79B9  # time stands still
SATURATED = 0xFF_FFFF
# What hardware shows after reset and a control tick with idle inputs, where it is not 0; the same for all of an array.
# None: contents of a memory.
IDLE: dict[str, int | None] = {
    "capture.status": 1024 << 16,
    "capture.data": None,
    "comm.snap_interval": SATURATED,
    "comm.snap_period": 6 * SATURATED,
    "comm.snap_delay": SATURATED,
    "comm.snap_sector_interval": SATURATED,
    "hall.counters": 1 << 16,  # code 0 is invalid
    "hall.phase": SATURATED,
    "sys.build": 3 << 16 | 9 << 24,
    "sys.clock": 50_000_000,
    "sys.time_now": NOW,
    "uart.status": 1 | 4,
}
# What goes on by itself once settings are random; the monitor by watchdogs whose time is up (seed 1796049089).
MOVING = ("safety.gates", "safety.monitor", "timer.tick_count", "timer.tick_time", "timer.update", "uart.status")
INPUTS = {"now_i": NOW, "rx_i": 1}  # idle, where it is not 0
SETTLE_CLOCKS = 100  # longer than the glitch filters
ALL_LANES = 0xF


@dataclass(frozen=True)
class Register:
    """Masks of a word by the access of its fields, and its value after reset."""

    name: str
    stored: int  # read and write, kept
    cleared: int  # of these, those that hardware may clear: a watchdog that random settings made short trips
    pulses: int  # written to act, read as 0
    shown: int  # read only
    reset: int


def read_map(block: str) -> tuple[int, dict[int, Register]]:
    """Bytes that the block decodes, and its registers by byte address."""
    compiler = RDLCompiler()
    compiler.compile_file(str(RTL / "regs" / f"fl_{block}_regs.rdl"))
    top = compiler.elaborate().top
    assert isinstance(top, AddrmapNode)
    registers = {}
    for node in top.descendants(unroll=True):
        if not isinstance(node, RegNode):
            continue
        stored = cleared = pulses = shown = reset = 0
        for field in node.fields():
            mask = ((1 << field.width) - 1) << field.low
            if field.get_property("singlepulse") or field.get_property("onwrite") or not field.is_sw_readable:
                pulses |= mask
            elif field.is_sw_writable:
                stored |= mask
                cleared |= mask if field.get_property("hwclr") else 0
            else:
                shown |= mask
            reset |= (field.get_property("reset") or 0) << field.low
        name = f"{block}.{node.inst_name}"
        registers[node.absolute_address] = Register(name, stored, cleared, pulses, shown, reset)
    return 1 << (top.size - 1).bit_length(), registers


def lanes(sel: int) -> int:
    """Bits of a word that the byte selects open."""
    return sum(0xFF << 8 * i for i in range(4) if sel >> i & 1)


class TB(Bench):
    """Keeps what software has written and what hardware showed last."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        self.block = dut._name.removeprefix("fl_").removesuffix("_wb")
        self.size, self.map = read_map(self.block)
        self.expected: dict[int, int] = {}

    async def begin(self) -> None:
        """Start the clock with the time fixed and all other inputs 0, then reset."""
        inputs = [h._name for h in self.dut if h._name.endswith("_i") and h._name not in ("clk_i", "rst_i", "req_i")]
        await self.start(**{name: INPUTS.get(name, 0) for name in inputs})
        await self.reset()

    async def reset(self) -> None:
        """One clock of reset, and a control tick after the filters have settled."""
        self.dut.rst_i.value = 1
        await self.clocks()
        self.dut.rst_i.value = 0
        self.expected = {adr: register.reset & register.stored for adr, register in self.map.items()}
        await self.clocks(SETTLE_CLOCKS)
        if hasattr(self.dut, "tick_i"):
            self.dut.tick_i.value = 1
            await self.clocks()
            self.dut.tick_i.value = 0
        await self.clocks(4)

    async def access(self, adr: int, wdat: int, we: bool, sel: int, stb: int = 1) -> int:
        """One clock on the bus with anything on its lines; the data shown in it."""
        self.dut.req_i.value = request(adr, wdat, we, sel)
        self.dut.stb_i.value = stb
        await Timer(CLOCK_NS // 4, "ns")
        value = int(self.dut.rdat_o.value)
        await self.clocks()
        self.dut.stb_i.value = 0
        return value

    async def store(self, adr: int, wdat: int, sel: int = ALL_LANES) -> None:
        """Write, in the block and in the model."""
        await self.access(adr, wdat, True, sel)
        register = self.map.get(adr)
        if register:
            mask = register.stored & lanes(sel)
            self.expected[adr] = self.expected[adr] & ~mask | wdat & mask

    async def read_all(self) -> dict[int, int]:
        """Every word that the block decodes: stored fields are the model's, bits without a field are 0."""
        words = {adr: await self.read(adr) for adr in range(0, self.size, 4)}
        for adr, word in words.items():
            register = self.map.get(adr)
            if register is None:
                assert word == 0, f"{adr:#x}, where no register is, reads {word:#x}"
            else:
                got, wanted = word & ~register.shown, self.expected[adr]
                assert got in (wanted, wanted & ~register.cleared), (
                    f"{register.name} ({adr:#x}) reads {got:#x}, not {wanted:#x}"
                )
        return words

    async def shown(self) -> dict[int, int]:
        """What the read-only fields show, by address."""
        words = await self.read_all()
        return {adr: words[adr] & r.shown for adr, r in self.map.items() if r.shown and r.name not in MOVING}


@cocotb.test
async def reset_gives_the_values_of_the_map(dut: Any) -> None:
    """After power-up, and again after every stored bit has been inverted."""
    tb = TB(dut)
    await tb.begin()
    for _ in range(2):
        for adr, word in (await tb.read_all()).items():
            register = tb.map.get(adr)
            idle = IDLE.get(register.name, 0) if register else None
            if register and idle is not None:
                wanted = register.reset & register.shown | idle
                assert word & register.shown == wanted, f"{register.name} shows {word:#x}, not {wanted:#x}"
        for adr, register in tb.map.items():
            await tb.store(adr, ~register.reset & ~register.pulses & 0xFFFF_FFFF)
        await tb.read_all()
        await tb.reset()


@cocotb.test
async def a_write_reaches_its_fields_only(dut: Any) -> None:
    """Every address and every byte select, random data: what is not addressed stays, read-only registers too."""
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    await tb.begin()
    shown = await tb.shown()
    for sel in (ALL_LANES, 1, 2, 4, 8, rng.randrange(16), 0, ALL_LANES):
        addresses = list(range(0, tb.size, 4))
        rng.shuffle(addresses)
        for adr in addresses:
            register = tb.map.get(adr)
            pulses = register.pulses if register else 0
            await tb.store(adr, rng.getrandbits(32) & ~pulses, sel)
            after = await tb.shown()
            if register is None or not register.stored | register.pulses:
                assert after == shown, f"a write to {adr:#x} changed {after} from {shown}"
            shown = after


@cocotb.test
async def nothing_but_a_strobed_write_writes(dut: Any) -> None:
    """Reads with data on the write lines, writes without strobe."""
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    await tb.begin()
    for adr, register in tb.map.items():
        await tb.store(adr, rng.getrandbits(32) & ~register.pulses)
    for adr in range(0, tb.size, 4):
        await tb.access(adr, rng.getrandbits(32), False, ALL_LANES)
        await tb.access(adr, rng.getrandbits(32), True, ALL_LANES, stb=0)
    await tb.read_all()


@cocotb.test
async def pulses_read_zero(dut: Any) -> None:
    """A command bit that is written 1 reads 0 in the bus's next access, two clocks later; other fields are stored."""
    tb = TB(dut)
    await tb.begin()
    for adr, register in tb.map.items():
        if register.pulses:
            await tb.store(adr, 0xFFFF_FFFF)
            await tb.clocks()
            await tb.read_all()


@pytest.mark.parametrize("block", SOURCES)
def test_register_wrapper(block: str) -> None:
    """Reset values, access and byte selects of every register; addresses without one read 0 and take nothing.

    Verifies: REG-02
    """
    sources = ["soc/fl_bus_pkg.sv", *SOURCES[block], f"soc/fl_{block}_wb.sv"]
    run_block_test(f"fl_{block}_wb", sources, __name__, registers=[block])


def test_every_wrapper_is_here() -> None:
    """A new wrapper comes with its sources above.

    Verifies: REG-02
    """
    assert {f"fl_{block}_wb" for block in SOURCES} == {path.stem for path in RTL.glob("*/*_wb.sv")}
