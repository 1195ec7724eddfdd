# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The simulated bench: chip, commissioning program, and a machine that only the plant knows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fluxlock.base.stage import Progress, tell_building
from fluxlock.clock import CLOCK_HZ
from fluxlock.commission.plate import NamePlate, first_guess
from fluxlock.commission.procedure import Commissioning
from fluxlock.commission.protocol import MeasurementError
from fluxlock.config import ConfigError, Motor, Problem, Scenario
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.parameters import parameter_block
from fluxlock.cosim.run import IMAGE_FILE, prepare
from fluxlock.firmware import ParameterBlock, build_commission, write_image
from fluxlock.results.rundata import SimulationFault


@dataclass(frozen=True)
class Measured:
    """values: what the conversation returned; duration_s: of chip time; wall_s: of the simulation."""

    values: dict[str, Any]
    duration_s: float
    wall_s: float


def plate_of(motor: Motor) -> NamePlate:
    """What stands on the machine."""
    return NamePlate(motor.name, motor.pole_pairs, motor.rated_current_a, motor.max_speed_rpm)


def known_of(bench: Scenario) -> tuple[Commissioning, ParameterBlock]:
    """What the measurement is told of a bench, and what its program: name plate and inverter, no more.

    Raises ConfigError where the bench has a drive that the program is not made for.
    """
    vector = bench.drive.vector
    if vector is not None and vector.current_regulator == "c":
        text = '"c" cannot be measured with: the commissioning program answers no regulator step; set it to "rtl"'
        raise ConfigError([Problem(bench.sources.scenario, "drive.vector.current_regulator", text)])
    plate = plate_of(bench.motor)
    block = parameter_block(bench.model_copy(update={"motor": first_guess(plate, bench.inverter)}))
    carrier, tick = block.number("vector_sample_cycles"), block.number("tick_cycles")
    return Commissioning(plate, bench.inverter, CLOCK_HZ, carrier, tick), block


def measure(bench: Scenario, folder: Path, seed: int, progress: Progress | None = None) -> Measured:
    """Run the commissioning on a bench. Its motor goes to the plant; the measurement gets the name plate.

    Raises ConfigError (see known_of), MeasurementError, or SimulationFault if the simulator broke off.
    """
    dialogue, block = known_of(bench)
    tell_building(progress, bench.duration_s, "chip")
    try:
        chip = build_chip(method="vector")
        plan = prepare(bench, folder, seed, block=block)
        write_image(plan.folder / IMAGE_FILE, build_commission(), block)
        meta = run_plan(replace(plan, dialogue=dialogue, final_commands=()), chip, progress)
    except (SimulatorError, RuntimeError) as error:
        raise SimulationFault(str(error)) from error
    if meta["fault"]:
        raise MeasurementError(meta["fault"])
    return Measured(meta["conclusion"], meta["cycles"] / CLOCK_HZ, meta["wall_s"])
