"""The chip with a program on its core: buses, memory, interrupts, commutations and faults up to the gates."""

from __future__ import annotations

import itertools
import subprocess
import sys
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge

from cocotb_tests.soc.bench import Bench
from fluxlock.build import file_lock, generate_registers
from fluxlock.cosim.block import run_block_test
from fluxlock.cosim.chip import rtl_sources
from fluxlock.firmware.toolchain import TARGET_FLAGS
from fluxlock.paths import BUILD, GENERATED, REGISTER_BLOCKS, RTL, content_hash

HERE = Path(__file__).parent
CHANNELS, RAM_WORDS = 9, 16384
MAILBOX = 0xE000 // 4
DONE, TRIPS = 31, 24
MIDDLE = 0x800
CONVERSION = 40  # clocks


def build_image() -> Path:
    """Compile the test program into a `$readmemh` file; the same file until a source changes."""
    sources = [HERE / name for name in ("soc_program.c", "soc_start.S", "soc_program.ld")]
    folder = BUILD / "block" / "soc_program"
    image = folder / f"{content_hash([*sources, generate_registers() / 'fluxlock_regs.h'], TARGET_FLAGS)}.hex"
    with file_lock(folder / ".lock"):
        if not image.exists():
            elf, binary = image.with_suffix(".elf"), image.with_suffix(".bin")
            zig = [sys.executable, "-m", "ziglang"]
            include = ["-I", str(HERE.parents[1] / "sw" / "hal" / "include"), "-I", str(GENERATED)]
            files = [str(sources[0]), str(sources[1]), "-T", str(sources[2])]
            subprocess.run(
                [*zig, "cc", *TARGET_FLAGS, "-Wall", "-Werror", *include, *files, "-o", str(elf)], check=True
            )
            subprocess.run([*zig, "objcopy", "-O", "binary", str(elf), str(binary)], check=True)
            data = (bytes(0x80) + binary.read_bytes()).ljust(4 * RAM_WORDS, b"\0")
            words = [int.from_bytes(data[i : i + 4], "little") for i in range(0, len(data), 4)]
            image.write_text("".join(f"{word:08x}\n" for word in words))
    return image


class Chip:
    """Converter model with constant codes, and access to the program's mailbox."""

    def __init__(self, dut: Any) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.codes = [MIDDLE] * CHANNELS

    async def start(self) -> None:
        for index in range(32):
            self.dut.u_cpu.u_ram.mem[MAILBOX + index].value = 0
        await self.bench.start(adc_valid_i=0, adc_code_i=0, fault_pin_i=0, hall_i=0, uart_rx_i=1)
        cocotb.start_soon(self._convert())

    async def _convert(self) -> None:
        while True:
            await RisingEdge(self.dut.adc_strobe_o)
            held = list(self.codes)
            await ClockCycles(self.dut.clk_i, CONVERSION)
            await FallingEdge(self.dut.clk_i)
            self.dut.adc_code_i.value = sum(code << 12 * i for i, code in enumerate(held))
            self.dut.adc_valid_i.value = 1
            await FallingEdge(self.dut.clk_i)
            self.dut.adc_valid_i.value = 0

    def mailbox(self, index: int) -> int:
        return int(self.dut.u_cpu.u_ram.mem[MAILBOX + index].value)

    async def until_done(self) -> None:
        for _ in range(400):
            await ClockCycles(self.dut.clk_i, 500)
            if self.mailbox(DONE) == 0x600D600D:
                await FallingEdge(self.dut.clk_i)
                return
        raise AssertionError(f"the program did not finish; mailbox {[hex(self.mailbox(i)) for i in range(32)]}")


@cocotb.test
async def program_sees_the_chip(dut: Any) -> None:
    chip = Chip(dut)
    await chip.start()
    await chip.until_done()
    found = [chip.mailbox(i) for i in range(24)]
    assert found[0] == 0x464C5558 and found[2] == 50_000_000, f"identity {found[0]:#x}, clock {found[2]}"
    assert found[1] & 0xFFFF == 1 and found[1] >> 16 == 3 | CHANNELS << 8, f"build {found[1]:#x}"
    assert found[3:12] == [3, 0, 50, 50, 4096, 0xFFFFFF, 1250, 50, 0x06020100], [hex(x) for x in found[3:12]]
    assert found[12] == 0x12AB5678, f"byte write: {found[12]:#x}"
    assert 2 <= found[13] <= 60, f"{found[13]} clocks between two reads of the time"
    assert found[14] == 0, f"unmapped addresses read {found[14]:#x}"
    assert found[15] == 0x600DF00D and found[16] == found[0], "a write to an unmapped address landed somewhere"
    assert found[17] == 0, f"{found[17]} wrong words in RAM"
    assert chip.mailbox(28) == 4, f"{chip.mailbox(28)} access faults in four calls to nowhere"
    ticks, loads, preempted, other, latency, overruns = found[18:24]
    assert (ticks, other, overruns) == (20, 0, 0), f"ticks, other causes, overruns: {ticks, other, overruns}"
    assert loads == preempted and loads >= 4, f"{preempted} of {loads} deferred interrupts were pre-empted"
    # 13 clocks to the first instruction, and what it finds in the pipeline and out of the data cache.
    assert latency < 60, f"control interrupt {latency} clocks late"


@cocotb.test
async def commutation_reaches_the_gates_at_its_instant(dut: Any) -> None:
    chip = Chip(dut)
    await chip.start()
    await chip.until_done()
    schedule: list[tuple[int, int]] = []  # instant, sector
    sectors = [0b001001, 0b100001, 0b100100, 0b000110, 0b010010, 0b011000]  # both switches of each sector on
    changes: dict[int, int] = {}
    gates = int(dut.gate_o.value)
    for _ in range(3000 * 9):
        await FallingEdge(dut.clk_i)
        now = int(dut.trc_now_o.value)
        if dut.trc_comm_valid_o.value == 1:
            assert dut.trc_valid_o.value == 1
            schedule.append((int(dut.trc_comm_sched_o.value), int(dut.trc_sector_o.value)))
        if int(dut.gate_o.value) != gates:
            gates = changes[now] = int(dut.gate_o.value)
        high, low = int(dut.gate_h_o.value), int(dut.gate_l_o.value)
        assert [high >> x & 1 | (low >> x & 1) << 1 for x in range(3)] == [gates >> 2 * x & 3 for x in range(3)]
    assert len(schedule) >= 8
    assert [b[0] - a[0] for a, b in itertools.pairwise(schedule)] == [3000] * (len(schedule) - 1)
    for instant, sector in schedule[1:-1]:
        assert instant in changes, f"no gate changed at {instant}"
        assert changes[instant] == sectors[sector], f"sector {sector}: gates {changes[instant]:#08b}"


async def clocks_to_off(dut: Any) -> int:
    """Clock edges until all gates are off, the next edge is 1."""
    for count in range(1, 20):
        await FallingEdge(dut.clk_i)
        if int(dut.gate_o.value) == 0:
            return count
    raise AssertionError("gates stay on")


@cocotb.test
async def faults_turn_the_gates_off(dut: Any) -> None:
    chip = Chip(dut)
    await chip.start()
    await chip.until_done()

    async def gates_on() -> None:
        for _ in range(20000):
            await FallingEdge(dut.clk_i)
            # Early in a pulse, so that the carrier is not what turns them off.
            if int(dut.gate_o.value).bit_count() == 2 and dut.u_pwm.u_carrier.count_o.value.to_unsigned() == 60:
                return
        raise AssertionError("gates do not come back after the trip is cleared")

    for repeat in range(2):
        await gates_on()
        dut.fault_pin_i.value = 1
        assert await clocks_to_off(dut) == 3, "fault pin"
        await ClockCycles(dut.clk_i, 300)
        assert int(dut.gate_o.value) == 0, "gates on although the fault pin is high"
        dut.fault_pin_i.value = 0

        await gates_on()
        chip.codes = [MIDDLE] * 3 + [MIDDLE, MIDDLE + 1025, MIDDLE] + [MIDDLE] * 3
        for _ in range(200):
            await FallingEdge(dut.clk_i)
            if dut.adc_valid_i.value == 1 and int(dut.adc_code_i.value) >> 48 & 0xFFF == MIDDLE + 1025:
                break
        count = 1
        while int(dut.gate_o.value) != 0:
            await FallingEdge(dut.clk_i)
            count += 1
            assert count <= 3, "gates on 3 clocks after the code"
        chip.codes = [MIDDLE] * CHANNELS
        await ClockCycles(dut.clk_i, 3000)
        seen = [chip.mailbox(TRIPS + 2 * repeat), chip.mailbox(TRIPS + 2 * repeat + 1)]
        assert seen == [0x04, 0x01], f"causes seen by the program: {seen}"


def test_fl_soc() -> None:
    """A program on the core finds the chip as documented; gates follow instants and faults.

    Verifies: SOC-15, SOC-16, SOC-17, SOC-18, SOC-19
    """
    image = build_image()
    sources = [path for path in rtl_sources() if path.is_relative_to(RTL) or "VexRiscv" in path.name]
    run_block_test(
        "fl_soc",
        [path for path in sources if path.parent.name != "pkg"],
        __name__,
        parameters={"Init": f'"{image}"'},
        registers=REGISTER_BLOCKS,
    )
