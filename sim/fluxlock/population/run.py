# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Lives one after the other or side by side: refused, or run and judged, and kept by the content of all that made them.

A life that has run is not run again, so a population that was interrupted goes on where it was.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from fluxlock import native, results
from fluxlock.base.paths import BUILD, content_hash
from fluxlock.base.writable import check_folder, write_whole
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware.toolchain import host_sources
from fluxlock.population.draw import Draw, Population
from fluxlock.population.injection_draw import InjectionDraw
from fluxlock.population.injection_judge import judge_injection, row_of
from fluxlock.population.injection_life import InjectionLife, injection_life, injection_refusals, play_injection
from fluxlock.population.judge import judge, play
from fluxlock.population.life import Life, life_of, refusals
from fluxlock.population.rest import RestLife, judge_rest, rest_life
from fluxlock.workers import side_by_side, versions

FOLDER = BUILD / "population"
RIGHT, NAMED, REFUSED, WRONG = "right", "named", "refused", "wrong"
OUTCOMES = (RIGHT, NAMED, REFUSED, WRONG)
# Modules that measure, beside the native drive that runs.
MEASURING = ("judge", "ideal", "rest", "injection_judge", "injection_life"), ("metrics", "angles")

Row = dict[str, Any]
Done = Callable[[], None]


class SourcesChanged(Exception):
    """Firmware, models or measures are others than at the first life: a row would be of a mixture."""


def outcomes(method: Population) -> tuple[str, ...]:
    """Those that a life can have: only a start by injection may end in a fault that names it."""
    return OUTCOMES if method == "injection" else (RIGHT, REFUSED, WRONG)


def makers() -> str:
    """Hash of firmware, of the models that run it, of what measures, and of the packages; taken before the first life.

    Equal in every checkout of equal content.
    """
    own, shared = MEASURING
    sources = [*Path(native.__file__).parent.glob("*.py")]
    sources += [Path(__file__).with_name(f"{name}.py") for name in own]
    sources += [Path(results.__file__).with_name(f"{name}.py") for name in shared]
    return content_hash(sources, host_sources(), versions())


def _key(life: Life | InjectionLife, made_by: str) -> str:
    """Of what runs and measures, the firmware's parameters, machine and life."""
    settings = json.dumps(life.scenario.model_dump(mode="json", exclude={"expect"}), sort_keys=True)
    more = (life.holds, life.changes) if isinstance(life, Life) else (life.machine, life.draw)
    return content_hash([], made_by, parameter_block(life.scenario).pack(), settings, *more)


def _head(life: Life | InjectionLife, method: Population) -> Row:
    d = life.draw
    shared = ("resistance_pu", "inductance_pu", "base_hz", "run_up_s", "saliency", "supply_v", "power_w", "pole_pairs")
    machine = {name: getattr(d, name) for name in shared}
    machine |= {"emf": d.emf} if isinstance(d, Draw) else {"phases": d.phases}
    return {"index": d.index, "method": method, "machine": machine}


def _judged(life: Life | InjectionLife) -> Row:
    """Outcome of a life that runs, and what was found."""
    if isinstance(life, RestLife):
        rest = judge_rest(play(life), life)
        return {"outcome": WRONG if rest.reasons else RIGHT, **asdict(rest)}
    if isinstance(life, Life):
        found = judge(play(life), life).as_json()
        return {"outcome": WRONG if found["reasons"] else RIGHT, **found}
    run = play_injection(life)
    verdict = judge_injection(run, life)
    return {"outcome": WRONG if verdict.reasons else NAMED if verdict.named else RIGHT, **row_of(verdict, run)}


def any_life(method: Population, seed: int, index: int, rest: bool = False) -> tuple[Life | InjectionLife, list[str]]:
    """The life of a machine, and why it is refused. rest: that from rest, which injection's lives are anyway."""
    if method == "injection":
        injected = injection_life(InjectionDraw.of(seed, index))
        return injected, injection_refusals(injected)
    life = life_of(Draw.of(seed, index), method)
    reasons = refusals(life)  # before the life from rest, whose times follow from the parameters
    return (rest_life(life) if rest and not reasons else life), reasons


def run_life(method: Population, seed: int, made_by: str, index: int, rest: bool = False) -> Row:
    """A row of the population's document. made_by: see `makers`."""
    life, reasons = any_life(method, seed, index, rest)
    head = _head(life, method)
    if reasons:
        texts = [{"kind": text.partition(":")[0], "text": text} for text in reasons]
        return {**head, "outcome": REFUSED, "reasons": texts}
    path = FOLDER / method / f"{_key(life, made_by)}.json"
    if path.exists():
        row: Row = json.loads(path.read_text(encoding="utf-8"))
        return row
    if makers() != made_by:
        raise SourcesChanged("the sources have changed since the first life; run the population again")
    begin = time.process_time()
    found = _judged(life)
    spent = {"simulated_s": life.scenario.duration_s, "cpu_s": time.process_time() - begin}
    row = {**head, **found, **spent}
    check_folder(path.parent)
    write_whole(path, json.dumps(row))
    return row


def run_lives(
    method: Population, seed: int, indices: Iterable[int], jobs: int, done: Done, rest: bool = False
) -> list[Row]:
    """Rows of the lives by index; done: called for each as it comes."""
    check_folder(FOLDER / method)
    rows: list[Row] = []

    def store(_: int, row: Row) -> None:
        rows.append(row)
        done()

    side_by_side(partial(run_life, method, seed, makers(), rest=rest), list(indices), jobs, store)
    return sorted(rows, key=lambda row: int(row["index"]))
