# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fluxlock: sensorless motor control on an FPGA, its firmware and a motor run together, clock by clock.

The public names are loaded when they are first used, so that `import fluxlock` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from os.path import realpath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fluxlock.api import scenario_of, simulate
    from fluxlock.config import ConfigError, Inverter, Motor, Scenario, load_inverter, load_motor, load_scenario
    from fluxlock.cosim.outcome import UNITS, Run
    from fluxlock.results.rundata import SimulationFault
    from fluxlock.sweeps import Sweep, sweep

# Through a link to the checkout its files have the names they have without: what was built is found, not built again.
__path__ = [realpath(folder) for folder in __path__]

_HOMES = {
    "fluxlock.results.rundata": ("SimulationFault",),
    "fluxlock.api": ("scenario_of", "simulate"),
    "fluxlock.cosim.outcome": ("UNITS", "Run"),
    "fluxlock.config": (
        "ConfigError",
        "Inverter",
        "Motor",
        "Scenario",
        "load_inverter",
        "load_motor",
        "load_scenario",
    ),
    "fluxlock.sweeps": ("Sweep", "sweep"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "UNITS",
    "ConfigError",
    "Inverter",
    "Motor",
    "Run",
    "Scenario",
    "SimulationFault",
    "Sweep",
    "load_inverter",
    "load_motor",
    "load_scenario",
    "scenario_of",
    "simulate",
    "sweep",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'fluxlock' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
