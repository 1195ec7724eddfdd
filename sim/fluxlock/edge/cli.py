# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock edge fit`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from fluxlock.config import ConfigError, Problem
from fluxlock.help import example

app = typer.Typer(
    help="Switching edges of a board: from an oscilloscope record to the inverter file.",
    epilog=example("fluxlock edge fit my-scope.csv"),
    no_args_is_help=True,
)


# A callback keeps `fit` a word of its own though it is the only command.
@app.callback()
def edge() -> None:
    """Switching edges of a board: from an oscilloscope record to the inverter file."""


@app.command("fit", epilog=example("fluxlock edge fit my-scope.csv", "fluxlock edge fit my-scope.csv --reference-v 24"))
def fit(
    file: Annotated[Path, typer.Argument(help="Record of one edge (CSV): docs/howto/edges.md states its form.")],
    reference_v: Annotated[float, typer.Option(help="Jump for which the heights are printed, V.")] = 48.0,
) -> None:
    """Fit step, ring and lobe to the open terminal's voltage and print the table [sensing.edge].

    A term that the record does not show is left out. What is left of the record goes to the error output.
    """
    if not 0.1 <= reference_v <= 2000:
        raise ConfigError(
            [Problem("--reference-v", "", f"{reference_v:g} V is not permitted, permitted: 0.1 to 2000 V")]
        )
    from fluxlock.edge.fit import fit_record
    from fluxlock.edge.record import read_record

    record = read_record(file)
    found = fit_record(record, reference_v)
    if len(found.keys) == 1:
        raise ConfigError([Problem(str(file), "", "shows no step, ring or lobe behind the edge: nothing to fit")])
    print("[sensing.edge]")
    for key, value in found.keys.items():
        print(f"{key} = {value:.4g}")
    left = f"{found.residual_v * 1e3:.3g} mV rms, {found.residual_share:.2g} of the record's own"
    print(f"left of the record: {left}, over {record.time_s.size} samples behind the edge", file=sys.stderr)
