# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Synthesis: what is read from the tools' reports, when it fails, and the numbers that the pages show."""

from __future__ import annotations

import json
import math
import re
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import alone
from fluxlock.digits import thousands
from fluxlock.synth import __main__ as command
from fluxlock.synth import blocks, configurations, report, timing
from fluxlock.synth.blocks import AREAS, BlockPlacement, BlockResult, BlockSet, block_files, load_settings
from fluxlock.synth.configurations import Configuration, Placement, limits_missed, load_configurations, not_routed
from fluxlock.synth.timing import PadDelays
from fluxlock.synth.tools import WORK, SynthesisError, TimeLimitError, pack, place_and_route, run_tool, synthesize
from fluxlock.synth.xilinx import XilinxCells, cells_of

CLOCK, PADS = "posedge clk", timing.PAD
CONFIG = Configuration(
    "x", "", "", "LFE5U-85F", "", 6, 50.0, "", pad_output_ns=6.0, pad_input_ns=5.0, limit_s=60.0,
    together=("g_o", "h_o"), together_ns=4.0,
)  # fmt: skip
RESULT: dict[str, Any] = {
    "device": "LFE5U-85F", "speed_grade": 6, "clock_mhz": 50.0, "fmax_mhz": 51.26, "routed": True,
    "pad_output_ns": 4.0, "pad_input_ns": 3.0, "together_ns": 2.0, "luts_left": 0.2345, "lut4": 12345, "carry": 1001,
    "ff": 7, "lut_ram": 6, "block_ram": 5, "dsp": 4, "yosys_s": 100.4, "nextpnr_s": 200.6, "seed": 1, "problems": [],
    "xilinx": {"lut6": 9, "carry4": 8, "ff": 7, "lut_ram": 6, "block_ram": 5, "dsp": 4},
    "sources": {"chip": "0123456789ab"},
}  # fmt: skip
MADE = "chip `0123456789ab`"


def way(start: str, end: str, *delays: float) -> dict[str, Any]:
    """A path of nextpnr's report: flip-flop, nets and setup."""
    kinds = ["clk-to-q", *["routing", "logic"] * len(delays)]
    steps = [
        {
            "type": kind,
            "delay": delay,
            "net": f"n{i}",
            "sources": ["/share/map.v:1.2-3.4", f"rtl/a/fl_a.sv:{i}.8"],
            "to": {"cell": "c"},
        }
        for i, (kind, delay) in enumerate(zip(kinds, delays, strict=False))
    ]
    return {"from": start, "to": end, "path": steps}


def net(driver: str, start: str, cell: str, end: str, *delays: float) -> dict[str, Any]:
    """A net of nextpnr's detailed report with one end."""
    return {"driver": driver, "event": start, "endpoints": [{"cell": cell, "event": end, "delay": list(delays)}]}


def test_pad_delays() -> None:
    """The longest ways between pads and flip-flops are found in nextpnr's report, other ways do not count.

    Verifies: BRD-07
    """
    asynchronous = timing.asynchronous_pads(
        '# x\nBLOCK PATH FROM PORT "button_i";\nBLOCK PATH TO PORT "led_o[0]";\nLOCATE COMP "d_i[0]" SITE "A1";\n'
    )
    assert asynchronous == {"button_i", "led_o[0]"}
    nets = [
        net("ff_a", CLOCK, "ff_b", CLOCK, 16.0, 17.0),
        net("d_i[0]$tr_io", PADS, "ff_c", CLOCK, 3.4, 3.5),
        net("button_i_lut", PADS, "ff_d", CLOCK, 8.1, 8.1),
        net("button_i$tr_io", PADS, "ff_e", CLOCK, 8.0, 8.0),
        net("ff_f", CLOCK, "q_o$tr_io", PADS, 4.4, 4.5),
        net("ff_g", CLOCK, "clock_gate", PADS, 9.9, 9.9),
        net("ff_h", CLOCK, "led_o[0]$tr_io", PADS, 9.8, 9.8),
        net("e_i$tr_io", PADS, "q_o$tr_io", PADS, 9.0, 9.0),
        net("ff_i", CLOCK, "g_o[0]$tr_io", PADS, 5.5, 6.0),
        net("ff_j", CLOCK, "g_o[1]$tr_io", PADS, 7.0, 8.5),
    ]
    report = {"detailed_net_timings": nets}
    assert timing.pad_delays(report, asynchronous) == PadDelays(8.5, 3.5, 0.0)
    assert timing.pad_delays(report, asynchronous, ["g_o"]) == PadDelays(4.5, 3.5, 3.0)
    assert timing.pad_delays({"detailed_net_timings": nets[:1]}, asynchronous) == PadDelays(0.0, 0.0, 0.0)


def test_critical_path() -> None:
    """The slowest way from flip-flop to flip-flop is told with its nets and their lines in our sources.

    Verifies: BRD-09
    """
    paths = [way(PADS, CLOCK, 30.0), way(CLOCK, CLOCK, 0.5, 1.0, 0.25), way(CLOCK, CLOCK, 0.5, 4.0, 0.25)]
    assert timing.critical_path({"critical_paths": paths}) == [
        "4.75 ns, 0.75 ns of it logic and 4.00 ns routing",
        "  0.50 ns  c (clk-to-q)",
        "  4.50 ns  n1 (rtl/a/fl_a.sv:1)",
    ]
    assert timing.critical_path({"critical_paths": paths[:1]}) == []
    assert timing.fmax_mhz({"fmax": {"a": {"achieved": 60.0}, "b": {"achieved": 55.5}}}) == 55.5
    assert timing.fmax_mhz({"fmax": {}}) is None


@pytest.mark.parametrize(
    ("fmax", "pads", "found"),
    [
        (50.0, PadDelays(6.0, 5.0, 4.0), []),
        (49.9, PadDelays(6.0, 5.0, 4.0), ["clock: 49.9 MHz, below 50.0 MHz"]),
        (50.0, PadDelays(6.1, 5.0, 4.0), ["flip-flop to pad: 6.1 ns, above 6.0 ns"]),
        (50.0, PadDelays(6.0, 5.1, 4.0), ["pad to flip-flop: 5.1 ns, above 5.0 ns"]),
        (50.0, PadDelays(6.0, 5.0, 4.1), ["g_o and h_o apart: 4.1 ns, above 4.0 ns"]),
    ],
)
def test_limits_missed(fmax: float, pads: PadDelays, found: list[str]) -> None:
    """Each missed limit is named, and none that is met.

    Verifies: BRD-09
    """
    assert limits_missed(CONFIG, fmax, pads) == found
    small = replace(CONFIG, luts_left=0.2)
    assert limits_missed(small, fmax, pads, 0.2) == found
    assert limits_missed(small, fmax, pads, 0.1994) == ["LUTs: 19.9% left, below 20.0%", *found]


def test_like() -> None:
    """A configuration that is like another has its keys, but for those of its own.

    Verifies: BRD-09
    """
    found = load_configurations()
    whole, half = found["three-phase"], found["three-phase-45f"]
    own = {"name": half.name, "like": whole.name, "description": half.description, "device": "LFE5U-45F"}
    assert half == replace(whole, **own, luts_left=0.2)


@pytest.mark.parametrize(
    ("outcomes", "wanted"),
    [
        ([(49.0, ["clock"]), (51.0, []), (52.0, [])], (2, 2)),
        ([(49.0, ["clock"]), (49.5, ["clock"]), (48.0, ["clock"])], (2, 3)),
        ([(55.0, ["not routed"]), (44.0, ["clock"]), (43.0, ["clock"])], (2, 3)),
    ],
)
def test_seeds(
    monkeypatch: pytest.MonkeyPatch, outcomes: list[tuple[float, list[str]]], wanted: tuple[int, int]
) -> None:
    """Seeds are tried until one meets the limits; else the fastest routed one counts.

    Verifies: BRD-07
    """

    def place(config: Configuration, folder: Path, seed: int) -> Placement:
        fmax, problems = outcomes[seed - 1]
        return Placement(seed, fmax, None if "not routed" in problems else PadDelays(1.0, 1.0, 1.0), problems, [], 10.0)

    monkeypatch.setattr(configurations, "place", place)
    best, used_s = configurations.best_placement(replace(CONFIG, seeds=3), Path(), 1)
    assert (best.seed, used_s) == (wanted[0], 10.0 * wanted[1])


@pytest.mark.parametrize(
    ("outcomes", "fmax", "tried"),
    [
        ([120.0], 120.0, 1),
        ([math.inf], None, 1),
        ([80.0], 80.0, 1),  # far from the aim
        ([95.0, 0.0, 99.0, 101.0], 101.0, 4),
        ([95.0, *3 * [94.0], 89.0, 101.0], 101.0, 6),
        ([95.0, *7 * [94.0]], 95.0, 8),
    ],
)
def test_block_attempts(monkeypatch: pytest.MonkeyPatch, outcomes: list[float], fmax: float | None, tried: int) -> None:
    """A block that comes near what is aimed at is tried again until it is reached; the fastest attempt counts.

    Verifies: BRD-07
    """
    left, placed = list(outcomes), []
    settings = load_settings()

    def place_block(_: Path, __: blocks.Settings, seed: int, timing_weight: int) -> BlockPlacement:
        placed.append((seed, timing_weight))
        return BlockPlacement(left.pop(0), "", [], 10.0)

    assert (settings.device.clock_mhz, settings.seeds) == (100.0, 4)
    monkeypatch.setattr(blocks, "synthesize", lambda *_: ({"LUT4": 7}, 1.0))
    monkeypatch.setattr(blocks, "place_block", place_block)
    result = blocks.build_block("fl_fifo", block_files(settings)["fl_fifo"], [], settings, 1)
    assert (result.fmax_mhz, result.lut4, result.cpu_s, left) == (fmax, 7, 1.0 + 10.0 * tried, [])
    assert result.problems == ([f"clock: {fmax:.1f} MHz, below 100.0 MHz"] if fmax and fmax < 100.0 else [])
    assert placed == [(seed, weight) for weight in (10, 60) for seed in (1, 2, 3, 4)][:tried]


def test_tool_that_is_not_there(tmp_path: Path) -> None:
    """A tool of a dependency group that has not been set up is named, with what sets it up.

    Verifies: BRD-09
    """
    with pytest.raises(SynthesisError, match="no-such-tool is not installed: run make setup"):
        run_tool(["no-such-tool"], tmp_path / "log", 1.0)


def test_tool_is_stopped(tmp_path: Path) -> None:
    """A tool that does not end is stopped, and its log tells how far it came.

    Verifies: BRD-09
    """
    WORK.mkdir(parents=True, exist_ok=True)
    log = WORK / "test-limit.log"
    placed = "Max frequency for clock '$glbnet$clk': 38.25 MHz (FAIL at 50.00 MHz)"
    routing = "iter=9 wires=1 overused=95 overuse=95\\niter=10 wires=1 overused=30 overuse=31"
    program = f"print({placed!r}); print('{routing}', flush=True)\nwhile True: pass"
    with pytest.raises(TimeLimitError, match=r"did not end within 1 s of processor time: build/synth/test-limit\.log"):
        run_tool([sys.executable, "-c", program], log, 1.0)
    assert timing.placed_fmax_mhz(log.read_text()) == 38.25
    assert not_routed(log, 2.0) == "routing did not end within 2 s of processor time, 30 wires still overused"
    log.write_text("Info: Creating initial analytic placement")
    assert not_routed(log, 2.0) == "placement did not end within 2 s of processor time"
    log.unlink()


def small_module(name: str, text: str) -> tuple[list[Path], Path]:
    """Source of a module and the folder that it is synthesized in."""
    folder = WORK / f"test-{name}"
    folder.mkdir(parents=True, exist_ok=True)
    source = folder / f"{name}.sv"
    source.write_text(f"module {name} {text}\nendmodule\n")
    return [source], folder


def test_latch_fails() -> None:
    """A latch fails synthesis and is named.

    Verifies: BRD-09
    """
    sources, folder = small_module(
        "latch", "(input logic a_i, b_i, output logic y_o);\nalways_latch if (a_i) y_o = b_i;"
    )
    with pytest.raises(SynthesisError, match=r"latch: latches inferred: latch/\S*"):
        synthesize("latch", sources, {}, folder)


def test_small_control_sets() -> None:
    """An enable of a few flip-flops becomes logic, one of many stays an enable.

    Verifies: BRD-07
    """
    sources, folder = small_module(
        "sets",
        "(input logic clk_i, few_i, many_i, input logic [15:0] d_i, output logic [3:0] few_o, "
        "output logic [15:0] many_o);\n"
        "always_ff @(posedge clk_i) if (few_i) few_o <= d_i[3:0];\n"
        "always_ff @(posedge clk_i) if (many_i) many_o <= ~d_i;",
    )
    counts, _ = synthesize("sets", sources, {}, folder, control_set_ffs=8)
    assert counts["TRELLIS_FF"] == 20 and counts["LUT4"] >= 4
    top = json.loads((folder / "netlist.json").read_text())["modules"]["sets"]
    (many,) = top["ports"]["many_i"]["bits"]
    enables = [tuple(c["connections"].get("CE", ())) for c in top["cells"].values() if c["type"] == "TRELLIS_FF"]
    assert enables.count((many,)) == 16 and set(enables) - {(many,)} <= {(), ("1",)}
    assert all(config.control_set_ffs > 1 for config in load_configurations().values())


def test_bitstream_of_a_small_module() -> None:
    """The whole way for the smallest device, with few flip-flops: netlist, placed, routed, timing report, bitstream.

    Verifies: BRD-07, BRD-10
    """
    sources, folder = small_module(
        "way",
        "(input logic clk_i, d_i, output logic q_o);\nlogic d_q;\n"
        "always_ff @(posedge clk_i) {q_o, d_q} <= {~d_q, d_i};",
    )
    config = load_configurations()["six-step-25f"]
    counts, _ = synthesize("way", sources, {}, folder)
    assert counts["TRELLIS_FF"] == 2
    options = ["--seed", "1", "--router", "router2", "--lpf-allow-unconstrained", "--detailed-timing-report"]
    options += ["--textcfg", str((folder / "placed.config").relative_to(ROOT))]
    found, _ = place_and_route(config.placed_on, folder, options, config.limit_s)
    pads = timing.pad_delays(found, set())
    assert timing.fmax_mhz(found) and 0.0 < pads.to_pad < 50.0 and 0.0 < pads.from_pad < 50.0
    assert pack(folder).stat().st_size > 10_000


@pytest.mark.parametrize(
    ("option", "value", "least"), [("--jobs", "0", 1), ("--jobs", "-1", 1), ("--seed", "-1", 0), ("--seed", "x", 0)]
)
def test_options(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], option: str, value: str, least: int
) -> None:
    """A number of jobs or a seed that is none is refused before anything is built.

    Verifies: BRD-09
    """
    monkeypatch.setattr(sys, "argv", ["synth", "fl_fifo", f"{option}={value}"])
    with pytest.raises(SystemExit) as stop:
        command.main()
    assert stop.value.code == 2
    assert f"argument {option}: must be a whole number from {least}, not {value!r}" in capsys.readouterr().err


def test_one_at_a_time(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A configuration that another process builds is refused by name; a block waits until its folder is free.

    Verifies: BRD-09
    """
    monkeypatch.setattr(configurations, "relative", lambda path: path.name)
    monkeypatch.setattr(configurations, "WORK", tmp_path)
    with alone(tmp_path / "x"):
        assert command.run_configurations([CONFIG], 1) == {"x": None}
    assert capsys.readouterr().err == "x: another synthesis is using x; wait for its end\n"
    settings, inside = load_settings(), []

    def synthesize(*_: object) -> tuple[dict[str, int], float]:
        inside.append(1)
        time.sleep(0.1)
        inside.append(-1)
        return {}, 1.0

    monkeypatch.setattr(blocks, "WORK", tmp_path)
    monkeypatch.setattr(blocks, "synthesize", synthesize)
    monkeypatch.setattr(blocks, "place_block", lambda *_: BlockPlacement(120.0, "", [], 1.0))
    path = block_files(settings)["fl_fifo"]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda seed: blocks.build_block("fl_fifo", path, [], settings, seed), (1, 2)))
    assert inside == [1, -1, 1, -1]


def test_results_of_two_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Runs that end at the same time leave the results of all, and write the pages one after the other.

    Verifies: BRD-09
    """
    inside = []

    def write(*_: object) -> None:
        inside.append(1)
        time.sleep(0.05)
        inside.append(-1)

    monkeypatch.setattr(command, "WORK", tmp_path)
    monkeypatch.setattr(command, "RESULTS", tmp_path / "synth.json")
    monkeypatch.setattr(report, "write", write)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda n: command.keep({"configurations": {}, "blocks": {n: {}}}, {}, ({}, ())), "abcd"))
    kept = json.loads((tmp_path / "synth.json").read_text())
    assert sorted(kept["blocks"]) == ["a", "b", "c", "d"] and inside == 4 * [1, -1]


def test_tables() -> None:
    """Numbers of a result reach the page's table and the rows of what was measured; an estimate is marked as one.

    Verifies: BRD-09
    """
    assert " ".join(report.configuration_row("three-phase", RESULT)) == (
        "three-phase LFE5U-85F-6 51.3 50 4.0 3.0 2.0 12345 1001 14347 23.4 7 6 5 4 100 201 all limits met, seed 1 "
        "chip `0123456789ab`"
    )
    assert " ".join(report.xilinx_row("three-phase", RESULT)) == "three-phase 9 8 7 6 5 4 chip `0123456789ab`"
    assert report.block_row("a", RESULT) == ["a", "51.3", "12345", "1001", "14347", "7", "6", "5", "4", MADE]
    placed = {**RESULT, "fmax_mhz": 38.25, "routed": False, "pad_output_ns": None, "problems": ["a", "b"]}
    row = report.configuration_row("three-phase", placed)
    assert report.fmax_text({**placed, "fmax_mhz": None}) == "–"
    assert row[2:6] == ["38.2 (placed)", "50", "–", "3.0"] and row[-2:] == ["a; b", MADE]
    text = "| LUT4 / carry | old |\n| Fmax (MHz) | old |\nother\n"
    assert report.with_measured_rows(text, report.measured_rows(placed)) == (
        "| LUT4 / carry cells / FF / block RAM / DSP on LFE5U-85F | 12 345 / 1 001 / 7 / 5 / 4 "
        "| `make synth ONLY=three-phase` |\n"
        "| Fmax (MHz), target 50 | 38.2 (placed); a; b | `make synth ONLY=three-phase` |\nother\n"
    )
    with pytest.raises(ValueError, match="0 rows begin with 'Fmax'"):
        report.with_measured_rows("| LUT4 / carry | old |", report.measured_rows(RESULT))


def test_xilinx_cells() -> None:
    """LUTs of all sizes, flip-flops of all kinds and both sizes of block RAM are counted, a memory of LUTs by its LUTs.

    Verifies: BRD-09
    """
    counts = {"LUT1": 1, "LUT3": 20, "LUT6": 300, "CARRY4": 4, "FDRE": 50, "FDSE": 6, "RAM32M": 2, "SRL16E": 1}
    counts |= {"RAMB18E1": 3, "RAMB36E1": 10, "DSP48E1": 7, "MUXF7": 99}
    assert cells_of(counts) == XilinxCells(lut6=321, carry4=4, ff=56, lut_ram=9, block_ram=23, dsp=7)
    assert cells_of({}) == XilinxCells(0, 0, 0, 0, 0, 0)


def test_rows_stay() -> None:
    """New rows replace those of the same name, others stay, those of unknown names and of an older head go.

    Verifies: BRD-09
    """
    text = "x\n<!-- m:begin -->\n| n | v |\n| --- | --- |\n| c | 1 |\n| a | 2 |\n| gone | 3 |\n<!-- m:end -->\ny\n"
    expected = "x\n<!-- m:begin -->\n| n | v |\n| --- | --- |\n| a | 2 |\n| b | 4 |\n| c | 5 |\n<!-- m:end -->\ny\n"
    new = [["c", "5"], ["b", "4"]]
    assert report.with_rows(text, "m", ["n", "v"], new, ["a", "b", "c"]) == expected
    assert "| a |" not in report.with_rows(text, "m", ["n", "w"], new, ["a", "b", "c"])
    empty = "<!-- m:begin -->\n<!-- m:end -->"
    assert report.with_rows(empty, "m", ["n", "v"], new, ["c"]).splitlines()[3:4] == ["| c | 5 |"]


def page_rows(name: str) -> list[dict[str, str]]:
    """A table of the page, a dictionary each row."""
    text = report.PAGE.read_text(encoding="utf-8").split(f"<!-- {name}:begin -->")[1].split(f"<!-- {name}:end -->")[0]
    head, _, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in text.strip().splitlines())
    return [dict(zip(head, row, strict=True)) for row in rows]


def test_page_and_measured() -> None:
    """Rows of the page are configurations and blocks that there are, and the numbers among the measured are the page's.

    Verifies: BRD-09
    """
    rows = {row["configuration"]: row for row in page_rows("synth")}
    assert list(rows) == [name for name in load_configurations() if name in rows]
    blocks = [row["block"] for row in page_rows("blocks")]
    assert blocks == [name for name in block_files(load_settings()) if name in blocks]
    record, measured = rows[report.RECORD], report.MEASURED.read_text(encoding="utf-8")
    keys = ("LUT4", "carry (CCU2C)", "FF", "block RAM (18 kbit)", "DSP (18 × 18)")
    size = " / ".join(thousands(int(record[key])) for key in keys)
    (line,) = re.findall(r"^\| LUT4 / carry cells .*$", measured, re.MULTILINE)
    assert f"| {size} |" in line and record["device"].rsplit("-", 1)[0] in line
    (line,) = re.findall(r"^\| Fmax .*$", measured, re.MULTILINE)
    fmax = [record["Fmax / MHz"], *([] if record["result"].startswith(report.MET) else [record["result"]])]
    assert f"| {'; '.join(fmax)} |" in line and f"target {record['target / MHz']} " in line


def test_flags() -> None:
    """The page says what the tools are told of each configuration, by the file of the configurations.

    Verifies: BRD-09
    """
    text = report.PAGE.read_text(encoding="utf-8")
    table = report.flags_table(load_configurations().values())
    assert report.with_text(text, "flags", table) == text
    assert (
        "fl_board_ulx3s: Vector = 0, Boot = 1, RamWords = 18432 | 8 | 4 | `--25k --package CABGA381 --speed 6" in table
    )


def test_sums_of_sets() -> None:
    """The row of a set is the sum of what it says of its blocks.

    Verifies: BRD-09
    """
    sets = load_settings().sets
    for row in page_rows("sets"):
        parts = dict(part.split() for part in row["LUT4 + 2 × carry of each block"].split(", "))
        assert set(parts) == set(sets[row["set"]].blocks)
        assert sum(map(int, parts.values())) == int(row["LUT4 + 2 × carry"])


def test_sets() -> None:
    """Sets of blocks name modules that there are, with parameters that these have, and their rows are sums.

    Verifies: BRD-07
    """
    settings = load_settings()
    paths = block_files(settings)
    for group in settings.sets.values():
        assert set(group.copies) <= set(group.blocks)
        for module, parameters in group.blocks.items():
            text = paths[module].read_text()
            for name in parameters:
                assert re.search(rf"parameter +int unsigned +{name}\b", text), f"{group.name}: {module} has no {name}"
    with pytest.MonkeyPatch.context() as patch:
        results = [
            BlockResult(
                fmax_mhz=fmax,
                **{name: 10 * i + k for k, name in enumerate(AREAS)},
                problems=[f"problem {i}"] if i == 2 else [],
                critical_path=[f"way {i}"],
                cpu_s=1.5,
            )
            for i, fmax in enumerate((120.0, None, 90.0))
        ]
        patch.setattr(blocks, "build_block", lambda *_: results.pop(0))
        group = BlockSet("x", "", {"lut": 5, "dsp": 2}, {"fl_a": {}, "fl_b": {}, "fl_c": {}}, {"fl_b": 2})
        total = blocks.build_set(group, dict.fromkeys(group.blocks, Path()), [], settings, 1)
    assert (total.fmax_mhz, total.critical_path, total.problems) == (90.0, ["way 2"], ["fl_c: problem 2"])
    assert [getattr(total, name) for name in AREAS] == [40 + 4 * k for k in range(6)]
    sizes = {f"fl_{name}": 10 * i + 2 * (10 * i + 1) for i, name in enumerate("abc")}
    assert total.parts == {**sizes, "fl_b": 2 * sizes["fl_b"]}
    assert report.set_row(group, asdict(total))[-3:-1] == ["5, 2", "fl_b 64, fl_c 62, fl_a 2"]


def guard_flip_flops(netlist: Path, guard: int) -> dict[str, list[int]]:
    """Nets of one gate guard's registers, each behind a flip-flop."""
    modules = json.loads(netlist.read_text())["modules"].values()
    (top,) = (module for module in modules if "top" in module["attributes"])
    driven = {cell["connections"]["Q"][0] for cell in top["cells"].values() if cell["type"] == "TRELLIS_FF"}
    wanted = re.compile(rf"g_guard\[{guard}\]\.u_guard\.(gate_h_q|gate_l_q|block_h_q|block_l_q|wait_q)$")
    found = {match[1]: net["bits"] for name, net in top["netnames"].items() if (match := wanted.search(name))}
    assert all(bit in driven for bits in found.values() for bit in bits)
    return found


def test_guards_share_no_flip_flop() -> None:
    """The two gate guards of the safety block as the smallest device gets them: no tool has made one of them.

    The block alone, which is what holds both; `make synth` maps the same text in the chip.

    Verifies: SAFE-22
    """
    config = load_configurations()["six-step-25f"]
    folder = WORK / "test-guards"
    folder.mkdir(parents=True, exist_ok=True)
    files = [path for path in configurations.sources() if "board" not in path.parts]
    synthesize("fl_safety_wb", files, {}, folder, config.control_set_ffs)
    first, second = (guard_flip_flops(folder / "netlist.json", guard) for guard in range(2))
    assert {name: len(bits) for name, bits in first.items()} == {name: len(bits) for name, bits in second.items()}
    assert {len(bits) for bits in first.values()} == {3, 30} and len(first) == 5
    assert not {bit for bits in first.values() for bit in bits} & {bit for bits in second.values() for bit in bits}


def test_smallest_configuration() -> None:
    """`make synth` has brought it to the smallest device: the page's row names no limit that is missed.

    Verifies: BRD-10
    """
    rows = {row["configuration"]: row for row in page_rows("synth")}
    config = load_configurations()["six-step-25f"]
    row = rows[config.name]
    assert config.device == "LFE5U-25F" and row["device"].startswith(config.device)
    assert row["result"].startswith(report.MET) and float(row["Fmax / MHz"]) >= config.clock_mhz == 50.0
