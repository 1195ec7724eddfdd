# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxverify campaign`: progress, score, table, `build/campaign.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from typing import Any

from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from fluxlock.base.progress import counting_bars
from fluxlock.base.writable import check_file
from fluxlock.config import ConfigError, Problem
from fluxlock.cosim.run import image_of
from fluxlock.sources import source_hashes
from fluxverify.campaign.grid import DRIVES, Drive
from fluxverify.campaign.judge import WRONG
from fluxverify.campaign.page import RESULT, WAYS, kinds, score
from fluxverify.campaign.run import FOLDER, ROW_FILE, chip_for, grid, mean_cpu_s, population, run_drive


def _nothing_to_show() -> ConfigError:
    text = "no run has finished with this seed on this chip and firmware; run it without --show"
    return ConfigError([Problem("--show", "", text)])


def _show(progress: Progress, task: TaskID, ended: int, count: int) -> None:
    progress.update(task, completed=ended, total=count)


def _rows(drives: Sequence[Drive], quick: bool, every: int, seed: int, jobs: int) -> list[dict[str, Any]]:
    """Verdicts of the drives' grids, with bars while they run; jobs 0: nothing runs, so there are none."""
    if not jobs:
        return [row for drive in drives for row in run_drive(drive, seed, quick, 0, every)]
    rows: list[dict[str, Any]] = []
    with counting_bars() as progress:
        for drive in drives:
            task = progress.add_task(drive.name, total=None)

            rows += run_drive(drive, seed, quick, jobs, every, partial(_show, progress, task))
    return rows


def _machine(drive: Drive) -> dict[str, Any]:
    """What a drive consists of."""
    scenario, chip = drive.load(), chip_for(drive)
    registers = population(chip)
    return {
        "drive": drive.name,
        "motor": scenario.motor.name,
        "chip": chip.key,
        "firmware": image_of(scenario).stem,
        "registers": len(registers),
        "register_bits": sum(registers.values()),
    }


def run(names: Sequence[str], quick: bool, every: int, seed: int, jobs: int) -> bool:
    """Run the grid of the named drives, print a table, write the document; False if a run ended wrong.

    jobs 0: run nothing, take what has finished.
    """
    known = [drive.name for drive in DRIVES]
    missing = [name for name in names if name not in known]
    if missing:
        raise ConfigError([Problem("campaign", name, f"no drive; drives: {', '.join(known)}") for name in missing])
    drives = [drive for drive in DRIVES if not names or drive.name in names]
    # Before a chip is built only to find what has been run on it.
    if not jobs and not any(any((FOLDER / drive.name).rglob(ROW_FILE)) for drive in drives):
        raise _nothing_to_show()
    check_file(RESULT)
    sources = source_hashes()  # before the runs: the checkout may change while they last
    runs = [one for drive in drives for one in grid(drive, seed, quick, every)]
    rows = _rows(drives, quick, every, seed, jobs)
    if not jobs and not rows:
        raise _nothing_to_show()
    document = {
        "seed": seed,
        "sources": sources,
        "quick": quick,
        "every": every,
        "drives": [drive.name for drive in drives],
        "grid": len(runs),
        "cpu_s": round(mean_cpu_s(runs), 1),
        "machines": [_machine(drive) for drive in drives],
        "rows": rows,
    }
    RESULT.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    console = Console()
    table = Table(title=f"campaign, seed {seed}" + (", quick" if quick else ""), title_justify="left")
    for header in ("disturbance", "runs", *WAYS):
        table.add_column(header)
    for kind, counts in kinds(rows):
        table.add_row(kind, *map(str, counts))
    console.print(table)
    for row in (r for r in rows if r["outcome"] == WRONG):
        text = f"wrong: {row['drive']}, {row['moment']}, {row['disturbance']}: {'; '.join(row['reasons'])}"
        console.print(text + "".join(f" ({upset})" for upset in row["upsets"]), highlight=False, markup=False)
    right, share = score(rows)
    time = f"{document['cpu_s']} s of the processor per run"
    console.print(f"{right} of {len(rows)} runs ended right: {share:.2f} %; {time}; written: {RESULT}", highlight=False)
    return right == len(rows)
