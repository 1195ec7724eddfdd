"""Run a program of `sw/bench`, or a list of register writes, on the whole chip in place of the firmware."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fluxlock.analysis.rundata import RunData, SimulationFault
from fluxlock.build import IO_BASE, generate_registers
from fluxlock.config import Scenario
from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.parameters import parameter_block
from fluxlock.cosim.plan import SessionPlan
from fluxlock.cosim.run import BIT_CYCLES, IMAGE_FILE, collect, prepare, ready_chip
from fluxlock.firmware import build_program, write_image
from fluxlock.firmware.host import register_offsets
from fluxlock.plant import PlantParams


def run_program(name: str, table: bytes, scenario: Scenario, out_dir: Path, seed: int) -> RunData:
    """Run `sw/bench/<name>.c` with its table for the scenario's duration.

    Plant and parameter block are the scenario's. Raises SimulationFault if the run broke off.
    """
    plan = prepare(scenario, out_dir / "simulator", seed)
    write_image(plan.folder / IMAGE_FILE, build_program(name), parameter_block(scenario), table)
    return _run(plan, scenario.motor.phases, scenario.motor.pole_pairs)


def wait(ticks: int) -> tuple[str, int, int]:
    """A row of `run_script`: commit the shadowed registers, wait for control ticks."""
    return "", 0, ticks


def run_script(
    rows: Sequence[tuple[str, int, int]], plant: PlantParams, duration_s: float, out_dir: Path, seed: int
) -> RunData:
    """Write registers in order (`block.register`, index in an array, value) or `wait`; for a time, on a plant.

    The chip has the machine's number of phases. Raises SimulationFault if the run broke off.
    """
    offsets = register_offsets(generate_registers() / "fluxlock_regs.h")
    addresses = [IO_BASE + offsets[name] + 4 * index if name else 0 for name, index, _ in rows]
    words = [
        word for address, (*_, value) in zip(addresses, rows, strict=True) for word in (address, value & 2**32 - 1)
    ]
    folder = out_dir / "simulator"
    folder.mkdir(parents=True, exist_ok=True)
    table = struct.pack(f"<{1 + len(words)}I", len(rows), *words)
    write_image(folder / IMAGE_FILE, build_program("script"), None, table)
    plan = SessionPlan(
        plant=plant,
        seed=seed,
        clock_hz=CLOCK_HZ,
        duration_cycles=round(duration_s * CLOCK_HZ),
        conversion_cycles=max(1, round(plant.sensing.conversion_s * CLOCK_HZ)),
        bit_cycles=BIT_CYCLES,
        folder=folder.resolve(),
    )
    return _run(plan, plant.machine.phases, plant.machine.pole_pairs)


def _run(plan: SessionPlan, phases: int, pole_pairs: int) -> RunData:
    try:
        # There is no console to ask.
        plan = replace(plan, final_commands=())
        meta = run_plan(plan, ready_chip(phases=phases))
    except (SimulatorError, RuntimeError) as error:
        raise SimulationFault(str(error)) from error
    data = collect(plan, meta, pole_pairs)
    if meta["fault"]:
        raise SimulationFault(meta["fault"], data)
    return data
