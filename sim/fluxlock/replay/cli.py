# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock replay`: a log of a drive in, the machine that explains it out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluxlock.command_line import SeedOption, SetOption
from fluxlock.help import complete_toml


def replay(
    log: Annotated[Path, typer.Argument(metavar="LOG.csv", help="Log; its first line names columns and units.")],
    scenario: Annotated[
        Path,
        typer.Argument(help="Scenario file (TOML) of the drive.", autocompletion=complete_toml("scenarios")),
    ],
    set_: SetOption = None,
    seed: SeedOption = None,
) -> None:
    """Drive the twin with a log's demand and link voltage, and find R, L, flux and inertia of the machine in the log.

    Columns: t, target, speed, vdc, ia, ib, ic, and va, vb, vc or idc. Others are left out.
    """
    from fluxlock.cosim.cautions import checked
    from fluxlock.replay.fit import PARAMETERS, UNITS, Replay
    from fluxlock.replay.table import read_table

    table = read_table(log)
    loaded = checked(scenario, set_ or ())
    run = Replay(loaded, table, loaded.seed if seed is None else seed)
    print(f"{log}: {table['time'].size} rows, {run.end_s:.3f} s; fitting {', '.join(run.fitted)}", flush=True)
    found = run.fit()
    for name in PARAMETERS:
        if name in run.fitted:
            change = 100.0 * (found.factors[name] - 1.0)
            print(f"{name:4s}{found.values[name]:12.4g} {UNITS[name]:6s} {change:+.1f} % of the motor file")
        else:
            print(f"{name:4s}{found.values[name]:12.4g} {UNITS[name]:6s} not in this log: it has no va, vb, vc")
    print("residual, rms relative to the log's:")
    for name, value in found.residual.items():
        print(f"  {name:9s} {100 * value:6.2f} %, with the motor file {100 * found.before[name]:6.2f} %")
    print(f"{found.runs} runs of the twin")
