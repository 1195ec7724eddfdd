# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command `fluxlock sweep`: one table and one picture of a scenario over a grid of values."""

from __future__ import annotations

import os
import re
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from fluxlock.base.paths import RESULTS
from fluxlock.command_line import SchedulerOption
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.config.errors import did_you_mean
from fluxlock.help import complete_toml
from fluxlock.results.verdict import Verdict, say
from fluxlock.theory.six_step.output import prepare_folder
from fluxlock.workers import EXTRA

if TYPE_CHECKING:
    import pandas

    from fluxlock.sweeps import Row, Sweep

EXIT_FAILED = 1
METRICS = ("speed_rpm.mean", "commutation_error_deg.rms", "angle_error_deg.rms", "torque_nm.mean")
FILES = ("sweep.parquet", "overview.png")
NUMBER = re.compile(r"-?\d[\d.e+-]*")


def sweep(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML).", autocompletion=complete_toml("scenarios"))],
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=RANGE",
            help="LOW:HIGH:COUNT, 0.8x:1.2x:COUNT (of the file's value) or A,B,C. Repeatable: a grid.",
        ),
    ] = None,
    metric: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WINDOW.METRIC.STATISTIC", help="What the picture shows; default: speed and angle errors."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder, default build/<name of the file>-sweep.")] = None,
    twin: Annotated[
        bool, typer.Option("--twin", help="On the averaged twin, not on the chip: many times faster.")
    ] = False,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the noise, default the scenario's.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Runs side by side on this machine.")] = os.cpu_count() or 1,
    scheduler: SchedulerOption = None,
) -> None:
    """Run a scenario over a grid of values: sweep.parquet, overview.png.

    Results of points are kept in the folder: a sweep that was stopped goes on. Points that the checks refuse are named,
    the others run. Exit code 1 if a point is not right.
    """
    from fluxlock import sweeps
    from fluxlock.api import scenario_of
    from fluxlock.generate.registers import check_build

    if find_spec("pandas") is None or find_spec("pyarrow") is None:
        raise ConfigError([Problem("sweep", "", f"the table needs pandas and pyarrow: {EXTRA}")])
    folder = out if out is not None else RESULTS / f"{scenario.stem}-sweep"
    base = scenario_of(scenario)
    grid = sweeps.Grid.of(base, [sweeps.Axis.parse(text) for text in set_ or ()])
    for name in metric or ():
        window, known = name.partition(".")[0], [w.name for w in base.window]
        if window not in known:
            text = f'"{window}" is no window of the scenario, it has: {", ".join(known) or "none"}'
            raise ConfigError([Problem("--metric", name, text)])
    prepare_folder(folder, *FILES)
    if not twin and scheduler is None:
        check_build()
    made = grid.run(twin=twin, seed=seed, jobs=jobs, scheduler=scheduler, folder=folder, progress=True)
    table = made.to_dataframe()
    table.to_parquet(folder / FILES[0])
    names = metrics_of(table, metric or [])
    say(verdict(made))
    Console().print(printed(made, table, names))
    draw(made, table, names, folder / FILES[1], title_of(base, made, twin, seed))
    print(f"written: {folder}/{', '.join(FILES)}")
    if not made.passed:
        raise typer.Exit(EXIT_FAILED)


def verdict(made: Sweep) -> Verdict:
    """`ok` where every point that ran is right; each kind of failure and each reason of a refusal with its first point.

    Reasons that differ by their numbers alone are one.
    """
    ran = len(made.rows) - made.count("refused")
    kinds: dict[tuple[str, str], list[Row]] = {}
    for row in made.rows:
        if row["status"] != "right":
            reason = NUMBER.sub("", row["reason"]) if row["status"] == "refused" else ""
            kinds.setdefault((row["status"], reason), []).append(row)
    lines = [f"{made.count('right')} of {ran} points right" + ("" if ran else ": the checks refuse every point")]
    for (status, _), rows in kinds.items():
        at = ", ".join(f"{axis.key} {_number(rows[0][axis.key])}" for axis in made.axes)
        lines.append(f"{status} ({len(rows)}), first at {at}: {rows[0]['reason']}")
    return Verdict(made.passed, lines)


def metrics_of(table: pandas.DataFrame, asked: list[str]) -> list[str]:
    """Columns for table and picture: those asked for, else speed and angle errors of the last window that has them."""
    unknown = [name for name in asked if name not in table.columns]
    if unknown:
        there = [name for name in table.columns if name.count(".") >= 2]
        names = ", ".join(there) or "none"
        raise ConfigError(
            [Problem("--metric", n, f"no such column{did_you_mean(n, there)}; there are: {names}") for n in unknown]
        )
    found = [[column for column in table.columns if column.endswith(f".{name}")] for name in METRICS]
    return asked or [columns[-1] for columns in found if columns]


def _number(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def printed(made: Sweep, table: pandas.DataFrame, names: list[str]) -> Table:
    """One line a point: keys, status, metrics."""
    shown = Table()
    columns = [*(axis.key for axis in made.axes), "status", *names]
    for column in columns:
        shown.add_column(column.replace(".", "\n"), overflow="fold")
    for _, row in table.iterrows():
        shown.add_row(*("" if row[column] != row[column] else _number(row[column]) for column in columns))
    return shown


def title_of(base: Scenario, made: Sweep, twin: bool, seed: int | None) -> str:
    """What the picture is of."""
    used = base.seed if seed is None and "seed" not in (axis.key for axis in made.axes) else seed
    return f"{base.name}, {'twin' if twin else 'chip'}" + ("" if used is None else f", seed {used}")


def draw(made: Sweep, table: pandas.DataFrame, names: list[str], path: Path, title: str) -> None:
    """A panel per metric over the first key, a line per value of the others; what is not right is marked."""
    from matplotlib.figure import Figure

    from fluxlock.theory.six_step.plots import save

    first, *others = (axis.key for axis in made.axes)
    figure = Figure(figsize=(8.0, 1.0 + 2.4 * max(1, len(names))), layout="constrained")
    panels = figure.subplots(max(1, len(names)), 1, sharex=True, squeeze=False)[:, 0]
    groups = list(table.groupby(others, sort=False)) if others else [((), table)]
    for name, panel in zip(names, panels, strict=False):
        for values, rows in groups:
            text = ", ".join(f"{k.rpartition('.')[2]} {_number(v)}" for k, v in zip(others, values, strict=True))
            (line,) = panel.plot(rows[first], rows[name], marker=".", label=text)
            wrong = rows[rows["status"] == "failed"]
            panel.plot(wrong[first], wrong[name], "x", color=line.get_color(), markersize=9)
        panel.set_ylabel(name.replace(".", "\n"))
        panel.ticklabel_format(axis="y", useOffset=False)
        panel.grid(alpha=0.3)
    if others and names:
        panels[0].legend(fontsize="small")
    panels[-1].set_xlabel(first + ("; crosses: the run failed its verdict" if made.count("failed") else ""))
    figure.suptitle(title)
    save(figure, path)
