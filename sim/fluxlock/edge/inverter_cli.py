# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock inverter advise`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from fluxlock.base.paths import RESULTS
from fluxlock.config import ConfigError, Inverter, Motor, Problem, load_inverter, load_motor
from fluxlock.config.fields import with_unit
from fluxlock.help import complete_toml, example
from fluxlock.theory.six_step.output import prepare_folder, print_table, write_figure

if TYPE_CHECKING:
    from fluxlock.edge.advice import Choice, Parts

app = typer.Typer(
    help="Sense chain of an inverter: which filter the voltage dividers need for a machine.",
    epilog=example("fluxlock inverter advise motors/spindle-2pp.toml inverters/drive-48v.toml"),
    no_args_is_help=True,
)
SLOWEST_SHARE = 0.2  # of the highest speed: where the range begins if nothing is said
SPEEDS = 40  # of the curves


@app.callback()
def _group() -> None:
    """A group, though it has one command."""


def _range_rpm(motor: Motor, inverter: Inverter, from_rpm: float | None, to_rpm: float | None) -> tuple[float, float]:
    """Lowest and highest speed: by the options, else from a fifth of what supply and file permit up to that."""
    bound_rpm = inverter.supply_v / (motor.line_flux_vs * motor.omega_e(1.0))
    high = to_rpm if to_rpm is not None else min(motor.max_speed_rpm, bound_rpm)
    low = from_rpm if from_rpm is not None else SLOWEST_SHARE * high
    if high > bound_rpm:
        text = f"{high:g} r/min needs more than the supply of {with_unit(inverter.supply_v, 'V')}: "
        raise ConfigError([Problem("--to-rpm", "", text + f"permitted up to {bound_rpm:.0f} r/min")])
    if not 0 < low < high:
        text = f"{low:g} r/min is not below the highest speed of {high:g} r/min; permitted: above 0 and below it"
        raise ConfigError([Problem("--from-rpm", "", text)])
    return low, high


def _print(now: Choice, best: Choice, parts: Parts, divider_ohm: float | None) -> None:
    """Both poles side by side, a line a speed."""
    rows = []
    for name, choice in (("now", now), ("advised", best)):
        for b in choice.budgets:
            terms = (b.noise_deg, b.edges_deg, b.lag_deg, b.total_deg, b.dividers_deg)
            pole = f"{choice.pole_s * 1e9:.0f}"
            rows.append([name, pole, f"{b.speed_rpm:.0f}", str(b.samples), *(f"{t:.3f}" for t in terms)])
    heads = ("", "pole ns", "r/min", "samples", "noise", "edges", "lag", "all three", "dividers")
    print_table("Errors of the commutations, rms degrees el.", heads, rows)
    console = Console(soft_wrap=True, highlight=False)
    for name, choice in (("now", now), ("advised", best)):
        wait = f"samples count from {choice.settling.settle_s * 1e6:.3g} us after an edge ({choice.settling.reason})"
        after = f"carriers are stretched below {choice.stretched_rpm:.0f} r/min"
        if not choice.runs:
            after = "which leaves no samples of a crossing here"
        console.print(f"{name}: pole {choice.pole_s * 1e9:.0f} ns; {wait}; {after}", markup=False)
    if divider_ohm is not None:
        farad = best.pole_s / divider_ohm
        console.print(
            f"at {divider_ohm:g} ohm of the divider's resistors in parallel: {farad * 1e12:.0f} pF", markup=False
        )
    console.print(
        f"dividers: resistors of {parts.resistor:.2%}; the same each turn, drive.zcd.balance learns it", markup=False
    )


@app.command(
    "advise",
    epilog=example(
        "fluxlock inverter advise motors/spindle-2pp.toml inverters/drive-48v.toml",
        "fluxlock inverter advise motors/spindle-2pp.toml inverters/drive-48v.toml --divider-ohm 4700",
    ),
)
def advise(
    motor: Annotated[Path, typer.Argument(help="Motor file (TOML).", autocompletion=complete_toml("motors"))],
    inverter: Annotated[Path, typer.Argument(help="Inverter file (TOML).", autocompletion=complete_toml("inverters"))],
    carrier_hz: Annotated[float, typer.Option(min=1e3, max=200e3, help="Carrier frequency, Hz.")] = 20e3,
    from_rpm: Annotated[float | None, typer.Option(help="Lowest speed, r/min; default a fifth of the highest.")] = None,
    to_rpm: Annotated[
        float | None, typer.Option(help="Highest speed, r/min; default the file's, as far as the supply goes.")
    ] = None,
    resistor_percent: Annotated[
        float, typer.Option(min=0.0, max=20.0, help="Tolerance of the dividers' resistors, %.")
    ] = 0.1,
    capacitor_percent: Annotated[
        float, typer.Option(min=0.0, max=50.0, help="Tolerance of the dividers' capacitors, %.")
    ] = 5.0,
    divider_ohm: Annotated[
        float | None,
        typer.Option(min=1.0, max=1e7, help="Resistors of a divider in parallel, ohm: for the capacitor."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for advise.png and advise.json.")] = RESULTS / "advise",
) -> None:
    """Show what the dividers' filter costs and saves for your motor and speeds, and which pole to build.

    Six-step, without load. The advised pole is the longest one within 10 % of the least error: it filters most of what
    no file knows. It stretches no carrier that runs as it is today.
    """
    from fluxlock.config.drive import Drive
    from fluxlock.edge.advice import Parts, advised, choose
    from fluxlock.edge.plot import advice_figure

    loaded, stage = load_motor(motor), load_inverter(inverter)
    if loaded.phases != 3:
        raise ConfigError([Problem(str(motor), "phases", f"must be 3 for six-step operation, not {loaded.phases}")])
    low, high = _range_rpm(loaded, stage, from_rpm, to_rpm)
    prepare_folder(out, "advise.png", "advise.json")
    parts, drive = Parts(resistor_percent / 100, capacitor_percent / 100), Drive(carrier_hz=carrier_hz)
    middle = round((low * high) ** 0.5)
    now, runs = choose(loaded, stage, drive, (low, middle, high), parts)
    if not runs:
        text = f"no pole leaves samples of a crossing at {high:g} r/min and {with_unit(carrier_hz, 'Hz')}: "
        raise ConfigError(
            [Problem("--to-rpm, --carrier-hz", "", text + "a lower speed, a slower carrier or quicker samples")]
        )
    best = advised(now, runs)
    _print(now, best, parts, divider_ohm)
    curves = tuple(low * (high / low) ** (k / (SPEEDS - 1)) for k in range(SPEEDS))
    over = {
        name: choose(loaded, stage.with_pole(choice.pole_s), drive, curves, parts)[0]
        for name, choice in (("now", now), ("advised", best))
    }
    data = {
        "motor": loaded.name,
        "inverter": stage.name,
        "carrier_hz": carrier_hz,
        "parts": asdict(parts),
        "now": asdict(now),
        "advised": asdict(best),
        "poles": [asdict(c) for c in runs],
    }
    title = f"{loaded.name}, {stage.name}, {carrier_hz / 1e3:g} kHz"
    write_figure(out, "advise", advice_figure(title, now, best, runs, over), data)
