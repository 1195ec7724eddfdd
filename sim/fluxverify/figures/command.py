# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxverify figures`: choose, draw side by side, write PNG and `figures.json`."""

from __future__ import annotations

import json
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from fluxlock.base.paths import ROOT
from fluxlock.base.progress import counting_bars
from fluxlock.base.writable import refusal
from fluxlock.config import ConfigError, Problem, load_scenario
from fluxlock.config.errors import did_you_mean
from fluxlock.cosim.outcome import Run
from fluxlock.cosim.program import Row as RegisterRow
from fluxlock.plant import PlantParams
from fluxlock.results.rundata import RunData
from fluxlock.theory.six_step.output import prepare_folder
from fluxlock.workers import side_by_side
from fluxverify.figures.figure import FAMILIES, FIGURES, PRINTED, Drawing, FigureEntry, RowFault, Speed
from fluxverify.figures.panels import save_small
from fluxverify.regression.origin import kept, origin
from fluxverify.regression.runner import RunFailed, Runner, prepare_runs

SCHEMA_VERSION = 2  # 2: a row says who sets the speed, and whether it agrees
DOCUMENT = "figures.json"
COMMAND = "figures"


def of_family(family: str) -> list[FigureEntry]:
    """All figures of a family in the order of print."""
    import fluxverify.figures.sets  # noqa: F401  (registers the figures, also in a worker process)

    if family not in FAMILIES:
        known = f"{family!r} is no family{did_you_mean(family, FAMILIES)}; families: {', '.join(FAMILIES)}"
        raise ConfigError([Problem(COMMAND, "", known)])
    return sorted((f for f in FIGURES.values() if f.family == family), key=lambda f: f.order)


def select(family: str, wanted: Sequence[str]) -> list[FigureEntry]:
    """Figures by number, or all of a chapter by its number; all without one."""
    found = of_family(family)
    unknown = [w for w in wanted if not any(_matches(f, w) for f in found)]
    if unknown:
        known = ", ".join(f.number for f in found)
        text = f"no such figure of {family}; a chapter or one of: {known}"
        raise ConfigError([Problem(COMMAND, w, text) for w in unknown])
    return [f for f in found if not wanted or any(_matches(f, w) for w in wanted)]


def _matches(entry: FigureEntry, wanted: str) -> bool:
    return entry.number == wanted or entry.number.startswith(f"{wanted}.")


def list_figures(family: str, wanted: Sequence[str]) -> None:
    """Print numbers and titles."""
    for entry in select(family, wanted):
        print(f"{entry.number}: {entry.title}")


@dataclass(frozen=True)
class WatchedRunner(Runner):
    """A runner that notes who set the speed in its runs."""

    speeds: set[Speed] = field(default_factory=set, compare=False)

    def drive(
        self,
        scenario: str | Path,
        name: str,
        *overrides: str,
        seed: int | None = None,
        accept: Mapping[str, str] | None = None,
        expects: bool = False,
    ) -> Run:
        """As Runner."""
        run = super().drive(scenario, name, *overrides, seed=seed, accept=accept, expects=expects)
        self.speeds.add(_speed(run.scenario.mechanics.mode))
        return run

    def program(self, program: str, table: bytes, scenario: str | Path, name: str, *overrides: str) -> RunData:
        """As Runner."""
        self.speeds.add(_speed(load_scenario(ROOT / "scenarios" / scenario, overrides).mechanics.mode))
        return super().program(program, table, scenario, name, *overrides)

    def script(self, rows: Sequence[RegisterRow], plant: PlantParams, duration_s: float, name: str) -> RunData:
        """As Runner."""
        self.speeds.add(_speed(plant.mechanics.mode))
        return super().script(rows, plant, duration_s, name)


def _speed(mode: str) -> Speed:
    return "drive" if mode == "free" else "imposed"


def check_speeds(drawing: Drawing, runs: set[Speed]) -> None:
    """RowFault if the rows do not say of the figure's runs who set the speed in them."""
    stated: set[Speed] = {row.speed for row in drawing.table if row.speed != "no run"}
    if stated != runs:
        said, found = (", ".join(sorted(part)) or "no run" for part in (stated, runs))
        raise RowFault(f"speed: the rows say {said}; in the figure's runs it was {found}")


def draw(family: str, out: Path, number: str, quick: bool, seed: int) -> dict[str, Any]:
    """Draw one figure, write its PNG, and return its part of the document; a failure is a text in it."""
    (entry,) = (f for f in of_family(family) if f.number == number)
    image = f"{entry.stem}.png"
    failure = {"figure": number, "title": entry.title, "condition": "", "image": "", "table": []}
    runner = WatchedRunner(f"figures/{family}/{number}", quick, seed, plots=False)
    try:
        drawing = entry.body(runner)
        check_speeds(drawing, runner.speeds)
    except (RunFailed, RowFault) as error:
        return {**failure, "failure": str(error)}
    except Exception as error:
        return {**failure, "failure": refusal(error) or traceback.format_exc()}
    save_small(drawing.page, out / image)
    return entry.as_json(drawing, image) | {"failure": "; ".join(f"not vouched for: {x}" for x in runner.unvouched)}


def draw_all(
    entries: Sequence[FigureEntry], family: str, out: Path, quick: bool, seed: int, jobs: int
) -> dict[str, dict[str, Any]]:
    """Draw figures in `jobs` processes with a progress bar; results by number."""
    found: dict[str, dict[str, Any]] = {}
    with counting_bars() as progress:
        task = progress.add_task(COMMAND, total=len(entries))

        def done(number: str, part: dict[str, Any]) -> None:
            found[number] = part
            progress.update(task, advance=1, description=f"drawn {number}")

        prepare_runs(quick)
        work = partial(draw, family, out.absolute(), quick=quick, seed=seed)
        side_by_side(work, [f.number for f in entries], jobs, done, shares_build=True)
    return found


def run_figures(family: str, wanted: Sequence[str], out: Path, quick: bool, seed: int, jobs: int) -> bool:
    """Draw, print a table, write the document; False if a figure failed. Figures drawn before stay in the document."""
    entries = select(family, wanted)
    folder = out / family
    prepare_folder(folder, DOCUMENT, *(f"{entry.stem}.png" for entry in entries))
    made = origin(seed)  # before the runs: the checkout may change while they last
    found = draw_all(entries, family, folder, quick, seed, jobs)
    console = Console()
    table = Table(title=f"figures {family}" + (", quick" if quick else ""), title_justify="left")
    for header in ("figure", "quantity", PRINTED[family], "here"):
        table.add_column(header)
    for entry in entries:
        part = found[entry.number]
        for k, line in enumerate(part["table"]):
            table.add_row(entry.number if k == 0 else "", line["quantity"], line["printed"], line["here"])
        if part["failure"]:
            table.add_row(entry.number, f"[bold red]{escape(part['failure'].strip().splitlines()[-1])}[/]", "", "")
    console.print(table)
    document = _document(family, {n: {**part, **made} for n, part in found.items()}, folder / DOCUMENT, quick)
    document |= made
    (folder / DOCUMENT).write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    console.print(f"written: {folder}/{DOCUMENT} and PNG", highlight=False, soft_wrap=True)
    failed = [number for number, part in found.items() if part["failure"]]
    for number in failed:
        console.print(f"failed: {number}: {found[number]['failure'].strip()}", highlight=False, soft_wrap=True)
    return not failed


def _document(family: str, found: dict[str, dict[str, Any]], path: Path, quick: bool) -> dict[str, Any]:
    """The document with what stands in the file already and was not drawn anew (same length of run)."""
    parts: dict[str, dict[str, Any]] = {}
    numbers = [f.number for f in of_family(family)]
    if path.exists():
        before = json.loads(path.read_text(encoding="utf-8"))
        if before.get("schema") == SCHEMA_VERSION and before.get("quick") == quick:
            others = [part for part in before["figures"] if part["figure"] not in found]
            parts = {part["figure"]: part for part in kept(others, "figure", numbers.__contains__, "figure", path)}
    parts.update(found)
    return {
        "schema": SCHEMA_VERSION,
        "family": family,
        "quick": quick,
        "figures": [parts[number] for number in numbers if number in parts],
    }
