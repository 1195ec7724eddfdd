# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command `fluxlock injection MOTOR [INVERTER]`: feasible injection frequencies and settings as table, map and JSON."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from fluxlock.config import ConfigError, Problem, load_inverter, load_motor
from fluxlock.help import THEORY, example
from fluxlock.theory.six_step.output import prepare_folder, print_table, write_figure

if TYPE_CHECKING:
    from fluxlock.theory.injection.choice import Choice

app = typer.Typer()
CARRIER_HZ = 10_300.0
FIRST_N = 8  # shown in the table; then those about the two limits
AROUND = 3


def _mark(accepted: bool) -> str:
    return "yes" if accepted else "no"


def _periods(n: int) -> str:
    """What `period` permits, even from 4 on, of n carriers with an update a carrier and with two."""
    return " / ".join(str(k) if k >= 4 and k % 2 == 0 else "–" for k in (n, 2 * n))


def _print_choices(found: list[Choice], carrier_hz: float) -> None:
    """Table of the periods that `period` permits, and the one to take."""
    from fluxlock.theory.injection.choice import best

    rows = [
        [
            str(c.period),
            *(f"{x:.3g}" for x in (c.amplitude_v, c.peak_a, c.noise_deg, c.pll_hz, c.speed_hz, c.loop, c.search_a)),
            _mark(not c.refused),
        ]
        for c in found
    ]
    head = ("period", "V", "HF current, A", "noise, deg", "pll_hz", "speed_hz", "S", "search, A", "runs")
    print_table(f"settings by rule, single update, {carrier_hz:g} Hz", head, rows)
    for c in found:
        if c.refused:
            Console().print(f"period {c.period}: {c.refused}", highlight=False)
    taken = best(found)
    if taken is not None:
        Console().print(f"take period = {taken.period}, amplitude_v = {taken.amplitude_v:.3g}", highlight=False)


@app.command(rich_help_panel=THEORY, epilog=example("fluxlock injection motors/five-phase-tian.toml"))
def injection(
    motor: Annotated[Path, typer.Argument(help="Motor file (TOML) with inductance_q_h.")],
    inverter: Annotated[
        Path | None, typer.Argument(help="Inverter file (TOML): the table shows the settings by rule too.")
    ] = None,
    carrier_hz: Annotated[
        float,
        typer.Option(
            min=100.0, max=1e6, help="Carrier frequency f_sw of the inverter, Hz; the default is that of Tian 2019."
        ),
    ] = CARRIER_HZ,
    speed_rpm: Annotated[
        float | None,
        typer.Option(min=0.0, max=2e6, help="Highest speed with injection, r/min; without it the motor's."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for PNG and JSON.")] = Path("build/injection"),
) -> None:
    """Feasible injection frequencies f_sw / n by Tian's rule.

    Nominal: with the values of the motor file. Strict: also with inductances off by 10 % and the angle by 10 deg.
    With an inverter: amplitude, expected noise of the angle, loops and search by rule, and what refuses a choice.
    """
    from fluxlock.theory.injection import frequency as theory
    from fluxlock.theory.injection.choice import choices

    loaded = load_motor(motor)
    try:
        rule = theory.Rule.from_motor(loaded)
    except ValueError as error:
        raise ConfigError([Problem(str(motor), "", str(error))]) from None
    speed = loaded.max_speed_rpm if speed_rpm is None else speed_rpm
    found = theory.feasible(rule, carrier_hz, speed, loaded.pole_pairs)
    if found.largest_n(strict=False) == 0:
        text = (
            f"{carrier_hz:g} Hz is below the least injection frequency of {found.nominal_hz:.0f} Hz at {speed:g} "
            "r/min; raise it or lower --speed-rpm"
        )
        raise ConfigError([Problem("--carrier-hz", "", text)])
    largest = found.largest_n(strict=False)
    settings = [] if inverter is None else list(choices(loaded, load_inverter(inverter), carrier_hz, largest))
    prepare_folder(out, "injection.png", "injection.json")
    limits = (found.largest_n(strict=True), found.largest_n(strict=False))
    shown = [c for c in found.choices if c.n <= FIRST_N or any(abs(c.n - n) <= AROUND for n in limits)]
    rows: list[list[str]] = []
    for before, c in zip([None, *shown], shown, strict=False):
        if before and c.n > before.n + 1:
            rows.append(["…"] * 5)  # like the row before, all of them are in the file
        rows.append([str(c.n), f"{c.hz:.1f}", _mark(c.nominal), _mark(c.strict), _periods(c.n)])
    title = f"{loaded.name}: f_sw / n of {carrier_hz:g} Hz, to {speed:g} r/min"
    print_table(
        title,
        (
            "n",
            "f_sw / n, Hz",
            f"nominal: from {found.nominal_hz:.0f} Hz",
            f"strict: from {found.strict_hz:.0f} Hz",
            "period, single / double update",
        ),
        rows,
    )
    Console().print(
        f"largest n: {limits[1]} nominal, {limits[0]} strict (inductances within 10 %, angle within 10 deg)",
        highlight=False,
    )
    if settings:
        _print_choices(settings, carrier_hz)
    from fluxlock.theory.injection.plots import frequency_figure

    bounds = theory.bound_map(rule, loaded.omega_e(speed))
    data = {
        "carrier_hz": carrier_hz,
        "speed_rpm": speed,
        "nominal_hz": found.nominal_hz,
        "strict_hz": found.strict_hz,
        "choices": [{"n": c.n, "hz": c.hz, "nominal": c.nominal, "strict": c.strict} for c in found.choices],
        "settings": [asdict(c) for c in settings],
        "map": {
            "angle_deg": bounds.angle_deg,
            "inductance_percent": bounds.inductance_percent,
            "bound_hz": bounds.bound_hz,
        },
    }
    write_figure(out, "injection", frequency_figure(title, found, bounds), data)
