"""Every block of the RTL alone, out of context: without pads, ways to and from its ports not counted."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

from fluxlock.paths import ROOT, RTL
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
AREAS = ("lut4", "carry", "ff", "block_ram", "lut_ram", "dsp")  # counts of a BlockResult


@dataclass(frozen=True)
class BlockSet:
    """Blocks whose areas are summed."""

    name: str
    description: str
    wish: dict[str, int]  # most of "lut", LUT4 + 2 x carry, and "dsp"
    blocks: dict[str, dict[str, int]]  # module: parameters


@dataclass(frozen=True)
class Settings:
    """`constraints/blocks.toml`."""

    device: Device
    clock_mhz: float  # the chip's: every block must reach it
    limit_s: float  # of nextpnr, for one block, processor time
    left_out: dict[str, str]  # module: why it is not built alone
    sets: dict[str, BlockSet]


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


def load_settings() -> Settings:
    """Contents of `constraints/blocks.toml`."""
    with BLOCKS.open("rb") as file:
        values = tomllib.load(file)
    device = Device(values["device"], values["package"], values["speed_grade"], values["aim_mhz"])
    sets = {name: BlockSet(name=name, **table) for name, table in values["sets"].items()}
    return Settings(device, values["clock_mhz"], values["limit_s"], values["left_out"], sets)


def block_files(settings: Settings) -> dict[str, Path]:
    """All blocks by name: modules of the RTL that are neither package, register wrapper, board top nor left out."""
    files = {path.stem: path for path in sorted(RTL.glob("*/fl_*.sv"))}
    named = {*settings.left_out, *(module for group in settings.sets.values() for module in group.blocks)}
    unknown = named - set(files)
    if unknown:
        raise SynthesisError(f"{relative(BLOCKS)}: no module {', '.join(sorted(unknown))}")
    return {
        name: path
        for name, path in files.items()
        if not name.endswith(("_pkg", "_wb")) and not name.startswith("fl_board") and name not in settings.left_out
    }


def build_block(
    name: str, path: Path, files: list[Path], settings: Settings, seed: int, fixed: dict[str, int] | None = None
) -> BlockResult:
    """Synthesize, place and route one block alone; fixed: parameters that are not its defaults."""
    folder = WORK / "blocks" / "-".join([name, *(f"{key}{value}" for key, value in (fixed or {}).items())])
    folder.mkdir(parents=True, exist_ok=True)
    image = f'"{relative(empty_image())}"'
    parameters: dict[str, int | str] = {
        **(fixed or {}),
        **({"Init": image} if "string Init" in path.read_text() else {}),
    }
    cells, used_s = synthesize(name, files, parameters, folder)
    options = ["--seed", str(seed), "--router", "router2", "--out-of-context"]
    fmax, problems, steps = None, [], []
    try:
        report, nextpnr_s = place_and_route(settings.device, folder, options, settings.limit_s)
        used_s += nextpnr_s
    except TimeLimitError as error:
        problems = [str(error)]
    else:
        fmax, steps = timing.fmax_mhz(report), timing.critical_path(report)
        if fmax is not None and fmax < settings.clock_mhz:
            problems = [f"clock: {fmax:.1f} MHz, below {settings.clock_mhz:.1f} MHz"]
    return BlockResult(
        fmax_mhz=fmax and round(fmax, 1),
        lut4=cells.get("LUT4", 0),
        carry=cells.get("CCU2C", 0),
        ff=cells.get("TRELLIS_FF", 0),
        block_ram=cells.get("DP16KD", 0),
        lut_ram=cells.get("TRELLIS_DPR16X4", 0),
        dsp=cells.get("MULT18X18D", 0),
        problems=problems,
        critical_path=steps,
        cpu_s=round(used_s, 1),
    )


def build_set(group: BlockSet, paths: dict[str, Path], files: list[Path], settings: Settings, seed: int) -> BlockResult:
    """The blocks of a set, one after the other: sums of their areas, least Fmax."""
    built = {name: build_block(name, paths[name], files, settings, seed, fixed) for name, fixed in group.blocks.items()}
    slowest = min(built.values(), key=lambda r: r.fmax_mhz or math.inf)
    totals = {key: sum(getattr(r, key) for r in built.values()) for key in AREAS}
    return BlockResult(
        fmax_mhz=slowest.fmax_mhz,
        **totals,
        problems=[f"{name}: {problem}" for name, r in built.items() for problem in r.problems],
        critical_path=slowest.critical_path,
        cpu_s=round(sum(r.cpu_s for r in built.values()), 1),
    )
