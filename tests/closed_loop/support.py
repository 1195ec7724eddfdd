# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Running scenarios from tests: outputs stay below build/closed_loop, one folder a test."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.config import load_scenario
from fluxlock.cosim.native_firmware import NativeFirmware
from fluxlock.cosim.outcome import Run, write_outcome
from fluxlock.cosim.run import run_scenario

SEED = 1


def drive(
    scenario: str | Path,
    name: str,
    *overrides: str,
    seed: int = SEED,
    log_strobes: bool = False,
    native: NativeFirmware | None = None,
) -> Run:
    """Run a scenario (absolute, or in scenarios/) with overrides; print the seed.

    Trace and result stay in build/closed_loop/<name>, without the plots of the command. native: see `run_scenario`.
    """
    path = ROOT / "scenarios" / scenario
    loaded = load_scenario(path, overrides)
    folder = BUILD / "closed_loop" / name
    shutil.rmtree(folder, ignore_errors=True)
    print(f"{path.name} {' '.join(overrides)} seed {seed}: {folder}")
    data = run_scenario(loaded, folder, seed, log_strobes=log_strobes, native=native)
    outcome = write_outcome(data, loaded, folder, plots=False)
    print(json.dumps(outcome.metrics, indent=1))
    return outcome
