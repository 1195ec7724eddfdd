"""Serial converter interface against a model of the converters' pins."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.triggers import FallingEdge, First, RisingEdge, Timer

from cocotb_tests.soc.bench import CLOCK_NS, Bench
from fluxlock.cosim.block import run_block_test

FRAME_CYCLES, QUIET_CYCLES = 29, 2
ACCESS_NS = 20  # from the falling edge to the new bit: the slowest that constraints/ allows


class Converters:
    """AD7276 kind: two leading zeros and 12 bits, one after every falling edge."""

    def __init__(self, dut: Any, channels: int) -> None:
        self.dut, self.channels = dut, channels
        self.codes: list[int] = []
        self.frames: list[int] = []  # falling edges of each finished frame
        cocotb.start_soon(self._run())

    def _put(self, bits: list[int]) -> None:
        self.dut.sdata_i.value = sum(bit << i for i, bit in enumerate(bits))

    async def _run(self) -> None:
        while True:
            await FallingEdge(self.dut.cs_no)
            assert self.dut.sclk_o.value == 1, "clock low when the converters are selected"
            held, edges = list(self.codes), 0
            self._put([0] * self.channels)
            while True:
                fired = await First(edge := FallingEdge(self.dut.sclk_o), RisingEdge(self.dut.cs_no))
                if fired is not edge:
                    break
                edges += 1
                await Timer(2, "ns")
                self._put([random.getrandbits(1) for _ in held])  # old bit gone, new one not there yet
                await Timer(ACCESS_NS - 2, "ns")
                shift = 13 - edges
                self._put([code >> shift & 1 if shift >= 0 else random.getrandbits(1) for code in held])
            self.frames.append(edges)


@cocotb.test
async def reads_random_codes(dut: Any) -> None:
    channels = int(dut.Channels.value)
    bench = Bench(dut)
    converters = Converters(dut, channels)
    await bench.start(strobe_i=0, sdata_i=0)
    for gap in [0, 0, 1, 19, *(random.randrange(40) for _ in range(40))]:
        codes = [random.choice([0, 0xFFF, 0x800, 0x7FF, random.getrandbits(12)]) for _ in range(channels)]
        converters.codes = codes
        dut.strobe_i.value = 1
        await bench.clocks()
        dut.strobe_i.value = random.getrandbits(1)  # a strobe inside a frame is ignored
        assert dut.cs_no.value == 0, "hold is not one clock after the strobe"
        converters.codes = [0x555] * channels  # what comes after the hold does not count
        assert await bench.wait_high(dut.valid_o, 60) == FRAME_CYCLES - 1
        dut.strobe_i.value = 0
        got = int(dut.code_o.value)
        assert [got >> 12 * i & 0xFFF for i in range(channels)] == codes
        assert dut.cs_no.value == 1
        await bench.clocks(QUIET_CYCLES + gap)
        assert dut.valid_o.value == 0 and int(dut.code_o.value) == got
    assert converters.frames == [14] * len(converters.frames) and len(converters.frames) == 44
    await Timer(CLOCK_NS, "ns")


@pytest.mark.parametrize("channels", [9, 1])
def test_fl_adc_serial(channels: int) -> None:
    """Frame, hold instant, data timing at the slowest converter allowed.

    Verifies: SOC-14
    """
    run_block_test("fl_adc_serial", ["board/fl_adc_serial.sv"], __name__, parameters={"Channels": channels})
