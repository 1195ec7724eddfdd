# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The native program under the events of a scenario: the same C, averaged models in place of RTL and plant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fluxlock.config import Scenario
from fluxlock.native.drive import STEP_US, drive_of_scenario

STEP_S = STEP_US / 1e6


def factor_at(scenario: Scenario, t_s: float) -> float:
    """Load factor of the events, with their ramps."""
    factor = 1.0
    for event in scenario.events_in_order():
        if event.load_factor is not None and event.at_s <= t_s:
            done = min(1.0, (t_s - event.at_s) / event.ramp_s) if event.ramp_s else 1.0
            factor += (event.load_factor - factor) * done
    return factor


def play(scenario: Scenario) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (s) and speeds (r/min) of the native program under a scenario's commands, targets and load factors."""
    native = drive_of_scenario(scenario, 1)
    load = scenario.shaft_load
    events = scenario.events_in_order()
    rows = []
    while (t_s := native.now_us / 1e6) < scenario.duration_s:
        while events and events[0].at_s <= t_s:
            event = events.pop(0)
            line = event.command or (f"set speed_rpm {event.speed_rpm:.0f}" if event.speed_rpm else None)
            if line is not None:
                assert native.chip.fw.command(line) == ["ok"], line
        factor = factor_at(scenario, t_s)
        parts = ("fan_torque_nm", "coulomb_nm", "viscous_nm_s_per_rad", "constant_nm")
        native.chip.model.set_load(load.model_copy(update={part: factor * getattr(load, part) for part in parts}))
        native.step()
        rows.append((t_s + STEP_S, native.chip.model.rpm))
    found = np.array(rows)
    return found[:, 0], found[:, 1]
