"""Every block of the RTL alone, out of context: without pads, ways to and from its ports not counted."""

from __future__ import annotations

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


@dataclass(frozen=True)
class Settings:
    """`constraints/blocks.toml`."""

    device: Device
    clock_mhz: float  # the chip's: every block must reach it
    limit_s: float  # of nextpnr, for one block, processor time
    left_out: dict[str, str]  # module: why it is not built alone


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
    return Settings(device, values["clock_mhz"], values["limit_s"], values["left_out"])


def block_files(settings: Settings) -> dict[str, Path]:
    """All blocks by name: modules of the RTL that are neither package, register wrapper, board top nor left out."""
    files = {path.stem: path for path in sorted(RTL.glob("*/fl_*.sv"))}
    unknown = set(settings.left_out) - set(files)
    if unknown:
        raise SynthesisError(f"{relative(BLOCKS)}: no module {', '.join(sorted(unknown))}")
    return {
        name: path
        for name, path in files.items()
        if not name.endswith(("_pkg", "_wb")) and not name.startswith("fl_board") and name not in settings.left_out
    }


def build_block(name: str, path: Path, files: list[Path], settings: Settings, seed: int) -> BlockResult:
    """Synthesize, place and route one block alone."""
    folder = WORK / "blocks" / name
    folder.mkdir(parents=True, exist_ok=True)
    image = f'"{relative(empty_image())}"'
    parameters: dict[str, int | str] = {"Init": image} if "string Init" in path.read_text() else {}
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
