# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Every block of the RTL alone, out of context: without pads, ways to and from its ports not counted."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from fluxlock.base.paths import ROOT, RTL
from fluxlock.base.writable import alone
from fluxlock.synth import timing
from fluxlock.synth.tools import (
    WORK,
    Device,
    SynthesisError,
    TimeLimitError,
    empty_image,
    place_and_route,
    relative,
    synthesize,
)

BLOCKS = ROOT / "constraints" / "blocks.toml"
ALL_BLOCKS = "blocks"  # name of all of them on the command line
# A block that comes to this share of what is aimed at may reach it with another seed or timing weight.
NEAR = 0.9
AREAS = ("lut4", "carry", "ff", "block_ram", "lut_ram", "dsp")  # counts of a BlockResult


@dataclass(frozen=True)
class BlockSet:
    """Blocks whose areas are summed."""

    name: str
    description: str
    wish: dict[str, int]  # most of "lut", LUT4 + 2 x carry, and "dsp"
    blocks: dict[str, dict[str, int]]  # module: parameters
    copies: dict[str, int] = field(default_factory=dict)  # module: how often the chip has it, where more than once


@dataclass(frozen=True)
class Settings:
    """`constraints/blocks.toml`."""

    device: Device
    clock_mhz: float  # the chip's: what the slow blocks must reach; the others reach what is aimed at
    limit_s: float  # of nextpnr, for one block and attempt, processor time
    seeds: int  # tried until one reaches what is aimed at...
    timing_weights: list[int]  # ...each with these weights of the timing in the placement, the first first
    left_out: dict[str, str]  # module: why it is not built alone
    slow: dict[str, str]  # module: why the chip's clock is enough
    sets: dict[str, BlockSet]

    def least_mhz(self, module: str) -> float:
        """Clock below which a block fails."""
        return self.clock_mhz if module in self.slow else self.device.clock_mhz


@dataclass(frozen=True)
class BlockResult:
    """Area and timing of one block."""

    fmax_mhz: float | None  # None: no way from flip-flop to flip-flop
    lut4: int
    carry: int
    ff: int
    block_ram: int
    lut_ram: int
    dsp: int
    problems: list[str]
    critical_path: list[str]
    cpu_s: float
    parts: dict[str, int] = field(default_factory=dict)  # of a set: LUT4 + 2 x carry of each block, all copies


def load_settings() -> Settings:
    """Contents of `constraints/blocks.toml`."""
    with BLOCKS.open("rb") as file:
        values = tomllib.load(file)
    device = Device(values["device"], values["package"], values["speed_grade"], values["aim_mhz"])
    sets = {name: BlockSet(name=name, **table) for name, table in values["sets"].items()}
    modules = values["left_out"], values["slow"]
    return Settings(
        device, values["clock_mhz"], values["limit_s"], values["seeds"], values["timing_weights"], *modules, sets
    )


def block_files(settings: Settings) -> dict[str, Path]:
    """All blocks by name: modules of the RTL that are neither package, register wrapper, board top nor left out."""
    files = {path.stem: path for path in sorted(RTL.glob("*/fl_*.sv"))}
    named = {
        *settings.left_out,
        *settings.slow,
        *(module for group in settings.sets.values() for module in group.blocks),
    }
    unknown = named - set(files)
    if unknown:
        raise SynthesisError(f"{relative(BLOCKS)}: no module {', '.join(sorted(unknown))}")
    return {
        name: path
        for name, path in files.items()
        if not name.endswith(("_pkg", "_wb")) and not name.startswith("fl_board") and name not in settings.left_out
    }


@dataclass(frozen=True)
class BlockPlacement:
    """What one attempt came to."""

    fmax_mhz: float  # infinite: no way from flip-flop to flip-flop; 0: not routed
    problem: str  # empty: none
    critical_path: list[str]
    used_s: float  # processor time


def place_block(folder: Path, settings: Settings, seed: int, timing_weight: int) -> BlockPlacement:
    """Place and route the netlist in `folder` once, out of context."""
    options = ["--seed", str(seed), "--placer-heap-timingweight", str(timing_weight)]
    options += ["--router", "router1", "--out-of-context"]
    try:
        report, used_s = place_and_route(settings.device, folder, options, settings.limit_s)
    except TimeLimitError as error:
        return BlockPlacement(0.0, str(error), [], settings.limit_s)
    return BlockPlacement(timing.fmax_mhz(report) or math.inf, "", timing.critical_path(report), used_s)


def build_block(
    name: str, path: Path, files: list[Path], settings: Settings, seed: int, fixed: dict[str, int] | None = None
) -> BlockResult:
    """Synthesize, place and route one block alone; fixed: parameters that are not its defaults."""
    folder = WORK / "blocks" / "-".join([name, *(f"{key}{value}" for key, value in (fixed or {}).items())])
    # A set may hold the block as it is.
    with alone(folder, wait=True):
        return _build_block(name, path, files, settings, seed, fixed or {}, folder)


def _build_block(
    name: str, path: Path, files: list[Path], settings: Settings, seed: int, fixed: dict[str, int], folder: Path
) -> BlockResult:
    image = f'"{relative(empty_image())}"'
    parameters: dict[str, int | str] = {
        **fixed,
        **({"Init": image} if "string Init" in path.read_text() else {}),
    }
    cells, used_s = synthesize(name, files, parameters, folder)
    aim = settings.device.clock_mhz
    placements: list[BlockPlacement] = []
    for weight, other in product(settings.timing_weights, range(seed, seed + settings.seeds)):
        placements.append(place_block(folder, settings, other, weight))
        if placements[-1].fmax_mhz >= aim or placements[0].fmax_mhz < NEAR * aim:
            break
    best = max(placements, key=lambda p: p.fmax_mhz)
    least = settings.least_mhz(name)
    problem = best.problem or (
        f"clock: {best.fmax_mhz:.1f} MHz, below {least:.1f} MHz" if best.fmax_mhz < least else ""
    )
    return BlockResult(
        fmax_mhz=round(best.fmax_mhz, 1) if 0.0 < best.fmax_mhz < math.inf else None,
        lut4=cells.get("LUT4", 0),
        carry=cells.get("CCU2C", 0),
        ff=cells.get("TRELLIS_FF", 0),
        block_ram=cells.get("DP16KD", 0),
        lut_ram=cells.get("TRELLIS_DPR16X4", 0),
        dsp=cells.get("MULT18X18D", 0),
        problems=[problem] if problem else [],
        critical_path=best.critical_path,
        cpu_s=round(used_s + sum(p.used_s for p in placements), 1),
    )


def build_set(group: BlockSet, paths: dict[str, Path], files: list[Path], settings: Settings, seed: int) -> BlockResult:
    """The blocks of a set, one after the other: sums of the areas of all copies, least Fmax."""
    built = {name: build_block(name, paths[name], files, settings, seed, fixed) for name, fixed in group.blocks.items()}
    copies = {name: group.copies.get(name, 1) for name in built}
    slowest = min(built.values(), key=lambda r: r.fmax_mhz or math.inf)
    totals = {key: sum(copies[name] * getattr(r, key) for name, r in built.items()) for key in AREAS}
    return BlockResult(
        fmax_mhz=slowest.fmax_mhz,
        **totals,
        problems=[f"{name}: {problem}" for name, r in built.items() for problem in r.problems],
        critical_path=slowest.critical_path,
        cpu_s=round(sum(r.cpu_s for r in built.values()), 1),
        parts={name: copies[name] * (r.lut4 + 2 * r.carry) for name, r in built.items()},
    )
