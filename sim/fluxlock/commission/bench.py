# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The bench of `fluxlock identify`: scenario with the files of the command line."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.commission.procedure import CURRENT_SHARE
from fluxlock.config import Scenario, load_inverter, load_motor, load_scenario

SCENARIO = ROOT / "scenarios" / "vector" / "identify.toml"


def bench_of(plant: Path, inverter: Path, set_: Iterable[str] = ()) -> Scenario:
    """Scenario of the bench; what does not fit raises ConfigError. set_: KEY=VALUE."""
    motor, stage = load_motor(plant), load_inverter(inverter)
    trip_a = stage.protection.phase_current_a
    limit_a = min(motor.rated_current_a, CURRENT_SHARE * trip_a)
    overrides = [f"motor={plant}", f"inverter={inverter}", f"drive.current_limit_a={limit_a}", *set_]
    return load_scenario(SCENARIO, overrides)
