# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command `fluxlock check-wiring`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table as RichTable

from fluxlock.base.paths import RESULTS
from fluxlock.can.can_bus import OPTION as CAN_OPTION
from fluxlock.can.can_bus import bus_of
from fluxlock.command_line import EXIT_FAILED
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.help import complete_toml
from fluxlock.results.verdict import Verdict, say

if TYPE_CHECKING:
    from fluxlock.wiring.measure import Measured


def _measure(scenario: Scenario, seed: int, port: Path | None, can: str | None, chip: bool, name: str) -> Measured:
    from fluxlock.flash.command import open_port
    from fluxlock.wiring.measure import on_board, on_bus, on_chip, on_twin

    if can is not None:
        bus, node_id = bus_of(scenario, can)
        with bus:
            return on_bus(scenario, bus, node_id)
    if port is None:
        return on_chip(scenario, seed, RESULTS / f"{name}-wiring") if chip else on_twin(scenario, seed)
    with open_port(port) as opened:
        return on_board(scenario, opened)


def _document(measured: Measured) -> dict[str, Any]:
    wiring = measured.wiring
    return {
        "passed": measured.passed,
        "fault": measured.fault,
        "findings": [
            {"kind": f.kind, "what": f.what, "remedy": f.remedy, "inputs": list(f.inputs)} for f in measured.findings
        ],
        "current_order": wiring.current_order,
        "current_inverted": list(wiring.current_inverted),
        "voltage_order": wiring.voltage_order,
        "current_a": measured.current_a.round(6).tolist(),
        "current_peak_a": round(measured.peak_a, 6),
        "current_noise_a": round(measured.noise_a, 6),
        "offset_a": None if measured.offset_a is None else [round(offset, 6) for offset in measured.offset_a],
        "voltage_v": measured.voltage_v.round(6).tolist(),
    }


def _show(measured: Measured) -> None:
    for title, table, unit in (("current", measured.current_a, "A"), ("voltage", measured.voltage_v, "V")):
        shown = RichTable(title=f"{title} at the inputs", title_justify="left")
        for header in ("leg", *(f"input {letter}, {unit}" for letter in "ABC")):
            shown.add_column(header, justify="right")
        for letter, row in zip("ABC", table, strict=True):
            shown.add_row(letter, *(f"{value:.3g}" for value in row))
        Console().print(shown)
    text = f"largest current {measured.peak_a:.3g} A, noise of these numbers {measured.noise_a:.2g} A"
    if measured.offset_a is not None:
        offsets = ", ".join(f"{letter} {offset:.3g} A" for letter, offset in zip("ABC", measured.offset_a, strict=True))
        text += f"; offsets of the current sensors {offsets}"
    print(text)


def verdict_of(measured: Measured) -> Verdict:
    """What the test has found, in words."""
    if measured.findings:
        return Verdict(False, [f"{f.what}: {f.remedy}" for f in measured.findings])
    if measured.fault != "none":
        return Verdict(False, [f"the drive stopped with the fault {measured.fault}, but no wiring explains the tables"])
    if not measured.voltage_v.any():
        why = "the chip has no capture buffer, or this machine bears only pulses that its samples do not see"
        return Verdict(True, [f"legs and current sensors belong together; the dividers were not seen: {why}"])
    return Verdict(True, ["legs, current sensors and voltage dividers belong together"])


def check_wiring(
    scenario: Annotated[
        Path,
        typer.Argument(help="Scenario file (TOML), with vector control.", autocompletion=complete_toml("scenarios")),
    ],
    port: Annotated[
        Path | None, typer.Option(help="Serial port of a board that runs this scenario, for example /dev/ttyUSB0.")
    ] = None,
    can: Annotated[
        str | None,
        typer.Option(
            CAN_OPTION,
            metavar="INTERFACE:CHANNEL",
            help="In place of it the bus of that board: socketcan:can0. The scenario needs the table \\[can].",
        ),
    ] = None,
    chip: Annotated[bool, typer.Option("--chip", help="Simulate the chip, in place of its averaged twin.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print tables and findings as JSON.")] = False,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key, also motor.KEY and inverter.KEY. Repeatable."),
    ] = None,
) -> None:
    """Test legs, current sensors and voltage dividers by small pulses, before the first turn, and name what is wrong.

    In a simulation, or on a board by `--port` or `--can`: the rotor stays where it is, the current below a tenth of the
    rated one. Of the scenario's events its faults alone happen, in a simulation. Exit code 1 if something is wrong:
    each line says what, and what to do.
    """
    from fluxlock.cosim.cautions import checked
    from fluxlock.results.rundata import SimulationFault
    from fluxlock.wiring.reach import WiringError

    loaded = checked(scenario, set_ or (), True)
    if loaded.drive.method != "vector":
        text = 'the test needs method = "vector" with the same motor and inverter; flash six-step after it'
        raise ConfigError([loaded.sources.problem("drive.method", text)])
    if loaded.motor.phases != 3:
        raise ConfigError([loaded.sources.problem("motor.phases", "the test is of three phases")])
    chosen = [
        name for name, on in (("--chip", chip), ("--port", port is not None), (CAN_OPTION, can is not None)) if on
    ]
    if len(chosen) > 1:
        raise ConfigError([Problem(chosen[0], "", f"and {chosen[1]} exclude each other: leave one out")])
    try:
        measured = _measure(loaded, loaded.seed, port, can, chip, scenario.stem)
    except (WiringError, SimulationFault) as error:
        say(Verdict(False, [f"simulation: {error}" if isinstance(error, SimulationFault) else str(error)]))
        raise typer.Exit(EXIT_FAILED) from None
    verdict = verdict_of(measured)
    if as_json:
        print(json.dumps(_document(measured), indent=2))
    else:
        _show(measured)
    say(verdict, quiet=as_json)
    if not verdict.passed:
        raise typer.Exit(EXIT_FAILED)
