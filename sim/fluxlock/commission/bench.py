# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The bench of `fluxlock identify`: scenario with the files of the command line."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.commission.procedure import CURRENT_SHARE
from fluxlock.config import Inverter, Motor, Scenario, load_inverter, load_motor, load_scenario

SCENARIO = ROOT / "scenarios" / "vector" / "identify.toml"


def _limit_a(motor: Motor, inverter: Inverter) -> float:
    return min(motor.rated_current_a, CURRENT_SHARE * inverter.protection.phase_current_a)


def bench_for(scenario: Scenario) -> Scenario:
    """The same bench with the machine, the inverter and the seed of a scenario."""
    base = load_scenario(SCENARIO)
    motor, inverter = scenario.motor, scenario.inverter
    drive = base.drive.model_copy(update={"current_limit_a": _limit_a(motor, inverter)})
    return base.model_copy(update={"motor": motor, "inverter": inverter, "drive": drive, "seed": scenario.seed})


def bench_of(plant: Path, inverter: Path, set_: Iterable[str] = ()) -> Scenario:
    """Scenario of the bench; what does not fit raises ConfigError. set_: KEY=VALUE."""
    limit_a = _limit_a(load_motor(plant), load_inverter(inverter))
    overrides = [f"motor={plant}", f"inverter={inverter}", f"drive.current_limit_a={limit_a}", *set_]
    return load_scenario(SCENARIO, overrides)
