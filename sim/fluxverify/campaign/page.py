# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The campaign's table, and docs/verification/campaign.md from its document."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.base.writable import EXIT_BAD_INPUT, guarded
from fluxlock.config import ConfigError, Problem
from fluxlock.cosim.chip import BOARD_RESET_CYCLES
from fluxlock.sources import sources_text
from fluxverify.campaign.board import OSC_STOP_TO_OFF, STOP_TO_OFF
from fluxverify.campaign.faults import FLOOD_S, LONG_START_S, LOOP_S, NODE_S, NOISE_SEED
from fluxverify.campaign.grid import DRIVES, RUN_S, SLOW_S, UPSET_S
from fluxverify.campaign.judge import HALTED, RIDDEN, STOPPED, WRONG
from fluxverify.campaign.master import COMMAND_TIMEOUT_MS

RESULT = BUILD / "campaign.json"
PAGE = ROOT / "docs" / "verification" / "campaign.md"
WAYS = (RIDDEN, STOPPED, HALTED, WRONG)
Rows = list[dict[str, Any]]
Kind = TypeVar("Kind")


def kind_of(row: dict[str, Any]) -> str:
    """Runs that a line of the table adds up."""
    name = str(row["disturbance"])
    return " ".join(name.split()[:2]) if "upset" in name else name


def counted(rows: Rows, kind: Callable[[dict[str, Any]], Kind]) -> list[tuple[Kind, tuple[int, ...]]]:
    """Every kind of run with its number, and how many of them ended in each way of `WAYS`."""
    found: dict[Kind, Rows] = {}
    for row in rows:
        found.setdefault(kind(row), []).append(row)
    return [
        (name, (len(same), *(sum(row["outcome"] == way for row in same) for way in WAYS)))
        for name, same in found.items()
    ]


def kinds(rows: Rows) -> list[tuple[str, tuple[int, ...]]]:
    """`counted` by disturbance."""
    return counted(rows, kind_of)


def score(rows: Rows) -> tuple[int, float]:
    """Runs that ended right, and their share in per cent."""
    right = sum(row["outcome"] != WRONG for row in rows)
    return right, 100.0 * right / max(1, len(rows))


def part(document: dict[str, Any]) -> str:
    """What part of the grid was asked for, as the options that did so; empty: all of it."""
    # Older documents do not name their drives.
    names = document.get("drives") or sorted({str(row["drive"]) for row in document["rows"]})
    found = ["--quick"] if document["quick"] else []
    found += [f"--every {document['every']}"] if document["every"] > 1 else []
    found += [] if {drive.name for drive in DRIVES} <= set(names) else [f"drives {', '.join(names)} only"]
    return ", ".join(found)


def _machines(document: dict[str, Any]) -> list[str]:
    """Table of the drives, their machines, chips and moments."""
    told = {machine["drive"]: machine for machine in document["machines"]}
    lines = ["| drive | motor | chip | firmware | registers, bits | moments |", "|---|---|---|---|---|---|"]
    for drive in (d for d in DRIVES if d.name in told):
        machine = told[drive.name]
        moments = ", ".join(moment.name for moment in drive.moments)
        lines.append(
            f"| {drive.name} (`scenarios/{drive.scenario}`) | {machine['motor']} | `{machine['chip']}` | "
            f"`{machine['firmware']}` | {machine['registers']}, {machine['register_bits']} | {moments} |"
        )
    return lines


def page(document: dict[str, Any]) -> str:
    """The page."""
    rows: Rows = document["rows"]
    right, share = score(rows)
    lines = [
        "# Fault campaign",
        "",
        f"`fluxverify campaign`, seed {document['seed']}, written from `build/campaign.json` by `python -m "
        "fluxverify.campaign.page`.",
        "",
        f"Made from {sources_text(document.get('sources'))}.",
        "",
        f"**{right} of {len(rows)} runs ended right, {share:.2f} %.**"
        + ("" if len(rows) == document["grid"] else f" The grid has {document['grid']}; the others have not been run.")
        + (f" A run takes {document['cpu_s']} s of the processor." if "cpu_s" in document else ""),
        "",
        *_machines(document),
        "",
        "The simulator's process is copied at each moment; every copy gets one disturbance, runs on for "
        f"{1e3 * RUN_S:.0f} ms (an upset {1e3 * UPSET_S:.0f} ms, a current or vdc that stands still "
        f"{1e3 * SLOW_S:.0f} ms, but a current at a given code in six-step operation, "
        f"a short by the next start {1e3 * LONG_START_S:.0f} ms, a drive that starts again up to three times as long) "
        "or until it has been in its fault state for 2 ms, and is judged from the moment on. Assertions of the RTL end "
        "a run as wrong, but for upsets and for a wrong `adc_valid_i`: the least spacing of its sets is asserted.",
        "",
        "Disturbed are windings, legs, supply, load and rotor, every converter channel (`adc_code_i`), every other "
        "input of the chip but clock and reset, and bits of registers and memory. Pins are forced at clock edges; "
        "*wrong* is the opposite of the level that is driven. The five-phase chip has the CAN controller, its firmware "
        "no node. No simulated chip has the port of the SPI flash: its pin leads nowhere.",
        "",
        "The firmware breaks too. Another instruction stands in its main loop, its control interrupt or its node: "
        "one that raises an exception, or one that goes round in itself. It is whole again when the firmware starts "
        f"anew. A main loop that hangs takes {1e3 * LOOP_S:.0f} ms to be found, a node {1e3 * NODE_S:.0f} ms. A stack "
        "overflow is a write of the core to its last word. Floods fill the console or the CAN bus for "
        f"{1e3 * FLOOD_S:.0f} ms, with noise of seed {NOISE_SEED}; another node sends those of the bus. "
        "*Started again*: an over-current by a sample, then `clear` and `start`, with a winding that is shorted by "
        "then or whole.",
        "",
        "The drives board and board-vector run on the chip behind `fl_board`, with its oscillator, its reset of "
        f"{BOARD_RESET_CYCLES} clocks and its serial converters. There the chip's clock and the oscillator stop, and "
        "the lock of the PLL goes, in every state of the drive. Gates and the drivers' enable must then be off within "
        f"{STOP_TO_OFF} clocks of the oscillator, {OSC_STOP_TO_OFF} of the chip, or at once, and stay off.",
        "",
        "Not in the grid: stores that are damaged. `cocotb_tests/soc/test_boot_store.py` damages them on the chip with "
        "a flash.",
        "",
        "Of the drives hall, encoder and can only pins, firmware, lines and bits are disturbed: Hall sensors commutate "
        "the first, an encoder gives the second its angle, a CANopen master commands the third every 0.5 ms, with a "
        f"command timeout of {COMMAND_TIMEOUT_MS} ms.",
        "",
        "| ending | |",
        "|---|---|",
        "| ridden through | the drive runs on, or has begun a new start by itself |",
        "| stopped by name | gates off, a fault name that belongs to the disturbance, on the console or in the CANopen "
        "node's emergency |",
        "| halted | gates and drivers' enable off in time for good; the chip's clock stands or it has begun anew, so "
        "it tells no name |",
        "| wrong | both gates of a leg on or the dead time cut; a phase current above the trip's limit for more than "
        "100 µs with a gate on; torque against the command for more than 10 ms below the speed that the slope has "
        "reached; a name that does not belong to the disturbance, or a stop by none; running on where only a stop is "
        "right; a silent console. All phases and legs count |",
        "",
        "Upsets are single bits that flip, in a register drawn by name or a word of the memory; they are judged by "
        "gates and current alone. Registers are drawn from those of the blocks and register blocks and of the core's "
        "pipeline. Not among them: arrays (memories, the core's register file and its cache), the core's other "
        "registers, and flip-flops that only assertions read. "
        "Settings upsets are bits of the locked settings of the safety block, parameter upsets bits of the parameter "
        "block before the program has looked at it, the sample period upset makes samples 83 times as rare: these must "
        "be named.",
        "",
        f"| disturbance | runs | {' | '.join(WAYS)} | names |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind, counts in kinds(rows):
        names = sorted({r["fault"] for r in rows if kind_of(r) == kind and r["outcome"] == STOPPED})
        shown = ", ".join(f"`{name}`" for name in names)
        lines.append(f"| {kind} | {' | '.join(map(str, counts))} | {shown} |")
    lines += ["", f"| drive | moment | runs | {' | '.join(WAYS)} |", "|---|---|---|---|---|---|---|"]
    for (drive, moment), counts in counted(rows, lambda row: (row["drive"], row["moment"])):
        lines.append(f"| {drive} | {moment} | {' | '.join(map(str, counts))} |")
    bad = [row for row in rows if row["outcome"] == WRONG]
    if bad:
        lines += ["", "## Runs that ended wrong", "", "| drive | moment | disturbance | why |", "|---|---|---|---|"]
    for row in bad:
        upset = "".join(f": `{x.replace('fl_soc__DOT__', '').replace('__DOT__', '.')}`" for x in row["upsets"])
        lines.append(
            f"| {row['drive']} | {row['moment']} | {row['disturbance']}{upset} | {'; '.join(row['reasons'])} |"
        )
    return "\n".join(lines) + "\n"


def read_document(path: Path) -> dict[str, Any]:
    """Document of a campaign, from a file."""
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        missing = [key for key in ("seed", "quick", "every", "grid", "machines", "rows") if key not in document]
    except OSError as error:
        text = f"cannot be read: {error.strerror}; fluxverify campaign writes {RESULT.relative_to(ROOT)}"
        raise ConfigError([Problem(str(path), "", text)]) from None
    except (ValueError, TypeError):
        raise ConfigError([Problem(str(path), "", "is no JSON document of fluxverify campaign")]) from None
    if missing:
        raise ConfigError([Problem(str(path), missing[0], "is missing: no document of fluxverify campaign")])
    return document


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page from the document of the last campaign, or of the file named; exit code 2 if it cannot be."""
    parser = argparse.ArgumentParser(description=f"Write {PAGE.relative_to(ROOT)} from the document of a campaign.")
    parser.add_argument("file", type=Path, nargs="?", default=RESULT, help="default: %(default)s")
    path = parser.parse_args(arguments).file
    try:
        document = read_document(path)
        if left := part(document):
            text = f"holds a part of the grid ({left}); {PAGE.name} stays as it is, it shows whole campaigns only"
            raise ConfigError([Problem(str(path), "", text)])
    except ConfigError as error:
        for problem in error.problems:
            print(f"error: {problem}", file=sys.stderr)
        return EXIT_BAD_INPUT
    PAGE.write_text(page(document), encoding="utf-8")
    print(f"written: {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
