# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scenario over a grid of values: every point runs by itself, the results become one table.

The results of points are kept by content: equal sources, settings and seed are not run again, so that a sweep that was
stopped goes on. All results are bit for bit those of one run after the other, whoever runs them.
"""

from __future__ import annotations

import itertools
import json
import math
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fluxlock.api import plain, results_folder, run_checked, scenario_of, seed_of, whole
from fluxlock.base.paths import content_hash, shipped
from fluxlock.base.progress import counting_bars
from fluxlock.base.writable import write_whole
from fluxlock.config import ConfigError, Inverter, Motor, Problem, Scenario
from fluxlock.config.errors import SET_OPTION, ToolsMissing
from fluxlock.config.fields import Model
from fluxlock.python_load import NAME, LoadFunction, PythonLoad
from fluxlock.results.rundata import SimulationFault
from fluxlock.workers import EXTRA, Cluster, OtherVersion, WorkerLost, on_scheduler, side_by_side, sources, versions

if TYPE_CHECKING:
    import pandas

RIGHT, FAILED, BROKEN, REFUSED = "right", "failed", "broken", "refused"
POINTS_MAX = 100_000
Row = dict[str, Any]
Done = Callable[[Row], None]


@dataclass(frozen=True)
class Axis:
    """One key and its values. key: dotted, as `--set` takes it. factors: the values multiply that of the file."""

    key: str
    values: tuple[Any, ...]
    factors: bool = False

    @staticmethod
    def parse(text: str) -> Axis:
        """Read `key=low:high:count`, `key=0.8x:1.2x:count` (of the file's) or `key=a,b,c`; else ConfigError."""
        key, equals, stated = (part.strip() for part in text.partition("="))
        if not equals or not key or not stated:
            form = "must have the form KEY=LOW:HIGH:COUNT, KEY=0.8x:1.2x:COUNT or KEY=A,B,C"
            raise ConfigError([Problem(SET_OPTION, text, form)])
        parts = stated.split(":")
        if len(parts) > 1 and not stated.startswith(("[", "{", '"', "'")):
            return _range(key, parts)
        return Axis(key, tuple(_words(key, stated)))

    def of(self, scenario: Scenario) -> Axis:
        """With factors turned into values of a scenario; ConfigError if the key has no number there."""
        if not self.factors:
            return self
        base: Any = scenario
        for part in self.key.split("."):
            base = getattr(base, part, None)
        numbers = base if isinstance(base, tuple) else (base,)
        if not all(isinstance(n, (int, float)) and not isinstance(n, bool) for n in numbers):
            text = "has no number in the file that a factor could multiply: give the values themselves"
            raise ConfigError([Problem("", self.key, text)])
        scaled = [tuple(n * factor for n in numbers) for factor in self.values]
        return Axis(self.key, tuple(s[0] if len(set(numbers)) == 1 else s for s in scaled))  # as the file states it


def _range(key: str, parts: Sequence[str]) -> Axis:
    relative = [part.strip().endswith("x") for part in parts[:2]]
    try:
        low, high = (float(part.strip().removesuffix("x")) for part in parts[:-1])
        count = int(parts[-1])
    except ValueError:
        text = f"{':'.join(parts)} is no range of numbers LOW:HIGH:COUNT"
        raise ConfigError([Problem("", key, text)]) from None
    if relative[0] != relative[1]:
        raise ConfigError([Problem("", key, "both ends are factors, 0.8x:1.2x, or none is")])
    if not (np.isfinite(low) and np.isfinite(high) and 1 <= count <= POINTS_MAX):
        text = f"needs finite ends and a count from 1 to {POINTS_MAX}, not {':'.join(parts)}"
        raise ConfigError([Problem("", key, text)])
    values = tuple(float(v) for v in np.linspace(low, high, count))
    whole = not relative[0] and all(part.strip().lstrip("+-").isdecimal() for part in parts[:2])
    return Axis(key, tuple(map(int, values)) if whole and all(v == int(v) for v in values) else values, relative[0])


def _words(key: str, stated: str) -> list[Any]:
    """Values between commas, each as TOML or, failing that, a word."""
    try:
        found = tomllib.loads(f"value = [{stated}]")["value"]
    except tomllib.TOMLDecodeError:
        found = [_word(word.strip()) for word in stated.split(",")]
    if not found or "" in found:
        raise ConfigError([Problem("", key, f"{stated!r} holds an empty value")])
    return list(found)


def _word(text: str) -> object:
    try:
        value: object = tomllib.loads(f"value = {text}")["value"]
        return value
    except tomllib.TOMLDecodeError:
        return text


@dataclass(frozen=True)
class Point:
    """One run of a sweep: its number, its keys, and the scenario that they make."""

    index: int
    keys: tuple[tuple[str, Any], ...]
    scenario: Scenario

    def key(self, seed: int | None, twin: bool, made_by: str) -> str:
        """Under which the result is kept."""
        settings = json.dumps(self.scenario.model_dump(mode="json"), sort_keys=True)
        return content_hash([], made_by, versions(), settings, self.scenario.seed if seed is None else seed, twin)

    def row(self, found: Row) -> Row:
        """What was found, behind the columns of this sweep: another one finds the same under other keys."""
        return {"point": self.index, **_shown(self.keys), **found}


@dataclass(frozen=True)
class Grid:
    """Points that can run, and rows of those that the checks refuse. axes: with values in place of factors."""

    axes: tuple[Axis, ...]
    points: list[Point]
    refused: list[Row]

    @staticmethod
    def of(scenario: Scenario, axes: Sequence[Axis]) -> Grid:
        """The grid of a scenario; the last axis changes fastest.

        Raises ConfigError for a grid that is none, and with every reason where the checks refuse all points.
        """
        empty = [axis.key for axis in axes if not axis.values]
        if empty:
            raise ConfigError([Problem("", key, "has no value: give it one at least") for key in empty])
        made = tuple(replace(axis, key=axis.key.replace("__", ".")).of(scenario) for axis in axes)
        count = math.prod(len(axis.values) for axis in made)
        if not made or not 1 <= count <= POINTS_MAX:
            text = f"{count} points, permitted 1 to {POINTS_MAX}" if made else "no key to change: give one its values"
            raise ConfigError([Problem("", "", text)])
        twice = sorted(key for key, n in Counter(axis.key for axis in made).items() if n > 1)
        if twice:
            raise ConfigError([Problem("", key, "is there twice; give it one range") for key in twice])
        points, refused, problems = [], [], _lost_files(scenario, made)
        if problems:
            raise ConfigError(problems)
        for index, values in enumerate(itertools.product(*(axis.values for axis in made))):
            keys = tuple(zip((axis.key for axis in made), values, strict=True))
            try:
                points.append(Point(index, keys, _checked(scenario, dict(keys))))
            except ConfigError as error:
                reason = "; ".join(str(problem) for problem in error.problems)
                refused.append({"point": index, **_shown(keys), "status": REFUSED, "reason": reason})
                problems += error.problems
        if not points:
            raise ConfigError(list(dict.fromkeys(problems)))
        return Grid(made, points, refused)

    def run(
        self,
        *,
        twin: bool = False,
        seed: int | None = None,
        jobs: int = 1,
        scheduler: str | Cluster | None = None,
        folder: Path | str | None = None,
        progress: bool = False,
        done: Done | None = None,
        load_nm: LoadFunction | None = None,
    ) -> Sweep:
        """Run the points that `folder` holds no result of; see `sweep`."""
        load = PythonLoad(load_nm) if load_nm is not None else None
        if load is not None and folder is not None:
            text = f"results are kept by content, and what {load_nm!r} does is none: leave out folder, or the function"
            raise ConfigError([Problem(NAME, "", text)])
        whole("jobs", jobs, 1)
        if seed is not None and self.points:
            seed = seed_of(self.points[0].scenario, seed)
        store = results_folder(Path(folder) / "points") if folder is not None else None
        made_by, rows, left = sources(), [], []
        paths = {p.index: store and store / f"{p.key(seed, twin, made_by)}.json" for p in self.points}

        def keep(row: Row) -> None:
            rows.append(row)
            if bars is not None and task is not None:
                bars.advance(task)
            if done is not None:
                done(row)

        def store_found(point: Point, found: Row) -> None:
            path = paths[point.index]
            if path is not None and found["status"] != BROKEN:
                write_whole(path, json.dumps(found))
            keep(point.row(found))

        with counting_bars() if progress else nullcontext() as bars:
            task = bars.add_task("points", total=len(self.points) + len(self.refused)) if bars is not None else None
            for row in self.refused:
                keep(row)
            for point in self.points:
                path = paths[point.index]
                if path is not None and path.exists():
                    keep(point.row(json.loads(path.read_text(encoding="utf-8"))))
                else:
                    left.append(point)
            if left:
                try:
                    with on_scheduler(scheduler):
                        side_by_side(partial(run_point, seed, twin, made_by, load), left, jobs, store_found)
                except (OtherVersion, WorkerLost) as error:
                    raise ConfigError([Problem("--jobs", str(jobs), str(error))]) from None
        return Sweep(self.axes, sorted(rows, key=lambda row: int(row["point"])))


def _lost_files(scenario: Scenario, axes: Iterable[Axis]) -> list[Problem]:
    """Files of motors and inverters that do not exist: no machine that the checks could refuse."""
    found = []
    for axis in axes:
        for value in axis.values:
            if axis.key in ("motor", "inverter") and isinstance(value, str) and not shipped(Path(value)).exists():
                try:
                    scenario_of(scenario, {axis.key: value})
                except ConfigError as error:
                    found += [problem for problem in error.problems if problem.key == axis.key]
    return found


def _checked(scenario: Scenario, keys: Mapping[str, Any]) -> Scenario:
    from fluxlock.cosim.parameters import check_parameters

    made = scenario_of(scenario, keys)
    check_parameters(made)
    return made


def _shown(keys: Sequence[tuple[str, Any]]) -> Row:
    """Columns of a point's keys: numbers and words as they are, motors and inverters by name, arrays as text."""
    named = ((k, v.name if isinstance(v, (Motor, Inverter)) else v) for k, v in keys)
    return {k: v if isinstance(v, (int, float, str, bool)) else json.dumps(v) for k, v in named}


def run_point(seed: int | None, twin: bool, made_by: str, load: PythonLoad | None, point: Point) -> Row:
    """Run one point and return its row but for the keys. Raises OtherVersion where the sources are others.

    ToolsMissing: this machine cannot build the chip.
    """
    if sources() != made_by:
        raise OtherVersion("a worker has another version of Fluxlock: install the same one there, or use its checkout")
    try:
        run = run_checked(point.scenario, twin, seed, load_nm=load.function if load is not None else None)
    except ToolsMissing:  # of this machine, not of the point
        raise
    except ConfigError as error:  # of the twin, which cannot do all that the chip can
        return {"status": REFUSED, "reason": "; ".join(str(problem) for problem in error.problems)}
    except SimulationFault as error:
        return {"status": BROKEN, "reason": str(error)}
    status = RIGHT if run.verdict.passed else FAILED
    return {"status": status, "reason": "; ".join(run.verdict.failures), **flat(run.metrics)}


def flat(metrics: Mapping[str, Any]) -> dict[str, float]:
    """Metrics as columns: window.metric.statistic -> number."""
    found: dict[str, float] = {}
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            found |= {f"{name}.{below}": number for below, number in flat(value).items()}
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            found[name] = float(value)
    return found


@dataclass(frozen=True)
class Sweep:
    """A finished sweep. axes: keys and values; rows: one a point, in the order of the grid.

    >>> Sweep((), [{"point": 0, "status": "right"}]).count("right")
    1
    """

    axes: tuple[Axis, ...]
    rows: list[Row]

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {status}" for status, count in Counter(row["status"] for row in self.rows).items())
        return f"<Sweep of {', '.join(axis.key for axis in self.axes)}: {counts}>"

    def count(self, status: str) -> int:
        """Points of a status: right, failed (verdict), broken (no result), refused (by the checks)."""
        return sum(row["status"] == status for row in self.rows)

    @property
    def passed(self) -> bool:
        """Whether points ran and each that did is right."""
        return self.count(RIGHT) > 0 and self.count(FAILED) == self.count(BROKEN) == 0

    def to_dataframe(self) -> pandas.DataFrame:
        """One row a point: point, the keys, status, reason, then window.metric.statistic, whose unit ends the metric.

        Raises ConfigError without pandas.
        """
        try:
            import pandas
        except ImportError:
            raise ConfigError([Problem("sweep", "", f"the table needs pandas: {EXTRA}")]) from None
        return pandas.DataFrame(self.rows).set_index("point")


def axes_of(axes: Mapping[str, Sequence[Any] | str] | Sequence[Axis]) -> list[Axis]:
    """Axes with plain values, of key -> values or of key -> a range in words; ConfigError for what is none."""
    if not isinstance(axes, Mapping):
        if not isinstance(axes, Iterable) or not all(isinstance(axis, Axis) for axis in axes):
            raise ConfigError([Problem("", "", f"must be a dict, key: values, not {axes!r}")])
        return [replace(axis, values=tuple(map(plain, axis.values))) for axis in axes]
    made = []
    for key, values in axes.items():
        if isinstance(values, str):
            made.append(Axis.parse(f"{key}={values}"))
        elif isinstance(values, Iterable) and not isinstance(values, (Mapping, Model)):
            made.append(Axis(key, tuple(map(plain, values))))
        else:
            raise ConfigError([Problem("", key, f"must be a list of values, not {values!r}")])
    return made


def sweep(
    scenario: Scenario | Path | str,
    axes: Mapping[str, Sequence[Any] | str] | Sequence[Axis],
    *,
    twin: bool = False,
    seed: int | None = None,
    jobs: int = 1,
    scheduler: str | Cluster | None = None,
    folder: Path | str | None = None,
    progress: bool = False,
    done: Done | None = None,
    load_nm: LoadFunction | None = None,
) -> Sweep:
    """Run a scenario at every point of a grid.

    axes: key -> values, `{"motor.resistance_ohm": [0.1, 0.2]}`, or a range as `--set` takes it, `"0.8x:1.2x:9"`; in the
    key's unit. twin, seed: see `simulate`. jobs: processes of this machine. scheduler: address of a Dask scheduler in
    place of them, `tcp://host:8786`, or a cluster of Dask, `LocalCluster()`; its workers need the same version of
    Fluxlock. folder: keeps the results of points, so that an equal sweep does not run them again. progress: draw a bar
    on the error output. done: called with each row as it comes. load_nm: see `simulate`; the function goes to the
    workers with what it uses of its module. It has no content that a result could be kept by, so a folder is refused.

    Raises ConfigError (bad key, range or scheduler, a worker of another version, a process that was lost). A point that
    cannot run does not end the others: its row says why.

    >>> made = sweep("scenarios/own-spindle.toml", {"drive.commutation": ["RSC", "NSC", "CSC"]}, jobs=2)
    >>> made.to_dataframe()["steady.commutation_error_deg.rms"]
    """
    made = Grid.of(scenario_of(scenario), axes_of(axes))
    return made.run(
        twin=twin,
        seed=seed,
        jobs=jobs,
        scheduler=scheduler,
        folder=folder,
        progress=progress,
        done=done,
        load_nm=load_nm,
    )
