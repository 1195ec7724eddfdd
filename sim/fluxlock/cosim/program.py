# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Run a program of `sw/images/bench`, or a list of register accesses, on the whole chip in place of the firmware."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.cosim.chip import Chip, build_chip
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.parameters import parameter_block
from fluxlock.cosim.plan import SessionPlan
from fluxlock.cosim.run import BIT_CYCLES, IMAGE_FILE, chip_of, collect, prepare
from fluxlock.firmware import build_program, write_image
from fluxlock.firmware.host import register_offsets
from fluxlock.generate.registers import IO_BASE
from fluxlock.plant import PlantParams
from fluxlock.results.rundata import RunData, SimulationFault


def run_program(name: str, table: bytes, scenario: Scenario, out_dir: Path, seed: int) -> RunData:
    """Run `sw/images/bench/<name>.c` with its table for the scenario's duration.

    Plant and parameter block are the scenario's. Raises SimulationFault if the run broke off.
    """
    # There is no console to ask.
    plan = replace(prepare(scenario, out_dir / "simulator", seed), final_commands=())
    write_image(plan.folder / IMAGE_FILE, build_program(name), parameter_block(scenario), table)
    return _run(plan, partial(chip_of, scenario), scenario.motor.pole_pairs)


@dataclass(frozen=True)
class Row:
    """What `run_script` does next.

    name: `block.register`, with an index in an array, to write; "": commit the shadowed registers, wait for `value`
    control ticks. read: the register is read, see `reads`.
    """

    name: str
    index: int = 0
    value: int = 0
    read: bool = False


def wait(ticks: int) -> Row:
    """Commit the shadowed registers, wait for control ticks."""
    return Row("", value=ticks)


def read(name: str, index: int = 0) -> Row:
    """Read a register."""
    return Row(name, index, read=True)


def reads(data: RunData) -> list[int]:
    """The values that a script has read, in order; signed 32 bits. Each takes 90 us of the console."""
    return [(int(line, 16) ^ 1 << 31) - (1 << 31) for line in data.uart]


def script_plan(rows: Sequence[Row], plant: PlantParams, duration_s: float, out_dir: Path, seed: int) -> SessionPlan:
    """Plan of a run that carries out rows in order."""
    offsets = register_offsets()
    words = [len(rows)]
    for row in rows:
        words += [IO_BASE + offsets[row.name] + 4 * row.index + row.read if row.name else 0, row.value & 2**32 - 1]
    folder = out_dir / "simulator"
    folder.mkdir(parents=True, exist_ok=True)
    write_image(folder / IMAGE_FILE, build_program("script"), None, struct.pack(f"<{len(words)}I", *words))
    return SessionPlan(
        plant=plant,
        seed=seed,
        clock_hz=CLOCK_HZ,
        duration_cycles=round(duration_s * CLOCK_HZ),
        conversion_cycles=max(1, round(plant.sensing.conversion_s * CLOCK_HZ)),
        bit_cycles=BIT_CYCLES,
        # There is no console to ask.
        final_commands=(),
        folder=folder.resolve(),
    )


def run_script(rows: Sequence[Row], plant: PlantParams, duration_s: float, out_dir: Path, seed: int) -> RunData:
    """Run the plan of a script, for a time, on a plant.

    The chip has the machine's number of phases, vector and injection path. Raises SimulationFault if the run broke off.
    """
    plan = script_plan(rows, plant, duration_s, out_dir, seed)
    return _run(
        plan,
        partial(build_chip, phases=plant.machine.phases, injection=True, method="vector"),
        plant.machine.pole_pairs,
    )


def _run(plan: SessionPlan, chip: Callable[[], Chip], pole_pairs: int) -> RunData:
    try:
        meta = run_plan(plan, chip())
    except (SimulatorError, RuntimeError) as error:
        raise SimulationFault(str(error)) from error
    data = collect(plan, meta, pole_pairs)
    if meta["fault"]:
        raise SimulationFault(meta["fault"], data)
    return data
