# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commands `fluxlock motor new`, `check` and `info`."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console

from fluxlock.base.writable import check_file
from fluxlock.config import ConfigError, Motor, Problem, load_inverter, load_motor
from fluxlock.config.drive import Drive
from fluxlock.config.info import derived_values, warnings
from fluxlock.config.mistakes import mistakes
from fluxlock.config.settling import settling_text
from fluxlock.datasheet.entries import BY_OPTION, ENTRIES, Value, read_value
from fluxlock.help import complete_toml, example

app = typer.Typer(
    help="Write a motor file from a data sheet, check one, show what follows from it.",
    epilog=example(
        "fluxlock motor new motors/my-motor.toml",
        "fluxlock motor check motors/spindle-2pp.toml",
        "fluxlock motor info motors/spindle-2pp.toml",
    ),
    no_args_is_help=True,
)
INFO_CARRIER_HZ = 20e3  # for which `info` states what depends on a carrier
MotorArgument = Annotated[Path, typer.Argument(help="Motor file (TOML).", autocompletion=complete_toml("motors"))]


def _option(name: str) -> object:
    entry = BY_OPTION[name]
    return typer.Option(f"--{name}", metavar="VALUE", help=f"{entry.question}, {entry.hint}.")


def _warn(file: Path, motor: Motor) -> None:
    """The unusual in a motor file, on the error output."""
    messages = Console(stderr=True)
    for line in warnings(motor):
        messages.print(f"warning: {file}: {line}", style="yellow", markup=False, highlight=False, soft_wrap=True)


def _ask(values: dict[str, Value]) -> None:
    """Ask for what no option has stated; a wrong answer is asked again."""
    from fluxlock.datasheet.convert import question_of

    print("Values of the data sheet; press return where it has none.", file=sys.stderr)
    for entry in ENTRIES:
        if entry.option in values or (entry.option == "pole-pairs" and "poles" in values):
            continue
        while text := typer.prompt(question_of(entry.option), default="", show_default=False, err=True).strip():
            try:
                values[entry.option] = read_value(entry, text)
                break
            except ConfigError as error:
                print(f"error: {error}", file=sys.stderr)


@app.command(
    "new",
    epilog=example(
        "fluxlock motor new motors/my-motor.toml",
        'fluxlock motor new motors/my-motor.toml --poles 14 --kv 1000 --resistance "0.12 ohm" --inductance "60 uH" '
        '--inertia "150 gcm2" --rated-current "20 A dc" --max-speed 12000',
    ),
)
def motor_new(
    file: Annotated[Path, typer.Argument(help="Motor file to write (TOML).")],
    name: Annotated[str | None, typer.Option(help="Name for tables and plots, default that of the file.")] = None,
    emf: Annotated[
        Literal["sinusoidal", "trapezoidal"], typer.Option(help="Shape of the EMF; sheets rarely say it.")
    ] = "sinusoidal",
    winding: Annotated[
        Literal["star", "delta"], typer.Option(help="Connection; matters for values of the kind phase alone.")
    ] = "star",
    poles: Annotated[str | None, _option("poles")] = None,
    pole_pairs: Annotated[str | None, _option("pole-pairs")] = None,
    kv: Annotated[str | None, _option("kv")] = None,
    ke: Annotated[str | None, _option("ke")] = None,
    kt: Annotated[str | None, _option("kt")] = None,
    resistance: Annotated[str | None, _option("resistance")] = None,
    inductance: Annotated[str | None, _option("inductance")] = None,
    inductance_q: Annotated[str | None, _option("inductance-q")] = None,
    inertia: Annotated[str | None, _option("inertia")] = None,
    rated_current: Annotated[str | None, _option("rated-current")] = None,
    peak_current: Annotated[str | None, _option("peak-current")] = None,
    rated_torque: Annotated[str | None, _option("rated-torque")] = None,
    voltage: Annotated[str | None, _option("voltage")] = None,
    no_load_speed: Annotated[str | None, _option("no-load-speed")] = None,
    no_load_current: Annotated[str | None, _option("no-load-current")] = None,
    max_speed: Annotated[str | None, _option("max-speed")] = None,
    electrical_time_constant: Annotated[str | None, _option("electrical-time-constant")] = None,
    mechanical_time_constant: Annotated[str | None, _option("mechanical-time-constant")] = None,
    source: Annotated[str, typer.Option(help="Maker, type and document, for the file.")] = "",
    note: Annotated[
        list[str] | None, typer.Option(help="Sentence for the head of the file, such as what is estimated; repeatable.")
    ] = None,
) -> None:
    """Write a motor file from what a data sheet has: Kv, Ke or Kt, terminal R and L, poles, currents.

    Without options it asks. Each value has a unit, and a kind where makers differ.
    Values that contradict each other are refused by name.
    """
    stated = {
        "poles": poles,
        "pole-pairs": pole_pairs,
        "kv": kv,
        "ke": ke,
        "kt": kt,
        "resistance": resistance,
        "inductance": inductance,
        "inductance-q": inductance_q,
        "inertia": inertia,
        "rated-current": rated_current,
        "peak-current": peak_current,
        "rated-torque": rated_torque,
        "voltage": voltage,
        "no-load-speed": no_load_speed,
        "no-load-current": no_load_current,
        "max-speed": max_speed,
        "electrical-time-constant": electrical_time_constant,
        "mechanical-time-constant": mechanical_time_constant,
    }
    if file.suffix != ".toml":
        raise ConfigError([Problem(str(file), "", "must be a file name that ends in .toml")])
    if file.exists():
        raise ConfigError([Problem(str(file), "", "exists and would be lost; name another file or remove it")])
    check_file(file)
    from fluxlock.datasheet.convert import Sheet, missing, motor_text

    values, problems = {}, []
    for option, text in stated.items():
        try:
            if text is not None:
                values[option] = read_value(BY_OPTION[option], text)
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    if missing(values) and sys.stdin.isatty():
        _ask(values)
    text = motor_text(Sheet(name or file.stem, values, emf, winding, source, tuple(note or ())))
    file.write_text(text, encoding="utf-8")
    try:
        motor = load_motor(file)
        if found := mistakes(motor):
            raise ConfigError([Problem("motor new", "", f"the values contradict each other: {line}") for line in found])
    except ConfigError:
        file.unlink()
        raise
    print(text, end="")
    print(f"written: {file}; what follows from it: fluxlock motor info {file}", file=sys.stderr)
    _warn(file, motor)


@app.command("check", epilog=example("fluxlock motor check motors/spindle-2pp.toml"))
def motor_check(file: MotorArgument) -> None:
    """Check a motor file: every wrong key by name, warnings of the unusual."""
    motor = load_motor(file)
    _warn(file, motor)
    pairs = f"{motor.pole_pairs} pole pair{'s' if motor.pole_pairs > 1 else ''}"
    print(f"{file}: ok ({motor.name}, {pairs}, {motor.emf})")


@app.command("info", epilog=example("fluxlock motor info motors/spindle-2pp.toml"))
def motor_info(
    file: MotorArgument,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    inverter: Annotated[
        Path | None,
        typer.Option(
            help="Inverter file: how long crossings wait after an edge.", autocompletion=complete_toml("inverters")
        ),
    ] = None,
) -> None:
    """Show a motor and what follows from its file, beside the machines in motors/."""
    motor = load_motor(file)
    waited = "" if inverter is None else settling_text(Drive(carrier_hz=INFO_CARRIER_HZ), load_inverter(inverter))
    values = derived_values(motor)
    from fluxlock.config.vector_loops import loops, reference_plant

    by_rule = loops(reference_plant(motor))
    if as_json:
        derived = {v.key: v.value for v in values}
        print(
            json.dumps(
                {"motor": motor.model_dump(mode="json"), "derived": derived, "vector": asdict(by_rule)}, indent=2
            )
        )
        return
    from fluxlock.motor_info import examples, table

    console = Console()
    console.print(table(motor, examples(), console.width), highlight=False)
    console.print(
        f"\nvector control at 20 kHz by rule: speed loop {by_rule.speed_hz:.3g} Hz, phase-locked loop "
        f"{by_rule.pll_hz:.3g} Hz, phase margin {by_rule.nominal_deg:.0f} degrees, with L off by 30 % "
        f"{by_rule.worst_deg:.0f}; bound by: {by_rule.reason}",
        highlight=False,
    )
    if waited:
        console.print(f"six-step at 20 kHz: {waited}", highlight=False)
    _warn(file, motor)
