# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip as a folder that needs neither this checkout nor Python: sources, lists, images, constraints, licences."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from fluxlock.base.paths import GENERATED, ROOT, package_dir
from fluxlock.base.stage import Progress
from fluxlock.config import Scenario
from fluxlock.cosim.block import WAIVERS
from fluxlock.cosim.run import IMAGE_FILE
from fluxlock.export import flows
from fluxlock.export.recording import Recording, package, record, text
from fluxlock.file_lists import BOARD_FOLDER, CHIP_LIST, read_list
from fluxlock.firmware.toolchain import build_loader
from fluxlock.generate.registers import generate_registers
from fluxlock.generate.soft_core import soft_core

BENCH = ROOT / "sim" / "export" / "fl_replay.sv"

REUSE = """version = 1

[[annotations]]
path = ["**.f", "**.core", "**.ys", "**.txt", "README.md", "LICENSE", "generated/**"]
SPDX-FileCopyrightText = "2026 Fluxlock contributors"
SPDX-License-Identifier = "Apache-2.0 WITH SHL-2.1"

# The firmware holds functions of compiler_rt.
[[annotations]]
path = ["*.hex"]
SPDX-FileCopyrightText = ["2026 Fluxlock contributors", "Zig contributors"]
SPDX-License-Identifier = "Apache-2.0 AND MIT"

[[annotations]]
path = ["generated/VexRiscv*.v"]
precedence = "override"
SPDX-FileCopyrightText = ["2016 Spinal HDL contributors", "2026 Fluxlock contributors"]
SPDX-License-Identifier = "MIT"
"""


def place(source: Path) -> str:
    """Where a file of the checkout stands in the folder."""
    if source.is_relative_to(GENERATED):
        return f"generated/{source.name}"
    return source.relative_to(ROOT).as_posix()


def export(
    folder: Path,
    scenario: Scenario,
    clocks: int,
    boards: Sequence[str] = tuple(flows.BOARDS),
    progress: Progress | None = None,
) -> Recording:
    """Fill an empty folder; the run that was recorded for it."""
    generate_registers()
    soft_core()
    debug_core = soft_core(debug=True)
    sources = {"fl_soc": read_list(CHIP_LIST)}
    sources |= {flows.top(board): read_list(BOARD_FOLDER / f"{flows.top(board)}.f") for board in boards}
    lists = {name: [place(file) for file in files] for name, files in sources.items()}
    copied = {file for files in sources.values() for file in files} | {WAIVERS, debug_core}
    copied |= {ROOT / "constraints" / flows.BOARDS[board].constraints for board in boards}
    for file in copied:
        _copy(file, folder / place(file))
    for name, files in (lists | {"fl_replay": [*lists["fl_soc"], *flows.BENCH]}).items():
        (folder / f"{name}.f").write_text("".join(f"{file}\n" for file in files))
    for name, script in flows.scripts(boards, lists, folder).items():
        (folder / name).write_text(script)
    recording = _bench(folder, scenario, clocks, progress)
    _copy(build_loader(), folder / "boot.hex")
    _licences(folder)
    (folder / "README.md").write_text(_readme(scenario, boards))
    return recording


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def _bench(folder: Path, scenario: Scenario, clocks: int, progress: Progress | None) -> Recording:
    """Image of the RAM, and the run that the checkout's chip makes with it."""
    with tempfile.TemporaryDirectory() as run:
        recording = record(scenario, clocks, Path(run), progress)
        _copy(Path(run) / IMAGE_FILE, folder / "firmware.hex")
    _copy(BENCH, folder / "sim" / BENCH.name)
    files = (package(scenario, recording), text(recording.pins), text(recording.gates))
    for name, content in zip((flows.BENCH[0], *flows.CHANGES), files, strict=True):
        (folder / name).write_text(content)
    return recording


def _licences(folder: Path) -> None:
    for licence in sorted((ROOT / "LICENSES").glob("*.txt")):
        _copy(licence, folder / "LICENSES" / licence.name)
    core = package_dir("pythondata_cpu_vexriscv") / "verilog" / "ext" / "VexRiscv" / "LICENSE"
    _copy(core, folder / "LICENSES" / "MIT.txt")
    _copy(ROOT / "LICENSE", folder / "LICENSE")
    (folder / "REUSE.toml").write_text(REUSE)


def _readme(scenario: Scenario, boards: Sequence[str]) -> str:
    tops = ", ".join(f"`{flows.top(board)}`" for board in boards)
    run = f"verilator --binary {flows.PLAIN_OPTIONS} {flows.WAIVERS} -F fl_replay.f --top-module fl_replay"
    return f"""# Fluxlock, taken away

The chip is `fl_soc`, board tops are {tops}. `fl_soc.f` and its like list the sources of each in order.

    verilator --lint-only {flows.WAIVERS} -F fl_soc.f --top-module fl_soc
    {run} && obj_dir/Vfl_replay

The second line replays a recorded run of scenario `{scenario.name}` and compares the gates in every clock.
`firmware.hex`: firmware and parameters of its motor, the RAM's contents. `boot.hex`: the loader, for `Boot = 1`.
Scripts: `fluxlock.core` (FuseSoC), `*.ys` and `*.sh` (Yosys with slang, nextpnr), `*.tcl` (of vendors, not run yet).
`generated/` has the register blocks and the RISC-V core, VexRiscv. `VexRiscv_Debug.v` in its place has a debug bus.
Licences: `LICENSE` and `REUSE.toml`.
"""
