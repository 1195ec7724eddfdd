# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What `Drive` refuses, each in one line that names what is right; and that cocotb's own tests stay out."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import cocotb
import pytest
from cocotb.handle import Force
from cocotb.triggers import RisingEdge

from fluxlock.base.paths import ROOT
from fluxlock.drive import Bench, Drive, DriveError, drive_test

SCENARIO = ROOT / "scenarios" / "campaign" / "six-step.toml"
ELSE = Path("else.txt")

REFUSED: dict[str, tuple[Callable[[Drive], object], type[Exception], str]] = {
    "a torque without its name": (lambda d: d.load(0.01), TypeError, "positional"),  # type: ignore[call-arg]  # on purpose
    "no load": (lambda d: d.load(), TypeError, "needs a factor, or a part of the load: constant_nm, coulomb_nm"),
    "a part of no load": (lambda d: d.load(torque_nm=0.1), TypeError, "does not take torque_nm; it takes: constant_nm"),
    "a load in words": (lambda d: d.load(constant_nm="much"), ValueError, "constant_nm = 'much': must be a number"),  # type: ignore[arg-type]  # on purpose
    "no disturbance": (lambda d: d.disturb("ia"), TypeError, "needs an error: offset_lsb, gain, noise_lsb"),
    "a value to be set": (
        lambda d: setattr(d, "load_factor", 3),
        AttributeError,
        "a Drive has no load_factor to be set",
    ),
    "the clock": (lambda d: RisingEdge(d.dut.clk_i), TypeError, "has no edges for cocotb"),
    "the clock's other edge": (lambda d: d.dut.clk_i.falling_edge, TypeError, "await drive.run(seconds)"),
    "a change of the clock": (lambda d: d.dut.clk_i.value_change, TypeError, "has no edges for cocotb"),
    "a disturbance": (lambda d: d.disturb("ia", scale=0.5), TypeError, "it takes: offset_lsb, gain, noise_lsb"),
    "a detail": (lambda d: d.fault("open_phase", wings=2), TypeError, "fault 'open_phase' does not take wings"),
    "another detail": (lambda d: d.fault("supply", level=1), TypeError, "it takes: supply_v, ramp_s"),
    "a kind": (lambda d: d.fault("open", wings=2), ValueError, "fault 'open': must be one of open_phase, shorted"),
    "a supply in words": (lambda d: d.supply("12"), ValueError, "volts = '12': must be a number, at least 0"),  # type: ignore[arg-type]  # on purpose
    "no bus": (lambda d: d.can.send(1), DriveError, "the scenario has no [can]"),
    "a signal of the inside": (lambda d: d.dut.u_safety.u_trip, AttributeError, 'signals=["fl_trip.*"]'),
    "a span backwards": (lambda d: d.window(0.1, 0.05), ValueError, "window 0.1 to 0.05 s: must end after its begin"),
    "a span to come": (lambda d: d.window(0.0, 1.0), ValueError, "and by now, 0.0001 s"),
    "a block": (lambda d: d.registers["pvm.period.cycles"], KeyError, "blocks with stored fields: "),
    "an output": (lambda d: setattr(d.dut.gate_h_o, "value", 0), TypeError, "gate_h_o can be read and awaited, not"),
    "a bit": (lambda d: setattr(d.dut.hall_i[0], "value", 1), TypeError, "force_pin gives an input a level"),
    "an input": (lambda d: d.dut.adc_code_i.set(Force(0)), TypeError, "adc_code_i can be read and awaited, not"),
}


@drive_test()
async def wrong_use_is_refused(drive: Drive) -> None:
    """Names, numbers, spans and writes, each with what is right; reading and awaiting pins stays.

    Verifies: DRV-07
    """
    await drive.run(1e-4)
    for what, (use, kind, said) in REFUSED.items():
        try:
            use(drive)
        except kind as error:
            assert said in str(error) and "\n" not in str(error), (what, str(error))
        else:
            raise AssertionError(what)
    for waits, said in (
        (drive.run(-0.01), "seconds = -0.01: must be a number, at least 0"),
        (drive.until(5e-5), "until 5e-05 s: that time is past"),
        (drive.until("soon"), "when = 'soon': must be a number"),  # type: ignore[arg-type]  # on purpose
    ):
        with pytest.raises(ValueError, match=said):
            await waits

    async def later() -> bool:
        return False

    with pytest.raises(TypeError, match="without awaiting it"):
        await drive.until(later)
    branch = drive.branch([1])
    for end in branch:
        end.keep(end.value)
    with pytest.raises(RuntimeError, match="one loop"):
        list(branch)
    await drive.until(drive.time_s)
    await RisingEdge(drive.dut.adc_valid_i)
    assert drive.time_s > 1e-4 and not hasattr(drive.dut, "u_safety")


@cocotb.test()
async def of_another_chip(dut: object) -> None:
    """A test of the same file that `Bench.test` leaves to its own runner."""
    ELSE.touch()


def test_refusals(capfd: pytest.CaptureFixture[str]) -> None:
    """Without a name only the tests of a drive run, and the log says how far each came; cocotb's own runs by its name.

    Verifies: DRV-03
    """
    bench = Bench(SCENARIO)
    bench.test(__name__)
    said = capfd.readouterr().out
    print(said)
    assert not (bench.folder / ELSE).exists() and "TESTS=1 PASS=1" in said
    assert re.search(r"wrong_use_is_refused ends at 0\.00\d+ s after [1-9]\d+ clocks", said)
    bench.test(__name__, testcase="of_another_chip")
    assert (bench.folder / ELSE).exists()
