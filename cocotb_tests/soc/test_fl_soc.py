# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

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
from fluxlock.base.paths import BUILD, GENERATED, REGISTER_BLOCKS, RTL, content_hash
from fluxlock.base.writable import file_lock
from fluxlock.cosim.block import run_block_test
from fluxlock.cosim.chip import rtl_sources
from fluxlock.firmware.toolchain import TARGET_FLAGS, flat_binary
from fluxlock.flash.image import map_version
from fluxlock.generate.memory import RAM_WORDS
from fluxlock.generate.registers import generate_registers

HERE = Path(__file__).parent
MAILBOX, MAILBOX_WORDS = 0x1E000 // 4, 41
# Of a RAM in three banks: 80 KiB from 0, 8 KiB from 0x1E000, where the mailbox is.
SMALL_WORDS, LARGEST_BANK_WORDS = 16384 + 4096 + 2048, 16384
DONE, TRIPS = 31, 24
SIX_STEP_WINDOWS = [REGISTER_BLOCKS.index(name) for name in ("zcd", "comm", "pwm", "freewheel", "hall")]
VECTOR_WINDOWS = [REGISTER_BLOCKS.index(name) for name in ("foc", "encoder", "injection")]
VECTOR_CODE, DIRECT_CODE, VECTOR_ON = 5, 3, 30
GOOD = 0x600D600D
MIDDLE = 0x800
CONVERSION = 40  # clocks
CODES_TO_TICK = {3: 73, 5: 126}  # clocks; with the compares in the shadow registers
WIDTHS = {3: (614, 386, 386), 5: (638, 533, 362, 362, 533)}  # of the voltage that the program asks for, clocks
FIVE_PHASE_TESTS = ["program_sees_the_chip", "vector_path_drives_the_gates"]
SIX_STEP_TESTS = [
    "program_sees_the_chip",
    "commutation_reaches_the_gates_at_its_instant",
    "faults_turn_the_gates_off",
]


def build_image(words: int) -> Path:
    """Compile the test program into a `$readmemh` file of so many words; the same file until a source changes."""
    sources = [HERE / name for name in ("soc_program.c", "soc_start.S", "soc_program.ld")]
    folder = BUILD / "block" / "soc_program"
    image = folder / f"{content_hash([*sources, generate_registers() / 'fluxlock_regs.h'], TARGET_FLAGS, words)}.hex"
    with file_lock(folder / ".lock"):
        if not image.exists():
            elf = image.with_suffix(".elf")
            zig = [sys.executable, "-m", "ziglang"]
            include = ["-I", str(HERE.parents[1] / "sw" / "hal" / "include"), "-I", str(GENERATED)]
            files = [str(sources[0]), str(sources[1]), "-T", str(sources[2])]
            subprocess.run(
                [*zig, "cc", *TARGET_FLAGS, "-Wall", "-Werror", *include, *files, "-o", str(elf)], check=True
            )
            data = (bytes(0x80) + flat_binary(elf)).ljust(4 * words, b"\0")
            values = [int.from_bytes(data[i : i + 4], "little") for i in range(0, len(data), 4)]
            image.write_text("".join(f"{value:08x}\n" for value in values))
    return image


class Chip:
    """Converter model with constant codes, and access to the program's mailbox."""

    def __init__(self, dut: Any) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.phases = len(dut.gate_h_o.value)
        self.channels = 2 * self.phases + 3
        self.ram_words = int(dut.RamWords.value)
        self.codes = [MIDDLE] * self.channels
        self.answers = True
        # The bank at the window's end holds the mailbox.
        small = self.ram_words == SMALL_WORDS
        self.mailbox_memory = dut.u_cpu.g_bank[11].g_ram.u_ram.mem if small else dut.u_cpu.u_ram.mem
        self.mailbox_index = 0 if small else MAILBOX

    async def start(self) -> None:
        for index in range(MAILBOX_WORDS):
            self.mailbox_memory[self.mailbox_index + index].value = 0
        await self.bench.start(
            adc_valid_i=0,
            adc_code_i=0,
            adc_fault_i=0,
            clock_fault_i=0,
            fault_pin_i=0,
            hall_i=0,
            encoder_i=0,
            uart_rx_i=1,
            can_rx_i=1,
            spi_miso_i=1,
            # A debugger that wants to halt the core: this core has no debug bus.
            debug_valid_i=1,
            debug_we_i=1,
            debug_adr_i=0,
            debug_wdat_i=1 << 17,
        )
        cocotb.start_soon(self._convert())
        cocotb.start_soon(self._listen())

    async def _listen(self) -> None:
        """An empty CAN bus: the chip sees what it sends."""
        while True:
            await self.dut.can_tx_o.value_change
            self.dut.can_rx_i.value = self.dut.can_tx_o.value

    async def _convert(self) -> None:
        while True:
            await RisingEdge(self.dut.adc_strobe_o)
            held = list(self.codes)
            await ClockCycles(self.dut.clk_i, CONVERSION)
            await FallingEdge(self.dut.clk_i)
            self.dut.adc_code_i.value = sum(code << 12 * i for i, code in enumerate(held))
            self.dut.adc_valid_i.value = int(self.answers)
            await FallingEdge(self.dut.clk_i)
            self.dut.adc_valid_i.value = 0

    def mailbox(self, index: int) -> int:
        return int(self.mailbox_memory[self.mailbox_index + index].value)

    async def until_done(self, index: int = DONE) -> None:
        for _ in range(400):
            await ClockCycles(self.dut.clk_i, 500)
            if self.mailbox(index) == GOOD:
                await FallingEdge(self.dut.clk_i)
                return
        raise AssertionError(
            f"the program did not reach {index}; mailbox {[hex(self.mailbox(i)) for i in range(MAILBOX_WORDS)]}"
        )


@cocotb.test
async def program_sees_the_chip(dut: Any) -> None:
    chip = Chip(dut)
    await chip.start()
    await chip.until_done()
    found = [chip.mailbox(i) for i in range(24)]
    assert (int(dut.debug_ready_o.value), int(dut.debug_rdat_o.value)) == (0, 0), "debug bus of a plain core"
    assert found[0] == 0x464C5558 and found[2] == 50_000_000, f"identity {found[0]:#x}, clock {found[2]}"
    build = map_version() | chip.phases << 16 | chip.channels << 24
    assert found[1] == build, f"build {found[1]:#x}"
    five, vector = chip.phases == 5, bool(dut.Vector.value)
    six_step = [0, 0, 0] if five else [4096, 0xFFFFFF, 1250]
    assert found[3:12] == [3, 0, 50, 50, *six_step, 50, 0x06020100], [hex(x) for x in found[3:12]]
    assert chip.mailbox(29) == (1250 if vector else 0)
    windows = [REGISTER_BLOCKS.index("spi"), *(SIX_STEP_WINDOWS if five else []), *([] if vector else VECTOR_WINDOWS)]
    absent = sum(1 << window for window in windows)
    assert chip.mailbox(32) == (1 << len(REGISTER_BLOCKS)) - 1 - absent, f"blocks {chip.mailbox(32):#x}"
    assert found[12] == 0x12AB5678, f"byte write: {found[12]:#x}"
    assert 2 <= found[13] <= 60, f"{found[13]} clocks between two reads of the time"
    assert found[14] == 0, f"unmapped addresses read {found[14]:#x}"
    assert found[15] == 0x600DF00D and found[16] == found[0], "a write to an unmapped address landed somewhere"
    whole = chip.ram_words == RAM_WORDS
    assert whole or chip.ram_words == SMALL_WORDS, "the default of the RTL is not that of fluxlock.generate.memory"
    first = (0x600DBA2E, int(dut.u_cpu.u_ram.mem[0x80 // 4].value))
    assert (chip.mailbox(38), chip.mailbox(39), chip.mailbox(40)) == (2 if whole else 0, *first), "banks of the RAM"
    assert found[17] == 0, f"{found[17]} wrong words in RAM"
    calls = 4 if whole else 5
    assert chip.mailbox(28) == calls, f"{chip.mailbox(28)} access faults in {calls} calls to nowhere"
    ticks, loads, preempted, other, latency, overruns = found[18:24]
    assert (ticks, other, overruns) == (20, 0, 0), f"ticks, other causes, overruns: {ticks, other, overruns}"
    assert loads == preempted and loads >= 4, f"{preempted} of {loads} deferred interrupts were pre-empted"
    # 13 clocks to the first instruction, and what it finds in the pipeline and out of the data cache.
    assert latency < 60, f"control interrupt {latency} clocks late"
    pending, identifier, data, age, error = (chip.mailbox(i) for i in range(33, 38))
    assert (pending, identifier, data, error) == (0x200, 0x9234_5678, 0x4433_2211, 4), "CAN controller"
    # 99 bits and stuff bits.
    assert 99 * 16 <= age <= 130 * 16, f"CAN frame {age} clocks old"


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
        high = int(dut.gate_h_o.value) ^ 7 * int(dut.HighActiveLow.value)
        low = int(dut.gate_l_o.value) ^ 7 * int(dut.LowActiveLow.value)
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
            if (
                int(dut.gate_o.value).bit_count() == 2
                and dut.g_six_step.u_six_step.u_pwm.u_carrier.count_o.value.to_unsigned() == 60
            ):
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
        chip.codes = [MIDDLE] * chip.channels
        await ClockCycles(dut.clk_i, 3000)
        seen = [chip.mailbox(TRIPS + 2 * repeat), chip.mailbox(TRIPS + 2 * repeat + 1)]
        assert seen == [0x04, 0x01], f"causes seen by the program: {seen}"


@cocotb.test
async def vector_path_drives_the_gates(dut: Any) -> None:
    """Requests, sampling and control tick are the leg carriers' after the switch; a missed deadline turns all off."""
    chip = Chip(dut)
    await chip.start()
    await chip.until_done()
    gates_of = 2 * chip.phases
    dut.hall_i.value = VECTOR_CODE
    await chip.until_done(VECTOR_ON)
    await ClockCycles(dut.clk_i, 3000)
    await RisingEdge(dut.vector_update)
    period, dead = 1000, 50
    times: dict[str, list[int]] = {"vector_update": [], "adc_strobe_o": [], "tick": []}
    on = [0] * gates_of
    carriers = 6
    for clock in range(carriers * period):
        await FallingEdge(dut.clk_i)
        for name, seen in times.items():
            if getattr(dut, name).value == 1:
                seen.append(clock)
        gates = int(dut.gate_o.value)
        for bit in range(gates_of):
            on[bit] += gates >> bit & 1
    updates = [k * period for k in range(carriers)]
    assert times["vector_update"] == updates
    # The pins follow one clock after the update, the samples lie 100 clocks after the pins.
    assert times["adc_strobe_o"] == [t + 101 for t in updates]
    ticks = [t + 101 + CONVERSION + CODES_TO_TICK[chip.phases] for t in updates]
    assert times["tick"] in (ticks[0::2], ticks[1::2]), f"{times['tick']}, every second of {ticks}"
    for leg, width in enumerate(WIDTHS[chip.phases]):
        for gate, clocks in ((0, width - dead), (1, period - width - dead)):
            got = on[2 * leg + gate] / carriers
            assert abs(got - clocks) <= 1.0, f"leg {leg}, gate {gate}: {got} clocks a carrier, expected {clocks}"

    chip.answers = False
    clock = 0
    while dut.vector_deadline.value == 0 and clock < 5 * period:
        await FallingEdge(dut.clk_i)
        clock += 1
    assert 2 * period < clock < 5 * period, f"deadline after {clock} clocks"
    assert int(dut.gate_o.value) != 0
    await FallingEdge(dut.clk_i)
    assert int(dut.gate_o.value) == 0, "gates on one clock after the deadline"
    await ClockCycles(dut.clk_i, 3000)
    assert int(dut.gate_o.value) == 0 and chip.mailbox(TRIPS) == 0x80, hex(chip.mailbox(TRIPS))


@cocotb.test
async def core_makes_the_voltages(dut: Any) -> None:
    """The current line interrupts the core at every sample, also within the handlers of both other lines."""
    chip = Chip(dut)
    await chip.start()
    await chip.until_done()
    dut.hall_i.value = DIRECT_CODE
    await chip.until_done(VECTOR_ON)
    ticks, within, gaps, other, loads = (chip.mailbox(i) for i in range(18, 23))
    # The program counts in what time the handlers leave to it.
    assert ticks >= 30 and (gaps, other) == (0, 0), f"ticks, samples lost, other causes: {ticks, gaps, other}"
    assert within >= ticks, f"{within} of {ticks} control handlers were interrupted"
    assert loads >= 4
    # The deferred handler waits for a tick, the control handler of the tick for a sample: all three levels.
    period, dead, carriers = 1000, 50, 6
    await RisingEdge(dut.vector_update)
    on, late = [0] * 6, []
    strobe = None
    for clock in range(carriers * period):
        await FallingEdge(dut.clk_i)
        if dut.adc_valid_i.value == 1:
            strobe = clock
        if dut.vector_sync.value == 1 and strobe is not None:
            late.append(clock - strobe)
        gates = int(dut.gate_o.value)
        for bit in range(6):
            on[bit] += gates >> bit & 1
    dut._log.info("codes to compares by way of the core: %s clocks", late)
    assert len(late) == carriers and max(late) < 500
    for leg, width in enumerate(WIDTHS[3]):
        for gate, clocks in ((0, width - dead), (1, period - width - dead)):
            got = on[2 * leg + gate] / carriers
            assert abs(got - clocks) <= 1.0, f"leg {leg}, gate {gate}: {got} clocks a carrier, expected {clocks}"


def run(
    phases: int,
    testcase: list[str] | None = None,
    vector: bool = True,
    ram_words: int = RAM_WORDS,
    high_active_low: bool = False,
) -> None:
    """Build the chip with the program in its RAM and run the named tests, or all."""
    image = build_image(ram_words if ram_words == RAM_WORDS else LARGEST_BANK_WORDS)
    sources = [path for path in rtl_sources() if path.is_relative_to(RTL) or "VexRiscv" in path.name]
    run_block_test(
        "fl_soc",
        [path for path in sources if path.parent.name != "pkg"],
        __name__,
        parameters={
            "Init": f'"{image}"',
            "Phases": phases,
            # Else the default of the RTL, which is to be RAM_WORDS.
            **({"RamWords": ram_words} if ram_words != RAM_WORDS else {}),
            "Vector": int(vector),
            "Injection": int(vector),
            "Can": 1,
            "HighActiveLow": int(high_active_low),
        },
        registers=REGISTER_BLOCKS,
        testcase=testcase,
        seen=["fl_ram", "fl_carrier"],
    )


def test_fl_soc() -> None:
    """A program on the core finds the chip as documented; gates follow instants and faults.

    Verifies: SOC-15, SOC-16, SOC-17, SOC-18, SOC-19, SOC-21, SOC-22, SOC-27, SOC-32
    """
    run(3)


def test_fl_soc_five_phases() -> None:
    """The same program on the chip with five phases: its blocks, converter channels and legs.

    Verifies: SOC-15, SOC-21, SOC-23
    """
    run(5, FIVE_PHASE_TESTS)


def test_fl_soc_six_step_only() -> None:
    """The same program on the chip without vector path, its RAM in banks, upper pins active low: up to the gates.

    Verifies: SOC-15, SOC-17, SOC-26, SOC-29, SAFE-05
    """
    run(3, SIX_STEP_TESTS, vector=False, ram_words=SMALL_WORDS, high_active_low=True)
