# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Motor, inverter and scenario files: models, reading, checking."""

from fluxlock.config.errors import ConfigError, Problem
from fluxlock.config.inverter import Inverter
from fluxlock.config.loader import ALLOW_OVERLOAD, load_inverter, load_motor, load_scenario
from fluxlock.config.motor import Load, Motor
from fluxlock.config.scenario import Scenario

__all__ = [
    "ALLOW_OVERLOAD",
    "ConfigError",
    "Inverter",
    "Load",
    "Motor",
    "Problem",
    "Scenario",
    "load_inverter",
    "load_motor",
    "load_scenario",
]
