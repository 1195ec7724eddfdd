# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock edge fit`."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path
from typing import Annotated

import typer

from fluxlock.config import ConfigError, Problem
from fluxlock.help import example

app = typer.Typer(
    help="Switching edges of a board: from a scope record to the inverter file, and what they do to a run.",
    epilog=example("fluxlock edge fit my-scope.csv", "fluxlock edge phase build/my-run"),
    no_args_is_help=True,
)


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


@app.command("phase", epilog=example("fluxlock edge phase build/my-run"))
def phase(
    folder: Annotated[Path, typer.Argument(help="Folder of a six-step run.")],
    from_s: Annotated[float, typer.Option(help="Begin, s.")] = 0.0,
    to_s: Annotated[float | None, typer.Option(help="End, s; that of the run if left out.")] = None,
) -> None:
    """Draw the commutation errors of a run by where in a carrier their crossings fall: FOLDER/pwm-phase.png.

    Errors are about their mean and without the scenario's advance. Edges that reach the crossings show as a wave.
    """
    from fluxlock.base.writable import check_file
    from fluxlock.edge.plot import draw_phases
    from fluxlock.results.metrics import Analysis
    from fluxlock.results.rundata import load_trace

    trace, picture = folder / "trace.npz", folder / "pwm-phase.png"
    if not trace.is_file():
        raise ConfigError(
            [Problem(str(folder), "", "has no trace.npz: name the folder of a run (--out of fluxlock run)")]
        )
    try:
        data = load_trace(trace)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ConfigError([Problem(str(trace), "", f"is no trace of a run ({error})")]) from None
    end_s = data.duration_s if to_s is None else to_s
    if not 0 <= from_s < end_s <= data.duration_s:
        text = f"{from_s:g} to {end_s:g} s is no span of the run, permitted within 0 to {data.duration_s:g} s"
        raise ConfigError([Problem("--from-s, --to-s", "", text)])
    check_file(picture)
    analysis = Analysis(data)
    low, high = (
        max(analysis.track.first_cycle, from_s * data.clock_hz),
        min(analysis.track.last_cycle, end_s * data.clock_hz),
    )
    bins = analysis.commutation_phases(low, high)
    if bins.pp_deg is None:
        raise ConfigError([Problem(str(folder), "", "has no crossings that fall into several parts of a carrier")])
    draw_phases(bins, picture, f"{from_s:g} to {end_s:g} s, {int(bins.count.sum())} commutations")
    print(f"largest less smallest mean: {bins.pp_deg:.3f} deg; written: {picture}")
