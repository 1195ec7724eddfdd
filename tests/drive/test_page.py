# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Tests of a user's own, in a folder outside of the checkout: those of the page, and one beside a package of cocotb."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.cosim.launch import bytecode_environment
from fluxverify import drive_bench

PAGE = ROOT / "docs" / "howto" / "cocotb-test.md"
FILE = re.compile(r"^<!-- file (\S+) -->\n```\w+\n(.*?)^```", re.DOTALL | re.MULTILINE)
FAILS, PASSES = "56_000) < 50\n", "56_000) < 400\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder beside the checkout with the page's files."""
    (tmp_path / "fluxlock").symlink_to(ROOT)
    here = tmp_path / "my-tests"
    here.mkdir()
    for name, text in FILE.findall(PAGE.read_text()):
        (here / name).write_text(text)
    return here


def run(folder: Path, *words: str) -> tuple[int, str]:
    """Exit code and output of pytest there, with nothing of this session's environment."""
    command = ["../fluxlock/.venv/bin/python", "-m", "pytest", "-p", "no:cacheprovider", *words]
    out = ("PYTEST", "COCOTB", "PYTHONPATH", "VERILATOR")
    env = {name: value for name, value in os.environ.items() if not name.startswith(out)}
    paths = (place for place in env["PATH"].split(os.pathsep) if not Path(place, "verilator").exists())
    env["PATH"] = os.pathsep.join(paths)
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    print(done.stdout[-6000:], done.stderr[-2000:])
    return done.returncode, done.stdout


def test_the_page(folder: Path) -> None:
    """The page's test is 15 lines; it fails as the page says, with the line and the value, and passes as it says.

    Verifies: DRV-02
    """
    test = folder / "test_spindle.py"
    text = test.read_text()
    body = [line for line in text.splitlines() if line.strip()]
    assert len(body) <= 15
    code, said = run(folder, test.name)
    assert code == 1
    assert FAILS.strip() in said and "AssertionError: assert" in said
    assert FAILS in text
    test.write_text(text.replace(FAILS, PASSES))
    code, said = run(folder, test.name)
    assert code == 0 and "1 passed" in said


BESIDE = """
from pathlib import Path

import cocotb
from cocotb.clock import Clock
from cocotb_tools.runner import get_runner
from cocotbext.axi import AxiStreamBus, AxiStreamSink, AxiStreamSource, MemoryRegion
from fluxlock.drive import Bench, Drive, drive_test, run_tests, verilator_runner

HERE = Path(__file__).parent


@cocotb.test()
async def stream(dut):
    cocotb.start_soon(Clock(dut.clk, 10, "ns").start())
    source = AxiStreamSource(AxiStreamBus.from_prefix(dut, "s"), dut.clk, dut.rst)
    sink = AxiStreamSink(AxiStreamBus.from_prefix(dut, "m"), dut.clk, dut.rst)
    await source.send(b"sector")
    assert bytes((await sink.recv()).tdata) == b"sector"


def test_stream():
    runner = verilator_runner()
    runner.build(sources=[HERE / "wire.sv"], hdl_toplevel="wire_axis", build_dir=HERE / "wire")
    runner.test(test_module="test_beside", hdl_toplevel="wire_axis", testcase="stream", build_dir=HERE / "wire")


@cocotb.test()
async def log_into_memory(dut):
    drive = Drive(dut)
    memory = MemoryRegion(64)
    await drive.start(56_000)
    await memory.write(0, round(drive.speed_rpm).to_bytes(4, "little"))
    await drive.run(1e-3)
    assert abs(int.from_bytes(await memory.read(0, 4), "little") - 56_000) < 600


def test_drive():
    arguments = Bench("spindle.toml", folder=HERE / "drive").arguments()
    get_runner("verilator").test(test_module="test_beside", testcase="log_into_memory", **arguments)


@drive_test()
async def spins(drive):
    assert drive.speed_rpm > 50_000


def test_spins():
    run_tests("spindle.toml", __file__)
"""
WIRE = """
module wire_axis (
    input logic clk, input logic rst,
    input logic [7:0] s_tdata, input logic s_tvalid, s_tlast, output logic s_tready,
    output logic [7:0] m_tdata, output logic m_tvalid, m_tlast, input logic m_tready
);
  assign {m_tdata, m_tvalid, m_tlast, s_tready} = {s_tdata, s_tvalid, s_tlast, m_tready};
endmodule
"""


def test_beside_a_package_of_cocotb(folder: Path) -> None:
    """One file: models of cocotbext-axi on RTL of the user, the drive by cocotb's own runner, and a `drive_test`.

    The RTL finds Verilator without one in the environment, and `run_tests` leaves the other tests alone.

    Verifies: DRV-03
    """
    (folder / "test_beside.py").write_text(BESIDE)
    (folder / "wire.sv").write_text(WIRE)
    code, said = run(folder, "test_beside.py")
    assert code == 0 and "3 passed" in said


def test_a_run_that_a_test_leads_is_the_harness() -> None:
    """The same lines at the same clocks: log, waveforms and events of a test's run are those of the command's run.

    Verifies: DRV-10
    """
    bench = drive_bench.bench_of(0.025)
    assert bench.arguments()["extra_env"].items() >= bytecode_environment().items(), "imports as fast"
    assert drive_bench.led_by_test(bench) == drive_bench.harness(bench)
