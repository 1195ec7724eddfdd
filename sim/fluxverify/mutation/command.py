# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxverify mutate`."""

from __future__ import annotations

from functools import partial

from rich.console import Console
from rich.progress import Progress, TaskID

from fluxlock.base.progress import counting_bars
from fluxlock.config import ConfigError, Problem
from fluxlock.synth.tools import SynthesisError
from fluxverify.mutation.blocks import BLOCKS
from fluxverify.mutation.run import MutationError
from fluxverify.mutation.score import measure, write_result


def _show(bar: Progress, task: TaskID, done: int) -> None:
    bar.update(task, completed=done)


def mutate(names: list[str], count: int, seed: int, jobs: int) -> bool:
    """Measure blocks, write build/mutate/BLOCK.json, print a line a block and the survivors; True if goals are met.

    False too if a block without a defect fails its own tests.
    """
    for name in names:
        if name not in BLOCKS:
            raise ConfigError([Problem("BLOCK", "", f"must be one of {', '.join(BLOCKS)}, not {name!r}")])
    console, met = Console(), True
    with counting_bars() as bar:
        for name in names or BLOCKS:
            task = bar.add_task(name, total=count)
            try:
                result = measure(BLOCKS[name], count, seed, jobs, partial(_show, bar, task))
            except (MutationError, SynthesisError) as error:
                bar.console.print(f"error: {error}", highlight=False, markup=False, soft_wrap=True)
                return False
            bar.update(task, completed=count)
            path = write_result(result)
            met &= result["score_percent"] >= result["goal_percent"]
            for row in result["mutants"]:
                if row["result"] == "survived":
                    place = f"{row['source']}: {row['port']}" + (f", {row['wire']}" if row["wire"] else "")
                    console.print(f"{name}: survived: {place} {row['kind']}", highlight=False, soft_wrap=True)
            console.print(
                f"{name}: {result['killed']} of {result['count']} killed, {result['equal']} equal to the block, "
                f"{result['survived']} survived: score {result['score_percent']:.1f} %, goal "
                f"{result['goal_percent']:.0f} %; written: {path}",
                highlight=False,
                soft_wrap=True,
            )
    return met
