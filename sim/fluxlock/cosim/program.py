"""Run a program of `sw/bench` on the whole chip in place of the firmware."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fluxlock.analysis.rundata import RunData, SimulationFault
from fluxlock.config import Scenario
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.parameters import parameter_block
from fluxlock.cosim.run import IMAGE_FILE, collect, prepare, ready_chip
from fluxlock.firmware import build_program, write_image


def run_program(name: str, table: bytes, scenario: Scenario, out_dir: Path, seed: int) -> RunData:
    """Run `sw/bench/<name>.c` with its table for the scenario's duration.

    Plant and parameter block are the scenario's. Raises SimulationFault if the run broke off.
    """
    try:
        chip = ready_chip()
        plan = prepare(scenario, out_dir / "simulator", seed)
        write_image(plan.folder / IMAGE_FILE, build_program(name), parameter_block(scenario), table)
        # There is no console to ask.
        plan = replace(plan, final_commands=())
        meta = run_plan(plan, chip)
    except (SimulatorError, RuntimeError) as error:
        raise SimulationFault(str(error)) from error
    data = collect(plan, meta, scenario.motor.pole_pairs)
    if meta["fault"]:
        raise SimulationFault(meta["fault"], data)
    return data
