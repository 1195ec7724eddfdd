# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Run a scenario on the whole chip: a checked scenario in, `RunData` out.

`run_scenario` builds what is missing (registers, chip, firmware), writes the firmware image with the
scenario's parameter block, starts one simulator process, and reads what it left. Each chip variant compiles once and is
cached in `build/chip`.

Units: times of a scenario are in seconds, those of a run in clocks (50 MHz). The same scenario, seed and sources
give the same trace, bit for bit.
Errors: `SimulationFault` if a build fails or the run breaks off. It carries the data up to that clock, if there
are any.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.base.paths import BUILD
from fluxlock.base.stage import Progress, tell_building
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.config.motor import machine_params
from fluxlock.cosim.beside import built_beside
from fluxlock.cosim.chip import Chip, build_chip
from fluxlock.cosim.console import NO_REPLY
from fluxlock.cosim.convert import actions_of, plant_params
from fluxlock.cosim.debugger import GdbServer
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.native_firmware import NativeFirmware
from fluxlock.cosim.parameters import parameter_block
from fluxlock.cosim.plan import RAW_FILE, SessionPlan
from fluxlock.firmware import ParameterBlock, build_bus_library, build_firmware, write_image
from fluxlock.generate.memory import RAM_WORDS
from fluxlock.generate.registers import generate_registers
from fluxlock.plant.state import variant_of
from fluxlock.python_load import PythonLoad
from fluxlock.results.rundata import Rejection, RunData, SimulationFault

BIT_CYCLES = 50  # console: 1 Mbaud at 50 MHz
IMAGE_FILE = "firmware.hex"  # what `fl_ram` reads


def image_of(scenario: Scenario, ram_words: int = RAM_WORDS) -> Path:
    """The firmware that a scenario runs: its motor's phases; on a CAN bus with the node, and one method only.

    ram_words: of a board's chip; with less than the simulated one has, one method only as well.
    """
    method = scenario.drive.method if ram_words < RAM_WORDS else None
    return build_firmware(BUILD / "firmware", *_variant(scenario), method=method, ram_words=ram_words)


def _variant(scenario: Scenario) -> tuple[int, str | None]:
    return scenario.motor.phases, scenario.drive.method if scenario.can is not None else None


def prepare(
    scenario: Scenario,
    folder: Path,
    seed: int,
    *,
    recording: bool = False,
    log_strobes: bool = False,
    marks: tuple[int, ...] = (),
    stop_cycle: int | None = None,
    block: ParameterBlock | None = None,
    image: Path | None = None,
    trace: tuple[int, int] | None = None,
    gdb: int | None = None,
    load: PythonLoad | None = None,
) -> SessionPlan:
    """Write the firmware image with the scenario's parameter block into `folder` and return the plan of the run.

    recording, log_strobes, marks, trace, gdb: see `SessionPlan`; load: its own_load. stop_cycle: end there instead of
    at the scenario's duration. block: parameters in place of the scenario's. image: program in place of the firmware.
    """
    folder.mkdir(parents=True, exist_ok=True)
    bus = scenario.can
    setup = (bus.node_id, bus.bit_rate_kbit_per_s) if bus is not None else None
    program = image or image_of(scenario)
    write_image(folder / IMAGE_FILE, program, block or parameter_block(scenario), can_setup=setup)
    sensing = scenario.inverter.sensing
    zoom = tuple(round(t * CLOCK_HZ) for t in scenario.zoom_window_s())
    every = max(1, round(scenario.record.period_s / sensing.sample_period_s))
    duration = round(scenario.duration_s * CLOCK_HZ)
    return SessionPlan(
        plant=plant_params(scenario, every, ((zoom[0], zoom[1]),)),
        seed=seed,
        clock_hz=CLOCK_HZ,
        duration_cycles=min(duration, stop_cycle or duration),
        conversion_cycles=max(1, round(sensing.conversion_s * CLOCK_HZ)),
        bit_cycles=BIT_CYCLES,
        actions=tuple(a for event in scenario.events_in_order() for a in actions_of(scenario, event, program)),
        marks=marks,
        recording=recording,
        log_strobes=log_strobes,
        gate_polarity=scenario.inverter.gate_polarity,
        trace=trace,
        gdb=gdb,
        own_load=load,
        folder=folder.resolve(),
    )


def chip_of(
    scenario: Scenario,
    waves: bool = False,
    native: bool = False,
    can: bool = False,
    probe: bool = False,
    signals: tuple[str, ...] = (),
) -> Chip:
    """The chip that a scenario runs on: its motor's phases, inverter's gates, injection path and CAN if it uses them.

    It has the path of its method alone; with CAN both. can: with the CAN controller even so. native: without its core,
    and one for all methods, with or without CAN. probe: with its core open to debugger and profile, and one for all
    methods. signals: of its inside that cocotb sees, see `build_chip`.
    """
    has_can = can or native or scenario.can is not None
    return build_chip(
        waves,
        phases=scenario.motor.phases,
        injection=scenario.drive.vector.injection is not None,
        can=has_can,
        native=native,
        gate_polarity=scenario.inverter.gate_polarity,
        method=None if has_can or probe else scenario.drive.method,
        probe=probe,
        signals=signals,
    )


def parse_statistics(text: str) -> tuple[dict[str, dict[str, float]], int]:
    """Interrupt statistics and overruns from the console's reply to `stats`."""
    handlers: dict[str, dict[str, float]] = {}
    for name, low, mean, high, count in re.findall(r"^isr (\w+) (\d+) ([\d.]+) (\d+) (\d+)\s*$", text, re.MULTILINE):
        handlers[name] = {"min": float(low), "mean": float(mean), "max": float(high), "count": float(count)}
    overruns = re.search(r"^overruns (\d+) \d+\s*$", text, re.MULTILINE)  # control tick, all sources
    return handlers, int(overruns.group(1)) if overruns else 0


def rejected_lines(sent: list[tuple[int, str, str | None]], clock_hz: float) -> list[Rejection]:
    """Lines, each with its clock and answer, that the console answered with an error or not at all."""
    return [
        Rejection(cycle / clock_hz, line, (answer or NO_REPLY).removeprefix("error: "))
        for cycle, line, answer in sent
        if answer != "ok"
    ]


def collect(plan: SessionPlan, meta: dict[str, Any], pole_pairs: int) -> RunData:
    """Read what a session left in its folder."""
    handlers, overruns = parse_statistics(meta["uart"])
    with np.load(plan.folder / RAW_FILE) as raw:
        return RunData(
            log=raw["log"],
            records=raw["records"],
            plant_events=raw["plant_events"],
            zoom=raw["zoom"],
            clock_hz=plan.clock_hz,
            pole_pairs=pole_pairs,
            cycles=meta["cycles"],
            wall_s=meta["wall_s"],
            seed=plan.seed,
            uart=meta["uart"].splitlines(),
            isr=handlers,
            overruns=overruns,
            rejected=rejected_lines(meta["sent"], plan.clock_hz),
        )


def run_scenario(
    scenario: Scenario,
    out_dir: Path,
    seed: int,
    waves: bool = False,
    progress: Progress | None = None,
    log_strobes: bool = False,
    native: NativeFirmware | None = None,
    gdb: GdbServer | None = None,
    load: PythonLoad | None = None,
) -> RunData:
    """Build what is missing, run, and return what was measured. Raises SimulationFault if the run broke off.

    The simulator's files (log, image) stay in `out_dir/simulator`; waves: among them an FST of the zoom window. native:
    how the firmware runs in place of the chip's core. gdb: where the core waits for a debugger.
    load: written in Python, on top of the scenario's.
    """
    build = partial(tell_building, progress, scenario.duration_s)
    try:
        build("registers")
        generate_registers()
        build("chip")
        with built_beside(variant_of(machine_params(scenario.motor)), _variant(scenario)[1]):
            chip = chip_of(scenario, waves, native is not None, probe=gdb is not None)
        build("firmware")
        port = gdb.listener.fileno() if gdb is not None else None
        plan = prepare(scenario, out_dir / "simulator", seed, log_strobes=log_strobes, gdb=port, load=load)
        if gdb is not None:
            gdb.announce(image_of(scenario).with_suffix(".elf"))
        if native is None:
            meta = run_plan(plan, chip, progress)
        else:
            library = build_bus_library(*_variant(scenario), native.sanitize)
            meta = run_plan(plan, chip, progress, firmware=library, debugger=native.debugger)
    except (SimulatorError, RuntimeError) as error:
        raise SimulationFault(str(error)) from error
    data = collect(plan, meta, scenario.motor.pole_pairs)
    if meta["fault"]:
        raise SimulationFault(meta["fault"], data)
    return data
